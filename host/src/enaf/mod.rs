//! eNAF: the paper's agent (§III.C eq. 3–4, §IV), on burn.
//!
//! Read in this order; each file is one idea:
//!
//! | file | idea |
//! |---|---|
//! | [`config`] | what a session can be told |
//! | [`encoder`] | observations to features: a GRU with a hand-derived backward, or one feed-forward layer |
//! | [`model`] | features to V, μ, L, and Q = V − ½ (u−μ)ᵀ L Lᵀ (u−μ) |
//! | [`agent`] | acting: one decision after another, hidden state and all |
//! | [`actor`] | an episode with exploration, from its first observation to what the learner gets |
//! | [`noise`] | exploration that decays, behind a coin |
//! | [`replay`] | episodes stored whole, unrolled from their own start |
//! | [`learner`] | targets, one gradient step, Polyak target |
//! | [`trainer`] | the loop: act an episode, store it, learn |
//! | [`checkpoint`] | everything above as bytes, and back, bit for bit |
//!
//! All randomness comes from generators owned by the trainer, none from burn, and burn's `flex` device computes on the
//! calling thread only: trainers on different threads do not influence each other, and equal seeds give equal bits.

pub mod actor;
pub mod agent;
pub mod checkpoint;
pub mod config;
pub mod encoder;
mod environment;
mod error;
pub mod learner;
pub mod model;
pub mod noise;
pub mod replay;
pub mod trainer;

#[cfg(test)]
mod tests;

pub use actor::{Actor, Played};
pub use agent::{Decision, Policy};
pub use config::{EnafConfig, Form, NoiseConfig};
pub use environment::{End, EnvError, Environment, Outcome};
pub use error::EnafError;
pub use trainer::{EpisodeLog, Trainer};
