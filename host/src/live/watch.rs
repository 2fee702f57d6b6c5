//! What the robot is doing, from its telemetry: does it stand still, has it fallen, is it still there.

use sarah_protocol::bus::Mode;
use sarah_protocol::telemetry::{Telemetry, faults};

use crate::task::observation::loads_n;
use crate::task::odometry::Estimate;
use crate::task::pose_source::{PoseError, PoseSource};

/// The robot must have been still for this long before an episode begins or it is armed, µs.
const STILL_US: u64 = 1_000_000;
/// Slower than this is still, rad/s.
const STILL_RAD_S: f32 = 0.1;
/// A robot that leans less, and carries this much on either foot, stands, rad and N.
const STANDS_RAD: f32 = 0.3;
const LOADED_N: f32 = 15.0;
/// Without telemetry for this long there is no link, µs.
const SILENCE_US: u64 = 500_000;

/// Follows one robot.
pub struct Watch {
    source: PoseSource,
    last: Option<(u64, Telemetry)>,
    still_since_us: Option<u64>,
}

impl Watch {
    /// Of a robot not yet heard.
    pub fn new(source: PoseSource) -> Watch {
        Watch { source, last: None, still_since_us: None }
    }

    /// Telemetry arrived.
    pub fn saw(&mut self, at_us: u64, frame: &Telemetry) -> Estimate {
        if self.silent(at_us) {
            self.unsettle();
        }
        let estimate = self.source.saw(at_us as f64 * 1e-6, frame);
        let still = estimate.pose.rotation_rad_s < STILL_RAD_S && frame.phases[0] == 0 && stands(frame);
        match still {
            true => _ = self.still_since_us.get_or_insert(at_us),
            false => self.still_since_us = None,
        }
        self.last = Some((at_us, *frame));
        estimate
    }

    /// A pose from outside arrived.
    pub fn seen_from_outside(&mut self, at_us: u64, datagram: &[u8]) -> Result<(), PoseError> {
        self.source.heard(at_us as f64 * 1e-6, datagram)
    }

    /// Whether poses from outside are followed.
    pub fn external(&self) -> bool {
        self.source.external()
    }

    /// However still it was, that was before.
    pub fn unsettle(&mut self) {
        self.still_since_us = None;
    }

    /// Where the robot is now becomes the origin, and it is upright.
    pub fn restart(&mut self) {
        self.source.reset();
    }

    /// Nothing has been heard for a while, or ever.
    pub fn silent(&self, now_us: u64) -> bool {
        self.last.as_ref().is_none_or(|(at_us, _)| now_us.saturating_sub(*at_us) > SILENCE_US)
    }

    /// It stands, and has been still for a second.
    pub fn still(&self, now_us: u64) -> bool {
        self.still_since_us.is_some_and(|since| now_us.saturating_sub(since) >= STILL_US)
    }

    /// Where the trunk is.
    pub fn estimate(&self) -> Estimate {
        self.source.estimate()
    }

    /// What the robot said last.
    pub fn telemetry(&self) -> Option<&Telemetry> {
        self.last.as_ref().map(|(_, frame)| frame)
    }

    /// Whether it said last that it may move.
    pub fn armed(&self) -> bool {
        self.telemetry().is_some_and(|frame| frame.mode == Mode::Armed)
    }

    /// Whether it said last that it was stopped.
    pub fn stopped(&self) -> bool {
        self.telemetry().is_some_and(|frame| frame.faults & faults::E_STOP != 0)
    }
}

/// Upright on both feet, as the robot itself sees it.
fn stands(frame: &Telemetry) -> bool {
    let [left_heel, left_toe, right_heel, right_toe] = loads_n(frame);
    let upright = frame.lean.iter().all(|lean| lean.to_f32().abs() < STANDS_RAD);
    upright && left_heel + left_toe > LOADED_N && right_heel + right_toe > LOADED_N
}
