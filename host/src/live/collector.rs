//! The collector: what was heard, by the clock, becomes observations and rewards; and it says when an episode begins.
//!
//! ```text
//!            armed, settled, still for a second                    horizon reached
//!  Waiting ─────────────────────────────────────► Acting ─────────────────────────► Waiting
//!     ▲                                            │  └─ fall: brake, wait for somebody to put it back ──┐
//!     └────────── link lost, halted: spoilt ───────┘                                                     │
//!     ▲──────────────────────────────────────────────────────────────────────────────────────────────────┘
//! ```
//!
//! A pure state machine: what was heard and the time in, things to do out. Decisions fall due by the clock, whether or
//! not the answer to the last one has come.

use sarah_protocol::bus::Mode;
use sarah_protocol::host::{Command, Refusal};
use sarah_protocol::params::{Lpg, ParamSet};
use sarah_protocol::session::News;
use sarah_protocol::telemetry::{Telemetry, faults};

use super::arming::{Arming, Consent, Lost};
use super::seam::{Act, Seen};
use crate::enaf::End;
use crate::link::live::{Ask, Heard, What};
use crate::task::environment::DECISION_S;
use crate::task::judge::Judge;
use crate::task::observation::loads_n;
use crate::task::odometry::Estimate;
use crate::task::pose_source::PoseSource;
use crate::task::reward::RewardForm;
use crate::task::{action, observation};

/// The robot must have been still for this long before an episode begins or it is armed, µs.
const STILL_US: u64 = 1_000_000;
/// Slower than this is still, rad/s.
const STILL_RAD_S: f32 = 0.1;
/// A robot that leans less, and carries this much on either foot, stands, rad and N.
const STANDS_RAD: f32 = 0.3;
const LOADED_N: f32 = 15.0;
/// A second with fewer telemetry frames than this says too little, of about 100.
const FRAMES_MIN: usize = 50;
/// Without telemetry for this long there is no link, µs.
const SILENCE_US: u64 = 500_000;

const DECISION_US: u64 = (DECISION_S * 1e6) as u64;

/// What is collected for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Task {
    /// What is trained.
    pub lpg: Lpg,
    /// The set it started from; everything else stays.
    pub base: ParamSet,
    /// The reward.
    pub reward: RewardForm,
    /// Decisions in a full episode.
    pub horizon: usize,
    /// Episodes of the session.
    pub episodes: u64,
}

/// Something to be done.
#[derive(Clone, PartialEq, Debug)]
pub enum Do {
    /// For the predictor.
    Send(Seen),
    /// For the robot.
    Ask(Ask),
    /// For the operator.
    Say(String),
}

/// Counters of a session.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Counts {
    /// Episodes that were of no use.
    pub spoilt: u32,
    /// Decisions whose answer came after the next was due.
    pub late: u32,
}

#[derive(Clone, Debug)]
struct Acting {
    began_us: u64,
    due_us: u64,
    decision: usize,
    answered: usize,
    judge: Judge,
    second: Vec<Telemetry>,
    fell: bool,
}

/// Collects one session after another.
pub struct Collector {
    task: Task,
    episode: u64,
    arming: Arming,
    source: PoseSource,
    last: Option<(u64, Telemetry)>,
    still_since_us: Option<u64>,
    acting: Option<Acting>,
    /// Brakes that this host asked for, because the robot fell.
    fallen: bool,
    counts: Counts,
}

impl Collector {
    /// Collects for `task`, whose next episode is `episode`.
    pub fn new(task: Task, episode: u64, source: PoseSource) -> Collector {
        Collector {
            task,
            episode,
            arming: Arming::default(),
            source,
            last: None,
            still_since_us: None,
            acting: None,
            fallen: false,
            counts: Counts::default(),
        }
    }

    /// Goes over to another session; the robot stays as it is.
    pub fn switch(&mut self, task: Task, episode: u64) {
        (self.task, self.episode, self.acting) = (task, episode, None);
        self.counts = Counts::default();
    }

    /// The operator allows motion.
    pub fn allow(&mut self, consent: Consent) {
        self.arming.allow(consent);
    }

    /// The operator stops the robot.
    pub fn stop(&mut self, out: &mut Vec<Do>) {
        out.push(Do::Ask(Ask::EStop));
        self.lose(Lost::Stop, out);
    }

    /// Counters so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Whether an episode is under way.
    pub fn acting(&self) -> bool {
        self.acting.is_some()
    }

    /// Where the trunk is, by odometry or whoever sees it from outside.
    pub fn estimate(&self) -> Estimate {
        self.source.estimate()
    }

    /// Somebody outside says where the trunk is; what is no pose is dropped.
    pub fn seen_from_outside(&mut self, at_us: u64, datagram: &[u8], out: &mut Vec<Do>) {
        let before = self.source.external();
        let result = self.source.heard(at_us as f64 * 1e-6, datagram);
        match result {
            Ok(()) if !before => out.push(Do::Say("following the external pose".into())),
            Ok(()) => {}
            Err(error) if before => out.push(Do::Say(format!("an external pose is dropped: {error}"))),
            Err(_) => {}
        }
    }

    /// What the robot said last.
    pub fn telemetry(&self) -> Option<&Telemetry> {
        self.last.as_ref().map(|(_, frame)| frame)
    }

    /// Why no episode is under way, in a few words.
    pub fn waiting_for(&self) -> &'static str {
        match &self.last {
            _ if self.acting.is_some() => "nothing",
            None => "an answer: is the coordinator powered, and its firmware flashed?",
            Some((_, frame)) if frame.faults & faults::E_STOP != 0 => {
                "the emergency stop to be cleared (c), then arm (a)"
            }
            Some((_, frame)) if frame.mode == Mode::Braked && self.arming.consent() == Consent::None => "arm (a)",
            Some(_) if self.fallen => "somebody to put the robot back on its feet",
            Some(_) => "the robot to stand still",
        }
    }

    /// Something was heard.
    pub fn heard(&mut self, heard: &Heard, out: &mut Vec<Do>) {
        match &heard.what {
            What::News(News::Telemetry(frame)) => self.saw(heard.at_us, frame, out),
            What::News(News::Done(Command::Arm { .. })) => {
                self.arming.done(heard.at_us);
                self.fallen = false;
                out.push(Do::Say("armed".into()));
            }
            What::News(News::Refused(Command::Arm { .. }, refusal)) => match refusal {
                Refusal::NotReady(_) => self.arming.refused(heard.at_us),
                other => {
                    self.arming.lose();
                    out.push(Do::Say(format!("not armed: {other}")));
                }
            },
            What::News(News::Refused(Command::Claim, refusal)) => {
                out.push(Do::Say(format!("{refusal}: end that host, or wait for it; asking again")));
            }
            What::News(News::Rebooted) => self.lose(Lost::Restart, out),
            What::Down { why } => {
                out.push(Do::Say(format!("the link is down ({why}); the robot balances on, trying again")));
                self.lose(Lost::Link, out);
            }
            What::Up { port } if heard.at_us > 0 => out.push(Do::Say(format!("the link is up on {port}"))),
            _ => {}
        }
    }

    fn saw(&mut self, at_us: u64, frame: &Telemetry, out: &mut Vec<Do>) {
        let estimate = self.source.saw(at_us as f64 * 1e-6, frame);
        let still = estimate.pose.rotation_rad_s < STILL_RAD_S && frame.phases[0] == 0 && stands(frame);
        match still {
            true => _ = self.still_since_us.get_or_insert(at_us),
            false => self.still_since_us = None,
        }
        let braked = frame.mode == Mode::Braked;
        let was_armed = self.last.as_ref().is_some_and(|(_, last)| last.mode == Mode::Armed);
        self.last = Some((at_us, *frame));
        if let Some(acting) = &mut self.acting {
            let now_s = seconds(at_us.saturating_sub(acting.began_us));
            acting.judge.saw(now_s, estimate.pose, std::slice::from_ref(frame));
            acting.second.push(*frame);
            acting.fell |= estimate.fell;
        }
        if braked && was_armed && !self.fallen {
            let acting_fell = self.acting.as_ref().is_some_and(|acting| acting.fell);
            if !acting_fell {
                self.lose(Lost::Halt, out);
            }
        }
    }

    /// Time passed.
    pub fn tick(&mut self, now_us: u64, settled: bool, out: &mut Vec<Do>) {
        let silent = self.last.as_ref().is_none_or(|(at_us, _)| now_us.saturating_sub(*at_us) > SILENCE_US);
        match &mut self.acting {
            Some(acting) if acting.fell => self.fall(out),
            Some(_) if silent => self.spoil("the robot is silent", out),
            Some(acting) if now_us >= acting.due_us => self.decide(now_us, out),
            Some(_) => {}
            None if silent => {}
            None => self.wait(now_us, settled, out),
        }
    }

    fn wait(&mut self, now_us: u64, settled: bool, out: &mut Vec<Do>) {
        let still = self.still_since_us.is_some_and(|since| now_us.saturating_sub(since) >= STILL_US);
        let Some((_, frame)) = &self.last else { return };
        let estimate = self.source.estimate();
        if still && (estimate.fell || !estimate.upright) {
            // Somebody has put it back on its feet, perhaps in a way that odometry could not follow.
            self.source.reset();
        }
        match frame.mode {
            Mode::Braked if still && frame.faults & faults::E_STOP == 0 && self.arming.ask(now_us) => {
                out.push(Do::Ask(Ask::Arm));
            }
            Mode::Armed if self.source.estimate().fell && !self.fallen => {
                self.fallen = true;
                out.push(Do::Ask(Ask::Disarm));
            }
            Mode::Armed if still && settled && self.episode < self.task.episodes => self.begin(now_us, out),
            _ => {}
        }
    }

    fn begin(&mut self, now_us: u64, out: &mut Vec<Do>) {
        self.source.reset();
        let mut judge = Judge::new(0.0);
        judge.saw(0.0, self.source.estimate().pose, &[]);
        self.acting = Some(Acting {
            began_us: now_us,
            due_us: now_us + DECISION_US,
            decision: 0,
            answered: 0,
            judge,
            second: vec![],
            fell: false,
        });
        out.push(Do::Send(Seen::Began { episode: self.episode, observation: observation::observe(&[]) }));
    }

    /// A decision is over.
    fn decide(&mut self, now_us: u64, out: &mut Vec<Do>) {
        let Some(acting) = &mut self.acting else { return };
        if acting.second.len() < FRAMES_MIN {
            return self.spoil("too little telemetry", out);
        }
        if acting.answered <= acting.decision {
            self.counts.late += 1;
            return self.spoil("the predictor did not answer", out);
        }
        let reward = acting.judge.decide(seconds(now_us.saturating_sub(acting.began_us))).reward(self.task.reward);
        acting.decision += 1;
        // By the clock: a late look must not make the next decision shorter or later.
        acting.due_us += DECISION_US;
        let end = (acting.decision >= self.task.horizon).then_some(End::TimeOut);
        let observation = observation::observe(&std::mem::take(&mut acting.second));
        out.push(Do::Send(Seen::Went { episode: self.episode, observation, reward, end }));
        if end.is_some() {
            self.acting = None;
            self.episode += 1;
        }
    }

    fn fall(&mut self, out: &mut Vec<Do>) {
        let Some(acting) = self.acting.take() else { return };
        self.fallen = true;
        out.push(Do::Ask(Ask::Disarm));
        if acting.answered <= acting.decision {
            // It fell before its action was known: nobody can learn from that.
            self.acting = Some(acting);
            return self.spoil("the robot fell at once", out);
        }
        let observation = observation::observe(&acting.second);
        let end = Some(End::Fall);
        out.push(Do::Send(Seen::Went { episode: self.episode, observation, reward: 0.0, end }));
        self.episode += 1;
    }

    fn spoil(&mut self, why: &str, out: &mut Vec<Do>) {
        if self.acting.take().is_some() {
            self.counts.spoilt += 1;
            out.push(Do::Send(Seen::Spoilt { episode: self.episode }));
            out.push(Do::Say(format!("episode {} is of no use: {why}; it is repeated", self.episode)));
        }
    }

    fn lose(&mut self, lost: Lost, out: &mut Vec<Do>) {
        let had = self.arming.lose();
        let (why, remedy) = match lost {
            Lost::Link => ("the link was lost", ""),
            Lost::Restart => ("the robot restarted", "; arm it with a when it stands"),
            Lost::Halt => ("the robot braked by itself", "; see `sarah monitor` for the reason, then arm with a"),
            Lost::Stop => ("emergency stop", "; clear with c, then arm with a"),
        };
        if had && lost != Lost::Link {
            out.push(Do::Say(format!("{why}{remedy}")));
        }
        if lost != Lost::Link {
            self.fallen = false;
        }
        self.spoil(why, out);
    }

    /// The predictor's answer: the set to ask the robot for, unless it answers something long over.
    pub fn act(&mut self, act: &Act) -> Option<ParamSet> {
        let acting = self.acting.as_mut()?;
        if act.episode != self.episode || act.decision != acting.decision {
            return None;
        }
        acting.answered = act.decision + 1;
        Some(action::decode(&self.task.base, self.task.lpg, &act.action))
    }
}

/// Upright on both feet, as the robot itself sees it.
fn stands(frame: &Telemetry) -> bool {
    let [left_heel, left_toe, right_heel, right_toe] = loads_n(frame);
    let upright = frame.lean.iter().all(|lean| lean.to_f32().abs() < STANDS_RAD);
    upright && left_heel + left_toe > LOADED_N && right_heel + right_toe > LOADED_N
}

fn seconds(us: u64) -> f32 {
    us as f32 * 1e-6
}

#[cfg(test)]
mod tests;
