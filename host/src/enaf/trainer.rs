//! The loop of one session: act an episode, store it, learn from the store.

use std::collections::VecDeque;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use super::agent::{Agent, check, with_constants};
use super::learner::Learner;
use super::model::{Network, Shape};
use super::noise::Noise;
use super::replay::{Episode, Replay};
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
    /// Worlds skipped because their simulation failed.
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
        let mut log = self.act(env)?;
        self.learn(&mut log)?;
        self.episode += 1;
        Ok(log)
    }

    fn act(&mut self, env: &mut dyn Environment) -> Result<EpisodeLog, EnafError> {
        let number = self.episode;
        let finite = |quantity, decision, values: &[f32]| match values.iter().all(|x| x.is_finite()) {
            true => Ok(()),
            false => Err(EnafError::WorldNotFinite { episode: number, decision, quantity }),
        };
        let shape = self.learner.shape();
        let mut agent = Agent::new(Network::new(shape, self.learner.weights(), self.gate()));
        self.noise.begin(number);

        let seed = episode_seed(self.seed, number + (self.spoilt << 32));
        let mut observation = env.reset(seed).map_err(EnafError::Environment)?;
        let mut previous = self.initial_action.clone();
        let mut episode = Episode::default();
        let mut mu_mean = vec![0.0; previous.len()];
        let mut value_mean = 0.0;
        for decision in 0..self.config.horizon {
            check("observation", shape.observation, &observation)?;
            finite("observation", decision, &observation)?;
            episode.inputs.extend(shape.see(&observation, &previous));
            let decided = agent.act(&observation, &previous)?;
            let noise = self.noise.draw();
            let action: Vec<f32> = decided.mu.iter().zip(&noise).map(|(mu, n)| (mu + n).clamp(-1.0, 1.0)).collect();
            let outcome = env.decide(&action).map_err(EnafError::Environment)?;
            finite("reward", decision, &[outcome.reward])?;

            episode.actions.extend(&action);
            episode.rewards.push(outcome.reward);
            value_mean += decided.value;
            mu_mean.iter_mut().zip(&decided.mu).for_each(|(sum, mu)| *sum += mu);
            previous = action;
            observation = outcome.observation;
            if let Some(end) = outcome.end {
                episode.fell = end == End::Fall;
                break;
            }
        }
        let decisions = episode.rewards.len();
        check("observation", shape.observation, &observation)?;
        finite("observation", decisions, &observation)?;
        episode.inputs.extend(shape.see(&observation, &previous));
        mu_mean.iter_mut().for_each(|mu| *mu /= decisions as f32);

        let return_sum = episode.rewards.iter().sum::<f32>();
        let reward_mean = return_sum / self.config.horizon as f32;
        if !self.noise.noisy() {
            if self.noise_free.len() == self.config.average_episodes {
                self.noise_free.pop_front();
            }
            self.noise_free.push_back(NoiseFree { reward_mean, mu_mean: mu_mean.clone() });
        }
        let fell = episode.fell;
        self.replay.push(episode);
        Ok(EpisodeLog {
            episode: number,
            seed,
            decisions,
            return_sum,
            reward_mean,
            fell,
            noisy: self.noise.noisy(),
            sigma: self.noise.width(),
            mu_mean,
            value_mean: value_mean / decisions as f32,
            noise_free_mean: self.noise_free_mean(),
            loss: 0.0,
            grad_norm: 0.0,
            updates: self.learner.updates(),
            gate: self.gate(),
        })
    }

    fn learn(&mut self, log: &mut EpisodeLog) -> Result<(), EnafError> {
        self.owed_updates += self.config.depth * log.decisions;
        if self.episode + 1 < self.config.warm_up_episodes() as u64 {
            return Ok(());
        }
        let (gate, updates) = (self.gate(), std::mem::take(&mut self.owed_updates));
        let (input, action) = (self.learner.shape().input(), self.learner.shape().action);
        for _ in 0..updates {
            let batch = self.replay.draw(self.config.batch_episodes, self.config.unroll, input, action);
            let Some(batch) = batch else { break };
            let step = self.learner.step(&batch, &self.config, gate)?;
            log.loss += step.loss / updates as f32;
            log.grad_norm += step.grad_norm / updates as f32;
        }
        log.updates = self.learner.updates();
        Ok(())
    }

    /// Whether the state-dependent part of μ is let in.
    fn gate(&self) -> bool {
        self.config.residual_after.is_some_and(|after| self.episode >= after as u64)
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
