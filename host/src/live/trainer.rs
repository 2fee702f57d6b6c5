//! The three sessions of a run on a robot, one after another, into the same run folder as in simulation.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::time::{Duration, Instant};

use sarah_protocol::params::{Lpg, ParamSet};
use sarah_protocol::session::News;
use sarah_sim::robot::Geometry;
use sarah_sim::sil::SilError;

use super::arming::Consent;
use super::collector::{Collector, Do, Task};
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
use crate::task::environment::horizon;
use crate::task::odometry::Odometry;
use crate::task::pose_source::{PoseSocket, PoseSource};
use crate::task::{action, observation};
use crate::train::config::ConfigError;
use crate::train::journal::Journal;
use crate::train::{Chain, Method, TrainConfig, TrainError, outcome, session::Trained};

/// A look at everything at least this often.
const LOOK: Duration = Duration::from_millis(5);
/// The operator is told what is waited for when that has lasted for this long.
const PATIENCE: Duration = Duration::from_secs(3);
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

/// Trains the robot; ends early, to be resumed, when the operator says so.
pub fn train(config: &TrainConfig, robot: &Robot, folder: &RunFolder, info: &RunInfo) -> Result<PathBuf, TrainError> {
    let geometry = Geometry::load().map_err(SilError::from).map_err(LinkError::from).map_err(EvaluateError::from)?;
    let poses = robot.pose.as_deref().map(listen_for_poses).transpose()?;
    let link = Link::open(&robot.target, Role::Writer)?;
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = interrupted.clone();
    // Without the handler the signal ends the process at once, which the journal survives too.
    let _ = ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed));
    let progress = Progress::new(3 * u64::from(config.episodes));
    progress.phase(&format!("training on {} in {}", link.health().port, folder.layout().root().display()));
    progress.print(console::HELP);
    let recorder = Recorder::start(&folder.layout().root().join("recordings"), &link)?;
    let mut collector = None;
    let mut chain = Chain { method: Method::Enaf, seed: config.seed, sessions: vec![] };
    let words = console::listen();
    let mut bench = Bench { robot, link: &link, geometry, poses, recorder, words, interrupted, progress: &progress };
    for (index, lpg) in Lpg::ALL.into_iter().enumerate() {
        let number = index as u8 + 1;
        let base = chain.base(index);
        let (learning, task) = open(config, folder, lpg, base, number)?;
        progress.skip(learning.journal.episodes().into());
        let (learning, ended) = bench.session(learning, task, &mut collector, number)?;
        if ended {
            progress.finish();
            println!("{}", bench.farewell());
            println!("to go on: sarah train --resume {}", folder.layout().root().display());
            return Ok(folder.layout().root().to_path_buf());
        }
        let metrics = read_metrics(&folder.layout().metrics(Method::Enaf.folder(), config.seed, number))?;
        let events = event_file(&metrics, crate::report::columns::EPISODE, crate::report::columns::TIME_S);
        folder.write_tensorboard(Method::Enaf.folder(), config.seed, number, &events)?;
        // There is no common push on a robot to validate with: the constants are handed on as they are.
        let constants = action::decode(&base, lpg, &learning.trainer.mean_action());
        chain.sessions.push(Trained { constants, policy: None, broken: learning.journal.broken() });
    }
    let trained = chain.base(3);
    let applied = bench.leave(&trained);
    let report = outcome::on_a_robot(config, folder, info, &chain)?;
    outcome::write_report(folder.layout(), &report)?;
    progress.finish();
    println!("{}", bench.farewell());
    if !applied {
        println!("the trained set could not be handed over; `sarah params set --from {0} --link …`", params(folder));
    }
    println!("report: {}\nparameters: {}", folder.layout().report().display(), params(folder));
    println!("to keep them over power cycles: sarah params commit --link {}", link_name(&robot.target));
    Ok(folder.layout().root().to_path_buf())
}

fn listen_for_poses(address: &str) -> Result<PoseSocket, TrainError> {
    PoseSocket::bind(address).map_err(|source| TrainError::Poses { address: address.into(), source })
}

fn params(folder: &RunFolder) -> String {
    folder.layout().params().display().to_string()
}

fn link_name(target: &Target) -> String {
    match target {
        Target::Only => "serial".into(),
        Target::Path(path) => format!("serial:{path}"),
    }
}

/// A session as its journal left it, or a new one.
fn open(
    config: &TrainConfig,
    folder: &RunFolder,
    lpg: Lpg,
    base: ParamSet,
    number: u8,
) -> Result<(Learning, Task), TrainError> {
    let place = folder.session(Method::Enaf.folder(), config.seed, number)?;
    let (journal, saved) = Journal::open(lpg, &place)?;
    let horizon = horizon(&config.train_scenario().map_err(ConfigError::from)?);
    let enaf = EnafConfig { horizon, ..config.enaf_for(Method::Enaf) };
    let trainer = match &saved {
        Some(saved) => Trainer::load(&enaf, saved).map_err(|error| journal.unusable(error))?,
        None => Trainer::new(&enaf, observation::LEN, &action::encode(&base, lpg), config.seed * 10 + lpg as u64)?,
    };
    let task = Task { lpg, base, reward: config.reward, horizon, episodes: config.episodes.into() };
    Ok((Learning { trainer, journal, lpg, base }, task))
}

/// Everything a session is run with.
struct Bench<'a> {
    robot: &'a Robot,
    link: &'a Link,
    geometry: Geometry,
    poses: Option<PoseSocket>,
    recorder: Recorder,
    words: Receiver<Option<Word>>,
    interrupted: Arc<AtomicBool>,
    progress: &'a Progress,
}

impl Bench<'_> {
    /// Runs one session; true if the operator ended it.
    fn session(
        &mut self,
        learning: Learning,
        task: Task,
        collector: &mut Option<Collector>,
        number: u8,
    ) -> Result<(Learning, bool), TrainError> {
        let next = learning.trainer.episodes();
        let collector = match collector {
            Some(collector) => {
                collector.switch(task, next);
                collector
            }
            None => {
                let mut first = Collector::new(task, next, PoseSource::new(Odometry::new(self.geometry)));
                if self.robot.arm {
                    first.allow(self.robot.consent);
                }
                collector.insert(first)
            }
        };
        let weights = Weights::default();
        let (seen, answers) = predict(Predictor::new(learning.trainer.actor(), weights.clone()));
        let learner = Learner::start(learning, weights);
        let mut learned = next;
        let mut spoilt = 0;
        let mut waiting = Waiting::default();
        let mut out = vec![];
        let mut ended = false;
        while learned < task.episodes && !ended {
            self.listen(collector, &mut out)?;
            collector.tick(self.link.now_us(), self.link.health().settled, &mut out);
            ended |= self.obey(collector, &mut out);
            for item in out.drain(..) {
                match item {
                    // A predictor that failed says so below.
                    Do::Send(message) => _ = seen.send(message),
                    Do::Ask(ask) => self.link.ask(ask),
                    Do::Say(text) => self.progress.print(&text),
                }
            }
            loop {
                match answers.try_recv() {
                    Ok(Ok(Answer::Act(act))) => {
                        if let Some(set) = collector.act(&act) {
                            self.link.ask(Ask::Params(set));
                        }
                    }
                    Ok(Ok(Answer::Played(played))) => {
                        let all = collector.counts().spoilt;
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
            if learner.failed() {
                break;
            }
            if let Some(what) = waiting.long(collector.waiting_for()) {
                self.progress.print(&format!("waiting for {what}"));
            }
        }
        Ok((learner.finish()?, ended))
    }

    /// What was heard, within [`LOOK`].
    fn listen(&mut self, collector: &mut Collector, out: &mut Vec<Do>) -> Result<(), TrainError> {
        let mut patience = LOOK;
        while let Some(heard) = self.link.next(patience) {
            patience = Duration::ZERO;
            if let What::News(News::Failed(error)) = &heard.what {
                return Err((*error).into());
            }
            collector.heard(&heard, out);
            let pose = matches!(heard.what, What::News(_)).then(|| collector.estimate());
            self.recorder.heard(heard, pose)?;
        }
        if let Some(poses) = &self.poses {
            let now_us = self.link.now_us();
            // A source that fails is one that is silent: odometry goes on.
            let _ = poses.receive(|datagram| collector.seen_from_outside(now_us, datagram, out));
        }
        Ok(())
    }

    /// What the operator typed; true if it is enough.
    fn obey(&mut self, collector: &mut Collector, out: &mut Vec<Do>) -> bool {
        let mut enough = self.interrupted.load(Ordering::Relaxed);
        while let Ok(word) = self.words.try_recv() {
            match word {
                Some(Word::Arm) => collector.allow(self.robot.consent),
                Some(Word::Stop) => collector.stop(out),
                Some(Word::Clear) => out.push(Do::Ask(Ask::ClearEStop)),
                Some(Word::Quit) => enough = true,
                None => out.push(Do::Say(console::HELP.into())),
            }
        }
        enough
    }

    /// Hands the robot its last set; whether it took it.
    fn leave(&mut self, set: &ParamSet) -> bool {
        self.link.ask(Ask::Params(*set));
        let end = Instant::now() + LAST_SET;
        while Instant::now() < end {
            _ = self.link.next(LOOK);
            if self.link.health().params == Some(*set) {
                return true;
            }
        }
        false
    }

    /// How the robot is left.
    fn farewell(&self) -> String {
        let health = self.link.health();
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
