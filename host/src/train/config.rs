//! What a training run does: resolved, validated, and saved with the run.

use sarah_protocol::params::{ParamError, ParamSet, RawParams};
use serde::{Deserialize, Serialize};
use thiserror::Error;
use toml::Table;

use crate::enaf::{EnafConfig, EnafError, Form};
use crate::link::port::Target;
use crate::run::ParamFileError;
use crate::task::reward::RewardForm;
use crate::task::robots::{DrawError, Robots};
use crate::train::start::Start;
use sarah_sim::scenario::{Scenario, ScenarioError};
use sarah_sim::sil::SilConfig;

/// How constants or a policy are found.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// eNAF in its default form: learned constants first.
    Enaf,
    /// eNAF in the paper's exact form.
    EnafPaper,
    /// CMA-ES over constants.
    CmaEs,
    /// Random search over constants.
    Random,
    /// A search over constants in a program of its own ([`crate::search::ExternalSearch`]).
    External,
}

impl Method {
    /// Name in tables and figures.
    pub const fn name(self) -> &'static str {
        match self {
            Method::Enaf => "eNAF",
            Method::EnafPaper => "eNAF, paper's form",
            Method::CmaEs => "CMA-ES",
            Method::Random => "random search",
            Method::External => "external search",
        }
    }

    /// Name on the command line, in configurations and of its folder in a run.
    pub const fn folder(self) -> &'static str {
        match self {
            Method::Enaf => "enaf",
            Method::EnafPaper => "enaf-paper",
            Method::CmaEs => "cma-es",
            Method::Random => "random",
            Method::External => "external",
        }
    }
}

/// One training run. Absent fields take their defaults; unknown ones are refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainConfig {
    /// First seed; a run uses `seed .. seed + seeds`.
    pub seed: u64,
    /// Number of seeds. The report speaks of all of them, never of the best.
    pub seeds: u64,
    /// Episodes per session and method.
    pub episodes: u32,
    /// Episodes of each session on the robot as it is built, before it becomes what `robot` and `draw` say: what is judged
    /// is the robot that it has become.
    pub nominal_episodes: u32,
    /// What the first session begins with: `table-ii`, `default`, or the path of a parameter file or of a run.
    pub start: Start,
    /// The set of that file, as it was when the run began, in Table I's order; a run's own record has it. Goes before the
    /// path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_as_run: Option<RawParams>,
    /// What is trained, ours first.
    pub methods: Vec<Method>,
    /// Program and arguments of the method `external`, started where the trainer was.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub external: Vec<String>,
    /// First standard deviation of the method `cma-es`, in a cube of width 2.
    pub cma_sigma: f64,
    /// Port of the robot that is trained, as --link has it; without it the simulated one is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<Target>,
    /// Training scenario, by name or path.
    pub scenario: String,
    /// The scenario itself, as it was when the run began; a run's own record has it, so that a file edited later
    /// changes nothing. Goes before the name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scenario_as_run: Option<Scenario>,
    /// Reward of training.
    pub reward: RewardForm,
    /// Pushes on which a session's result must beat its start to be handed on.
    pub validation_episodes: u32,
    /// Episodes that judge a session, before and after, on common pushes.
    pub judged_episodes: u32,
    /// Impulses of the final push grids, N·s.
    pub grid_impulses_n_s: Vec<f32>,
    /// Episodes per direction of the final push grids (24 directions).
    pub grid_repeats: u32,
    /// Episodes between two checkpoints.
    pub checkpoint_every: u32,
    /// The agent.
    pub enaf: EnafConfig,
    /// The robot and its firmware.
    pub robot: SilConfig,
    /// Ranges from which every episode draws changes of `robot`, as studies have them.
    #[serde(skip_serializing_if = "Table::is_empty")]
    pub draw: Table,
}

impl Default for TrainConfig {
    fn default() -> Self {
        TrainConfig {
            seed: 1,
            seeds: 5,
            episodes: 120,
            nominal_episodes: 0,
            start: Start::default(),
            start_as_run: None,
            methods: vec![Method::Enaf, Method::EnafPaper, Method::CmaEs],
            external: vec![],
            cma_sigma: 0.4,
            link: None,
            scenario: "train".into(),
            scenario_as_run: None,
            reward: RewardForm::Gated,
            validation_episodes: 24,
            judged_episodes: 50,
            grid_impulses_n_s: vec![24.0, 18.0],
            grid_repeats: 4,
            checkpoint_every: 5,
            enaf: EnafConfig::default(),
            robot: SilConfig::default(),
            draw: Table::new(),
        }
    }
}

/// Why a run cannot start.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// A field.
    #[error("configuration: {field} must be {rule}")]
    Field {
        /// Which.
        field: &'static str,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// What only a robot has.
    #[error("--link, --arm and --pose mean nothing to a run in simulation: leave them out")]
    Simulated,
    /// The agent's part.
    #[error(transparent)]
    Enaf(#[from] EnafError),
    /// The file that `start` names.
    #[error("start: {0}; give table-ii, default, or a parameter file or run folder")]
    Start(Box<ParamFileError>),
    /// The record of what such a file said.
    #[error("start_as_run: {0}; it is the run's own record: leave it as it was")]
    StartAsRun(ParamError),
    /// The scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The robots.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// Not TOML, or not ours.
    #[error("{file}: {message}; `sarah train --print-config` shows a complete one")]
    Parse {
        /// Which file.
        file: String,
        /// Where and why, in one line.
        message: String,
    },
}

impl TrainConfig {
    /// The same path with smaller numbers: shows that everything works, proves nothing.
    pub fn quick() -> Self {
        TrainConfig {
            seeds: 2,
            episodes: 10,
            methods: vec![Method::Enaf, Method::CmaEs],
            validation_episodes: 6,
            judged_episodes: 6,
            grid_impulses_n_s: vec![24.0],
            grid_repeats: 1,
            enaf: EnafConfig { warm_up_episodes: Some(3), ..EnafConfig::default() },
            ..TrainConfig::default()
        }
    }

    /// What of it makes sense on a robot: one seed, the agent alone, nothing compared.
    pub fn on_a_robot(self, link: Target) -> Self {
        TrainConfig { link: Some(link), seeds: 1, methods: vec![Method::Enaf], ..self }
    }

    /// Reads and checks TOML; `file` is for messages.
    pub fn parse(file: &str, text: &str) -> Result<Self, ConfigError> {
        let config: TrainConfig = toml::from_str(text).map_err(|error| {
            let line = error.span().map_or(String::new(), |span| {
                format!("line {}: ", text[..span.start.min(text.len())].matches('\n').count() + 1)
            });
            ConfigError::Parse { file: file.into(), message: format!("{line}{}", error.message().replace('\n', " ")) }
        })?;
        config.validate()?;
        Ok(config)
    }

    /// Checks every field.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let rules = [
            ("seeds", (1..=1000).contains(&self.seeds), "1 to 1000"),
            ("seed", self.seed < 1 << 40, "below 2^40"),
            ("episodes", (1..=100_000).contains(&self.episodes), "1 to 100000"),
            ("nominal_episodes", self.nominal_episodes < self.episodes, "fewer than episodes"),
            ("methods", !self.methods.is_empty(), "at least one of enaf, enaf-paper, cma-es, random, external"),
            ("cma_sigma", self.cma_sigma > 0.0 && self.cma_sigma <= 2.0, "above 0, at most 2"),
            ("validation_episodes", (2..=100_000).contains(&self.validation_episodes), "2 to 100000"),
            ("judged_episodes", (2..=100_000).contains(&self.judged_episodes), "2 to 100000"),
            ("grid_repeats", (1..=1000).contains(&self.grid_repeats), "1 to 1000"),
            ("checkpoint_every", self.checkpoint_every > 0, "1 or more"),
            (
                "grid_impulses_n_s",
                !self.grid_impulses_n_s.is_empty()
                    && self.grid_impulses_n_s.iter().all(|impulse| (0.0..=100.0).contains(impulse)),
                "one or more numbers from 0 to 100",
            ),
        ];
        for (field, holds, rule) in rules {
            if !holds {
                return Err(ConfigError::Field { field, rule });
            }
        }
        let mut unique = self.methods.clone();
        unique.sort();
        unique.dedup();
        if unique.len() != self.methods.len() {
            return Err(ConfigError::Field { field: "methods", rule: "a list without repetition" });
        }
        if self.link.is_some() && (self.methods != [Method::Enaf] || self.seeds != 1) {
            return Err(ConfigError::Field { field: "methods and seeds", rule: "[\"enaf\"] and 1 on a robot" });
        }
        if self.methods.contains(&Method::External) == self.external.is_empty() {
            let rule = "a program and its arguments, with the method external and only with it";
            return Err(ConfigError::Field { field: "external", rule });
        }
        if self.link.is_some() && !self.draw.is_empty() {
            return Err(ConfigError::Field { field: "draw", rule: "left out on a robot, which is the one it is" });
        }
        if self.link.is_some() && self.nominal_episodes > 0 {
            let rule = "0 on a robot, which stays the one it is";
            return Err(ConfigError::Field { field: "nominal_episodes", rule });
        }
        self.enaf.validate()?;
        self.robots()?;
        self.train_scenario()?;
        self.start_set()?;
        Ok(())
    }

    /// The robots that are trained.
    pub fn robots(&self) -> Result<Robots, DrawError> {
        Robots::new(self.robot.clone(), self.draw.clone())
    }

    /// The training scenario.
    pub fn train_scenario(&self) -> Result<Scenario, ScenarioError> {
        match &self.scenario_as_run {
            Some(scenario) => scenario.validate().map(|()| scenario.clone()),
            None => Scenario::load(&self.scenario),
        }
    }

    /// What the first session begins with.
    pub fn start_set(&self) -> Result<ParamSet, ConfigError> {
        match self.start_as_run {
            Some(values) => ParamSet::new(values).map_err(ConfigError::StartAsRun),
            None => self.start.load().map_err(|error| ConfigError::Start(error.into())),
        }
    }

    /// The same run with everything written out that lies elsewhere.
    pub fn resolved(&self) -> Result<Self, ConfigError> {
        let start_as_run = match self.start {
            Start::Path(_) => Some(*self.start_set()?.values()),
            Start::TableIi | Start::Default => None,
        };
        Ok(TrainConfig { scenario_as_run: Some(self.train_scenario()?), start_as_run, ..self.clone() })
    }

    /// Whether a method's agent acts by itself in the end; otherwise it hands on a set and nothing else.
    pub fn acts(&self, method: Method) -> bool {
        let enaf = self.enaf_for(method);
        let learns = matches!(method, Method::Enaf | Method::EnafPaper);
        learns && (enaf.form == Form::Paper || enaf.residual_after.is_some())
    }

    /// The agent's configuration for a method.
    pub fn enaf_for(&self, method: Method) -> EnafConfig {
        match method {
            // Everything that the form decides is the form's own; what both share is as configured.
            Method::EnafPaper => EnafConfig {
                form: Form::Paper,
                horizon: self.enaf.horizon,
                layer_norm: self.enaf.layer_norm,
                batch_episodes: self.enaf.batch_episodes,
                depth: self.enaf.depth,
                gamma: self.enaf.gamma,
                ..EnafConfig::default()
            },
            _ => self.enaf.clone(),
        }
    }

    /// As TOML, every default written out.
    pub fn to_toml(&self) -> Result<String, ConfigError> {
        toml::to_string_pretty(self)
            .map_err(|error| ConfigError::Parse { file: "configuration".into(), message: error.to_string() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::param_set_text;

    #[test]
    fn a_saved_configuration_reads_back_as_it_was() {
        let resolved = TrainConfig::default().resolved().expect("embedded");
        for config in [TrainConfig::default(), TrainConfig::quick(), resolved] {
            let text = config.to_toml().expect("writes");
            assert_eq!(TrainConfig::parse("config.toml", &text).expect("reads"), config);
        }
    }

    #[test]
    fn a_misspelt_key_is_one_line_that_names_it() {
        let error = TrainConfig::parse("my.toml", "episodes = 3\nepisods = 4\n").expect_err("unknown key");
        let text = error.to_string();
        assert!(text.contains("my.toml: line 2") && text.contains("episods") && !text.contains('\n'), "{text}");
    }

    #[test]
    fn a_start_from_a_file_is_kept_with_the_run() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("mine.toml");
        let mut values = *ParamSet::table_ii().values();
        values[0] = 0.05;
        let set = ParamSet::new(values).expect("within limits");
        std::fs::write(&file, param_set_text(&set, None)).expect("writes");
        let text = format!("start = {:?}\n", file.display().to_string());
        let resolved = TrainConfig::parse("my.toml", &text).expect("reads").resolved().expect("the file is there");
        std::fs::remove_file(&file).expect("is there");
        let kept = TrainConfig::parse("config.toml", &resolved.to_toml().expect("writes")).expect("reads");
        assert_eq!((kept.start_set().expect("kept"), &kept), (set, &resolved));
        let error = TrainConfig::parse("my.toml", &text).expect_err("the file has gone").to_string();
        assert!(error.contains("mine.toml") && error.contains("table-ii"), "{error}");
    }

    #[test]
    fn numbers_out_of_range_are_refused_by_name() {
        for (text, field) in [("seeds = 0", "seeds"), ("grid_impulses_n_s = [nan]", "grid_impulses_n_s")] {
            let error = TrainConfig::parse("my.toml", text).expect_err("out of range").to_string();
            assert!(error.contains(field), "{error}");
        }
    }
}
