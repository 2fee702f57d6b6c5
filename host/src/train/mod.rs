//! A training run from configuration to report.
//!
//! ```text
//!  every method × seed:  session 1 (knee) ─► session 2 (hip) ─► session 3 (abductor)      earlier ones frozen
//!  judged:               every session before and after, on pushes nobody trained on
//!  compared:             trained, default, braked, CMA-ES on push grids
//!  left in the folder:   config, metrics, checkpoints, params.toml, evaluation.json, figures, report.md
//! ```
//!
//! - [`config`]: what a run does. [`session`]: one session. [`journal`]: what it leaves on disk as it goes.
//! - [`outcome`]: judging and comparing.

pub mod config;
pub mod journal;
pub mod outcome;
pub mod session;
pub mod start;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use sarah_protocol::params::ParamSet;
use sarah_protocol::session::SessionError;
use thiserror::Error;

use crate::enaf::EnafError;
use crate::evaluate::{EvaluateError, parallel};
use crate::link::port::{PortError, Target};
use crate::link::sim::SimRobot;
use crate::live;
use crate::live::arming::Consent;
use crate::live::trainer::{Reached, Robot};
use crate::progress::Progress;
use crate::recording::RecordingError;
use crate::run::{RunError, RunFolder, RunInfo, event_file, read_metrics};
use crate::search::SearchError;
use crate::task::action::Scope;

pub use config::{ConfigError, Method, TrainConfig};
use session::{Session, Trained};

/// Why a run stopped.
#[derive(Debug, Error)]
pub enum TrainError {
    /// What was asked for.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The agent.
    #[error(transparent)]
    Enaf(#[from] EnafError),
    /// The run folder.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Judging.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// A checkpoint of another program.
    #[error(
        "{path} is damaged or not a checkpoint of format {expected}: resume with the version that wrote it, or start a new run"
    )]
    Checkpoint {
        /// Which.
        path: PathBuf,
        /// The format read here.
        expected: u32,
    },
    /// A checkpoint whose learner does not load.
    #[error(
        "{path} cannot be resumed ({why}): resume with the version and configuration that wrote it, or start a new run"
    )]
    Learner {
        /// Which.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// A file that is there but cannot be read.
    #[error("cannot read {path}: {source}; check its permissions")]
    Read {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Stored results that do not decode.
    #[error("{path} is damaged ({why}): delete it and resume, and it is made again")]
    Stored {
        /// Which.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// The robot's port.
    #[error(transparent)]
    Port(#[from] PortError),
    /// Nobody says hello.
    #[error("no answer on {0}: is the coordinator powered, and flashed with this version? `cargo sarah flash` does it")]
    NoAnswer(String),
    /// Poses from outside.
    #[error("cannot listen for poses at {address}: {source}; give --pose ADDRESS:PORT of this machine that is free")]
    Poses {
        /// Where.
        address: String,
        /// Why not.
        source: std::io::Error,
    },
    /// The robot's firmware.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A search of somebody else's.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// A figure.
    #[error("{0}")]
    Figure(String),
    /// Another part of the run failed; its error is the one to tell.
    #[error("stopped because another part of the run failed")]
    Stopped,
}

/// One method with one seed through all three sessions.
#[derive(Clone, Debug)]
pub struct Chain {
    /// The method.
    pub method: Method,
    /// The seed.
    pub seed: u64,
    /// After each session.
    pub sessions: Vec<Trained>,
    /// What the first of them began with.
    pub start: ParamSet,
}

impl Chain {
    /// The set that session `index` began with.
    pub fn base(&self, index: usize) -> ParamSet {
        match index.checked_sub(1) {
            Some(before) => self.sessions[before].constants,
            None => self.start,
        }
    }
}

/// What only a run on a robot needs: whether motion is allowed from the beginning, and another port to resume on.
#[derive(Clone, Debug, Default)]
pub struct Operator {
    /// Arm when the robot stands, and again after every fall.
    pub arm: bool,
    /// Instead of the run's own port.
    pub link: Option<Target>,
    /// Where poses from outside arrive.
    pub pose: Option<String>,
}

impl Operator {
    /// The robot of a run, reached; `None` in simulation, where an operator has nothing to say.
    fn robot(&self, config: &TrainConfig) -> Result<Option<Reached>, TrainError> {
        let Some(port) = &config.link else {
            return match self.arm || self.link.is_some() || self.pose.is_some() {
                true => Err(ConfigError::Simulated.into()),
                false => Ok(None),
            };
        };
        let target = self.link.as_ref().unwrap_or(port).clone();
        let consent = if self.arm { Consent::AfterFalls } else { Consent::Once };
        live::trainer::reach(Robot { target, consent, arm: self.arm, pose: self.pose.clone() }).map(Some)
    }
}

/// A new run.
pub fn train(config: &TrainConfig, out: &Path, operator: &Operator) -> Result<PathBuf, TrainError> {
    config.validate()?;
    let config = &config.resolved()?;
    // A robot that cannot be built or reached is refused before anything is written.
    let robot = operator.robot(config)?;
    if robot.is_none() {
        let episode = config.train_scenario().map_err(ConfigError::from)?.episode(config.seed, 0);
        for robot in config.robots().and_then(|robots| robots.extremes()).map_err(ConfigError::from)? {
            SimRobot::start(&robot, &episode).map_err(EvaluateError::from)?;
        }
    }
    let seeds = (config.seed..config.seed + config.seeds).collect();
    let info = RunInfo::collect(seeds, Path::new(env!("CARGO_MANIFEST_DIR")));
    let folder = RunFolder::create(out, &config.to_toml()?, &info)?;
    run(config, robot, &folder, &info)
}

/// Goes on with a run that was cut off; ends as it would have without the cut.
pub fn resume(out: &Path, operator: &Operator) -> Result<PathBuf, TrainError> {
    let (folder, info) = RunFolder::resume(out)?;
    let path = folder.layout().config();
    let config = TrainConfig::parse(&path.display().to_string(), &crate::run::read_text(&path)?)?;
    run(&config, operator.robot(&config)?, &folder, &info)
}

fn run(
    config: &TrainConfig,
    robot: Option<Reached>,
    folder: &RunFolder,
    info: &RunInfo,
) -> Result<PathBuf, TrainError> {
    if let Some(robot) = robot {
        return live::trainer::train(config, robot, folder, info);
    }
    let chains = (config.seeds * config.methods.len() as u64) as usize;
    let training = chains as u64 * 3 * u64::from(config.episodes);
    let progress = Progress::new(training + outcome::episodes(config));
    let result = run_with(config, folder, info, &progress);
    progress.finish();
    result
}

fn run_with(
    config: &TrainConfig,
    folder: &RunFolder,
    info: &RunInfo,
    progress: &Progress,
) -> Result<PathBuf, TrainError> {
    progress.phase(&format!("training in {}", folder.layout().root().display()));
    let jobs: Vec<(Method, u64)> = (config.seed..config.seed + config.seeds)
        .flat_map(|seed| config.methods.iter().map(move |method| (*method, seed)))
        .collect();
    let failed = AtomicBool::new(false);
    let results = parallel(jobs.len(), |job| {
        let (method, seed) = jobs[job];
        chain(config, folder, method, seed, progress, &failed).inspect_err(|_| failed.store(true, Ordering::Relaxed))
    });
    let chains = all_or_cause(results)?;
    let report = outcome::judge(config, folder, info, &chains, progress)?;
    progress.phase("writing the report");
    outcome::write_report(folder.layout(), &report)?;
    let root = folder.layout().root().to_path_buf();
    progress.finish();
    for evaluation in &report.evaluations {
        println!("\n{}", crate::report::headline(evaluation));
    }
    println!("report: {}", folder.layout().report().display());
    println!("parameters: {}", folder.layout().params().display());
    Ok(root)
}

/// All chains, or the error that stopped the run rather than those of the chains that it stopped.
fn all_or_cause(results: Vec<Result<Chain, TrainError>>) -> Result<Vec<Chain>, TrainError> {
    let mut chains = vec![];
    let mut stopped = None;
    for result in results {
        match result {
            Ok(chain) => chains.push(chain),
            Err(TrainError::Stopped) => stopped = Some(TrainError::Stopped),
            Err(cause) => return Err(cause),
        }
    }
    stopped.map_or(Ok(chains), Err)
}

fn chain(
    config: &TrainConfig,
    folder: &RunFolder,
    method: Method,
    seed: u64,
    progress: &Progress,
    failed: &AtomicBool,
) -> Result<Chain, TrainError> {
    let mut chain = Chain { method, seed, sessions: vec![], start: config.start_set()? };
    for (index, scope) in Scope::SESSIONS.into_iter().enumerate() {
        let number = index as u8 + 1;
        let place = folder.session(method.folder(), seed, number)?;
        let mut session = Session::open(config, method, scope, chain.base(index), seed, &place)?;
        progress.skip(session.episodes().min(config.episodes).into());
        let mut recent = vec![];
        session.run(config, |reward| {
            recent.push(reward);
            let tail = &recent[recent.len().saturating_sub(10)..];
            let mean = tail.iter().sum::<f32>() / tail.len() as f32;
            progress.episode(Some(format!("{} seed {seed} session {number}: reward {mean:.2}", method.name())));
            if failed.load(Ordering::Relaxed) { Err(TrainError::Stopped) } else { Ok(()) }
        })?;
        let metrics = read_metrics(&folder.layout().metrics(method.folder(), seed, number))?;
        let events = event_file(&metrics, crate::report::columns::EPISODE, crate::report::columns::TIME_S);
        folder.write_tensorboard(method.folder(), seed, number, &events)?;
        let trained = session.trained()?;
        if trained.broken > 0 {
            progress.print(&format!(
                "{} seed {seed} session {number}: the simulation failed in {} episodes; they were repeated in other worlds",
                method.name(),
                trained.broken
            ));
        }
        chain.sessions.push(trained);
    }
    Ok(chain)
}
