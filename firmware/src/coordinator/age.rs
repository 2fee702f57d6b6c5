//! Time since something happened, which neither wraps nor overflows.

/// Microseconds since the last [`Age::reset`]; stops at the largest number, so a silence of hours stays a silence
/// although the clock wraps every 71 minutes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Age(u32);

impl Age {
    /// Longer ago than anything.
    pub const NEVER: Age = Age(u32::MAX);

    /// It happened now.
    pub fn reset(&mut self) {
        self.0 = 0;
    }

    /// `dt_us` passed.
    pub fn advance(&mut self, dt_us: u32) {
        self.0 = self.0.saturating_add(dt_us);
    }

    /// Microseconds.
    pub const fn us(self) -> u32 {
        self.0
    }

    /// It is at least `period_us` ago.
    pub const fn reached(self, period_us: u32) -> bool {
        self.0 >= period_us
    }

    /// True once per `period_us`; starts the next period.
    pub fn due(&mut self, period_us: u32) -> bool {
        let due = self.reached(period_us);
        if due {
            self.0 = 0;
        }
        due
    }
}
