//! What collector and predictor say to each other: whole messages, no shared state, nothing that needs one process.

use serde::{Deserialize, Serialize};

use crate::enaf::End;

/// Collector to predictor.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Seen {
    /// An episode begins; a first action is wanted.
    Began {
        /// Number of the episode, from 0 in each session.
        episode: u64,
        /// Tells it from another attempt at the same episode.
        attempt: u32,
        /// `[O]`.
        observation: Vec<f32>,
    },
    /// The last action has been held for one decision.
    Went {
        /// The attempt.
        attempt: u32,
        /// `[O]`: what was seen of the decision.
        observation: Vec<f32>,
        /// What it earned.
        reward: f32,
        /// Whether the episode is over; otherwise another action is wanted.
        end: Option<End>,
    },
    /// The episode is of no use to anybody.
    Spoilt {
        /// The attempt.
        attempt: u32,
    },
}

/// Predictor to collector: hold this action for the next decision.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Act {
    /// The attempt at an episode.
    pub attempt: u32,
    /// The decision in it, from 0.
    pub decision: usize,
    /// `[A]`, in [-1, 1].
    pub action: Vec<f32>,
}
