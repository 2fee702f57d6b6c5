//! The honest baselines: search for constants, episode by episode, under the same world and budget as the agent.
//!
//! A search's whole state is its journal: the rewards so far. Its proposals follow from seed and journal, so going on
//! after a kill is exact.

mod cma;
mod external;
mod random;

use thiserror::Error;

pub use cma::CmaEs;
pub use external::ExternalSearch;
pub use random::RandomSearch;

use crate::enaf::{EnvError, Environment};

/// Proposes constants, one episode each, and learns from their rewards.
pub trait Search {
    /// The next constants to try, each in [-1, 1].
    fn ask(&mut self) -> Result<Vec<f32>, SearchError>;
    /// The mean reward of the episode they made.
    fn tell(&mut self, reward: f32) -> Result<(), SearchError>;
    /// What to hardcode.
    fn recommend(&mut self) -> Result<Vec<f32>, SearchError>;
}

/// Why a search cannot go on. Only one in another process can fail.
#[derive(Debug, Error)]
pub enum SearchError {
    /// Nothing to start.
    #[error("method external needs a program: give external = [\"python3\", \"search.py\"] in the configuration")]
    NoCommand,
    /// It does not start.
    #[error("cannot start the search `{command}`: {source}; is it installed, and the path right from here?")]
    Start {
        /// Which.
        command: String,
        /// Why.
        source: std::io::Error,
    },
    /// It has ended.
    #[error("the search `{command}` has ended ({source}): what it printed above says why")]
    Lost {
        /// Which.
        command: String,
        /// How.
        source: std::io::Error,
    },
    /// It does not answer.
    #[error("the search `{command}` has not answered for {seconds} s; run it by hand to see where it hangs")]
    Silent {
        /// Which.
        command: String,
        /// For how long.
        seconds: u64,
    },
    /// It says something else.
    #[error("the search `{command}` answered {answer:?}, not a list of {dimensions} numbers in [-1, 1]")]
    Answer {
        /// Which.
        command: String,
        /// What it said.
        answer: String,
        /// Numbers of a point.
        dimensions: usize,
    },
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
