//! Why a chip starts over.

/// Cause of a reset, in the order of RSTC.RCAUSE's bits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Reset {
    /// Supply came up.
    PowerOn = 0,
    /// Brown-out of the core supply.
    BrownOutCore = 1,
    /// Brown-out of VDD.
    BrownOutSupply = 2,
    /// The reset pin.
    External = 4,
    /// The watchdog.
    Watchdog = 5,
    /// AIRCR.SYSRESETREQ.
    System = 6,
}

impl Reset {
    /// RSTC.RCAUSE after this reset.
    pub const fn cause_bit(self) -> u8 {
        1 << self as u8
    }

    /// Whether it came from the supply: then nothing but non-volatile memory outlasts it (data sheet: RSTC, "Reset
    /// Causes and Effects").
    pub const fn is_of_supply(self) -> bool {
        matches!(self, Reset::PowerOn | Reset::BrownOutCore | Reset::BrownOutSupply)
    }

    /// Whether SRAM contents are lost.
    pub const fn loses_sram(self) -> bool {
        matches!(self, Reset::PowerOn)
    }
}
