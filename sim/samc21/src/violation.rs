//! What the silicon would have refused or punished: findings about the firmware, with where and when.

use std::fmt;

use crate::{Cycles, Width};

/// The rule that was broken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[non_exhaustive]
pub enum Kind {
    /// Access to a peripheral whose bus clock is masked off in MCLK, or whose generic clock does not run.
    Unclocked,
    /// Write to a write-synchronised register while its previous write is still being synchronised.
    SyncBusy,
    /// Write to an enable-protected register or field while the peripheral is enabled.
    EnableProtected,
    /// Write of ones to reserved bits (the mask of those bits).
    ReservedBits(u32),
    /// Value that the data sheet reserves or forbids for the register.
    ReservedValue,
    /// Access of a width the register does not support.
    WrongWidth,
    /// Address not aligned to the access; a HardFault.
    Unaligned,
    /// Nothing answers at the address; a HardFault.
    Unmapped,
    /// The peripheral exists, but not in this emulator; a HardFault, so that no firmware runs on guessed answers.
    Unmodelled,
    /// No register at this offset of the peripheral.
    NoRegister,
    /// Write to a read-only register.
    ReadOnly,
    /// Read of a write-only register.
    WriteOnly,
    /// Write refused by PAC, a lock bit or a key.
    WriteProtected,
    /// Use of a peripheral in an order or state the data sheet forbids (says which).
    Misuse(&'static str),
    /// Undefined instruction, or UDF; a HardFault.
    Undefined,
    /// Branch to an address with bit 0 clear, the ARM state a Cortex-M has not; a HardFault.
    ArmState,
    /// Exception return that the architecture calls unpredictable (says why); a HardFault.
    ExceptionReturn(&'static str),
    /// BKPT or SVC that nothing could take; a HardFault.
    Escalated,
    /// A fault inside HardFault: the core stands still until reset.
    Lockup,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Kind::Unclocked => write!(f, "clock is off"),
            Kind::SyncBusy => write!(f, "write while synchronisation is busy"),
            Kind::EnableProtected => write!(f, "write to an enable-protected register"),
            Kind::ReservedBits(mask) => write!(f, "reserved bits {mask:#x} written"),
            Kind::ReservedValue => write!(f, "reserved value"),
            Kind::WrongWidth => write!(f, "wrong access width"),
            Kind::Unaligned => write!(f, "unaligned access"),
            Kind::Unmapped => write!(f, "nothing at this address"),
            Kind::Unmodelled => write!(f, "peripheral not modelled"),
            Kind::NoRegister => write!(f, "no register at this offset"),
            Kind::ReadOnly => write!(f, "write to a read-only register"),
            Kind::WriteOnly => write!(f, "read of a write-only register"),
            Kind::WriteProtected => write!(f, "write-protected"),
            Kind::Misuse(what) => write!(f, "{what}"),
            Kind::Undefined => write!(f, "undefined instruction"),
            Kind::ArmState => write!(f, "branch to ARM state"),
            Kind::ExceptionReturn(why) => write!(f, "exception return: {why}"),
            Kind::Escalated => write!(f, "SVC or BKPT that cannot be taken"),
            Kind::Lockup => write!(f, "lockup"),
        }
    }
}

/// One bus access, as seen by whoever answers it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Access {
    /// Address on the bus.
    pub address: u32,
    /// Width of the access.
    pub width: Width,
    /// The value written, `None` for a read.
    pub written: Option<u32>,
}

/// One finding.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Violation {
    /// The rule.
    pub kind: Kind,
    /// The access that broke it, if it was an access.
    pub access: Option<Access>,
    /// The peripheral, by its name in the data sheet.
    pub unit: Option<&'static str>,
    /// Address of the instruction.
    pub pc: u32,
    /// Function around it, with the offset into it, when the image has symbols.
    pub symbol: Option<String>,
    /// When.
    pub at: Cycles,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.kind)?;
        if let Some(unit) = self.unit {
            write!(f, ", {unit}")?;
        }
        if let Some(access) = self.access {
            let bits = access.width.bytes() * 8;
            match access.written {
                Some(value) => write!(f, ", write{bits} {:#010x} = {value:#x}", access.address)?,
                None => write!(f, ", read{bits} {:#010x}", access.address)?,
            }
        }
        write!(f, ", pc {:#010x}", self.pc)?;
        if let Some(symbol) = &self.symbol {
            write!(f, " in {symbol}")?;
        }
        write!(f, ", at {:.6} s", self.at.as_secs_f64())
    }
}
