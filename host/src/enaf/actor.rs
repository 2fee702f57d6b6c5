//! Acting with exploration: an episode from its first observation to what it leaves to the learner.
//!
//! ```text
//!  begin ──► decide ──► earned ──► decide ──► earned … ──► end ──► Played
//!              └ action      ▲ reward                         └ to the trainer's store
//! ```
//!
//! It needs nothing of the learner but weights, which may be exchanged at any decision: acting never waits for learning.

use super::agent::{Agent, check};
use super::model::{Network, Shape};
use super::noise::Noise;
use super::replay::Episode;
use super::{EnafConfig, EnafError};

/// What one episode was: to be stored, and to be told.
#[derive(Clone, Debug, PartialEq)]
pub struct Played {
    /// Number of the episode, from 0.
    pub number: u64,
    /// What the replay stores.
    pub episode: Episode,
    /// The exploration as the episode left it.
    pub noise: Noise,
    /// Mean over the decisions of μ (before the noise), `[A]`.
    pub mu_mean: Vec<f32>,
    /// Mean of V over the decisions, as predicted while acting.
    pub value_mean: f32,
}

/// Acts one episode after another.
#[derive(Clone, Debug)]
pub struct Actor {
    shape: Shape,
    agent: Agent,
    residual_after: Option<usize>,
    initial_action: Vec<f32>,
    noise: Noise,
    number: u64,
    previous: Vec<f32>,
    episode: Episode,
    mu_sum: Vec<f32>,
    value_sum: f32,
}

impl Actor {
    /// An actor whose next episode is `number`. μ starts at `initial_action` `[A]`.
    pub(crate) fn new(
        config: &EnafConfig,
        shape: &Shape,
        weights: &[f32],
        initial_action: &[f32],
        noise: Noise,
        number: u64,
    ) -> Self {
        let gate = gate(config.residual_after, number);
        Self {
            shape: shape.clone(),
            agent: Agent::new(Network::new(shape, weights, gate)),
            residual_after: config.residual_after,
            initial_action: initial_action.to_vec(),
            noise,
            number,
            previous: initial_action.to_vec(),
            episode: Episode::default(),
            mu_sum: vec![0.0; initial_action.len()],
            value_sum: 0.0,
        }
    }

    /// Starts the episode: draws its exploration.
    pub fn begin(&mut self) {
        self.noise.begin(self.number);
        self.agent.reset();
        self.previous.clone_from(&self.initial_action);
        self.episode = Episode::default();
        self.mu_sum.fill(0.0);
        self.value_sum = 0.0;
    }

    /// Acts by these weights from the next decision on; what has been seen of the episode stays.
    pub fn exchange(&mut self, weights: &[f32]) {
        self.agent.exchange(Network::new(&self.shape, weights, gate(self.residual_after, self.number)));
    }

    /// Decisions made in this episode.
    #[must_use]
    pub fn decisions(&self) -> usize {
        self.episode.rewards.len()
    }

    /// The action `[A]`, in [-1, 1], after `observation` `[O]`. Its reward must be told before the next.
    ///
    /// # Errors
    /// [`EnafError::Shape`] or [`EnafError::WorldNotFinite`] for an observation that cannot be.
    pub fn decide(&mut self, observation: &[f32]) -> Result<Vec<f32>, EnafError> {
        self.see(observation)?;
        let decided = self.agent.act(observation, &self.previous)?;
        let noise = self.noise.draw();
        let action: Vec<f32> = decided.mu.iter().zip(&noise).map(|(mu, n)| (mu + n).clamp(-1.0, 1.0)).collect();
        self.value_sum += decided.value;
        self.mu_sum.iter_mut().zip(&decided.mu).for_each(|(sum, mu)| *sum += mu);
        self.episode.actions.extend(&action);
        self.previous.clone_from(&action);
        Ok(action)
    }

    /// What the last action earned.
    ///
    /// # Errors
    /// [`EnafError::WorldNotFinite`].
    pub fn earned(&mut self, reward: f32) -> Result<(), EnafError> {
        self.finite("reward", &[reward])?;
        self.episode.rewards.push(reward);
        Ok(())
    }

    /// The episode is over, `observation` the last thing seen; the next one will have the next number.
    ///
    /// # Errors
    /// As [`Actor::decide`].
    pub fn end(&mut self, observation: &[f32], fell: bool) -> Result<Played, EnafError> {
        self.see(observation)?;
        self.episode.fell = fell;
        let decisions = self.episode.rewards.len() as f32;
        let played = Played {
            number: self.number,
            episode: std::mem::take(&mut self.episode),
            noise: self.noise.clone(),
            mu_mean: self.mu_sum.iter().map(|mu| mu / decisions).collect(),
            value_mean: self.value_sum / decisions,
        };
        self.number += 1;
        Ok(played)
    }

    fn see(&mut self, observation: &[f32]) -> Result<(), EnafError> {
        check("observation", self.shape.observation, observation)?;
        self.finite("observation", observation)?;
        self.episode.inputs.extend(self.shape.see(observation, &self.previous));
        Ok(())
    }

    fn finite(&self, quantity: &'static str, values: &[f32]) -> Result<(), EnafError> {
        match values.iter().all(|x| x.is_finite()) {
            true => Ok(()),
            false => Err(EnafError::WorldNotFinite { episode: self.number, decision: self.decisions(), quantity }),
        }
    }
}

/// Whether the state-dependent part of μ is let in.
pub(crate) fn gate(residual_after: Option<usize>, episode: u64) -> bool {
    residual_after.is_some_and(|after| episode >= after as u64)
}
