//! What can go wrong in a training session, by name.

use super::EnvError;

/// Why a session stopped or refused to start.
#[derive(Debug, thiserror::Error)]
pub enum EnafError {
    /// A configuration value that cannot train.
    #[error("configuration: `{field}` must be {rule}")]
    Config {
        /// The field, as written in TOML.
        field: &'static str,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// Something has the wrong number of numbers.
    #[error("{what}: expected {expected} numbers, got {got}")]
    Shape {
        /// Which vector.
        what: &'static str,
        /// How many numbers it must have.
        expected: usize,
        /// How many it has.
        got: usize,
    },
    /// The world handed over a number that is not finite.
    #[error("episode {episode}, decision {decision}: {quantity} is not finite")]
    WorldNotFinite {
        /// Episode, from 0.
        episode: u64,
        /// Decision within the episode, from 0.
        decision: usize,
        /// What was not finite.
        quantity: &'static str,
    },
    /// Learning produced a number that is not finite.
    #[error("update {update}: {quantity} is not finite")]
    LearningNotFinite {
        /// Gradient step, from 0.
        update: u64,
        /// What was not finite.
        quantity: &'static str,
    },
    /// The world failed.
    #[error("environment: {0}")]
    Environment(#[source] EnvError),
    /// The tensor library could not hand numbers over.
    #[error("tensor: {0}")]
    Tensor(String),
    /// Bytes that are no checkpoint of this program.
    #[error("not an eNAF checkpoint")]
    NotACheckpoint,
    /// A checkpoint of another format.
    #[error("checkpoint version {found}, this program reads {expected}")]
    CheckpointVersion {
        /// The version in the file.
        found: u16,
        /// The version read and written here.
        expected: u16,
    },
    /// A checkpoint of a session configured otherwise.
    #[error("checkpoint: {0} differs from the configuration")]
    CheckpointMismatch(&'static str),
    /// A checkpoint that does not decode or encode.
    #[error("checkpoint: {0}")]
    Codec(#[from] postcard::Error),
}
