//! How long emulated chips are awake per control tick.
//!
//! From one entry of a chip's tick function to the next, everything counts: the wake-up, the tick, interrupts, bus and
//! housekeeping tasks that ran in between.

/// Function that begins a tick: of a node, of the coordinator.
pub const ENTRIES: [&str; 4] = [
    "sarah_firmware::board::coordinator::imu_tick",
    "sarah_firmware::board::samc21::node::control_tick",
    "sarah_firmware::board::samc21::node::control_tick",
    "sarah_firmware::board::samc21::node::control_tick",
];

/// Awake cycles from tick to tick, of one chip.
#[derive(Clone, Debug, Default)]
pub struct Awake {
    last: Option<u64>,
    samples: Vec<u32>,
}

/// What the samples say.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Summary {
    /// Ticks.
    pub ticks: usize,
    /// Mean, cycles.
    pub mean: f64,
    /// 99 of 100 ticks are at most this, cycles.
    pub p99: u32,
    /// The longest, cycles.
    pub max: u32,
}

impl Awake {
    /// A tick begins; the chip has been awake for `awake` cycles since power-up.
    pub fn at_tick(&mut self, awake: u64) {
        if let Some(last) = self.last.replace(awake) {
            self.samples.push((awake - last).min(u32::MAX.into()) as u32);
        }
    }

    /// So far.
    pub fn summary(&self) -> Summary {
        let mut sorted = self.samples.clone();
        sorted.sort_unstable();
        let ticks = sorted.len();
        let sum: u64 = sorted.iter().map(|cycles| u64::from(*cycles)).sum();
        Summary {
            ticks,
            mean: sum as f64 / ticks.max(1) as f64,
            p99: sorted.get((ticks * 99).div_ceil(100).saturating_sub(1)).copied().unwrap_or(0),
            max: sorted.last().copied().unwrap_or(0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ninety_nine_of_a_hundred_ticks_are_within_p99() {
        let mut awake = Awake::default();
        let mut total = 1_000;
        awake.at_tick(total);
        for cycles in 1..=100 {
            total += cycles;
            awake.at_tick(total);
        }
        assert_eq!(awake.summary(), Summary { ticks: 100, mean: 50.5, p99: 99, max: 100 });
    }
}
