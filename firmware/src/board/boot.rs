//! Why the chip started and what it found: the boot report.

use sarah_protocol::telemetry::ResetCause;

/// Where the CPU's clock comes from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ClockSource {
    /// A crystal and a PLL.
    Crystal,
    /// An oscillator on the chip: the crystal did not start or the PLL did not lock.
    Internal,
}

/// What made the firmware stop and reset.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fault {
    /// A panic; the line of the source.
    Panic {
        /// Line.
        line: u32,
    },
    /// A HardFault; the address of the instruction.
    HardFault {
        /// Program counter.
        pc: u32,
    },
    /// An interrupt without a handler.
    Stray {
        /// Its line; negative for an exception.
        line: i32,
    },
}

/// A fault as it survives the reset, in RAM that is not initialised: marker, kind, detail, check.
pub type Record = [u32; 4];

const MARKER: u32 = 0x5a5a_fa17;

impl Fault {
    /// As a record.
    pub const fn record(self) -> Record {
        let (kind, detail) = match self {
            Fault::Panic { line } => (1, line),
            Fault::HardFault { pc } => (2, pc),
            Fault::Stray { line } => (3, line as u32),
        };
        [MARKER, kind, detail, !(MARKER ^ kind ^ detail.rotate_left(7))]
    }

    /// From a record; nothing if it is not one, as after power-up.
    pub const fn recall(record: Record) -> Option<Fault> {
        let [marker, kind, detail, check] = record;
        if marker != MARKER || check != !(MARKER ^ kind ^ detail.rotate_left(7)) {
            return None;
        }
        match kind {
            1 => Some(Fault::Panic { line: detail }),
            2 => Some(Fault::HardFault { pc: detail }),
            3 => Some(Fault::Stray { line: detail as i32 }),
            _ => None,
        }
    }
}

/// A number that differs from boot to boot with good odds: the last one and whatever the clocks and the RAM were up to,
/// stirred (Murmur3's finaliser). Never 0.
pub const fn stir(last: u32, entropy: u32) -> u32 {
    let mut x = last.wrapping_add(0x9e37_79b9) ^ entropy;
    x = (x ^ x >> 16).wrapping_mul(0x85eb_ca6b);
    x = (x ^ x >> 13).wrapping_mul(0xc2b2_ae35);
    x ^= x >> 16;
    if x == 0 { 1 } else { x }
}

/// What the start found.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BootReport {
    /// Why the chip started.
    pub cause: ResetCause,
    /// What the firmware died of before, if it did.
    pub fault: Option<Fault>,
    /// Where its clock comes from.
    pub clock: ClockSource,
    /// Drawn anew at every boot.
    pub nonce: u32,
}

#[cfg(target_os = "none")]
impl BootReport {
    /// Logs it under a name.
    pub fn log(&self, name: &str) {
        let cause = match self.cause {
            ResetCause::Unknown => "unknown",
            ResetCause::PowerOn => "power on",
            ResetCause::BrownOut => "brown-out",
            ResetCause::External => "reset pin",
            ResetCause::Watchdog => "watchdog",
            ResetCause::Software => "software",
        };
        defmt::info!("{=str}: reset by {=str}, nonce {=u32:#x}", name, cause, self.nonce);
        if self.clock == ClockSource::Internal {
            defmt::error!("the crystal did not start: running from the internal oscillator, the bus may fail");
        }
        match self.fault {
            Some(Fault::Panic { line }) => defmt::error!("before: panic at line {=u32}", line),
            Some(Fault::HardFault { pc }) => defmt::error!("before: HardFault at {=u32:#x}", pc),
            Some(Fault::Stray { line }) => defmt::error!("before: stray interrupt {=i32}", line),
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_fault_survives_and_anything_else_is_none() {
        for fault in [Fault::Panic { line: 42 }, Fault::HardFault { pc: 0x1234 }, Fault::Stray { line: -2 }] {
            assert_eq!(Fault::recall(fault.record()), Some(fault));
            for word in 0..4 {
                let mut torn = fault.record();
                torn[word] ^= 1;
                assert_eq!(Fault::recall(torn), None);
            }
        }
        assert_eq!(Fault::recall([0; 4]), None);
        assert_eq!(Fault::recall([u32::MAX; 4]), None);
    }

    proptest! {
        #[test]
        fn boots_in_a_row_differ(start: u32, entropy: u32) {
            let first = stir(start, entropy);
            prop_assert_ne!(first, 0);
            prop_assert_ne!(stir(first, entropy), first);
        }
    }
}
