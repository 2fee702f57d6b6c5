//! The report of a run: tables and figures from its data, and from nothing else.
//!
//! [`RunReport`] is `evaluation.json`. Together with the metrics it is all that `sarah report` needs: figures come
//! from [`draw_figures`], the text from [`markdown`], the table in the terminal from [`headline`]. All are pure.

mod figures;
mod markdown;
mod sessions;
mod table;

pub use figures::{NamedFigure, SessionCurves, columns, draw_figures, session_curves};
pub use markdown::markdown;
pub use sessions::{LearnerReport, SessionReport, Verdict};
pub use table::headline;
pub(crate) use table::{Table, number};

use crate::figures::{Pose, Push};
use crate::metrics::{DirectionSurvival, EpisodeResult, Summary, Trace, by_direction};
use crate::run::RunInfo;
use serde::{Deserialize, Serialize};

/// Everything that the report says, as stored in `evaluation.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// Where the run came from.
    pub info: RunInfo,
    /// Evaluations, the most telling first: the headline is its table.
    pub evaluations: Vec<Evaluation>,
    /// Training sessions in order.
    pub sessions: Vec<SessionReport>,
    /// The trained parameters.
    pub parameters: Vec<ParameterRow>,
    /// An episode to show.
    pub episode: Option<ShownEpisode>,
}

/// Controllers on common pushes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// What was done, for instance `push-grid, 24 N·s, 24 directions × 4`.
    pub title: String,
    /// The controllers, ours first.
    pub controllers: Vec<ControllerReport>,
}

/// One controller in an evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ControllerReport {
    /// The summary.
    pub summary: Summary,
    /// Survival by direction of the push.
    pub directions: Vec<DirectionSurvival>,
}

impl ControllerReport {
    /// Summarises episodes.
    pub fn new(controller: &str, scenario: &str, results: &[EpisodeResult]) -> Self {
        Self { summary: Summary::new(controller, scenario, results), directions: by_direction(results) }
    }
}

/// One parameter of the trained set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterRow {
    /// Its name in Table I.
    pub symbol: String,
    /// Its unit, empty if it has none.
    pub unit: String,
    /// What it does, in a few words.
    pub what: String,
    /// Where training began.
    pub start: f64,
    /// What each seed arrived at.
    pub trained: Vec<f64>,
    /// What the run recommends: the value in `params.toml`.
    pub chosen: f64,
}

/// An episode to show in figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShownEpisode {
    /// What happened, sample by sample.
    pub trace: Trace,
    /// The push.
    pub push: Option<Push>,
    /// The robot at a few instants.
    pub poses: Vec<Pose>,
}
