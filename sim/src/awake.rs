//! How long emulated chips are awake per control tick, and how punctual the ticks are.
//!
//! From one entry of a chip's tick function to the next, everything counts: the wake-up, the tick, interrupts, bus and
//! housekeeping tasks that ran in between. A tick is late by how much longer than usual ago the one before began.

use samc21::Cycles;

/// Function that begins a tick: of a node, of the coordinator.
pub const ENTRIES: [&str; 4] = [
    "sarah_firmware::board::coordinator::imu_tick",
    "sarah_firmware::board::samc21::node::control_tick",
    "sarah_firmware::board::samc21::node::control_tick",
    "sarah_firmware::board::samc21::node::control_tick",
];

/// Awake and all cycles from tick to tick, of one chip.
#[derive(Clone, Debug, Default)]
pub struct Awake {
    /// When the last tick began, and how long the chip had been awake by then.
    last: Option<(Cycles, u64)>,
    samples: Vec<u32>,
    intervals: Vec<u32>,
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
    /// 99 of 100 ticks are late by at most this, cycles of 48 MHz.
    pub late_p99: u32,
    /// The latest, cycles of 48 MHz.
    pub late_max: u32,
}

impl Awake {
    /// A tick begins at `now`; the chip has been awake for `awake` cycles since power-up.
    pub fn at_tick(&mut self, now: Cycles, awake: u64) {
        if let Some((then, before)) = self.last.replace((now, awake)) {
            let short = |cycles: u64| cycles.min(u32::MAX.into()) as u32;
            self.samples.push(short(awake - before));
            self.intervals.push(short(now.since(then)));
        }
    }

    /// So far.
    pub fn summary(&self) -> Summary {
        let (samples, intervals) = (sorted(&self.samples), sorted(&self.intervals));
        let ticks = samples.len();
        let sum: u64 = samples.iter().map(|cycles| u64::from(*cycles)).sum();
        let p99 = |sorted: &[u32]| sorted.get((ticks * 99).div_ceil(100).saturating_sub(1)).copied().unwrap_or(0);
        let max = |sorted: &[u32]| sorted.last().copied().unwrap_or(0);
        // What most ticks have between them.
        let usual = intervals.chunk_by(|a, b| a == b).max_by_key(|same| same.len()).map_or(0, |same| same[0]);
        Summary {
            ticks,
            mean: sum as f64 / ticks.max(1) as f64,
            p99: p99(&samples),
            max: max(&samples),
            late_p99: p99(&intervals).saturating_sub(usual),
            late_max: max(&intervals).saturating_sub(usual),
        }
    }
}

fn sorted(cycles: &[u32]) -> Vec<u32> {
    let mut sorted = cycles.to_vec();
    sorted.sort_unstable();
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ninety_nine_of_a_hundred_ticks_are_within_p99() {
        let mut awake = Awake::default();
        let (mut now, mut total) = (Cycles(5_000), 1_000);
        awake.at_tick(now, total);
        for cycles in 1..=100 {
            total += cycles;
            now += 4_800;
            awake.at_tick(now, total);
        }
        assert_eq!(awake.summary(), Summary { ticks: 100, mean: 50.5, p99: 99, max: 100, late_p99: 0, late_max: 0 });
    }

    #[test]
    fn a_tick_is_late_by_what_its_interval_is_longer_than_most() {
        let mut awake = Awake::default();
        let mut now = Cycles(0);
        awake.at_tick(now, 0);
        for tick in 0..100 {
            now += match tick {
                40 => 4_950,
                // After a late one comes a short interval.
                41 => 4_650,
                70 => 4_830,
                71 => 4_770,
                _ => 4_800,
            };
            awake.at_tick(now, 0);
        }
        let Summary { late_p99, late_max, .. } = awake.summary();
        assert_eq!((late_p99, late_max), (30, 150));
    }
}
