//! Units of work: what is done at one go, saved as it finishes, and never done again.

use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::StudyError;
use super::plan::{Condition, EvaluationPlan, Learner, Plan, TrainingPlan};
use crate::metrics::EpisodeResult;
use crate::run::{Layout, RunError, read_text};

/// One unit of a study.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// A controller under a condition at one impulse.
    Cell(Cell),
    /// What a training arm begins with, judged.
    Start {
        /// Index of the arm.
        arm: usize,
    },
    /// A training arm with one seed through its sessions.
    Chain {
        /// Index of the arm.
        arm: usize,
        /// The seed.
        seed: u64,
    },
}

/// A controller under a condition at one impulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Index of the arm.
    pub arm: usize,
    /// Index of the condition.
    pub condition: usize,
    /// Strength of the pushes, N·s; `None` is the scenario's own.
    pub impulse_n_s: Option<f32>,
}

/// What a session of a training arm came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SessionData {
    /// Mean reward of every training episode.
    pub rewards: Vec<f64>,
    /// Whether it explored.
    pub noisy: Vec<bool>,
    /// Episodes that the simulation spoilt; they were repeated in other worlds.
    pub broken: u32,
    /// The set that it hands on.
    pub set: Vec<f32>,
    /// What it is worth, on pushes that nobody trained on.
    pub judged: Vec<EpisodeResult>,
    /// Of an agent whose action depends on the state: the set that it does on average, held, on the same pushes.
    #[serde(default)]
    pub held: Vec<EpisodeResult>,
    /// Of such an agent: the set that it hands on, on the same pushes.
    #[serde(default)]
    pub handed_on: Vec<EpisodeResult>,
}

impl SessionData {
    /// What the set is worth that it hands on.
    pub fn handed_on(&self) -> &[EpisodeResult] {
        if self.handed_on.is_empty() { &self.judged } else { &self.handed_on }
    }
}

impl Unit {
    /// Every unit of a plan. Long ones first within an arm, so that the last minutes have work for every core.
    pub fn all(plan: &Plan) -> Vec<Unit> {
        match plan {
            Plan::Evaluation(plan) => cells(plan).into_iter().map(Unit::Cell).collect(),
            // Seeds before arms: a study that is cut short has compared all arms on fewer seeds.
            Plan::Training(plan) => {
                let arms = 0..plan.arms.len();
                let chains = (plan.seed..plan.seed + plan.seeds)
                    .flat_map(|seed| arms.clone().map(move |arm| Unit::Chain { arm, seed }));
                chains.chain(arms.clone().map(|arm| Unit::Start { arm })).collect()
            }
        }
    }

    /// Its name among the saved results.
    pub fn name(&self, plan: &Plan) -> String {
        let arms = plan.arms();
        match (*self, plan) {
            (Unit::Cell(cell), Plan::Evaluation(plan)) => {
                let impulse = cell.impulse_n_s.map_or_else(|| "own".into(), |impulse| impulse.to_string());
                // No name has a dot: different cells have different files.
                format!("{}.{}.{impulse}", arms[cell.arm], plan.conditions[cell.condition].name)
            }
            (Unit::Start { arm }, _) => format!("{}.start", arms[arm]),
            (Unit::Chain { arm, seed }, _) => format!("{}.seed-{seed}", arms[arm]),
            (Unit::Cell(cell), _) => arms[cell.arm].to_owned(),
        }
    }

    /// Episodes it takes, for progress.
    pub fn episodes(&self, plan: &Plan) -> u64 {
        match (*self, plan) {
            (Unit::Cell(cell), Plan::Evaluation(plan)) => plan.conditions[cell.condition].episodes,
            (Unit::Chain { arm, .. }, Plan::Training(plan)) => {
                let judged = u64::from(plan.judged_episodes) * if plan.arms[arm].acts() { 3 } else { 1 };
                (u64::from(plan.episodes) + judged) * plan.sessions.len() as u64
            }
            (Unit::Start { .. }, Plan::Training(plan)) => plan.judged_episodes.into(),
            _ => 0,
        }
    }

    /// Whether it is saved.
    pub fn done(&self, plan: &Plan, layout: &Layout) -> bool {
        layout.evaluated(&self.name(plan)).is_file()
    }

    /// Its saved result, if there is one.
    pub fn load<T: DeserializeOwned>(&self, plan: &Plan, layout: &Layout) -> Result<Option<T>, StudyError> {
        let path = layout.evaluated(&self.name(plan));
        if !path.is_file() {
            return Ok(None);
        }
        Ok(Some(decode(&path, &read_text(&path)?)?))
    }
}

/// Cells condition by condition, so that arms that are compared finish together.
pub fn cells(plan: &EvaluationPlan) -> Vec<Cell> {
    let mut cells = vec![];
    for (index, condition) in plan.conditions.iter().enumerate() {
        for impulse_n_s in impulses(condition) {
            cells.extend((0..plan.arms.len()).map(|arm| Cell { arm, condition: index, impulse_n_s }));
        }
    }
    cells
}

/// The impulses of a condition.
pub fn impulses(condition: &Condition) -> Vec<Option<f32>> {
    match condition.impulses_n_s.as_slice() {
        [] => vec![None],
        impulses => impulses.iter().copied().map(Some).collect(),
    }
}

/// An arm of a training plan with everything that is saved of it.
#[derive(Clone, Debug)]
pub struct ArmData<'a> {
    /// The arm.
    pub arm: &'a Learner,
    /// Judged before anything was learned.
    pub start: Vec<EpisodeResult>,
    /// For each seed that is finished, its sessions.
    pub chains: Vec<(u64, Vec<SessionData>)>,
}

/// Reads what is saved of a training study.
pub fn load_training<'a>(
    study: &Plan,
    plan: &'a TrainingPlan,
    layout: &Layout,
) -> Result<Vec<ArmData<'a>>, StudyError> {
    let arms = plan.arms.iter().enumerate().map(|(index, arm)| {
        let start = Unit::Start { arm: index }.load(study, layout)?.unwrap_or_default();
        let mut chains = vec![];
        for seed in plan.seed..plan.seed + plan.seeds {
            if let Some(sessions) = (Unit::Chain { arm: index, seed }).load(study, layout)? {
                chains.push((seed, sessions));
            }
        }
        Ok(ArmData { arm, start, chains })
    });
    arms.collect()
}

fn decode<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, RunError> {
    serde_json::from_str(text).map_err(|error| RunError::damaged(path, error))
}
