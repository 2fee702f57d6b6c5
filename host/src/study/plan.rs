//! A study resolved: everything written out that lies elsewhere, so that a folder is complete by itself.
//!
//! Seeds are split, and nobody is judged on what anything was trained, validated or tuned on:
//!
//! | for | seeds |
//! |---|---|
//! | training, and tuning by hand | below 2⁴⁴ |
//! | validation of a training session | from 2⁵⁹ |
//! | judging by `sarah train` | from 2⁶⁰ |
//! | judging by a study: pushes, sensor errors | from 2⁶¹ |
//! | draws of a study: the robot of each episode | from 2⁶² |

use std::collections::BTreeSet;

use sarah_sim::scenario::{Overrides, Scenario};
use sarah_sim::sil::SilConfig;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::StudyError;
use super::balancer::Balancer;
use super::file::{ConditionFile, EvaluationFile, MethodArm, StudyFile, TrainingFile};
use crate::link::sim::SimRobot;
use crate::overrides::overridden;
use crate::task::action::Scope;
use crate::task::robots::Robots;
use crate::train::TrainConfig;

/// Seeds of judging.
pub const JUDGE_SEED: u64 = 1 << 61;
/// Episodes of one unit at most: a slip of the finger shall not run for a month.
const MOST_EPISODES: u64 = 100_000;

/// A resolved study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Plan {
    /// Controllers under conditions.
    Evaluation(EvaluationPlan),
    /// Ways to learn, over seeds.
    Training(TrainingPlan),
}

/// Controllers under conditions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvaluationPlan {
    /// What the report is called.
    pub title: String,
    /// Added to the seeds of judging and of draws.
    pub seed: u64,
    /// Who balances.
    pub arms: Vec<Balancer>,
    /// Under what.
    pub conditions: Vec<Condition>,
}

/// Scenario and robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Its name.
    pub name: String,
    /// Impulses, each run on its own, N·s; none: the scenario's own.
    pub impulses_n_s: Vec<f32>,
    /// Episodes of each impulse.
    pub episodes: u64,
    /// What happens.
    pub scenario: Scenario,
    /// To which robot.
    pub robot: SilConfig,
    /// Ranges from which every episode draws changes of its own.
    pub draw: Table,
}

/// Ways to learn, over seeds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingPlan {
    /// What the report is called.
    pub title: String,
    /// First training seed.
    pub seed: u64,
    /// Number of training seeds.
    pub seeds: u64,
    /// Episodes of each session.
    pub episodes: u32,
    /// Which sessions, in order.
    pub sessions: Vec<Scope>,
    /// Episodes that judge a session.
    pub judged_episodes: u32,
    /// Ways to learn.
    pub arms: Vec<Learner>,
}

/// A way to learn with its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Learner {
    /// Its name.
    pub name: String,
    /// All of it: one method, the study's seeds and budget.
    pub config: TrainConfig,
}

impl Learner {
    /// Whether its agent acts by itself in the end, and is judged also as what it does on average and as what it hands on.
    pub fn acts(&self) -> bool {
        self.config.methods.iter().any(|method| self.config.acts(*method))
    }
}

impl Plan {
    /// The title.
    pub fn title(&self) -> &str {
        match self {
            Plan::Evaluation(plan) => &plan.title,
            Plan::Training(plan) => &plan.title,
        }
    }

    /// Names of the arms, the one that others are compared with first.
    pub fn arms(&self) -> Vec<&str> {
        match self {
            Plan::Evaluation(plan) => plan.arms.iter().map(|arm| arm.name.as_str()).collect(),
            Plan::Training(plan) => plan.arms.iter().map(|arm| arm.name.as_str()).collect(),
        }
    }

    /// The seeds that are learned with; empty where nothing is learned.
    pub fn training_seeds(&self) -> Vec<u64> {
        match self {
            Plan::Evaluation(_) => vec![],
            Plan::Training(plan) => (plan.seed..plan.seed + plan.seeds).collect(),
        }
    }

    /// Resolves and checks a study. Robots are built once each: one that cannot be is refused before anything runs.
    pub fn of(file: &StudyFile) -> Result<Plan, StudyError> {
        match file {
            StudyFile::Evaluation(file) => evaluation(file).map(Plan::Evaluation),
            StudyFile::Training(file) => training(file).map(Plan::Training),
        }
    }

    /// As TOML.
    pub fn to_toml(&self) -> Result<String, StudyError> {
        toml::to_string_pretty(self).map_err(|error| StudyError::Part { part: "study".into(), why: error.to_string() })
    }
}

fn evaluation(file: &EvaluationFile) -> Result<EvaluationPlan, StudyError> {
    seed_in_range(file.seed)?;
    names("arm", file.arm.iter().map(|arm| arm.name.as_str()))?;
    if !file.common.name.is_empty() {
        let why = "holds for all conditions and has no name: remove it".into();
        return Err(StudyError::Part { part: "common".into(), why });
    }
    let nominal = [ConditionFile { name: "nominal".into(), ..ConditionFile::default() }];
    let conditions = if file.condition.is_empty() { &nominal[..] } else { &file.condition[..] };
    names("condition", conditions.iter().map(|condition| condition.name.as_str()))?;
    Ok(EvaluationPlan {
        title: file.title.clone(),
        seed: file.seed,
        arms: file.arm.iter().map(Balancer::of).collect::<Result<_, _>>()?,
        conditions: conditions
            .iter()
            .map(|own| condition(&own.over(&file.common), file.seed))
            .collect::<Result<_, _>>()?,
    })
}

fn condition(own: &ConditionFile, seed: u64) -> Result<Condition, StudyError> {
    let wrong = |why: String| StudyError::Part { part: format!("condition {}", own.name), why };
    let named = Scenario::load(own.scenario.as_deref().unwrap_or("push-grid"))?;
    let changed = overridden(&named, &own.set_scenario).map_err(wrong)?;
    let scenario =
        changed.with(&Overrides { directions: own.directions, repeats: own.repeats, ..Overrides::default() })?;
    let episodes = scenario.episodes().or(own.episodes).unwrap_or(20);
    if !(1..=MOST_EPISODES).contains(&episodes) {
        return Err(wrong(format!("{episodes} episodes: give 1 to {MOST_EPISODES}")));
    }
    let robot = overridden(&SilConfig::default(), &own.set).map_err(wrong)?;
    let impulses_n_s = own.impulses_n_s.clone().unwrap_or_default();
    if impulses_n_s.iter().map(|impulse| impulse.to_bits()).collect::<BTreeSet<_>>().len() != impulses_n_s.len() {
        return Err(wrong("impulses_n_s must be a list without repetition".into()));
    }
    for impulse in &impulses_n_s {
        scenario.with(&Overrides { impulse_n_s: Some(*impulse), ..Overrides::default() })?;
    }
    let episode = scenario.episode(JUDGE_SEED + seed, 0);
    let robots = Robots::new(robot.clone(), own.draw.clone()).map_err(|why| wrong(why.to_string()))?;
    for robot in robots.extremes().map_err(|why| wrong(why.to_string()))? {
        // Another simulator is asked when its turn comes: a study can be read where it is not installed.
        let here = SilConfig { plant: None, ..robot };
        SimRobot::start(&here, &episode).map_err(|error| wrong(error.to_string()))?;
    }
    Ok(Condition { name: own.name.clone(), impulses_n_s, episodes, scenario, robot, draw: own.draw.clone() })
}

fn training(file: &TrainingFile) -> Result<TrainingPlan, StudyError> {
    seed_in_range(file.seed)?;
    names("arm", file.arm.iter().map(|arm| arm.name.as_str()))?;
    let unique: BTreeSet<&str> = file.sessions.iter().map(|session| session.name()).collect();
    if file.sessions.is_empty() || unique.len() != file.sessions.len() {
        let why = "give one or more of knee, hip, abductor, all, none twice".into();
        return Err(StudyError::Part { part: "sessions".into(), why });
    }
    Ok(TrainingPlan {
        title: file.title.clone(),
        seed: file.seed,
        seeds: file.seeds,
        episodes: file.episodes,
        sessions: file.sessions.clone(),
        judged_episodes: file.judged_episodes,
        arms: file.arm.iter().map(|arm| learner(arm, file)).collect::<Result<_, _>>()?,
    })
}

/// What the study itself decides, for all arms alike, and what only `sarah train` does.
const DECIDED: [&str; 10] = [
    "seed",
    "seeds",
    "episodes",
    "judged_episodes",
    "methods",
    "link",
    "scenario_as_run",
    "start_as_run",
    "grid_impulses_n_s",
    "grid_repeats",
];

fn learner(arm: &MethodArm, file: &TrainingFile) -> Result<Learner, StudyError> {
    let wrong = |why: String| StudyError::Part { part: format!("arm {}", arm.name), why };
    if let Some(key) = DECIDED.iter().find(|key| [&arm.set, &file.common].iter().any(|set| set.contains_key(**key))) {
        return Err(wrong(format!(
            "{key} is the study's to decide, for all arms alike: remove it from set and common"
        )));
    }
    let studied = TrainConfig {
        seed: file.seed,
        seeds: file.seeds,
        episodes: file.episodes,
        judged_episodes: file.judged_episodes,
        methods: vec![arm.method],
        ..TrainConfig::default()
    };
    let common = overridden(&studied, &file.common).map_err(wrong)?;
    let config = overridden(&common, &arm.set).map_err(wrong)?;
    config.validate().map_err(|error| wrong(error.to_string()))?;
    let config = config.resolved().map_err(|error| wrong(error.to_string()))?;
    let episode = config.train_scenario()?.episode(config.seed, 0);
    let robots = config.robots().and_then(|robots| robots.extremes()).map_err(|why| wrong(why.to_string()))?;
    for robot in robots {
        SimRobot::start(&robot, &episode).map_err(|error| wrong(error.to_string()))?;
    }
    Ok(Learner { name: arm.name.clone(), config })
}

fn seed_in_range(seed: u64) -> Result<(), StudyError> {
    if seed < 1 << 40 {
        return Ok(());
    }
    Err(StudyError::Part { part: "seed".into(), why: format!("{seed} is out of range; give a number below 2^40") })
}

/// Names become file names.
fn names<'a>(what: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), StudyError> {
    let mut seen = BTreeSet::new();
    for name in names {
        let fit = |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '-';
        if name.is_empty() || name.len() > 40 || !name.chars().all(fit) {
            let why = "give a name of a to z, 0 to 9 and -, at most 40 letters".into();
            return Err(StudyError::Part { part: format!("{what} {name:?}"), why });
        }
        if !seen.insert(name) {
            let why = "is there twice: give every one a name of its own".into();
            return Err(StudyError::Part { part: format!("{what} {name}"), why });
        }
    }
    if seen.is_empty() {
        let why = format!("is missing: give at least one [[{what}]] with a name");
        return Err(StudyError::Part { part: what.into(), why });
    }
    Ok(())
}
