//! Emulated time.

use std::ops::{Add, AddAssign, Sub};

/// A point in emulated time: ticks of the 48 MHz main clock since power-on.
///
/// Every chip of a [`Machine`](crate::Machine) counts the same ticks. A chip whose CPU runs slower than 48 MHz (4 MHz
/// after reset) spends several ticks per CPU cycle, see [`Clocks::cpu_ticks`](crate::Clocks::cpu_ticks).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub struct Cycles(pub u64);

impl Cycles {
    /// Ticks per second.
    pub const HZ: u64 = 48_000_000;
    /// Later than anything that happens.
    pub const NEVER: Cycles = Cycles(u64::MAX);

    /// The point `micros` microseconds after power-on.
    pub const fn from_micros(micros: u64) -> Self {
        Cycles(micros * (Self::HZ / 1_000_000))
    }

    /// The point `millis` milliseconds after power-on.
    pub const fn from_millis(millis: u64) -> Self {
        Cycles(millis * (Self::HZ / 1_000))
    }

    /// Seconds since power-on.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 / Self::HZ as f64
    }

    /// Ticks from `earlier` to this point, zero if `earlier` is later.
    pub const fn since(self, earlier: Cycles) -> u64 {
        self.0.saturating_sub(earlier.0)
    }
}

impl Add<u64> for Cycles {
    type Output = Cycles;

    fn add(self, ticks: u64) -> Cycles {
        Cycles(self.0 + ticks)
    }
}

impl AddAssign<u64> for Cycles {
    fn add_assign(&mut self, ticks: u64) {
        self.0 += ticks;
    }
}

impl Sub for Cycles {
    type Output = u64;

    fn sub(self, earlier: Cycles) -> u64 {
        self.0 - earlier.0
    }
}
