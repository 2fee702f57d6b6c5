//! Acting: one decision after another, deterministic, with the hidden state and the previous action carried along.

use super::model::Network;
use super::{EnafError, model::Part};

/// What the network says at one decision.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// μ `[A]`, in [-1, 1], without noise.
    pub mu: Vec<f32>,
    /// V, in units of return.
    pub value: f32,
}

/// A network that acts. Call [`Agent::reset`] at the start of every episode.
#[derive(Clone, Debug)]
pub struct Agent {
    network: Network,
    state: Vec<f32>,
}

impl Agent {
    /// An agent at the start of an episode.
    #[must_use]
    pub fn new(network: Network) -> Self {
        let state = vec![0.0; network.shape().hidden];
        Self { network, state }
    }

    /// Forgets the episode so far.
    pub fn reset(&mut self) {
        self.state.fill(0.0);
    }

    /// Goes on with another network of the same shape; the hidden state stays.
    pub fn exchange(&mut self, network: Network) {
        self.network = network;
    }

    /// Decides after `observation` `[O]`, given the action `[A]` of the decision before (at an episode's start: the
    /// session's initial action).
    ///
    /// # Errors
    /// [`EnafError::Shape`] for the wrong number of numbers, [`EnafError::Tensor`] if the tensor library fails.
    pub fn act(&mut self, observation: &[f32], previous: &[f32]) -> Result<Decision, EnafError> {
        let shape = self.network.shape();
        check("observation", shape.observation, observation)?;
        check("action", shape.action, previous)?;
        let input = shape.see(observation, previous);
        let (value, mu) = self.network.decide(&input, &mut self.state)?;
        Ok(Decision { mu, value })
    }
}

/// Refuses a vector of the wrong length.
pub(crate) fn check(what: &'static str, expected: usize, got: &[f32]) -> Result<(), EnafError> {
    match got.len() == expected {
        true => Ok(()),
        false => Err(EnafError::Shape { what, expected, got: got.len() }),
    }
}

/// A frozen, noise-free copy for evaluation: it may go to another thread and never learns.
#[derive(Clone, Debug)]
pub struct Policy {
    agent: Agent,
    initial_action: Vec<f32>,
    previous: Vec<f32>,
}

impl Policy {
    pub(crate) fn new(network: Network, initial_action: &[f32]) -> Self {
        Self { agent: Agent::new(network), initial_action: initial_action.to_vec(), previous: initial_action.to_vec() }
    }

    /// Starts an episode.
    pub fn reset(&mut self) {
        self.agent.reset();
        self.previous.clone_from(&self.initial_action);
    }

    /// The action `[A]`, in [-1, 1], after `observation` `[O]`.
    ///
    /// # Errors
    /// As [`Agent::act`].
    pub fn act(&mut self, observation: &[f32]) -> Result<Vec<f32>, EnafError> {
        let decision = self.agent.act(observation, &self.previous)?;
        self.previous.clone_from(&decision.mu);
        Ok(decision.mu)
    }
}

/// Copies `weights` with the constants replaced by those whose tanh is `action`.
pub(crate) fn with_constants(shape: &super::model::Shape, weights: &[f32], action: &[f32]) -> Vec<f32> {
    let mut weights = weights.to_vec();
    let limit = 1.0 - f32::EPSILON;
    for (w, u) in weights[shape.part(Part::Constants)].iter_mut().zip(action) {
        *w = u.clamp(-limit, limit).atanh();
    }
    weights
}
