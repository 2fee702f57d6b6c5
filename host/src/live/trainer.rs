//! The three sessions of a run on a robot, one after another, into the same run folder as in simulation.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::time::{Duration, Instant};

use sarah_protocol::host::Which;
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::{News, State};
use sarah_protocol::telemetry::Event;
use sarah_sim::robot::Geometry;
use sarah_sim::sil::SilError;

use super::arming::Consent;
use super::collector::{Collector, Counts, Do, Look, Task};
use super::console::{self, Word};
use super::learner::{Learner, Learning};
use super::predictor::{Answer, Predictor, Weights};
use super::recorder::Recorder;
use super::seam::Seen;
use crate::enaf::{EnafConfig, EnafError, EpisodeLog, Trainer};
use crate::evaluate::EvaluateError;
use crate::link::live::{Ask, Link, Role, What};
use crate::link::port::Target;
use crate::link::sim::LinkError;
use crate::progress::Progress;
use crate::run::{RunFolder, RunInfo, event_file, read_metrics};
use crate::stop;
use crate::task::action::{self, Scope};
use crate::task::environment::horizon;
use crate::task::observation;
use crate::task::odometry::Odometry;
use crate::task::pose_source::{PoseSocket, PoseSource};
use crate::train::config::ConfigError;
use crate::train::journal::Journal;
use crate::train::{Chain, Method, TrainConfig, TrainError, outcome, session::Trained};

/// A look at everything at least this often.
const LOOK: Duration = Duration::from_millis(5);
/// The operator is told what is waited for when that has lasted for this long.
const PATIENCE: Duration = Duration::from_secs(3);
/// A robot that is there says hello within this.
const HELLO: Duration = Duration::from_secs(3);
/// The final set takes force at the next cycle boundary; a robot that stands still is always at one.
const LAST_SET: Duration = Duration::from_secs(10);

/// How the robot is reached, and what the operator allows.
#[derive(Clone, Debug)]
pub struct Robot {
    /// The port.
    pub target: Target,
    /// What a word of the operator allows.
    pub consent: Consent,
    /// Whether it is allowed from the beginning.
    pub arm: bool,
    /// Where poses from outside arrive, if they do.
    pub pose: Option<String>,
}

/// A robot that answers, and what else a run needs before anything is written.
pub struct Reached {
    robot: Robot,
    link: Link,
    geometry: Geometry,
    poses: Option<PoseSocket>,
}

/// Opens the port and waits for the robot's hello.
pub fn reach(robot: Robot) -> Result<Reached, TrainError> {
    let geometry = Geometry::load().map_err(SilError::from).map_err(LinkError::from).map_err(EvaluateError::from)?;
    let poses = robot.pose.as_deref().map(listen_for_poses).transpose()?;
    let link = Link::open(&robot.target, Role::Writer)?;
    let end = Instant::now() + HELLO;
    loop {
        match link.health().state {
            State::Failed(error) => return Err(error.into()),
            State::Greeting if Instant::now() > end => return Err(TrainError::NoAnswer(link.health().port)),
            State::Greeting => std::thread::sleep(LOOK),
            _ => return Ok(Reached { robot, link, geometry, poses }),
        }
    }
}

/// Trains the robot; ends early, to be resumed, when the operator says so.
pub fn train(
    config: &TrainConfig,
    reached: Reached,
    folder: &RunFolder,
    info: &RunInfo,
) -> Result<PathBuf, TrainError> {
    // If nobody listens the signal ends the process at once, which the journal survives too.
    let interrupted = stop::when_asked().unwrap_or_default();
    let progress = Progress::new(3 * u64::from(config.episodes));
    progress.phase(&format!("training on {} in {}", reached.link.health().port, folder.layout().root().display()));
    progress.print(console::HELP);
    let recorder = Recorder::start(&folder.layout().root().join("recordings"), &reached.link)?;
    let start = config.start_set()?;
    let (chain, mut bench) = {
        let (_, first) = open(config, folder, Scope::SESSIONS[0], start, 1)?;
        let mut collector = Collector::new(first, 0, PoseSource::new(Odometry::new(reached.geometry)));
        if reached.robot.arm {
            collector.allow(reached.robot.consent);
        }
        let chain = Chain { method: Method::Enaf, seed: config.seed, sessions: vec![], start };
        let words = console::listen();
        (chain, Bench { reached, collector, recorder, words, interrupted, progress: &progress, ended: false })
    };
    let result = sessions(config, folder, chain, &mut bench).and_then(|chain| match chain {
        None => Ok(None),
        Some(chain) => {
            let applied = bench.leave(&chain.base(3));
            let report = outcome::on_a_robot(config, folder, info, &chain)?;
            outcome::write_report(folder.layout(), &report)?;
            Ok(Some(applied))
        }
    });
    if let Err(error) = bench.recorder.finish() {
        progress.print(&format!("the recording ended early: {error}"));
    }
    if bench.recorder.dropped() > 0 {
        progress.print(&format!("the disk was too slow: {} items were not recorded", bench.recorder.dropped()));
    }
    progress.finish();
    println!("{}", bench.farewell());
    let root = folder.layout().root().to_path_buf();
    let link = &bench.reached.robot.target;
    match result? {
        None => println!("to go on: sarah train --resume {}", root.display()),
        Some(applied) => {
            if !applied {
                println!("the trained set did not come into force");
            }
            println!(
                "report: {}\nparameters: {}",
                folder.layout().report().display(),
                folder.layout().params().display()
            );
            println!(
                "10 s from now the robot returns to its stored set; to keep the trained one:\n  \
                 sarah params set --from {} --link {link} --commit",
                root.display()
            );
        }
    }
    Ok(root)
}

/// The sessions in order; `None` if the operator ended them.
fn sessions(
    config: &TrainConfig,
    folder: &RunFolder,
    mut chain: Chain,
    bench: &mut Bench<'_>,
) -> Result<Option<Chain>, TrainError> {
    for (index, scope) in Scope::SESSIONS.into_iter().enumerate() {
        let number = index as u8 + 1;
        let base = chain.base(index);
        let (learning, task) = open(config, folder, scope, base, number)?;
        bench.progress.skip(learning.journal.episodes().into());
        let learning = bench.session(learning, task, number)?;
        if bench.ended {
            return Ok(None);
        }
        let metrics = read_metrics(&folder.layout().metrics(Method::Enaf.folder(), config.seed, number))?;
        let events = event_file(&metrics, crate::report::columns::EPISODE, crate::report::columns::TIME_S);
        folder.write_tensorboard(Method::Enaf.folder(), config.seed, number, &events)?;
        // There is no common push on a robot to validate with: the constants are handed on as they are.
        let constants = action::decode(&base, scope, &learning.trainer.mean_action());
        chain.sessions.push(Trained { constants, policy: None, broken: learning.journal.broken() });
    }
    Ok(Some(chain))
}

fn listen_for_poses(address: &str) -> Result<PoseSocket, TrainError> {
    PoseSocket::bind(address).map_err(|source| TrainError::Poses { address: address.into(), source })
}

/// A session as its journal left it, or a new one.
fn open(
    config: &TrainConfig,
    folder: &RunFolder,
    scope: Scope,
    base: ParamSet,
    number: u8,
) -> Result<(Learning, Task), TrainError> {
    let place = folder.session(Method::Enaf.folder(), config.seed, number)?;
    let (journal, saved) = Journal::open(scope, &place)?;
    let horizon = horizon(&config.train_scenario().map_err(ConfigError::from)?);
    let enaf = EnafConfig { horizon, ..config.enaf_for(Method::Enaf) };
    let trainer = match &saved {
        Some(saved) => Trainer::load(&enaf, saved).map_err(|error| journal.unusable(error))?,
        None => Trainer::new(&enaf, observation::LEN, &action::encode(&base, scope), config.seed * 10 + scope as u64)?,
    };
    let task = Task { scope, base, reward: config.reward, horizon, episodes: config.episodes.into() };
    Ok((Learning { trainer, journal, scope, base }, task))
}

/// Everything a session is run with.
struct Bench<'a> {
    reached: Reached,
    collector: Collector,
    recorder: Recorder,
    words: Receiver<Word>,
    interrupted: Arc<AtomicBool>,
    progress: &'a Progress,
    /// The operator has had enough.
    ended: bool,
}

impl Bench<'_> {
    /// Runs one session, or what the operator wants of it. The robot is watched until its last episode is learned.
    fn session(&mut self, learning: Learning, task: Task, number: u8) -> Result<Learning, TrainError> {
        let mut learned = learning.trainer.episodes();
        let mut handed = learned;
        self.collector.switch(task, learned);
        let weights = Weights::default();
        let (seen, answers) = predict(Predictor::new(learning.trainer.actor(), weights.clone()));
        let mut learner = Learner::start(learning, weights);
        let mut spoilt = 0;
        let mut waiting = Waiting::default();
        let mut out = vec![];
        while !learner.over() {
            if learned >= task.episodes || self.ended {
                learner.close();
            }
            // Weights must not fall far behind, and a kill must not cost more than what is being learned.
            let look = self.look(handed - learned <= 1, &mut out);
            for item in out.drain(..) {
                match item {
                    // A predictor that failed says so below.
                    Do::Send(message) => _ = seen.send(message),
                    Do::Ask(ask) => self.reached.link.ask(ask),
                    Do::Say(text) => self.progress.print(&text),
                }
            }
            loop {
                match answers.try_recv() {
                    Ok(Ok(Answer::Act(act))) => {
                        if let Some(set) = self.collector.act(&act) {
                            self.reached.link.ask(Ask::Params(set));
                        }
                    }
                    Ok(Ok(Answer::Played(played))) => {
                        let all = self.collector.counts().spoilt;
                        handed = played.number + 1;
                        learner.learn(*played, all - std::mem::replace(&mut spoilt, all));
                    }
                    Ok(Ok(Answer::Nothing)) => {}
                    Ok(Err(error)) => return Err(error.into()),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return Err(TrainError::Stopped),
                }
            }
            while let Some(log) = learner.learned() {
                learned = log.episode + 1;
                self.progress.episode(Some(line(&log, number)));
            }
            if let Some(what) = waiting.long(self.collector.waiting_for(&look)) {
                self.progress.print(&format!("waiting for {what}"));
            }
        }
        let counts = self.collector.counts();
        if counts.spoilt > 0 {
            let Counts { spoilt, late } = counts;
            self.progress.print(&format!("session {number}: {spoilt} episodes of no use, {late} for late answers"));
        }
        learner.finish()
    }

    /// What was heard and typed since the last look, and what follows from it.
    fn look(&mut self, learned: bool, out: &mut Vec<Do>) -> Look {
        let Reached { link, poses, robot, .. } = &self.reached;
        let mut patience = LOOK;
        while let Some(heard) = link.next(patience) {
            patience = Duration::ZERO;
            self.collector.heard(&heard, out);
            if let What::News(News::Event { event: Event::Applied { .. }, .. } | News::Connected(_)) = heard.what {
                // For the recording: an event has no values.
                out.push(Do::Ask(Ask::Get(Which::Applied)));
            }
            let pose = matches!(heard.what, What::News(_)).then(|| self.collector.estimate());
            if let Some(error) = self.recorder.heard(heard, pose, link) {
                out.push(Do::Say(format!("the recording ended ({error}); training goes on without it")));
            }
        }
        if let Some(poses) = poses {
            let now_us = link.now_us();
            // A source that fails is one that is silent: odometry goes on.
            let _ = poses.receive(|datagram| self.collector.seen_from_outside(now_us, datagram, out));
        }
        let look = Look::at(link.now_us(), &link.health(), learned);
        while let Ok(word) = self.words.try_recv() {
            match word {
                Word::Arm => self.collector.word(robot.consent, &look, out),
                Word::Stop => self.collector.stop(out),
                Word::Clear => out.push(Do::Ask(Ask::ClearEStop)),
                Word::Quit => self.ended = true,
                Word::Help => out.push(Do::Say(console::HELP.into())),
                Word::Gone => self.collector.unattended(out),
            }
        }
        self.ended |= self.interrupted.load(Ordering::Relaxed);
        self.collector.tick(&look, out);
        look
    }

    /// Hands the robot its last set; whether it took it. It is watched until then.
    fn leave(&mut self, set: &ParamSet) -> bool {
        self.collector.rest(*set);
        let end = Instant::now() + LAST_SET;
        let mut out = vec![];
        while Instant::now() < end {
            if self.look(true, &mut out).held == Some(*set) {
                return true;
            }
            for item in out.drain(..) {
                match item {
                    Do::Ask(ask) => self.reached.link.ask(ask),
                    Do::Say(text) => self.progress.print(&text),
                    Do::Send(_) => {}
                }
            }
        }
        false
    }

    /// How the robot is left.
    fn farewell(&self) -> String {
        let health = self.reached.link.health();
        match health.up {
            true => format!("the robot goes on with generation {}", health.applied),
            false => "the robot goes on with what it has; its link is down".into(),
        }
    }
}

/// What is waited for, and since when.
#[derive(Default)]
struct Waiting {
    what: &'static str,
    since: Option<Instant>,
    told: bool,
}

impl Waiting {
    /// What to tell the operator, once it has lasted.
    fn long(&mut self, what: &'static str) -> Option<&'static str> {
        if what != self.what {
            *self = Waiting { what, since: Some(Instant::now()), told: false };
        }
        let long = self.since.is_some_and(|since| since.elapsed() > PATIENCE);
        (long && !std::mem::replace(&mut self.told, long) && what != "nothing").then_some(what)
    }
}

fn line(log: &EpisodeLog, number: u8) -> String {
    let fell = if log.fell { ", fell" } else { "" };
    format!("session {number}, episode {}: reward {:.2}{fell}", log.episode + 1, log.reward_mean)
}

type Answers = Receiver<Result<Answer, EnafError>>;

/// A predictor in a thread of its own, until its sender is dropped or it fails.
fn predict(mut predictor: Predictor) -> (Sender<Seen>, Answers) {
    let (seen, messages) = channel();
    let (said, answers) = channel();
    std::thread::spawn(move || {
        while let Ok(message) = messages.recv() {
            let answer = predictor.on(&message);
            let failed = answer.is_err();
            if said.send(answer).is_err() || failed {
                break;
            }
        }
    });
    (seen, answers)
}
