//! What telemetry determines by itself, computed again.
//!
//! | | compared | when |
//! |---|---|---|
//! | Factor | bit for bit with that of a sample of the last 30 ms | every IMU sample is in the recording: 1 kHz |
//! | lean | within 1 mrad of the attitude filter's, started at the first frame's lean | as above |
//!
//! A frame's Factor is the knee's: worked out of a sample that is as old as bus and status message take, so which one is
//! not known. With fewer frames than samples, the sample may not be in the recording, and nothing is compared. While knee
//! or IMU are lost the Factor stands still, and is not compared either.

use std::fmt;

use sarah_firmware::attitude::{Attitude, ImuSample, MAX_STEP_US};
use sarah_firmware::lpg::factor::{PlainDivider, factor, q30_to_q16};
use sarah_protocol::fixed::Q16;
use sarah_protocol::telemetry::{Telemetry, faults};

use super::Difference;

/// Longest time between frames at which every sample of the IMU, 1 kHz, is in one, µs.
const EVERY_SAMPLE_US: u32 = 1_500;
/// The oldest sample a Factor may come from: two periods of the node's status, and the bus, µs.
const FACTOR_AGE_US: u32 = 30_000;
/// Lean may differ by this much, rad: the filter starts at a lean in steps of 0.5 mrad, the accelerometer's.
const LEAN_TOLERANCE: Q16 = Q16::lit(0.001);
/// A loss of knee or IMU shows in the faults this much later, and its end is felt as long, µs.
const TROUBLE_US: u32 = 200_000;
/// After a start the robot's filter finds up in larger steps, for 0.3 s from its first sample, µs.
const FINDING_UP_US: u32 = 400_000;
/// Steps of the filter until it stands at the lean it was given.
const SETTLING: u32 = 1_000;

/// What has been compared.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Checked {
    /// Telemetry frames.
    pub frames: u64,
    /// Frames whose Factor was computed again.
    pub factors: u64,
    /// Frames whose lean was computed again.
    pub leans: u64,
    /// The most a lean differed, rad.
    pub worst_lean_rad: f32,
    /// Median time between frames, µs.
    pub period_us: u32,
}

/// Compares what the frames determine.
pub fn check(frames: &[Telemetry]) -> Result<Checked, Difference> {
    let mut gaps: Vec<u32> = frames.windows(2).map(|pair| pair[1].time_us.wrapping_sub(pair[0].time_us)).collect();
    gaps.sort_unstable();
    let period_us = gaps.get(gaps.len() / 2).copied().unwrap_or(0);
    let mut checked = Checked { frames: frames.len() as u64, period_us, ..Checked::default() };
    if period_us == 0 || period_us > EVERY_SAMPLE_US {
        return Ok(checked);
    }
    let mut run = Run::new();
    for (index, (frame, troubled)) in frames.iter().zip(troubled(frames)).enumerate() {
        run.frame(index, frame, troubled, &mut checked)?;
    }
    Ok(checked)
}

/// Whether knee or IMU are lost about the time of each frame.
fn troubled(frames: &[Telemetry]) -> Vec<bool> {
    let lost = |frame: &Telemetry| frame.faults & (faults::NODE_LOST | faults::IMU_LOST) != 0;
    let mut near = vec![false; frames.len()];
    for backwards in [false, true] {
        let mut last: Option<u32> = None;
        for step in 0..frames.len() {
            let index = if backwards { frames.len() - 1 - step } else { step };
            let frame = &frames[index];
            if lost(frame) {
                last = Some(frame.time_us);
            }
            let apart = |at: u32| frame.time_us.wrapping_sub(at).min(at.wrapping_sub(frame.time_us));
            near[index] |= last.is_some_and(|at| apart(at) <= TROUBLE_US);
        }
    }
    near
}

/// Frames without a gap.
struct Run {
    filter: Attitude,
    before: Option<u32>,
    /// Factor of each sample, with its time.
    factors: Vec<(u32, Q16)>,
    began_us: u32,
}

impl Run {
    fn new() -> Run {
        Run { filter: Attitude::new(), before: None, factors: vec![], began_us: 0 }
    }

    fn frame(
        &mut self,
        index: usize,
        frame: &Telemetry,
        troubled: bool,
        checked: &mut Checked,
    ) -> Result<(), Difference> {
        let now_us = frame.time_us;
        let sample = ImuSample { accel: frame.accel, gyro: frame.gyro };
        let dt_us = self.before.map(|before| now_us.wrapping_sub(before));
        let gap = dt_us.is_none_or(|dt| dt > EVERY_SAMPLE_US) || now_us < FINDING_UP_US;
        if gap {
            *self = Run { filter: standing_at(frame), began_us: now_us, ..Run::new() };
        }
        self.before = Some(now_us);
        self.filter.assume_bias(frame.gyro_bias);
        let motion = self.filter.update(dt_us.filter(|_| !gap).unwrap_or(0), &sample);
        self.factors.retain(|(at_us, _)| now_us.wrapping_sub(*at_us) <= FACTOR_AGE_US);
        self.factors.push((now_us, q30_to_q16(factor(&PlainDivider, motion.acceleration, motion.rotation))));

        let difference = |recorded: String, replayed: String| {
            Err(Difference { node: None, tick: index as u64 + 1, at_us: now_us.into(), recorded, replayed })
        };
        if !troubled && now_us.wrapping_sub(self.began_us) > FACTOR_AGE_US {
            checked.factors += 1;
            if !self.factors.iter().any(|(_, factor)| *factor == frame.factor) {
                let nearest = self.factors.iter().min_by_key(|(_, factor)| factor.0.abs_diff(frame.factor.0));
                let nearest = nearest.map_or(0.0, |(_, factor)| factor.to_f32());
                return difference(format!("Factor {}", frame.factor.to_f32()), format!("{nearest} at the nearest"));
            }
        }
        if !gap {
            checked.leans += 1;
            for (recorded, replayed) in frame.lean.into_iter().zip(motion.lean) {
                let apart = (recorded - replayed).abs();
                checked.worst_lean_rad = checked.worst_lean_rad.max(apart.to_f32());
                if apart > LEAN_TOLERANCE {
                    return difference(format!("lean {} rad", recorded.to_f32()), format!("{} rad", replayed.to_f32()));
                }
            }
        }
        Ok(())
    }
}

/// A filter that has stood still at the frame's lean until now, and feels the frame's rotation.
fn standing_at(frame: &Telemetry) -> Attitude {
    let [forward, left] = frame.lean.map(|lean| lean.to_f32().sin());
    let up = [-forward, -left, (1.0 - forward * forward - left * left).max(0.0).sqrt()];
    let accel = up.map(|axis| (axis * 2048.0).round() as i16);
    let mut filter = Attitude::new();
    for _ in 0..SETTLING {
        filter.update(MAX_STEP_US, &ImuSample { accel, gyro: [0; 3] });
    }
    // No time passes: only the rotation is noted, for the mean with the next sample's.
    filter.assume_bias(frame.gyro_bias);
    filter.update(0, &ImuSample { accel, gyro: frame.gyro });
    filter
}

impl fmt::Display for Checked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Checked { frames, factors, leans, worst_lean_rad, period_us } = self;
        if *leans == 0 {
            let rate = 1e6 / f64::from((*period_us).max(1));
            return match frames {
                0 => Ok(()),
                _ => writeln!(
                    f,
                    "not compared: Factor and lean of {frames} telemetry frames; at {rate:.0} Hz not every IMU sample is \
                     in one (record with --rate 1000)"
                ),
            };
        }
        writeln!(
            f,
            "telemetry: Factor of {factors} of {frames} frames is bit for bit that of a sample of its last {} ms; lean of \
             {leans} within {:.2} mrad (at most {:.0} allowed, as the filter's first state is not recorded)",
            FACTOR_AGE_US / 1000,
            worst_lean_rad * 1e3,
            LEAN_TOLERANCE.to_f32() * 1e3
        )
    }
}
