//! What an episode was worth: results, their summary, and the trace behind a figure.

mod episode;
mod summary;
mod trace;

pub use episode::{EnergyJ, EpisodeResult, Outcome};
pub use summary::{Autonomy, DirectionSurvival, Median, MedianP5P95, MedianP95, Summary, by_direction};
pub use trace::{Trace, TraceSample};
