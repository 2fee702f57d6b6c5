//! The honest baselines: search for constants, episode by episode, under the same world and budget as the agent.
//!
//! A search's whole state is its journal: the rewards so far. Its proposals follow from seed and journal, so going on
//! after a kill is exact.

mod cma;
mod random;

pub use cma::CmaEs;
pub use random::RandomSearch;

use crate::enaf::{EnvError, Environment};

/// Proposes constants, one episode each, and learns from their rewards.
pub trait Search {
    /// The next constants to try, each in [-1, 1].
    fn ask(&mut self) -> Vec<f32>;
    /// The mean reward of the episode they made.
    fn tell(&mut self, reward: f32);
    /// What to hardcode.
    fn recommend(&self) -> Vec<f32>;
}

/// One episode with constant parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConstantEpisode {
    /// Sum of rewards over the horizon.
    pub reward: f32,
    /// Ended by a fall.
    pub fell: bool,
    /// Decisions lasted.
    pub decisions: usize,
}

/// Runs an episode with `action` held.
pub fn run_constant(
    env: &mut dyn Environment,
    action: &[f32],
    seed: u64,
    horizon: usize,
) -> Result<ConstantEpisode, EnvError> {
    env.reset(seed)?;
    let mut result = ConstantEpisode { reward: 0.0, fell: false, decisions: 0 };
    for _ in 0..horizon {
        let outcome = env.decide(action)?;
        result.reward += outcome.reward / horizon as f32;
        result.decisions += 1;
        if let Some(end) = outcome.end {
            result.fell = end == crate::enaf::End::Fall;
            break;
        }
    }
    Ok(result)
}
