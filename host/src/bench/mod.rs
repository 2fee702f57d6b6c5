//! `sarah bench`: how good the link is, measured on simulated or emulated boards in their own time.
//!
//! - [`latency`]: from a host's word to its effect, many thousand times. [`soak`]: a bad line for a long time.
//! - [`flood`]: what a host that never stops talking costs the control ticks.
//! - [`wire`]: a host at the end of a world's link, which the others share.

pub mod flood;
pub mod latency;
pub mod soak;
pub mod wire;

use thiserror::Error;

use sarah_sim::emulated::ImagesError;
use sarah_sim::sil::SilError;

use crate::run::RunError;

/// Why a measurement ended.
#[derive(Debug, Error)]
pub enum BenchError {
    /// The simulation.
    #[error(transparent)]
    Sil(#[from] SilError),
    /// The images.
    #[error(transparent)]
    Images(#[from] ImagesError),
    /// A file.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The link broke a promise.
    #[error("at {at_s:.3} s: {what}; this is a bug of the link, please report it with the seed and this command")]
    Broken {
        /// Time of the robot, s.
        at_s: f64,
        /// What.
        what: String,
    },
}
