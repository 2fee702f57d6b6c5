//! Studies: one TOML file says what is asked, one command answers it with tables and figures.
//!
//! ```text
//!  file ─► plan ─► units ─► evaluated/*.json ─► tables, figures, report.md
//! ```
//!
//! - [`mod@file`]: what people write. [`plan`], [`balancer`]: the same, resolved and checked; the seeds of judging.
//! - [`mod@unit`]: what is done at one go and saved as it finishes. [`run`]: doing it. [`sittings`]: how long it took.
//! - [`compare`], [`learning`]: from saved episodes to rows. [`pages_evaluation`], [`pages_training`], [`report`]: from
//!   rows to what is read. [`document`]: the same into a document.
//!
//! The folder of a study is laid out as that of a run ([`crate::run`]), with `tables/`, `sittings.json` and, of a
//! training study, `params/` (the set of each arm's median seed) added. The
//! same file gives the same bytes in `evaluated/`, `tables/` and `figures/`, killed and taken up again or not.

pub mod balancer;
pub mod compare;
pub mod document;
pub mod file;
pub mod learning;
pub mod pages_evaluation;
pub mod pages_training;
pub mod plan;
pub mod report;
pub mod run;
pub mod sittings;
pub mod unit;

use std::path::PathBuf;

use sarah_sim::scenario::ScenarioError;
use thiserror::Error;

use crate::evaluate::EvaluateError;
use crate::figures::FigureError;
use crate::run::{ParamFileError, RunError};
use crate::task::robots::DrawError;
use crate::train::TrainError;

pub use file::StudyFile;
pub use plan::Plan;

/// Why a study stopped.
#[derive(Debug, Error)]
pub enum StudyError {
    /// Not TOML, or no study.
    #[error("{file}: {message}; tests/studies has examples")]
    Parse {
        /// Which file.
        file: String,
        /// Where and why, in one line.
        message: String,
    },
    /// A part of the study that cannot be.
    #[error("study: {part}: {why}")]
    Part {
        /// Which.
        part: String,
        /// Why, and what to do.
        why: String,
    },
    /// A scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// An arm's parameters.
    #[error(transparent)]
    Params(#[from] ParamFileError),
    /// The folder.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The folder already holds something else.
    #[error("{} is not empty and holds no study: choose another folder with --out", .0.display())]
    NotEmpty(PathBuf),
    /// The folder belongs to another study.
    #[error("{} holds another study, or this one before its file was changed: choose another folder with --out", .0.display())]
    Other(PathBuf),
    /// The folder to report on is none.
    #[error("{} holds no study: make one with `sarah study run FILE --out {}`", .0.display(), .0.display())]
    NoStudy(PathBuf),
    /// An episode.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// The robots of an episode.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// A training session.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// A figure.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// A document without a place for a study.
    #[error("{} has no place for the study: add the lines `{begin}` and `{end}` where its table shall be", .document.display())]
    NoPlace {
        /// Which.
        document: PathBuf,
        /// The line before.
        begin: String,
        /// The line after.
        end: &'static str,
    },
    /// Another unit failed; its error is the one to tell.
    #[error("stopped because another part of the study failed")]
    Stopped,
}
