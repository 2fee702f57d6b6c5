//! The clocks that run: published by the models of MCLK, OSCCTRL and GCLK, read by everybody else.

use crate::unit::{Mask, Unit};

/// A frequency in hertz.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default)]
pub struct Hertz(pub u32);

/// Number of generic clock channels (data sheet: GCLK, PCHCTRL).
pub const CHANNELS: usize = 41;

/// Which clocks run, and how fast.
///
/// The values after [`Clocks::default`] are those after reset: OSC48M divided by 12 on the CPU, no generic clock.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Clocks {
    /// 48 MHz ticks per CPU cycle, at least one. CPU clocks that do not divide 48 MHz are rounded by the clock models.
    pub cpu_ticks: u32,
    /// MCLK.AHBMASK.
    pub ahb: u32,
    /// MCLK.APBAMASK, APBBMASK, APBCMASK.
    pub apb: [u32; 3],
    /// Frequency of each generic clock channel, `None` while it does not run (index: PCHCTRL number).
    pub generic: [Option<Hertz>; CHANNELS],
}

impl Default for Clocks {
    fn default() -> Self {
        Clocks { cpu_ticks: 12, ahb: 0x1cff, apb: [0x0fff, 0x0007, 0], generic: [None; CHANNELS] }
    }
}

impl Clocks {
    /// Whether the bus interface of `unit` is clocked.
    pub fn bus_runs(&self, unit: Unit) -> bool {
        let Some((mask, bit)) = unit.clock_mask() else { return true };
        let register = match mask {
            Mask::Ahb => self.ahb,
            Mask::ApbA => self.apb[0],
            Mask::ApbB => self.apb[1],
            Mask::ApbC => self.apb[2],
        };
        register >> bit & 1 != 0
    }
}
