//! Odometry against the truth, in simulation.

use serde::{Deserialize, Serialize};

use super::Estimate;
use crate::task::judge::Pose;

/// The error is read this long after a push, s: when the reward asks how far the robot drifted.
const AFTER_PUSH_S: f32 = 3.0;
/// A fall must be told within this time, s.
pub const FALL_WITHIN_S: f32 = 0.3;

/// What came of one episode.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Audited {
    /// Horizontal errors 3 s after each push, m.
    pub after_push_m: Vec<f32>,
    /// Horizontal error at the end of an episode without a fall, m.
    pub at_end_m: Option<f32>,
    /// From the fall to when odometry told it, s.
    pub told_fall_after_s: Option<f32>,
    /// The robot fell.
    pub fell: bool,
    /// Odometry told a fall before there was one, or without one.
    pub false_fall: bool,
}

/// Compares the two through an episode.
#[derive(Clone, Debug, Default)]
pub struct Audit {
    /// Truth less estimate when both began, m.
    offset_m: Option<[f32; 2]>,
    error_m: f32,
    pushed_s: Option<f32>,
    fell_s: Option<f32>,
    audited: Audited,
}

impl Audit {
    /// The robot is pushed now.
    pub fn pushed(&mut self, now_s: f32) {
        self.pushed_s = Some(now_s);
    }

    /// A slice of time has passed. After a fall, feed it for [`FALL_WITHIN_S`] more.
    pub fn saw(&mut self, now_s: f32, truth: &Pose, fallen: bool, estimate: &Estimate) {
        if fallen {
            self.fell_s.get_or_insert(now_s);
        }
        self.audited.fell = self.fell_s.is_some();
        if estimate.fell {
            match self.fell_s {
                Some(fell_s) => {
                    self.audited.told_fall_after_s.get_or_insert(now_s - fell_s);
                }
                None => self.audited.false_fall = true,
            }
        }
        if self.fell_s.is_some() {
            // Where it lies is nobody's question.
            return;
        }
        let [x, y] = [0, 1].map(|i| truth.position_m[i] - estimate.pose.position_m[i]);
        let [x0, y0] = *self.offset_m.get_or_insert([x, y]);
        self.error_m = (x - x0).hypot(y - y0);
        if self.pushed_s.is_some_and(|pushed_s| now_s - pushed_s >= AFTER_PUSH_S) {
            self.pushed_s = None;
            self.audited.after_push_m.push(self.error_m);
        }
    }

    /// The episode is over.
    pub fn finish(mut self) -> Audited {
        self.audited.at_end_m = self.fell_s.is_none().then_some(self.error_m);
        self.audited
    }
}

/// Middle and tail of a set of errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorM {
    /// Half are smaller, m.
    pub median: f32,
    /// 95 % are smaller, m.
    pub p95: f32,
}

/// Many episodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AuditSummary {
    /// Horizontal error 3 s after a push, m.
    pub after_push_m: Option<ErrorM>,
    /// Horizontal error at the end of episodes without a fall, m.
    pub at_end_m: Option<ErrorM>,
    /// Falls told within [`FALL_WITHIN_S`].
    pub falls_told: u32,
    /// Falls told later or never.
    pub falls_missed: u32,
    /// Episodes with a fall told before there was one.
    pub false_falls: u32,
}

impl AuditSummary {
    /// Sums up episodes.
    pub fn new(episodes: &[Audited]) -> AuditSummary {
        let count = |these: &dyn Fn(&Audited) -> bool| episodes.iter().filter(|episode| these(episode)).count() as u32;
        let told = |episode: &Audited| episode.told_fall_after_s.is_some_and(|after_s| after_s <= FALL_WITHIN_S);
        AuditSummary {
            after_push_m: error(episodes.iter().flat_map(|episode| episode.after_push_m.iter().copied()).collect()),
            at_end_m: error(episodes.iter().filter_map(|episode| episode.at_end_m).collect()),
            falls_told: count(&|episode| episode.fell && told(episode)),
            falls_missed: count(&|episode| episode.fell && !told(episode)),
            false_falls: count(&|episode| episode.false_fall),
        }
    }
}

fn error(mut errors_m: Vec<f32>) -> Option<ErrorM> {
    errors_m.sort_by(f32::total_cmp);
    let last = errors_m.len().checked_sub(1)?;
    let at = |part: f32| errors_m[(last as f32 * part).round() as usize];
    Some(ErrorM { median: at(0.5), p95: at(0.95) })
}
