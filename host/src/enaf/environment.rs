//! What the agent asks of the world: one decision is one second on the robot.

use serde::{Deserialize, Serialize};

/// Whatever went wrong in the world.
pub type EnvError = Box<dyn std::error::Error + Send + Sync>;

/// A world that is acted upon once a second.
pub trait Environment {
    /// Numbers in one observation.
    fn observation_len(&self) -> usize;

    /// Numbers in one action.
    fn action_len(&self) -> usize;

    /// Starts an episode; equal seeds start equal episodes. Returns the first observation, each number normalised by a
    /// fixed physical range to about [-3, 3].
    ///
    /// # Errors
    /// Whatever keeps the world from starting.
    fn reset(&mut self, episode_seed: u64) -> Result<Vec<f32>, EnvError>;

    /// Holds `action`, each number in [-1, 1], for one decision.
    ///
    /// # Errors
    /// Whatever keeps the world from going on.
    fn decide(&mut self, action: &[f32]) -> Result<Outcome, EnvError>;
}

/// What one decision led to.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The observation after the decision.
    pub observation: Vec<f32>,
    /// The reward earned during the decision.
    pub reward: f32,
    /// Whether the episode is over.
    pub end: Option<End>,
}

/// Why an episode ended. The difference matters to learning: after a fall nothing more can be earned, after a time-out
/// everything could have gone on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum End {
    /// The robot fell.
    Fall,
    /// The time was up.
    TimeOut,
}
