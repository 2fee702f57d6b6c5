//! The loop of one session: act an episode, store it, learn from the store.

use std::collections::VecDeque;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use super::actor::{Actor, Played, gate};
use super::agent::with_constants;
use super::learner::{Learner, Step};
use super::model::{Network, Shape};
use super::noise::Noise;
use super::replay::Replay;
use super::{EnafConfig, EnafError, End, Environment, Form, Policy};

/// What one episode did and taught.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeLog {
    /// Number of the episode, from 0.
    pub episode: u64,
    /// The seed its world was started with.
    pub seed: u64,
    /// Decisions made.
    pub decisions: usize,
    /// Sum of the rewards.
    pub return_sum: f32,
    /// `return_sum / horizon`: an early fall loses what it could still have earned.
    pub reward_mean: f32,
    /// Ended by a fall.
    pub fell: bool,
    /// Explored (the coin).
    pub noisy: bool,
    /// Width of the OU process, action units.
    pub sigma: f32,
    /// Mean over the decisions of μ (before the noise), `[A]`.
    pub mu_mean: Vec<f32>,
    /// Mean of V over the decisions, as predicted while acting.
    pub value_mean: f32,
    /// Mean `reward_mean` of the latest noise-free episodes; `None` before the first.
    pub noise_free_mean: Option<f32>,
    /// Mean Huber loss over this episode's gradient steps; 0 without any.
    pub loss: f32,
    /// Mean gradient norm before the clip; 0 without any.
    pub grad_norm: f32,
    /// Gradient steps so far, over all episodes.
    pub updates: u64,
    /// Whether the state-dependent part is let in (constants-first).
    pub gate: bool,
}

impl EpisodeLog {
    /// Takes one of `due` gradient steps into the means.
    pub fn learned(&mut self, step: &Step, due: usize) {
        self.loss += step.loss / due as f32;
        self.grad_norm += step.grad_norm / due as f32;
        self.updates += 1;
    }
}

/// A noise-free episode, as far as it matters for choosing the parameters to keep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct NoiseFree {
    reward_mean: f32,
    mu_mean: Vec<f32>,
}

/// One training session.
///
/// Equal configuration, seed and world give equal bits, and so does a session that was saved and loaded in between.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trainer {
    pub(crate) config: EnafConfig,
    seed: u64,
    initial_action: Vec<f32>,
    learner: Learner,
    noise: Noise,
    replay: Replay,
    episode: u64,
    /// Worlds of the next episode skipped because their simulation failed.
    spoilt: u64,
    /// Gradient steps put off by the warm-up.
    owed_updates: usize,
    /// The latest noise-free episodes, oldest first.
    noise_free: VecDeque<NoiseFree>,
}

impl Trainer {
    /// A new session. μ starts at `initial_action` `[A]`, each number in [-1, 1].
    ///
    /// # Errors
    /// [`EnafError::Config`] for a configuration or an initial action that cannot train.
    pub fn new(
        config: &EnafConfig,
        observation_len: usize,
        initial_action: &[f32],
        seed: u64,
    ) -> Result<Self, EnafError> {
        config.validate()?;
        if initial_action.is_empty() || !initial_action.iter().all(|u| (-1.0..=1.0).contains(u)) {
            return Err(EnafError::Config { field: "initial_action", rule: "one or more numbers in [-1, 1]" });
        }
        let shape = Shape::new(config, observation_len, initial_action.len());
        // One generator per purpose: drawing more of one kind of randomness never shifts another kind.
        let mut root = Pcg64Mcg::seed_from_u64(seed);
        let mut weights_rng = Pcg64Mcg::seed_from_u64(root.random());
        let noise_rng = Pcg64Mcg::seed_from_u64(root.random());
        let replay_rng = Pcg64Mcg::seed_from_u64(root.random());
        let nets = if config.twin { 2 } else { 1 };
        let weights = (0..nets).map(|_| shape.initial_weights(initial_action, &mut weights_rng)).collect();
        Ok(Self {
            config: config.resolved(),
            seed,
            initial_action: initial_action.to_vec(),
            learner: Learner::new(shape, weights),
            noise: Noise::new(config, initial_action.len(), noise_rng),
            replay: Replay::new(config.replay_episodes, replay_rng),
            episode: 0,
            spoilt: 0,
            owed_updates: 0,
            noise_free: VecDeque::new(),
        })
    }

    /// Acts one episode with its exploration, stores it, and learns.
    ///
    /// # Errors
    /// What the world reports, and numbers that are not finite, by name. After an error the session should be taken up
    /// from its last checkpoint.
    pub fn episode(&mut self, env: &mut dyn Environment) -> Result<EpisodeLog, EnafError> {
        let mut actor = self.actor();
        actor.begin();
        let mut observation = env.reset(self.world()).map_err(EnafError::Environment)?;
        let mut fell = false;
        for _ in 0..self.config.horizon {
            let action = actor.decide(&observation)?;
            let outcome = env.decide(&action).map_err(EnafError::Environment)?;
            actor.earned(outcome.reward)?;
            observation = outcome.observation;
            if let Some(end) = outcome.end {
                fell = end == End::Fall;
                break;
            }
        }
        let played = actor.end(&observation, fell)?;
        let mut log = self.store(played);
        let due = self.due();
        while let Some(step) = self.update()? {
            log.learned(&step, due);
        }
        Ok(log)
    }

    /// An actor for the next episode and those after it, with what has been learned so far.
    #[must_use]
    pub fn actor(&self) -> Actor {
        let (shape, weights) = (self.learner.shape(), self.learner.weights());
        Actor::new(&self.config, shape, weights, &self.initial_action, self.noise.clone(), self.episode)
    }

    /// The weights as learned so far, for an actor.
    #[must_use]
    pub fn weights(&self) -> &[f32] {
        self.learner.weights()
    }

    /// The seed of the next episode's world.
    fn world(&self) -> u64 {
        episode_seed(self.seed, self.episode + (self.spoilt << 32))
    }

    /// Stores an episode that was acted. What is to be learned from it is done by [`Trainer::update`].
    pub fn store(&mut self, played: Played) -> EpisodeLog {
        let Played { number, episode, noise, mu_mean, value_mean } = played;
        let seed = self.world();
        self.spoilt = 0;
        self.noise = noise;
        let decisions = episode.rewards.len();
        let return_sum = episode.rewards.iter().sum::<f32>();
        let reward_mean = return_sum / self.config.horizon as f32;
        // Without a coin no episode is free of noise; μ is noted before the noise is added.
        if !self.noise.noisy() || self.config.noise.coin >= 1.0 {
            if self.noise_free.len() == self.config.average_episodes {
                self.noise_free.pop_front();
            }
            self.noise_free.push_back(NoiseFree { reward_mean, mu_mean: mu_mean.clone() });
        }
        let fell = episode.fell;
        self.replay.push(episode);
        self.owed_updates += self.config.depth * decisions;
        self.episode = number + 1;
        EpisodeLog {
            episode: number,
            seed,
            decisions,
            return_sum,
            reward_mean,
            fell,
            noisy: self.noise.noisy(),
            sigma: self.noise.width(),
            mu_mean,
            value_mean,
            noise_free_mean: self.noise_free_mean(),
            loss: 0.0,
            grad_norm: 0.0,
            updates: self.learner.updates(),
            gate: gate(self.config.residual_after, number),
        }
    }

    /// Gradient steps that [`Trainer::update`] would do now.
    #[must_use]
    pub fn due(&self) -> usize {
        match self.episode < self.config.warm_up_episodes() as u64 {
            true => 0,
            false => self.owed_updates,
        }
    }

    /// One gradient step of those the stored episodes are worth ([`EnafConfig::depth`] per decision); `None` when all
    /// are done, or while warming up.
    ///
    /// # Errors
    /// Numbers that are not finite, by name.
    pub fn update(&mut self) -> Result<Option<Step>, EnafError> {
        if self.due() == 0 {
            return Ok(None);
        }
        let shape = self.learner.shape();
        let (input, action) = (shape.input(), shape.action);
        let count = self.config.batch_episodes;
        let batch = match self.config.piece {
            Some(length) => self.replay.draw_pieces(count, length, input, action),
            None => self.replay.draw(count, self.config.unroll, input, action),
        };
        let Some(batch) = batch else { return Ok(None) };
        // The gate is that of the episode stored last.
        let gate = gate(self.config.residual_after, self.episode.saturating_sub(1));
        let step = self.learner.step(&batch, &self.config, gate)?;
        self.owed_updates -= 1;
        Ok(Some(step))
    }

    /// Whether the state-dependent part of μ is let in.
    fn gate(&self) -> bool {
        gate(self.config.residual_after, self.episode)
    }

    /// Whether its action depends on the state by now.
    #[must_use]
    pub fn modulates(&self) -> bool {
        self.config.form == Form::Paper || self.gate()
    }

    fn noise_free_mean(&self) -> Option<f32> {
        let n = self.noise_free.len();
        (n > 0).then(|| self.noise_free.iter().map(|e| e.reward_mean).sum::<f32>() / n as f32)
    }

    /// Goes on in other worlds than the ones to come: for a caller whose simulation of the next one failed.
    pub fn skip_world(&mut self) {
        self.spoilt += 1;
    }

    /// Episodes acted so far.
    #[must_use]
    pub fn episodes(&self) -> u64 {
        self.episode
    }

    /// The configuration, every default written out.
    #[must_use]
    pub fn config(&self) -> &EnafConfig {
        &self.config
    }

    /// The action `[A]` to hardcode: the mean of μ over the latest [`EnafConfig::average_episodes`] noise-free
    /// episodes (the initial action before the first).
    ///
    /// One episode's reward says little: pushes differ, and the best of many noisy rewards is mostly the luckiest.
    /// Learned constants wander around the optimum with each gradient step, and the mean of their path over its tail is
    /// closer to it than any one point (Polyak & Ruppert averaging), so nothing is picked by reward here.
    #[must_use]
    pub fn mean_action(&self) -> Vec<f32> {
        let n = self.noise_free.len();
        if n == 0 {
            return self.initial_action.clone();
        }
        let mean = |i| self.noise_free.iter().map(|e| e.mu_mean[i]).sum::<f32>() / n as f32;
        (0..self.initial_action.len()).map(mean).collect()
    }

    /// A frozen, noise-free copy of what has been learned. While the action is a constant it is [`Self::mean_action`];
    /// otherwise the network as it is now.
    #[must_use]
    pub fn policy(&self) -> Policy {
        let (shape, weights) = (self.learner.shape(), self.learner.weights());
        let network = match self.config.form {
            Form::ConstantsFirst if !self.gate() => {
                Network::new(shape, &with_constants(shape, weights, &self.mean_action()), false)
            }
            _ => Network::new(shape, weights, self.gate()),
        };
        Policy::new(network, &self.initial_action)
    }
}

/// The seed of an episode: a function of the session's seed and the episode's number only, so that sessions that differ
/// in anything but the seed meet the same worlds (SplitMix64, Steele et al. 2014).
pub(crate) fn episode_seed(seed: u64, episode: u64) -> u64 {
    let mut z = seed.wrapping_add((episode + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
