//! Telemetry with every signal of one instant.
//!
//! A frame holds what its sender knew last: node positions waited for the next frame, the IMU averages over 10 ms before
//! it is read, a pad's load cell has a delay of its own. While a leg swings at 5 rad/s, 10 ms are 4 cm of foot. So signals
//! are interpolated between the last two frames, to the age of the oldest one.

use sarah_protocol::telemetry::Telemetry;

use super::vector::normal;
use crate::task::observation::{acceleration_m_s2, loads_n, rate_rad_s};

/// Longest gap between two frames that is bridged, s. Two feet may both have stepped in a longer one.
const LONGEST_GAP_S: f32 = 0.25;

/// How old each signal is when its frame is sent, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ages {
    /// Accelerometer, gyro and lean: half the averaging window, and the delay of reading.
    pub imu_s: f32,
    /// Joint positions: what a node sends 100 times a second waits for the next frame.
    pub joints_s: f32,
    /// Pad loads: the same, and the load cell's own delay.
    pub loads_s: f32,
    /// The instant the estimate is made for: the end of the IMU's window one frame back, or older.
    pub of_estimate_s: f32,
}

impl Default for Ages {
    /// Those of the simulated robot: IMU window 10 ms and delay 10 ms, load cell 10 ms, a node's status 9 ms. Some
    /// milliseconds more or less cost nothing that could be measured.
    fn default() -> Self {
        Ages { imu_s: 0.015, joints_s: 0.009, loads_s: 0.019, of_estimate_s: 0.020 }
    }
}

/// All signals at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    /// Time since the sample before, s; 0 for the first one.
    pub dt_s: f32,
    /// World up in trunk axes, length 1.
    pub up: [f32; 3],
    /// Mean rotation since the sample before, trunk axes, rad/s.
    pub rate_rad_s: [f32; 3],
    /// Mean specific force since the sample before, trunk axes, m/s².
    pub force_m_s2: [f32; 3],
    /// Joint positions, m and rad.
    pub joints: [f32; 6],
    /// Pad loads, N: left heel, left toe, right heel, right toe.
    pub loads_n: [f32; 4],
    /// The knees' generator is idle.
    pub idle: bool,
}

/// What a frame is to the ones before it.
pub(super) enum Seen {
    /// The same frame once more.
    Again,
    /// Nothing before it to measure a change from.
    Fresh(Sample),
    /// The next one.
    Next(Sample),
}

/// Keeps what the next frame is interpolated with.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Aligner {
    before: Option<Telemetry>,
}

impl Aligner {
    /// The sample that `frame` completes.
    pub fn saw(&mut self, ages: &Ages, frame: &Telemetry) -> Seen {
        let Some(before) = self.before.replace(*frame) else {
            return Seen::Fresh(sample(0.0, ages, frame, frame));
        };
        // Wraps after 71 minutes. A clock that ran backwards looks like a gap of as much.
        let gap_us = frame.time_us.wrapping_sub(before.time_us);
        let gap_s = gap_us as f32 * 1e-6;
        match gap_us {
            0 => Seen::Again,
            _ if gap_s > LONGEST_GAP_S => Seen::Fresh(sample(0.0, ages, frame, frame)),
            _ => Seen::Next(sample(gap_s, ages, &before, frame)),
        }
    }
}

fn sample(gap_s: f32, ages: &Ages, before: &Telemetry, now: &Telemetry) -> Sample {
    // Fraction of the way from `before` to `now` at which a signal is as old as the estimate; `late` is where in the
    // interval between two samples it belongs.
    let part = |age_s: f32, late: f32| {
        if gap_s > 0.0 { (late - (ages.of_estimate_s - age_s) / gap_s).clamp(0.0, 1.0) } else { 1.0 }
    };
    // Means over the interval belong to its middle.
    let mean = part(ages.imu_s, 0.5);
    Sample {
        dt_s: gap_s,
        up: normal(blend(part(ages.imu_s, 1.0), up(before), up(now))),
        rate_rad_s: blend(mean, rate_rad_s(before), rate_rad_s(now)),
        force_m_s2: blend(mean, acceleration_m_s2(before), acceleration_m_s2(now)),
        joints: blend(part(ages.joints_s, 1.0), joints(before), joints(now)),
        loads_n: blend(part(ages.loads_s, 1.0), loads_n(before), loads_n(now)),
        idle: now.phases[0] == 0,
    }
}

fn blend<const N: usize>(part: f32, a: [f32; N], b: [f32; N]) -> [f32; N] {
    std::array::from_fn(|i| a[i] + part * (b[i] - a[i]))
}

fn joints(frame: &Telemetry) -> [f32; 6] {
    frame.joints.map(|q| q.to_f32())
}

fn up(frame: &Telemetry) -> [f32; 3] {
    let [x, y] = frame.lean.map(|lean| -lean.to_f32().clamp(-1.5, 1.5).sin());
    [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()]
}
