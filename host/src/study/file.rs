//! What people write: a study as a TOML file. Absent fields take their defaults, unknown ones are refused.
//!
//! ```toml
//! kind = "evaluation"                       # or "training", see below
//! title = "Who survives what"
//!
//! [[arm]]                                   # the first is the one that the others are compared with
//! name = "default"
//! controller = "default"                    # default, braked, table-ii; or params = "runs/train-1"
//! toward = { controller = "table-ii", share = 0.25 }  # a quarter of the way to another set; or params = "…"
//! shift.P1 = 0.1                            # a tenth of the way between the parameter's limits, upwards
//! shift_stepping.H2 = -0.1                  # this one only in a second after one with a step
//!
//! [common]                                  # holds for every condition that says nothing else
//! impulses_n_s = [18, 24]
//! repeats = 4
//!
//! [[condition]]
//! name = "payload-5kg"
//! set.robot.payload_kg = 5.0                # any key of the simulated robot and its firmware
//! draw.robot.friction = [0.4, 1.2]          # drawn anew in every episode
//! set.robot.weak_actuator = { joint = "left-knee", force_scale = 0.8 }
//! set_scenario.pushes.grid.duration_s = 0.3 # any key of the scenario
//! set_scenario.pushes.grid.height_m = 0.2   # above the trunk's centre of mass
//! ```
//!
//! ```toml
//! kind = "training"
//! title = "What the recurrence adds"
//! seeds = 10
//! episodes = 120                            # the budget of each session
//! sessions = ["knee"]                       # knee, hip, abductor (in turn without this line), all (13 parameters)
//! common.scenario = "train"                 # any key of `sarah train --print-config`
//! common.start = "default"                  # instead of "table-ii"; or a parameter file, or the folder of a run
//! common.draw.robot.friction = [0.4, 1.2]   # drawn anew in every episode
//!
//! [[arm]]
//! name = "feed-forward"
//! method = "enaf"                           # enaf, enaf-paper, cma-es, random, external
//! set.enaf.recurrent = false
//! ```

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use toml::Table;

use super::StudyError;
use crate::overrides::{merge, one_line};
use crate::task::action::Scope;
use crate::train::Method;

/// Which kind of study a file is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Controllers under conditions.
    Evaluation,
    /// Ways to learn, over seeds.
    Training,
}

/// A study as written.
#[derive(Clone, Debug, PartialEq)]
pub enum StudyFile {
    /// Controllers under conditions.
    Evaluation(EvaluationFile),
    /// Ways to learn, over seeds.
    Training(TrainingFile),
}

/// Controllers under conditions.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluationFile {
    /// `evaluation`.
    pub kind: Kind,
    /// What the report is called.
    pub title: String,
    /// Which of the judging pushes, sensor errors and draws.
    #[serde(default = "one")]
    pub seed: u64,
    /// Who balances, the one that others are compared with first.
    #[serde(default)]
    pub arm: Vec<ControllerArm>,
    /// What every condition has that says nothing else.
    #[serde(default)]
    pub common: ConditionFile,
    /// Under what; without any, one called `nominal`.
    #[serde(default)]
    pub condition: Vec<ConditionFile>,
}

/// A controller with its name.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerArm {
    /// Its name in tables and files.
    pub name: String,
    /// One that needs no file.
    pub controller: Option<ControllerName>,
    /// A parameter file, or the folder of a run.
    pub params: Option<PathBuf>,
    /// Another set that it lies nearer to.
    pub toward: Option<Toward>,
    /// What is added to parameters of the set, by symbol, as a share of the width of their limits, at which it ends.
    #[serde(default)]
    pub shift: BTreeMap<String, f32>,
    /// What is added beyond that for the seconds that follow one with a step.
    #[serde(default)]
    pub shift_stepping: BTreeMap<String, f32>,
}

/// A share of the straight way to another set.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Toward {
    /// The other set, if it needs no file.
    pub controller: Option<ControllerName>,
    /// The other set's file, or the folder of a run.
    pub params: Option<PathBuf>,
    /// 0 is the arm's own set, 1 the other.
    pub share: f32,
}

/// Controllers that need no file.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ControllerName {
    /// The set built into the firmware.
    Default,
    /// Brakes on, whatever happens.
    Braked,
    /// The paper's Table II.
    TableIi,
}

/// Scenario and robot.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConditionFile {
    /// Its name in tables and files; what is common to all has none.
    #[serde(default)]
    pub name: String,
    /// Scenario, by name or path; `push-grid` by default.
    pub scenario: Option<String>,
    /// Changes to the scenario.
    #[serde(default)]
    pub set_scenario: Table,
    /// Impulses, each run on its own, N·s; without any, the scenario's own.
    pub impulses_n_s: Option<Vec<f32>>,
    /// Directions of a push grid.
    pub directions: Option<u32>,
    /// Episodes per direction of a push grid.
    pub repeats: Option<u32>,
    /// Episodes of a scenario that is no grid.
    pub episodes: Option<u64>,
    /// Changes to the simulated robot and its firmware.
    #[serde(default)]
    pub set: Table,
    /// Ranges from which every episode draws changes of its own.
    #[serde(default)]
    pub draw: Table,
}

/// Ways to learn, over seeds.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingFile {
    /// `training`.
    pub kind: Kind,
    /// What the report is called.
    pub title: String,
    /// First training seed.
    #[serde(default = "one")]
    pub seed: u64,
    /// Number of training seeds.
    pub seeds: u64,
    /// Episodes of each session.
    pub episodes: u32,
    /// Which sessions, in this order; all three by default.
    #[serde(default = "all_sessions")]
    pub sessions: Vec<Scope>,
    /// Episodes that judge a session.
    #[serde(default = "fifty")]
    pub judged_episodes: u32,
    /// Changes to the training configuration of every arm.
    #[serde(default)]
    pub common: Table,
    /// Ways to learn, the one that others are compared with first.
    #[serde(default)]
    pub arm: Vec<MethodArm>,
}

/// A way to learn with its name.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodArm {
    /// Its name in tables and files.
    pub name: String,
    /// The method; eNAF by default.
    #[serde(default = "enaf")]
    pub method: Method,
    /// Changes to the training configuration.
    #[serde(default)]
    pub set: Table,
}

fn one() -> u64 {
    1
}

fn fifty() -> u32 {
    50
}

fn enaf() -> Method {
    Method::Enaf
}

fn all_sessions() -> Vec<Scope> {
    Scope::SESSIONS.to_vec()
}

#[derive(Deserialize)]
struct OfKind {
    kind: Kind,
}

impl StudyFile {
    /// Reads TOML; `file` is for messages.
    pub fn parse(file: &str, text: &str) -> Result<StudyFile, StudyError> {
        let wrong = |error: toml::de::Error| {
            let line = error.span().map_or(String::new(), |span| {
                format!("line {}: ", text[..span.start.min(text.len())].matches('\n').count() + 1)
            });
            StudyError::Parse { file: file.into(), message: format!("{line}{}", one_line(error.message())) }
        };
        let OfKind { kind } = toml::from_str(text).map_err(wrong)?;
        match kind {
            Kind::Evaluation => toml::from_str(text).map(StudyFile::Evaluation).map_err(wrong),
            Kind::Training => toml::from_str(text).map(StudyFile::Training).map_err(wrong),
        }
    }
}

impl ConditionFile {
    /// This condition where it says something, `common` where it does not.
    pub fn over(&self, common: &ConditionFile) -> ConditionFile {
        let both = |common: &Table, own: &Table| {
            let mut merged = common.clone();
            merge(&mut merged, own);
            merged
        };
        ConditionFile {
            name: self.name.clone(),
            scenario: self.scenario.clone().or_else(|| common.scenario.clone()),
            set_scenario: both(&common.set_scenario, &self.set_scenario),
            impulses_n_s: self.impulses_n_s.clone().or_else(|| common.impulses_n_s.clone()),
            directions: self.directions.or(common.directions),
            repeats: self.repeats.or(common.repeats),
            episodes: self.episodes.or(common.episodes),
            set: both(&common.set, &self.set),
            draw: both(&common.draw, &self.draw),
        }
    }
}
