//! What the training was worth: every session judged before and after, controllers compared, the report written.

use std::collections::BTreeMap;
use std::path::Path;

use sarah_firmware::default_params;
use sarah_protocol::params::{ParamSet, SPECS};
use sarah_sim::scenario::{Overrides, Scenario};

use super::{Chain, ConfigError, Method, TrainConfig, TrainError};
use crate::evaluate::{Controller, Recording, Watch, autonomy, run_episode, run_many};
use crate::figures::Push;
use crate::metrics::EpisodeResult;
use crate::progress::Progress;
use crate::report::{
    ControllerReport, Evaluation, LearnerReport, ParameterRow, RunReport, SessionReport, ShownEpisode, draw_figures,
    markdown, session_curves,
};
use crate::run::{
    Layout, MetricsTable, Origin, RunError, RunFolder, RunInfo, param_set_text, param_specs, read_metrics, read_text,
    write_atomic,
};
use crate::stats::mean;
use crate::task::action::Scope;
use crate::task::reward::RewardForm;
use crate::task::robots::Robots;

/// Seeds of judging lie here, those of training below 2^40·10 + 2: no push is both trained on and judged on.
const JUDGE_SEED: u64 = 1 << 60;
/// Directions of a push grid.
const DIRECTIONS: u32 = 24;
/// Poses in the picture of an episode.
const POSES: usize = 7;

/// Episodes that judging will take.
pub fn episodes(config: &TrainConfig) -> u64 {
    // A chain whose agent acts is judged once more, by the sets that it hands on.
    let judgements: u64 = config.methods.iter().map(|method| if config.acts(*method) { 2 } else { 1 }).sum();
    let sessions = (1 + config.seeds * judgements * 3) * u64::from(config.judged_episodes);
    let controllers = config.methods.len() as u64 + 2;
    let grid = u64::from(DIRECTIONS * config.grid_repeats) * config.grid_impulses_n_s.len() as u64;
    sessions + controllers * grid
}

/// Judges every chain and compares controllers.
pub fn judge(
    config: &TrainConfig,
    folder: &RunFolder,
    info: &RunInfo,
    chains: &[Chain],
    progress: &Progress,
) -> Result<RunReport, TrainError> {
    progress.phase("judging every session on common pushes");
    let judge = Judge { config, folder, progress, scenario: config.train_scenario().map_err(ConfigError::from)? };
    let start = judge.rewards("start", &Controller::Constants(config.start_set()?))?;
    let (mut judged, mut handed_on) = (BTreeMap::new(), BTreeMap::new());
    for chain in chains {
        for (index, trained) in chain.sessions.iter().enumerate() {
            let controller = trained.controller(chain.base(index), Scope::SESSIONS[index]);
            let name = format!("{}-seed-{}-session-{}", chain.method.folder(), chain.seed, index + 1);
            let rewards = judge.rewards(&name, &controller)?;
            // An agent that acts by state hands on a set, which is worth something else.
            handed_on.insert(
                (chain.method, chain.seed, index),
                match &trained.policy {
                    Some(_) => judge.rewards(&format!("{name}-set"), &Controller::Constants(trained.constants))?,
                    None => rewards.clone(),
                },
            );
            judged.insert((chain.method, chain.seed, index), rewards);
        }
    }
    let sessions = (0..3).map(|index| session_report(config, chains, &start, [&handed_on, &judged], index)).collect();

    let chosen: Vec<&Chain> = config
        .methods
        .iter()
        .filter_map(|method| {
            median_chain(chains, *method, |chain| {
                let valid: Vec<f64> = handed_on[&(*method, chain.seed, 2)].iter().flatten().copied().collect();
                mean(&valid).unwrap_or_default()
            })
        })
        .collect();
    progress.phase("comparing controllers on push grids");
    let mut evaluations = vec![];
    for impulse in &config.grid_impulses_n_s {
        evaluations.push(judge.grid(*impulse, &chosen)?);
    }
    let best = chosen.first().map_or_else(default_params, |chain| chain.base(3));
    let origin = Origin {
        run: folder.layout().root().file_name().map(|name| name.to_string_lossy().into_owned()),
        seed: chosen.first().map(|chain| chain.seed),
        revision: info.revision.clone(),
        agent: config.methods.first().map(|method| method.name().to_owned()),
    };
    write_atomic(&folder.layout().params(), param_set_text(&best, Some(&origin)).as_bytes())?;
    let report = RunReport {
        info: info.clone(),
        evaluations,
        sessions,
        parameters: parameters(config, chains, &best)?,
        episode: Some(shown(config, &best)?),
    };
    write_atomic(&folder.layout().evaluation(), &json(&report)?)?;
    Ok(report)
}

/// What a run on a robot leaves: what was learned, and no judgement, because nobody pushes two controllers alike there.
pub fn on_a_robot(
    config: &TrainConfig,
    folder: &RunFolder,
    info: &RunInfo,
    chain: &Chain,
) -> Result<RunReport, TrainError> {
    let set = chain.base(3);
    let origin = Origin {
        run: folder.layout().root().file_name().map(|name| name.to_string_lossy().into_owned()),
        seed: Some(chain.seed),
        revision: info.revision.clone(),
        agent: Some(chain.method.name().to_owned()),
    };
    write_atomic(&folder.layout().params(), param_set_text(&set, Some(&origin)).as_bytes())?;
    let report = RunReport {
        info: info.clone(),
        evaluations: vec![],
        sessions: vec![],
        parameters: parameters(config, std::slice::from_ref(chain), &set)?,
        episode: None,
    };
    write_atomic(&folder.layout().evaluation(), &json(&report)?)?;
    Ok(report)
}

/// Figures and text from a run's data. Reads everything it shows from the folder, except the report's own numbers.
pub fn write_report(layout: &Layout, report: &RunReport) -> Result<(), TrainError> {
    let config_text = read_text(&layout.config())?;
    let config = TrainConfig::parse(&layout.config().display().to_string(), &config_text)?;
    let mut curves = vec![];
    for (index, scope) in Scope::SESSIONS.into_iter().enumerate() {
        let mut agents: Vec<(&str, Vec<MetricsTable>)> = vec![];
        for method in &config.methods {
            let tables: Result<Vec<_>, _> = (config.seed..config.seed + config.seeds)
                .map(|seed| read_metrics(&layout.metrics(method.folder(), seed, index as u8 + 1)))
                .collect();
            agents.push((method.name(), tables?));
        }
        let specs = param_specs();
        curves.push(session_curves(index as u8 + 1, &specs[scope.range()], &agents));
    }
    let figures = draw_figures(report, &curves);
    std::fs::create_dir_all(layout.figures()).map_err(RunError::io("create", &layout.figures()))?;
    for figure in &figures {
        let saved = figure.figure.save(&layout.figures(), &figure.name);
        saved.map_err(|error| TrainError::Figure(error.to_string()))?;
    }
    Ok(write_atomic(&layout.report(), markdown(report, &config_text, &figures).as_bytes())?)
}

/// The report as stored in a run folder.
pub fn read_report(layout: &Layout) -> Result<RunReport, TrainError> {
    let path = layout.evaluation();
    decode(&path, &read_text(&path)?)
}

struct Judge<'a> {
    config: &'a TrainConfig,
    folder: &'a RunFolder,
    progress: &'a Progress,
    scenario: Scenario,
}

impl Judge<'_> {
    /// Rewards on the training scenario with pushes of the judge's own, one per episode; `None` where the simulation failed.
    fn rewards(&self, name: &str, controller: &Controller) -> Result<Vec<Option<f64>>, TrainError> {
        let robots = self.config.robots().map_err(ConfigError::from)?;
        let results = self.kept(name, controller, &robots, &self.scenario, self.config.judged_episodes.into())?;
        let reward =
            |result: &EpisodeResult| result.outcome.is_valid().then(|| result.reward(self.config.reward).into());
        Ok(results.iter().map(reward).collect())
    }

    /// Results from the folder, or made now and kept there.
    fn kept(
        &self,
        name: &str,
        controller: &Controller,
        robots: &Robots,
        scenario: &Scenario,
        count: u64,
    ) -> Result<Vec<EpisodeResult>, TrainError> {
        let path = self.folder.layout().evaluated(name);
        if path.exists() {
            self.progress.skip(count);
            return decode(&path, &read_text(&path)?);
        }
        let done = || self.progress.episode(None);
        let results = run_many(controller, robots, scenario, JUDGE_SEED + self.config.seed, count, &done)?;
        self.folder.write_evaluated(name, &json(&results)?)?;
        Ok(results)
    }

    fn grid(&self, impulse: f32, chosen: &[&Chain]) -> Result<Evaluation, TrainError> {
        let repeats = self.config.grid_repeats;
        let overrides = Overrides {
            impulse_n_s: Some(impulse),
            directions: Some(DIRECTIONS),
            repeats: Some(repeats),
            ..Overrides::default()
        };
        let scenario = Scenario::load("push-grid").and_then(|grid| grid.with(&overrides)).map_err(ConfigError::from)?;
        let trained = chosen.iter().enumerate().map(|(rank, chain)| {
            let name = match (rank, chain.method) {
                (0, method) => format!("trained ({})", method.name()),
                (_, method) => method.name().to_owned(),
            };
            (name, chain.method.folder(), Controller::Constants(chain.base(3)))
        });
        let others = [
            ("default".to_owned(), "default", Controller::Constants(default_params())),
            ("braked".to_owned(), "braked", Controller::Braked),
        ];
        let robots = Robots::alike(self.config.robot.clone());
        let mut controllers = vec![];
        for (label, file, controller) in trained.chain(others) {
            let count = u64::from(DIRECTIONS * repeats);
            let results = self.kept(&format!("grid-{impulse}-{file}"), &controller, &robots, &scenario, count)?;
            let mut report = ControllerReport::new(&label, "push-grid", &results);
            report.summary.autonomy = autonomy(&self.config.robot.energy, &results);
            controllers.push(report);
        }
        Ok(Evaluation {
            title: format!("push-grid, {impulse} N·s, {DIRECTIONS} directions × {repeats}"), controllers
        })
    }
}

/// Rewards by method, seed and session.
type Judged = BTreeMap<(Method, u64, usize), Vec<Option<f64>>>;

fn session_report(
    config: &TrainConfig,
    chains: &[Chain],
    start: &[Option<f64>],
    [handed_on, judged]: [&Judged; 2],
    index: usize,
) -> SessionReport {
    let learners = config.methods.iter().filter_map(|method| {
        let seeds = chains.iter().filter(|chain| chain.method == *method).map(|chain| chain.seed);
        let before: Vec<Vec<Option<f64>>> = seeds
            .clone()
            .map(|seed| match index.checked_sub(1) {
                Some(earlier) => handed_on[&(*method, seed, earlier)].clone(),
                None => start.to_vec(),
            })
            .collect();
        let after: Vec<Vec<Option<f64>>> = seeds.map(|seed| judged[&(*method, seed, index)].clone()).collect();
        // Both lists have one entry per seed and one number per judged episode.
        LearnerReport::new(method.name(), &before, &after, config.seed).ok()
    });
    let what = ["linear actuators (P1–P3)", "hips (H1–H5)", "abductors (V1–V5)"][index.min(2)];
    SessionReport {
        session: index as u8 + 1,
        what: what.into(),
        episodes: config.episodes,
        reward: match config.reward {
            RewardForm::Paper => "paper".into(),
            RewardForm::Gated => "gated".into(),
        },
        learners: learners.collect(),
    }
}

/// The chain of the median final reward: what a user may expect, not what luck once gave.
fn median_chain(chains: &[Chain], method: Method, reward: impl Fn(&Chain) -> f64) -> Option<&Chain> {
    let mut ranked: Vec<(f64, &Chain)> =
        chains.iter().filter(|chain| chain.method == method).map(|chain| (reward(chain), chain)).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.get(ranked.len().saturating_sub(1) / 2).map(|(_, chain)| *chain)
}

fn parameters(config: &TrainConfig, chains: &[Chain], chosen: &ParamSet) -> Result<Vec<ParameterRow>, ConfigError> {
    let start = config.start_set()?;
    let ours = config.methods.first();
    let rows = SPECS.iter().enumerate().map(|(index, spec)| ParameterRow {
        symbol: spec.symbol.into(),
        unit: spec.unit.into(),
        what: spec.meaning.into(),
        start: start.values()[index].into(),
        trained: chains
            .iter()
            .filter(|chain| Some(&chain.method) == ours)
            .map(|chain| chain.base(3).values()[index].into())
            .collect(),
        chosen: chosen.values()[index].into(),
    });
    Ok(rows.collect())
}

/// The paper's own evaluation episode, recorded.
fn shown(config: &TrainConfig, set: &ParamSet) -> Result<ShownEpisode, TrainError> {
    let scenario = Scenario::load("paper").map_err(ConfigError::from)?;
    let episode = scenario.episode(config.seed, 0);
    let mut recording = Recording::default();
    run_episode(&Controller::Constants(*set), &config.robot, &episode, Watch::Recording(&mut recording))?;
    let push = episode.pushes.first();
    // From the middle of the push, while its force acts.
    let from_s = push.map_or(0.0, |push| push.at_s + push.duration_s / 2.0);
    let after: Vec<_> = recording.poses.iter().filter(|pose| (from_s..from_s + 2.0).contains(&pose.t_s)).collect();
    let step = (after.len() / POSES).max(1);
    Ok(ShownEpisode {
        trace: recording.trace,
        push: push.map(|push| Push {
            at_s: push.at_s,
            direction_deg: push.direction_deg,
            impulse_n_s: push.impulse_n_s,
        }),
        poses: after.into_iter().step_by(step).take(POSES).copied().collect(),
    })
}

fn json<T: serde::Serialize>(value: &T) -> Result<Vec<u8>, TrainError> {
    serde_json::to_vec_pretty(value).map_err(|error| TrainError::Figure(error.to_string()))
}

fn decode<T: serde::de::DeserializeOwned>(path: &Path, text: &str) -> Result<T, TrainError> {
    serde_json::from_str(text).map_err(|error| TrainError::Stored { path: path.to_path_buf(), why: error.to_string() })
}
