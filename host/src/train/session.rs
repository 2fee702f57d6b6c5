//! One training session of one method and seed, episode by episode.

use sarah_protocol::params::ParamSet;
use serde::{Deserialize, Serialize};

use super::TrainError;
use super::config::{Method, TrainConfig};
use super::journal::{Journal, Row};
use crate::enaf::trainer::episode_seed;
use crate::enaf::{EnafError, Environment, Policy, Trainer};
use crate::evaluate::{Controller, Watch, run_episode};
use crate::run::{read_text, write_atomic};
use crate::search::{CmaEs, ExternalSearch, RandomSearch, Search, run_constant};
use crate::task::action::{self, Scope};
use crate::task::environment::{BrokenWorld, RobotEnvironment};
use crate::task::observation;
use crate::task::reward::RewardForm;
use crate::task::robots::Robots;
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::SilConfig;

/// Seeds of validation lie here, between those of training and of judging.
const VALIDATION_SEED: u64 = 1 << 59;

enum Learner {
    Enaf(Box<Trainer>),
    Search { search: Box<dyn Search + Send>, told: Vec<f32> },
}

/// Where a session stands.
pub struct Session {
    method: Method,
    scope: Scope,
    base: ParamSet,
    seed: u64,
    scenario: Scenario,
    robots: Robots,
    nominal_episodes: u32,
    reward: RewardForm,
    validation_episodes: u32,
    env: RobotEnvironment,
    learner: Learner,
    journal: Journal,
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

impl Trained {
    /// What balances after the session: the agent, if its action depends on the state, else the constants.
    pub fn controller(&self, base: ParamSet, scope: Scope) -> Controller {
        match &self.policy {
            Some(policy) => Controller::Policy { policy: Box::new(policy.clone()), base, scope },
            None => Controller::Constants(self.constants),
        }
    }
}

/// Whether a session's constants are better than its start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Validation {
    /// Mean paired difference of the reward; absent if the simulation left fewer than two.
    mean: Option<f32>,
    /// Its standard error.
    standard_error: Option<f32>,
    /// Whether the constants go to the next session.
    handed_on: bool,
}

impl Validation {
    /// From paired differences. Fewer than two tell nothing, and nothing is handed on.
    fn of(differences: &[f32]) -> Validation {
        if differences.len() < 2 {
            return Validation { mean: None, standard_error: None, handed_on: false };
        }
        let n = differences.len() as f32;
        let mean = differences.iter().sum::<f32>() / n;
        let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f32>() / (n - 1.0);
        let standard_error = (variance / n).sqrt();
        Validation { mean: Some(mean), standard_error: Some(standard_error), handed_on: mean > 0.0 }
    }
}

impl Session {
    /// Begins a session, or takes it up where its last checkpoint left it.
    pub fn open(
        config: &TrainConfig,
        method: Method,
        scope: Scope,
        base: ParamSet,
        seed: u64,
        folder: &std::path::Path,
    ) -> Result<Session, TrainError> {
        let scenario = config.train_scenario().map_err(super::ConfigError::from)?;
        let robots = config.robots().map_err(super::ConfigError::from)?;
        let env = RobotEnvironment::new(robots.clone(), scenario.clone(), base, scope, config.reward);
        // Sessions of one seed see different worlds, methods of one seed the same.
        let seed = seed * 10 + scope as u64;
        let (journal, saved) = Journal::open(scope, folder)?;
        let start = action::encode(&base, scope);
        let budget = config.episodes as usize;
        let learner = match method {
            Method::Enaf | Method::EnafPaper => {
                let enaf = crate::enaf::EnafConfig { horizon: env.horizon(), ..config.enaf_for(method) };
                Learner::Enaf(Box::new(match &saved {
                    Some(saved) => Trainer::load(&enaf, saved).map_err(|error| journal.unusable(error))?,
                    None => Trainer::new(&enaf, observation::LEN, &start, seed)?,
                }))
            }
            Method::CmaEs | Method::Random | Method::External => {
                let told: Vec<f32> = match &saved {
                    Some(saved) => postcard::from_bytes(saved).map_err(|error| journal.unusable(error))?,
                    None => vec![],
                };
                let search: Box<dyn Search + Send> = match method {
                    Method::Random => Box::new(RandomSearch::new(&start, budget, seed, told.clone())),
                    Method::External => Box::new(ExternalSearch::new(&config.external, &start, budget, seed, &told)?),
                    _ => Box::new(CmaEs::new(&start, config.cma_sigma, seed, told.clone())),
                };
                Learner::Search { search, told }
            }
        };
        Ok(Session {
            method,
            scope,
            base,
            seed,
            scenario,
            robots,
            nominal_episodes: config.nominal_episodes,
            reward: config.reward,
            validation_episodes: config.validation_episodes,
            env,
            learner,
            journal,
        })
    }

    /// Episodes done.
    pub fn episodes(&self) -> u32 {
        self.journal.episodes()
    }

    /// One more episode; its mean reward.
    pub fn episode(&mut self) -> Result<f32, TrainError> {
        let mut broken = 0;
        self.env.inhabit(match self.journal.episodes() < self.nominal_episodes {
            true => Robots::alike(SilConfig::default()),
            false => self.robots.clone(),
        });
        let (row, set) = match &mut self.learner {
            Learner::Enaf(trainer) => {
                let log = enaf_episode(trainer, &mut self.env, &mut broken)?;
                (Row::from(&log), action::decode(&self.base, self.scope, &log.mu_mean))
            }
            Learner::Search { search, told } => {
                let action = search.ask()?;
                let (horizon, episode) = (self.env.horizon(), self.journal.episodes());
                let done = search_episode(&mut self.env, &action, self.seed, episode, horizon, &mut broken)?;
                search.tell(done.reward)?;
                told.push(done.reward);
                let (reward, fell, decisions) = (done.reward, done.fell, done.decisions);
                let row = Row { reward, fell, noisy: true, decisions, learning: None };
                (row, action::decode(&self.base, self.scope, &action))
            }
        };
        self.journal.spoilt(broken);
        self.journal.append(&row, &set)?;
        Ok(row.reward)
    }

    /// Trains to the end of the session's budget with a checkpoint now and then; `each` hears every episode's reward and
    /// may stop it.
    pub fn run<E: From<TrainError>>(
        &mut self,
        config: &TrainConfig,
        mut each: impl FnMut(f32) -> Result<(), E>,
    ) -> Result<(), E> {
        while self.episodes() < config.episodes {
            let reward = self.episode()?;
            let done = self.episodes();
            if done.is_multiple_of(config.checkpoint_every) || done == config.episodes {
                self.save()?;
            }
            each(reward)?;
        }
        Ok(())
    }

    /// Makes everything so far outlive a kill.
    pub fn save(&mut self) -> Result<(), TrainError> {
        let learner = match &self.learner {
            Learner::Enaf(trainer) => trainer.save()?,
            Learner::Search { told, .. } => postcard::to_stdvec(told).map_err(EnafError::from)?,
        };
        self.journal.save(learner)
    }

    /// What the session has come to. Its validation is kept beside the checkpoint, so that a resumed run need not
    /// repeat it.
    ///
    /// Constants are handed on only if they beat the session's start on the mean of
    /// [`TrainConfig::validation_episodes`] common pushes, which no session trains on and nobody is judged on: a
    /// session that had nothing to gain must not pass its last noise on to the next. The paper's form is left as it is.
    /// An agent whose action depends on the state is judged as it is, whatever becomes of its constants.
    pub fn trained(&mut self) -> Result<Trained, TrainError> {
        let mut trained = self.candidate()?;
        if self.method != Method::EnafPaper && trained.constants != self.base {
            let path = self.journal.beside("validation.json");
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

    /// Rewards of `set` less those of the session's start, push by push, but for pushes on which the simulation failed.
    fn differences(&self, set: &ParamSet) -> Result<Vec<f32>, TrainError> {
        let reward = |set: &ParamSet, index: u64| {
            let episode = self.scenario.episode(VALIDATION_SEED + self.seed, index);
            let robot =
                self.robots.of(episode_seed(VALIDATION_SEED + self.seed, index)).map_err(super::ConfigError::from)?;
            let result = run_episode(&Controller::Constants(*set), &robot, &episode, Watch::Nothing)?;
            Ok::<_, TrainError>(result.outcome.is_valid().then(|| result.reward(self.reward)))
        };
        let pairs = (0..u64::from(self.validation_episodes)).map(|index| {
            let (set, start) = (reward(set, index)?, reward(&self.base, index)?);
            Ok(set.zip(start).map(|(set, start)| set - start))
        });
        pairs.filter_map(Result::transpose).collect()
    }

    fn candidate(&mut self) -> Result<Trained, TrainError> {
        let (constants, policy) = match &mut self.learner {
            Learner::Enaf(trainer) => (trainer.mean_action(), trainer.modulates().then(|| trainer.policy())),
            Learner::Search { search, .. } => (search.recommend()?, None),
        };
        let constants = action::decode(&self.base, self.scope, &constants);
        Ok(Trained { constants, policy, broken: self.journal.broken() })
    }

    /// The set that `policy` chooses on average in the validation episodes: what its dependence on the state has to beat.
    pub fn habit(&mut self, policy: &Policy) -> Result<ParamSet, TrainError> {
        let mut policy = policy.clone();
        let mut sum = vec![0.0; self.scope.range().len()];
        let mut decisions = 0.0;
        for index in 0..u64::from(self.validation_episodes) {
            let mut play = || -> Result<(), EnafError> {
                policy.reset();
                let world = episode_seed(VALIDATION_SEED + self.seed, index);
                let mut observation = self.env.reset(world).map_err(EnafError::Environment)?;
                for _ in 0..self.env.horizon() {
                    let action = policy.act(&observation)?;
                    sum.iter_mut().zip(&action).for_each(|(sum, action)| *sum += action);
                    decisions += 1.0;
                    let outcome = self.env.decide(&action).map_err(EnafError::Environment)?;
                    if outcome.end.is_some() {
                        break;
                    }
                    observation = outcome.observation;
                }
                Ok(())
            };
            match play() {
                Err(EnafError::Environment(error)) if error.is::<BrokenWorld>() => {}
                other => other?,
            }
        }
        let mean: Vec<f32> = sum.iter().map(|sum| sum / f32::max(decisions, 1.0)).collect();
        Ok(action::decode(&self.base, self.scope, &mean))
    }
}

/// Worlds in a row that may be spoilt: a robot that never gets to stand must not be tried for ever.
const SPOILT_AT_MOST: u64 = 50;

/// An episode that the simulation spoils teaches nothing: the trainer is put back and goes on with the next world.
fn enaf_episode(
    trainer: &mut Trainer,
    env: &mut RobotEnvironment,
    broken: &mut u32,
) -> Result<crate::enaf::EpisodeLog, TrainError> {
    let mut spoilt = 0;
    loop {
        let before = trainer.clone();
        match trainer.episode(env) {
            Err(EnafError::Environment(error)) if error.is::<BrokenWorld>() && spoilt < SPOILT_AT_MOST => {
                *trainer = before;
                trainer.skip_world();
                *broken += 1;
                spoilt += 1;
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
        let world = episode_seed(seed, u64::from(episode) + (attempt << 32));
        match run_constant(env, action, world, horizon) {
            Err(error) if error.is::<BrokenWorld>() && attempt < SPOILT_AT_MOST => {
                *broken += 1;
                attempt += 1;
            }
            other => return other.map_err(|error| EnafError::Environment(error).into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_validation_that_the_simulation_spoilt_hands_nothing_on_and_can_be_read_again() {
        for (differences, handed_on) in
            [(&[][..], false), (&[0.5], false), (&[0.25, 0.5], true), (&[-0.5, 0.25], false)]
        {
            let validation = Validation::of(differences);
            assert_eq!(validation.handed_on, handed_on);
            let text = serde_json::to_string(&validation).unwrap();
            assert_eq!(serde_json::from_str::<Validation>(&text).unwrap(), validation);
        }
    }

    #[test]
    fn the_robot_becomes_another_one_after_its_nominal_episodes_however_often_the_session_is_opened() {
        let mut config = TrainConfig { nominal_episodes: 2, episodes: 3, ..TrainConfig::default() };
        config.robot.robot.com_shift_m = [-0.3, 0.0, 0.0];
        let folder = tempfile::tempdir().unwrap();
        for episode in 0..3 {
            let start = config.start_set().unwrap();
            let mut session =
                Session::open(&config, Method::Random, Scope::SESSIONS[0], start, 1, folder.path()).unwrap();
            assert_eq!(session.episodes(), episode);
            let done = session.episode();
            assert_eq!(done.is_ok(), episode < 2, "{done:?}");
            session.save().unwrap();
        }
    }

    #[test]
    fn a_robot_that_never_gets_to_stand_is_an_error_and_not_tried_for_ever() {
        let mut config = TrainConfig::default();
        config.robot.robot.slope_pitch_rad = -0.3;
        config.robot.robot.com_shift_m = [-0.15, 0.0, 0.0];
        for method in [Method::Random, Method::Enaf] {
            let folder = tempfile::tempdir().unwrap();
            let start = config.start_set().unwrap();
            let mut session = Session::open(&config, method, Scope::SESSIONS[0], start, 1, folder.path()).unwrap();
            let error = session.run(&config, |_| Ok::<(), TrainError>(())).unwrap_err();
            assert!(error.to_string().contains("able to stand"), "{error}");
        }
    }
}
