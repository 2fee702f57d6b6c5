//! What follows from several snapshots: rates, the course of Factor, which leg swings.

use std::collections::VecDeque;

use sarah_protocol::bus::Side;
use sarah_protocol::telemetry::Telemetry;

/// Steps per second are counted over this, µs of the robot's time.
const STEP_WINDOW_US: u64 = 2_000_000;
/// Frames per second are counted over this, µs of the host's time.
const FRAME_WINDOW_US: u64 = 1_000_000;
/// More frames than this in a window are not kept: the robot sends 1000 a second at most.
const FRAMES_MAX: usize = 2_000;
/// One column of Factor's course, µs of the robot's time.
const COLUMN_US: u64 = 100_000;
/// Columns kept; no screen is wider.
const COLUMNS: usize = 200;
/// A gap that no telemetry bridges, µs: what was before says nothing about now.
const GAP_US: u32 = 60_000_000;
/// A knee that moved this far since the cycle began is the one that swings, m in Q16.
const MOVED: i32 = 131;

/// Course of the last seconds.
#[derive(Clone, Debug, Default)]
pub(super) struct Trend {
    /// The robot's time, unwrapped, µs.
    time_us: u64,
    last: Option<Telemetry>,
    steps: VecDeque<(u64, u32)>,
    frames: VecDeque<u64>,
    factor: VecDeque<(u64, f32)>,
    start: [i32; 2],
    swing: Option<Side>,
}

impl Trend {
    /// The next snapshot, received at `at_us`. The time since the one before, s; 0 where that says nothing.
    pub(super) fn push(&mut self, at_us: u64, now: &Telemetry) -> f64 {
        self.frames.push_back(at_us);
        while self.frames.len() > FRAMES_MAX
            || self.frames.front().is_some_and(|first| at_us.saturating_sub(*first) > FRAME_WINDOW_US)
        {
            self.frames.pop_front();
        }
        let dt_us = self.last.map_or(0, |last| now.time_us.wrapping_sub(last.time_us));
        // A node's restart counts its steps from zero: that is no step backwards.
        let recounted = self.last.is_some_and(|last| now.steps.wrapping_sub(last.steps) > u32::MAX / 2);
        if dt_us > GAP_US || recounted {
            *self = Trend { frames: std::mem::take(&mut self.frames), ..Trend::default() };
        }
        let dt_us = if self.last.is_some() { u64::from(dt_us) } else { 0 };
        self.time_us += dt_us;
        self.follow_steps(now.steps);
        self.follow_factor(now.factor.to_f32());
        self.follow_swing(now);
        self.last = Some(*now);
        dt_us as f64 * 1e-6
    }

    fn follow_steps(&mut self, steps: u32) {
        self.steps.push_back((self.time_us, steps));
        // The one before the window stays: it tells the count at the window's beginning.
        while self.steps.len() > FRAMES_MAX
            || self.steps.get(1).is_some_and(|(at, _)| self.time_us - at >= STEP_WINDOW_US)
        {
            self.steps.pop_front();
        }
    }

    fn follow_factor(&mut self, factor: f32) {
        let column = self.time_us / COLUMN_US;
        match self.factor.back_mut().filter(|(at, _)| *at == column) {
            // A peak must not vanish between two columns.
            Some((_, peak)) => *peak = peak.max(factor),
            None => self.factor.push_back((column, factor)),
        }
        while self.factor.len() > COLUMNS {
            self.factor.pop_front();
        }
    }

    /// Telemetry does not tell which leg swings, but its knee moves and the other is braked.
    fn follow_swing(&mut self, now: &Telemetry) {
        let knees = [now.joints[2].0, now.joints[5].0];
        let was = self.last.map_or(0, |last| last.phases[0]);
        if now.phases[0] == 0 || was == 0 {
            self.swing = None;
            self.start = knees;
        }
        let [left, right] = [0, 1].map(|leg| knees[leg].saturating_sub(self.start[leg]).saturating_abs());
        if now.phases[0] != 0 && left.max(right) > MOVED {
            self.swing = Some(if left > right { Side::Left } else { Side::Right });
        }
    }

    /// Steps per second over the last two seconds.
    pub(super) fn steps_per_s(&self) -> f32 {
        let (Some((_, first)), Some((_, last))) = (self.steps.front(), self.steps.back()) else { return 0.0 };
        last.wrapping_sub(*first) as f32 / (STEP_WINDOW_US as f32 * 1e-6)
    }

    /// Telemetry frames per second at this moment.
    pub(super) fn frames_per_s(&self, now_us: u64) -> f32 {
        let recent = self.frames.iter().filter(|at| now_us.saturating_sub(**at) <= FRAME_WINDOW_US).count();
        recent as f32 / (FRAME_WINDOW_US as f32 * 1e-6)
    }

    /// Peaks of Factor, 0.1 s each, the newest last.
    pub(super) fn factor(&self) -> impl DoubleEndedIterator<Item = f32> + '_ {
        self.factor.iter().map(|(_, peak)| *peak)
    }

    /// The leg that swings, as far as its movement shows.
    pub(super) fn swing(&self) -> Option<Side> {
        self.swing
    }
}

#[cfg(test)]
mod tests {
    use sarah_protocol::fixed::Q16;

    use super::*;

    fn at(ms: u32, steps: u32) -> Telemetry {
        Telemetry { time_us: ms.wrapping_mul(1000), steps, ..Telemetry::default() }
    }

    #[test]
    fn steps_are_counted_over_the_last_two_seconds_of_the_robots_time() {
        let mut trend = Trend::default();
        for ms in (0..=6010).step_by(10) {
            // Three steps a second until 4 s, then rest; all received at once.
            trend.push(0, &at(ms, ms.min(4000) * 3 / 1000));
            if ms == 3990 {
                assert_eq!(trend.steps_per_s(), 3.0);
            }
        }
        assert_eq!(trend.steps_per_s(), 0.0);
    }

    #[test]
    fn clocks_and_counters_wrap_and_a_restarted_node_makes_no_steps() {
        let mut trend = Trend::default();
        trend.push(0, &Telemetry { time_us: u32::MAX - 4_999, ..at(0, u32::MAX) });
        assert!((trend.push(10, &Telemetry { time_us: 5_000, ..at(0, 1) }) - 0.01).abs() < 1e-9);
        assert_eq!(trend.steps_per_s(), 1.0);
        trend.push(20, &Telemetry { time_us: 15_000, ..at(0, 0) });
        assert_eq!(trend.steps_per_s(), 0.0);
    }

    #[test]
    fn frames_per_second_fall_when_nothing_comes() {
        let mut trend = Trend::default();
        for index in 0..300u32 {
            trend.push(u64::from(index) * 10_000, &at(index * 10, 0));
        }
        assert!((trend.frames_per_s(2_990_000) - 100.0).abs() <= 1.0);
        assert_eq!(trend.frames_per_s(5_000_000), 0.0);
    }

    #[test]
    fn the_leg_whose_knee_moves_is_the_swing_leg() {
        let mut trend = Trend::default();
        let mut telemetry = at(0, 0);
        trend.push(0, &telemetry);
        telemetry = Telemetry { phases: [1, 1, 1], ..at(10, 0) };
        trend.push(0, &telemetry);
        assert_eq!(trend.swing(), None);
        telemetry = Telemetry { phases: [2, 1, 1], ..at(20, 0) };
        telemetry.joints[5] = Q16::lit(-0.01);
        trend.push(0, &telemetry);
        assert_eq!(trend.swing(), Some(Side::Right));
        telemetry.phases = [0; 3];
        trend.push(0, &telemetry);
        assert_eq!(trend.swing(), None);
    }

    #[test]
    fn a_peak_of_factor_survives_in_its_column() {
        let mut trend = Trend::default();
        for (ms, factor) in [(0, 0.01), (10, 0.5), (20, 0.02), (110, 0.03)] {
            trend.push(0, &Telemetry { factor: Q16::lit(factor), ..at(ms, 0) });
        }
        let peaks: Vec<f32> = trend.factor().collect();
        assert_eq!(peaks.len(), 2);
        assert!((peaks[0] - 0.5).abs() < 1e-3);
    }
}
