//! The collector: what was heard, by the clock, becomes observations and rewards; and it says when an episode begins.
//!
//! ```text
//!            armed, start set in force, still for a second         horizon reached
//!  Waiting ─────────────────────────────────────────────► Acting ─────────────────► Waiting
//!     ▲                                                    │  └─ fall: brake, wait for somebody to put it back ─┐
//!     ├────────── link lost, halted: spoilt ───────────────┘                                                    │
//!     └─────────────────────────────────────────────────────────────────────────────────────────────────────────┘
//! ```
//!
//! A pure state machine: what was heard and the time in, things to do out. Decisions fall due by the clock, whether or
//! not the answer to the last one has come. Between episodes the robot runs the set that the session started from, as in
//! simulation: a set that makes it fall must not be what it is stood up with.

use sarah_protocol::bus::HaltReason;
use sarah_protocol::host::{Command, Refusal};
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::{News, State};
use sarah_protocol::telemetry::{Event, Telemetry};

use super::arming::{Arming, Consent};
use super::seam::{Act, Seen};
use super::watch::Watch;
use crate::enaf::End;
use crate::link::live::{Ask, Heard, LinkHealth, What};
use crate::monitor::words::{event_words, fault_advice};
use crate::task::action::{self, Scope};
use crate::task::environment::DECISION_S;
use crate::task::judge::Judge;
use crate::task::observation;
use crate::task::odometry::Estimate;
use crate::task::pose_source::PoseSource;
use crate::task::reward::RewardForm;

/// A second with fewer telemetry frames than this says too little, of about 100.
const FRAMES_MIN: usize = 50;
/// A robot that does not brake when it is asked to is asked again after this, µs.
const AGAIN_US: u64 = 200_000;

const DECISION_US: u64 = (DECISION_S * 1e6) as u64;

/// What is collected for.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Task {
    /// What is trained.
    pub scope: Scope,
    /// The set it started from; everything else stays.
    pub base: ParamSet,
    /// The reward.
    pub reward: RewardForm,
    /// Decisions in a full episode.
    pub horizon: usize,
    /// Episodes of the session.
    pub episodes: u64,
}

/// What a look at everything else finds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Look {
    /// Time since the link was opened, µs.
    pub now_us: u64,
    /// This host is the writer.
    pub open: bool,
    /// The set in force, if it is known and no change is under way.
    pub held: Option<ParamSet>,
    /// The learner keeps up.
    pub learned: bool,
}

impl Look {
    /// At a link.
    pub fn at(now_us: u64, health: &LinkHealth, learned: bool) -> Look {
        let held = health.params.filter(|_| health.settled);
        Look { now_us, open: health.up && health.state == State::Open, held, learned }
    }
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
    /// What the current decision asked for.
    asked: Option<ParamSet>,
    judge: Judge,
    second: Vec<Telemetry>,
    fell: bool,
}

/// Collects one session after another.
pub struct Collector {
    task: Task,
    episode: u64,
    attempt: u32,
    arming: Arming,
    watch: Watch,
    acting: Option<Acting>,
    /// The robot lies; brakes are asked for until it says braked.
    fallen: bool,
    brake_us: u64,
    connected: bool,
    counts: Counts,
}

impl Collector {
    /// Collects for `task`, whose next episode is `episode`.
    pub fn new(task: Task, episode: u64, source: PoseSource) -> Collector {
        Collector {
            task,
            episode,
            attempt: 0,
            arming: Arming::default(),
            watch: Watch::new(source),
            acting: None,
            fallen: false,
            brake_us: 0,
            connected: false,
            counts: Counts::default(),
        }
    }

    /// Goes over to another session.
    pub fn switch(&mut self, task: Task, episode: u64) {
        (self.task, self.episode, self.acting) = (task, episode, None);
        self.counts = Counts::default();
    }

    /// Begins no more episodes; the robot goes over to `set`.
    pub fn rest(&mut self, set: ParamSet) {
        self.switch(Task { base: set, episodes: 0, ..self.task }, 0);
    }

    /// The operator allows motion beforehand, on the command line.
    pub fn allow(&mut self, consent: Consent) {
        self.arming.allow(consent, 0);
    }

    /// The operator says "arm": heard only while the robot is there, braked and not stopped, so that no word lies around.
    pub fn word(&mut self, consent: Consent, look: &Look, out: &mut Vec<Do>) {
        let not = match () {
            () if !look.open || self.watch.silent(look.now_us) => "the robot does not answer",
            () if self.watch.stopped() => "the emergency stop is latched: clear it with c first",
            () if self.watch.armed() => "it is armed already",
            () => {
                self.watch.unsettle();
                return self.arming.allow(consent, look.now_us);
            }
        };
        out.push(Do::Say(format!("not arming: {not}")));
    }

    /// The operator stops the robot.
    pub fn stop(&mut self, out: &mut Vec<Do>) {
        out.push(Do::Ask(Ask::EStop));
        self.lose("emergency stop; clear it with c, then arm with a", out);
    }

    /// Nobody can say stop any more.
    pub fn unattended(&mut self, out: &mut Vec<Do>) {
        self.arming.lose();
        out.push(Do::Say("the keyboard is gone: nothing will be armed any more; Ctrl-C ends".into()));
    }

    /// Counters so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Where the trunk is, by odometry or whoever sees it from outside.
    pub fn estimate(&self) -> Estimate {
        self.watch.estimate()
    }

    /// Somebody outside says where the trunk is; what is no pose is dropped.
    pub fn seen_from_outside(&mut self, at_us: u64, datagram: &[u8], out: &mut Vec<Do>) {
        let before = self.watch.external();
        match self.watch.seen_from_outside(at_us, datagram) {
            Ok(()) if !before => out.push(Do::Say("following the external pose".into())),
            Err(error) if before => out.push(Do::Say(format!("an external pose is dropped: {error}"))),
            _ => {}
        }
    }

    /// Why no episode is under way, in a few words.
    pub fn waiting_for(&self, look: &Look) -> &'static str {
        match () {
            () if self.acting.is_some() => "nothing",
            () if self.watch.telemetry().is_none() => {
                "an answer: is the coordinator powered, and its firmware flashed?"
            }
            () if self.watch.silent(look.now_us) => "the robot to be heard again",
            () if !look.open => "the robot to let this host write",
            () if self.episode >= self.task.episodes || !look.learned => "the learner",
            () if self.watch.stopped() => "the emergency stop to be cleared (c), then arm (a)",
            () if self.fallen && !self.watch.estimate().upright => "somebody to put the robot back on its feet",
            () if !self.watch.armed() && self.arming.consent(look.now_us) == Consent::None => "arm (a)",
            () if look.held != Some(self.task.base) => "the session's first set to be in force",
            () => "the robot to stand still",
        }
    }

    /// Something was heard.
    pub fn heard(&mut self, heard: &Heard, out: &mut Vec<Do>) {
        match &heard.what {
            What::News(News::Telemetry(frame)) => self.saw(heard.at_us, frame),
            What::News(News::Event { event, .. }) => self.happened(event, out),
            What::News(News::Done(Command::Arm { .. })) => self.arming.done(heard.at_us),
            What::News(News::Refused(command, refusal)) => self.refused(heard.at_us, command, refusal, out),
            What::NotNow { ask: Ask::Arm, .. } => self.arming.again(heard.at_us),
            What::News(News::Rebooted) => self.lose("the robot restarted; arm it with a when it stands", out),
            // After the first time it is a reconnection, even if the port never closed.
            What::News(News::Connected(_)) if std::mem::replace(&mut self.connected, true) => {
                self.lose("the link was lost for a while; what was armed is armed still", out);
            }
            What::Down { why } => {
                self.lose(&format!("the link is down ({why}); the robot balances on, trying again"), out);
            }
            What::Up { port } if heard.at_us > 0 && self.connected => {
                out.push(Do::Say(format!("the link is up on {port}")));
            }
            _ => {}
        }
    }

    fn happened(&mut self, event: &Event, out: &mut Vec<Do>) {
        match event {
            // Brakes that this host asked for.
            Event::Halted(HaltReason::Disarmed) => {}
            Event::Halted(reason) => {
                let bits = self.watch.telemetry().map_or(0, |frame| frame.faults);
                let advice = fault_advice(bits, Some(*reason));
                let advice: Vec<String> = advice.iter().map(|one| format!("{}: {}", one.what, one.remedy)).collect();
                self.lose(&format!("{}; {}", event_words(event), advice.join("; ")), out);
            }
            Event::Armed | Event::NodeLost(_) | Event::NodeRestarted(_) => out.push(Do::Say(event_words(event))),
            _ => {}
        }
    }

    fn refused(&mut self, at_us: u64, command: &Command, refusal: &Refusal, out: &mut Vec<Do>) {
        match (command, refusal) {
            (Command::Arm { .. }, Refusal::NotReady(_)) => self.arming.again(at_us),
            (Command::Arm { .. }, other) => {
                self.arming.lose();
                out.push(Do::Say(format!("not armed: {other}")));
            }
            (Command::Claim, other) => {
                out.push(Do::Say(format!("{other}: end that host, or wait for it; asking again")));
            }
            (Command::Stage { .. } | Command::Commit { .. }, other) => {
                out.push(Do::Say(format!("the robot refused a set: {other}")));
            }
            _ => {}
        }
    }

    fn saw(&mut self, at_us: u64, frame: &Telemetry) {
        let estimate = self.watch.saw(at_us, frame);
        if let Some(acting) = &mut self.acting {
            let now_s = seconds(at_us.saturating_sub(acting.began_us));
            acting.judge.saw(now_s, estimate.pose, std::slice::from_ref(frame));
            acting.second.push(*frame);
            acting.fell |= estimate.fell;
        }
    }

    /// Time passed.
    pub fn tick(&mut self, look: &Look, out: &mut Vec<Do>) {
        let silent = self.watch.silent(look.now_us);
        match &self.acting {
            _ if silent && self.watch.telemetry().is_some() => {
                // The port may be open all the same: a robot that comes back is not armed by an old word.
                self.arming.lose();
                self.watch.unsettle();
                self.spoil("the robot is silent", out);
            }
            Some(acting) if acting.fell => self.fall(out),
            Some(_) if !self.watch.armed() => self.spoil("the robot is braked", out),
            Some(acting) if look.now_us >= acting.due_us => self.decide(look, out),
            Some(_) => {}
            None => self.wait(look, out),
        }
        if self.fallen && self.watch.armed() && look.now_us >= self.brake_us {
            self.brake_us = look.now_us + AGAIN_US;
            out.push(Do::Ask(Ask::Disarm));
        }
    }

    fn wait(&mut self, look: &Look, out: &mut Vec<Do>) {
        let (still, estimate) = (self.watch.still(look.now_us), self.watch.estimate());
        if still && (estimate.fell || !estimate.upright) {
            // Somebody has put it back on its feet, perhaps in a way that odometry could not follow.
            self.watch.restart();
        }
        let ready = look.open && look.held == Some(self.task.base);
        if look.open && look.held.is_some() && !ready {
            out.push(Do::Ask(Ask::Params(self.task.base)));
        }
        if !self.watch.armed() {
            if still && ready && !self.watch.stopped() && self.arming.ask(look.now_us) {
                self.fallen = false;
                out.push(Do::Ask(Ask::Arm));
            }
        } else if estimate.fell {
            self.fallen = true;
        } else if still && ready && look.learned && !self.fallen && self.episode < self.task.episodes {
            self.begin(look.now_us, out);
        }
    }

    fn begin(&mut self, now_us: u64, out: &mut Vec<Do>) {
        self.watch.restart();
        let mut judge = Judge::new(0.0);
        judge.saw(0.0, self.watch.estimate().pose, &[]);
        self.attempt = self.attempt.wrapping_add(1);
        self.acting = Some(Acting {
            began_us: now_us,
            due_us: now_us + DECISION_US,
            decision: 0,
            answered: 0,
            asked: None,
            judge,
            second: vec![],
            fell: false,
        });
        let (episode, attempt) = (self.episode, self.attempt);
        out.push(Do::Send(Seen::Began { episode, attempt, observation: observation::observe(&[]) }));
    }

    /// A decision is over.
    fn decide(&mut self, look: &Look, out: &mut Vec<Do>) {
        let Some(acting) = &mut self.acting else { return };
        if acting.second.len() < FRAMES_MIN {
            return self.spoil("too little telemetry", out);
        }
        if acting.answered <= acting.decision {
            self.counts.late += 1;
            return self.spoil("the predictor did not answer", out);
        }
        if look.held != acting.asked {
            return self.spoil("its set did not come into force", out);
        }
        let now_s = seconds(look.now_us.saturating_sub(acting.began_us));
        let reward = acting.judge.decide(now_s).reward(self.task.reward);
        acting.decision += 1;
        // By the clock: a late look must not make the next decision shorter or later.
        acting.due_us += DECISION_US;
        let end = (acting.decision >= self.task.horizon).then_some(End::TimeOut);
        let observation = observation::observe(&std::mem::take(&mut acting.second));
        out.push(Do::Send(Seen::Went { attempt: self.attempt, observation, reward, end }));
        if end.is_some() {
            self.acting = None;
            self.episode += 1;
        }
    }

    fn fall(&mut self, out: &mut Vec<Do>) {
        let Some(acting) = self.acting.take() else { return };
        self.fallen = true;
        if acting.answered <= acting.decision {
            // It fell before its action was known: nobody can learn from that.
            self.acting = Some(acting);
            return self.spoil("the robot fell at once", out);
        }
        let (observation, end) = (observation::observe(&acting.second), Some(End::Fall));
        out.push(Do::Send(Seen::Went { attempt: self.attempt, observation, reward: 0.0, end }));
        self.episode += 1;
    }

    fn spoil(&mut self, why: &str, out: &mut Vec<Do>) {
        if self.acting.take().is_some() {
            self.counts.spoilt += 1;
            out.push(Do::Send(Seen::Spoilt { attempt: self.attempt }));
            out.push(Do::Say(format!("episode {} is of no use: {why}; it is repeated", self.episode + 1)));
        }
    }

    /// The operator's word is over, and with it the episode.
    fn lose(&mut self, why: &str, out: &mut Vec<Do>) {
        self.arming.lose();
        self.watch.unsettle();
        self.fallen = false;
        out.push(Do::Say(why.into()));
        self.spoil("see above", out);
    }

    /// The predictor's answer: the set to ask the robot for, unless it answers something long over.
    pub fn act(&mut self, act: &Act) -> Option<ParamSet> {
        let attempt = self.attempt;
        let acting = self.acting.as_mut().filter(|acting| act.attempt == attempt && act.decision == acting.decision)?;
        acting.answered = act.decision + 1;
        let set = action::decode(&self.task.base, self.task.scope, &act.action);
        acting.asked = Some(set);
        Some(set)
    }
}

fn seconds(us: u64) -> f32 {
    us as f32 * 1e-6
}

#[cfg(test)]
mod tests;
