//! One training session of one method and seed: episode by episode, with a checkpoint that a kill cannot spoil.

use std::path::PathBuf;

use sarah_protocol::params::{Lpg, ParamSet, SPECS};
use serde::{Deserialize, Serialize};

use super::TrainError;
use super::config::{Method, TrainConfig};
use crate::enaf::{EnafError, Policy, Trainer};
use crate::evaluate::{Controller, run_episode};
use crate::report::columns;
use crate::run::{MetricsCsv, read_text, write_atomic};
use crate::search::{CmaEs, RandomSearch, Search, run_constant};
use crate::task::action;
use crate::task::environment::{BrokenWorld, RobotEnvironment};
use crate::task::observation;
use crate::task::reward::RewardForm;
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::SilConfig;

/// Seeds of validation lie here, between those of training and of judging.
const VALIDATION_SEED: u64 = 1 << 59;

/// Version of the checkpoint's layout.
const CHECKPOINT_FORMAT: u32 = 1;

#[derive(Serialize, Deserialize)]
struct Checkpoint {
    format: u32,
    episodes: u32,
    metrics_bytes: u64,
    /// Episodes that the simulation spoilt.
    broken: u32,
    learner: Vec<u8>,
}

enum Learner {
    Enaf(Box<Trainer>),
    Search { search: Box<dyn Search + Send>, journal: Vec<f32> },
}

/// Where a session stands.
pub struct Session {
    method: Method,
    lpg: Lpg,
    base: ParamSet,
    seed: u64,
    scenario: Scenario,
    robot: SilConfig,
    reward: RewardForm,
    validation_episodes: u32,
    env: RobotEnvironment,
    learner: Learner,
    metrics: MetricsCsv,
    checkpoint: PathBuf,
    episodes: u32,
    broken: u32,
}

/// What a finished session leaves to the next.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The set to hardcode.
    pub constants: ParamSet,
    /// The agent, where there is one whose action depends on the state.
    pub policy: Option<Policy>,
    /// Episodes that the simulation spoilt.
    pub broken: u32,
}

/// Whether a session's constants are better than its start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Validation {
    /// Mean paired difference of the reward.
    mean: f32,
    /// Its standard error.
    standard_error: f32,
    /// Whether the constants go to the next session.
    handed_on: bool,
}

impl Validation {
    /// From at least two paired differences.
    fn of(differences: &[f32]) -> Validation {
        let n = differences.len() as f32;
        let mean = differences.iter().sum::<f32>() / n;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f32>() / (n - 1.0);
        let standard_error = (variance / n).sqrt();
        Validation { mean, standard_error, handed_on: mean > 0.0 }
    }
}

impl Session {
    /// Begins a session, or takes it up where its last checkpoint left it.
    pub fn open(
        config: &TrainConfig,
        method: Method,
        lpg: Lpg,
        base: ParamSet,
        seed: u64,
        folder: &std::path::Path,
    ) -> Result<Session, TrainError> {
        let scenario = config.train_scenario().map_err(super::ConfigError::from)?;
        let env = RobotEnvironment::new(config.robot.clone(), scenario.clone(), base, lpg, config.reward);
        // Sessions of one seed see different worlds, methods of one seed the same.
        let seed = seed * 10 + lpg as u64;
        let checkpoint = folder.join("checkpoint.bin");
        let saved = match std::fs::read(&checkpoint) {
            Ok(bytes) => Some(decode(&checkpoint, &bytes)?),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
            Err(error) => return Err(TrainError::Read { path: checkpoint, source: error }),
        };
        let start = action::encode(&base, lpg);
        let budget = config.episodes as usize;
        let learner = match method {
            Method::Enaf | Method::EnafPaper => {
                let enaf = crate::enaf::EnafConfig { horizon: env.horizon(), ..config.enaf_for(method) };
                Learner::Enaf(Box::new(match &saved {
                    Some(saved) => {
                        Trainer::load(&enaf, &saved.learner).map_err(|error| unusable(&checkpoint, error))?
                    }
                    None => Trainer::new(&enaf, observation::LEN, &start, seed)?,
                }))
            }
            Method::CmaEs | Method::Random => {
                let journal: Vec<f32> = match &saved {
                    Some(saved) => {
                        postcard::from_bytes(&saved.learner).map_err(|error| unusable(&checkpoint, error))?
                    }
                    None => vec![],
                };
                let search: Box<dyn Search + Send> = match method {
                    Method::Random => Box::new(RandomSearch::new(&start, budget, seed, journal.clone())),
                    _ => Box::new(CmaEs::new(&start, seed, journal.clone())),
                };
                Learner::Search { search, journal }
            }
        };
        let names = columns_of(lpg);
        let metrics = MetricsCsv::open(
            &folder.join("metrics.csv"),
            &names.iter().map(String::as_str).collect::<Vec<_>>(),
            saved.as_ref().map(|saved| saved.metrics_bytes),
        )?;
        let (episodes, broken) = saved.map_or((0, 0), |saved| (saved.episodes, saved.broken));
        let (robot, reward, validation_episodes) = (config.robot.clone(), config.reward, config.validation_episodes);
        Ok(Session {
            method,
            lpg,
            base,
            seed,
            scenario,
            robot,
            reward,
            validation_episodes,
            env,
            learner,
            metrics,
            checkpoint,
            episodes,
            broken,
        })
    }

    /// Episodes done.
    pub fn episodes(&self) -> u32 {
        self.episodes
    }

    /// One more episode; its mean reward.
    pub fn episode(&mut self) -> Result<f32, TrainError> {
        let reward = match &mut self.learner {
            Learner::Enaf(trainer) => enaf_episode(trainer, &mut self.env, &mut self.broken).map(|log| {
                let set = action::decode(&self.base, self.lpg, &log.mu_mean);
                let learning = [log.loss, log.grad_norm, log.value_mean, log.sigma].map(f64::from);
                let row = Row {
                    episode: self.episodes,
                    reward: log.reward_mean,
                    fell: log.fell,
                    noisy: log.noisy,
                    decisions: log.decisions,
                };
                (row, Some(learning), set)
            })?,
            Learner::Search { search, journal } => {
                let action = search.ask();
                let horizon = self.env.horizon();
                let done = search_episode(&mut self.env, &action, self.seed, self.episodes, horizon, &mut self.broken)?;
                search.tell(done.reward);
                journal.push(done.reward);
                let set = action::decode(&self.base, self.lpg, &action);
                let row = Row {
                    episode: self.episodes,
                    reward: done.reward,
                    fell: done.fell,
                    noisy: true,
                    decisions: done.decisions,
                };
                (row, None, set)
            }
        };
        let (row, learning, set) = reward;
        self.metrics.append(row.fields(learning, &set.values()[self.lpg.range()]))?;
        self.episodes += 1;
        Ok(row.reward)
    }

    /// Makes everything so far outlive a kill.
    pub fn save(&mut self) -> Result<(), TrainError> {
        self.metrics.sync()?;
        let learner = match &self.learner {
            Learner::Enaf(trainer) => trainer.save()?,
            Learner::Search { journal, .. } => postcard::to_stdvec(journal).map_err(EnafError::from)?,
        };
        let checkpoint = Checkpoint {
            format: CHECKPOINT_FORMAT,
            episodes: self.episodes,
            metrics_bytes: self.metrics.len_bytes(),
            broken: self.broken,
            learner,
        };
        let bytes = postcard::to_stdvec(&checkpoint).map_err(EnafError::from)?;
        Ok(write_atomic(&self.checkpoint, &bytes)?)
    }

    /// What the session has come to. Its validation is kept beside the checkpoint, so that a resumed run need not
    /// repeat it.
    ///
    /// Constants are handed on only if they beat the session's start on the mean of
    /// [`TrainConfig::validation_episodes`] common pushes, which no session trains on and nobody is judged on: a
    /// session that had nothing to gain must not pass its last noise on to the next. The paper's form is left as it is.
    pub fn trained(&self) -> Result<Trained, TrainError> {
        let mut trained = self.candidate();
        if self.method != Method::EnafPaper && trained.constants != self.base {
            let path = self.checkpoint.with_file_name("validation.json");
            let validation = if path.exists() {
                let stored = |why: String| TrainError::Stored { path: path.clone(), why };
                serde_json::from_str(&read_text(&path)?).map_err(|error| stored(error.to_string()))?
            } else {
                let validation = Validation::of(&self.differences(&trained.constants)?);
                let text = serde_json::to_string_pretty(&validation)
                    .map_err(|error| TrainError::Stored { path: path.clone(), why: error.to_string() })?;
                write_atomic(&path, text.as_bytes())?;
                validation
            };
            if !validation.handed_on {
                trained.constants = self.base;
            }
        }
        Ok(trained)
    }

    /// Rewards of `set` less those of the session's start, push by push.
    fn differences(&self, set: &ParamSet) -> Result<Vec<f32>, TrainError> {
        let reward = |set: &ParamSet, index: u64| {
            let episode = self.scenario.episode(VALIDATION_SEED + self.seed, index);
            let result = run_episode(&Controller::Constants(*set), &self.robot, &episode, None)?;
            Ok::<f32, TrainError>(match self.reward {
                RewardForm::Paper => result.reward_paper,
                RewardForm::Gated => result.reward_gated,
            })
        };
        (0..u64::from(self.validation_episodes))
            .map(|index| Ok(reward(set, index)? - reward(&self.base, index)?))
            .collect()
    }

    fn candidate(&self) -> Trained {
        let (constants, policy) = match &self.learner {
            Learner::Enaf(trainer) => {
                (trainer.mean_action(), (self.method == Method::EnafPaper).then(|| trainer.policy()))
            }
            Learner::Search { search, .. } => (search.recommend(), None),
        };
        Trained { constants: action::decode(&self.base, self.lpg, &constants), policy, broken: self.broken }
    }
}

/// An episode that the simulation spoils teaches nothing: the trainer is put back and goes on with the next world.
fn enaf_episode(
    trainer: &mut Trainer,
    env: &mut RobotEnvironment,
    broken: &mut u32,
) -> Result<crate::enaf::EpisodeLog, TrainError> {
    loop {
        let before = trainer.clone();
        match trainer.episode(env) {
            Err(EnafError::Environment(error)) if error.is::<BrokenWorld>() => {
                *trainer = before;
                trainer.skip_world();
                *broken += 1;
            }
            other => return Ok(other?),
        }
    }
}

fn search_episode(
    env: &mut RobotEnvironment,
    action: &[f32],
    seed: u64,
    episode: u32,
    horizon: usize,
    broken: &mut u32,
) -> Result<crate::search::ConstantEpisode, TrainError> {
    let mut attempt = 0u64;
    loop {
        let world = crate::enaf::trainer::episode_seed(seed, u64::from(episode) + (attempt << 32));
        match run_constant(env, action, world, horizon) {
            Err(error) if error.is::<BrokenWorld>() => {
                *broken += 1;
                attempt += 1;
            }
            other => return other.map_err(|error| EnafError::Environment(error).into()),
        }
    }
}

struct Row {
    episode: u32,
    reward: f32,
    fell: bool,
    noisy: bool,
    decisions: usize,
}

impl Row {
    fn fields(&self, learning: Option<[f64; 4]>, params: &[f32]) -> Vec<Option<f64>> {
        let mut fields = vec![
            Some(f64::from(self.episode)),
            Some(f64::from(self.episode + 1) * 30.0),
            Some(f64::from(self.reward)),
            Some(f64::from(u8::from(self.noisy))),
            Some(f64::from(u8::from(self.fell))),
            Some(self.decisions as f64),
        ];
        match learning {
            Some(learning) => fields.extend(learning.map(Some)),
            None => fields.extend([None; 4]),
        }
        fields.extend(params.iter().map(|value| Some(f64::from(*value))));
        fields
    }
}

fn columns_of(lpg: Lpg) -> Vec<String> {
    let fixed = [
        columns::EPISODE,
        columns::TIME_S,
        columns::REWARD,
        columns::NOISY,
        "fell",
        "decisions",
        "loss",
        "grad_norm",
        "value",
        "sigma",
    ];
    fixed.iter().copied().chain(SPECS[lpg.range()].iter().map(|spec| spec.symbol)).map(String::from).collect()
}

fn unusable(path: &std::path::Path, why: impl ToString) -> TrainError {
    TrainError::Learner { path: path.to_path_buf(), why: why.to_string() }
}

fn decode(path: &std::path::Path, bytes: &[u8]) -> Result<Checkpoint, TrainError> {
    let damaged = || TrainError::Checkpoint { path: path.to_path_buf(), expected: CHECKPOINT_FORMAT };
    let (format, _): (u32, _) = postcard::take_from_bytes(bytes).map_err(|_| damaged())?;
    if format != CHECKPOINT_FORMAT {
        return Err(damaged());
    }
    postcard::from_bytes(bytes).map_err(|_| damaged())
}
