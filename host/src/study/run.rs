//! Does what a study asks for: units in parallel worlds, each saved as it finishes.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use sarah_sim::scenario::{Overrides, Scenario};
use serde::Serialize;

use super::StudyError;
use super::plan::{EvaluationPlan, JUDGE_SEED, Learner, Plan, TrainingPlan};
use super::sittings::{Sitting, Sittings};
use super::unit::{Cell, SessionData, Unit};
use crate::evaluate::{Controller, Watch, parallel, run_episode};
use crate::metrics::EpisodeResult;
use crate::progress::Progress;
use crate::report::columns;
use crate::run::{Layout, RunError, RunFolder, RunInfo, read_metrics, read_text};
use crate::search::ExternalSearch;
use crate::task::robots::Robots;
use crate::train::session::Session;
use crate::train::{Method, TrainError};

/// Runs a study in `out`, or what is left of it; what a document shows of it.
pub fn run(plan: &Plan, out: &Path) -> Result<String, StudyError> {
    let units = Unit::all(plan);
    others_answer(plan, &units, &Layout::new(out))?;
    let folder = open(plan, out)?;
    let progress = Progress::new(units.iter().map(|unit| unit.episodes(plan)).sum());
    let done = |unit: &Unit| unit.done(plan, folder.layout());
    let left: Vec<&Unit> = units.iter().filter(|unit| !done(unit)).collect();
    progress.phase(&format!("{}: {} of {} units to do in {}", plan.title(), left.len(), units.len(), out.display()));
    progress.skip(units.iter().filter(|unit| done(unit)).map(|unit| unit.episodes(plan)).sum());
    let worker = Worker {
        plan,
        folder: &folder,
        progress: &progress,
        failed: AtomicBool::new(false),
        sittings: Mutex::new(Sittings::open(folder.layout())?),
        sitting: Sitting::begin(),
        began: Instant::now(),
    };
    let results = parallel(left.len(), |index| {
        worker.unit(left[index]).inspect_err(|_| worker.failed.store(true, Ordering::Relaxed))
    });
    progress.finish();
    // The error that stopped the study, not those of the units that it stopped.
    let mut stopped = None;
    for result in results {
        match result {
            Ok(()) => {}
            Err(StudyError::Stopped) => stopped = Some(StudyError::Stopped),
            Err(cause) => return Err(cause),
        }
    }
    stopped.map_or_else(|| super::report::write(folder.layout(), plan), Err)
}

/// Somebody else's program that cannot start is found out before the first episode, not an hour later.
fn others_answer(study: &Plan, units: &[Unit], layout: &Layout) -> Result<(), StudyError> {
    let Plan::Training(plan) = study else { return Ok(()) };
    for (index, arm) in plan.arms.iter().enumerate() {
        let of_arm = |unit: &&Unit| matches!(unit, Unit::Chain { arm, .. } if *arm == index);
        let waits = units.iter().filter(of_arm).any(|unit| !unit.done(study, layout));
        if waits && arm.config.methods.contains(&Method::External) {
            let dimensions = plan.sessions.first().map_or(1, |session| session.range().len());
            ExternalSearch::new(&arm.config.external, &vec![0.0; dimensions], plan.episodes as usize, 0, &[])
                .map_err(TrainError::from)?;
        }
    }
    Ok(())
}

/// Begins a study in a new folder, or takes up the same one; another one is refused.
fn open(plan: &Plan, out: &Path) -> Result<RunFolder, StudyError> {
    let text = plan.to_toml()?;
    let layout = Layout::new(out);
    if layout.info().is_file() {
        let (folder, _) = RunFolder::resume(out)?;
        if read_text(&layout.config())? != text {
            return Err(StudyError::Other(out.to_path_buf()));
        }
        return Ok(folder);
    }
    let info = RunInfo::collect(plan.training_seeds(), Path::new(env!("CARGO_MANIFEST_DIR")));
    match RunFolder::create(out, &text, &info) {
        Err(RunError::NotEmpty(path)) => Err(StudyError::NotEmpty(path)),
        other => Ok(other?),
    }
}

struct Worker<'a> {
    plan: &'a Plan,
    folder: &'a RunFolder,
    progress: &'a Progress,
    failed: AtomicBool,
    sittings: Mutex<Sittings>,
    sitting: Sitting,
    began: Instant,
}

impl Worker<'_> {
    fn unit(&self, unit: &Unit) -> Result<(), StudyError> {
        let name = unit.name(self.plan);
        match (unit, self.plan) {
            (Unit::Cell(cell), Plan::Evaluation(plan)) => self.save(&name, &self.cell(plan, cell, &name)?)?,
            (Unit::Start { arm }, Plan::Training(plan)) => {
                let arm = &plan.arms[*arm];
                let start = Controller::Constants(arm.config.start_set().map_err(TrainError::from)?);
                self.save(&name, &self.judge(plan, arm, &start, &name)?)?;
            }
            (Unit::Chain { arm, seed }, Plan::Training(plan)) => {
                self.save(&name, &self.chain(plan, &plan.arms[*arm], *seed, &name)?)?;
            }
            // `Unit::all` makes no unit of the other kind.
            _ => {}
        }
        let mut sittings = self.sittings.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        sittings.record(self.folder.layout(), &self.sitting, self.began.elapsed())
    }

    fn save<T: Serialize>(&self, name: &str, value: &T) -> Result<(), StudyError> {
        let path = self.folder.layout().evaluated(name);
        let json = serde_json::to_vec(value).map_err(|error| RunError::damaged(&path, error))?;
        Ok(self.folder.write_evaluated(name, &json)?)
    }

    fn check(&self) -> Result<(), StudyError> {
        if self.failed.load(Ordering::Relaxed) { Err(StudyError::Stopped) } else { Ok(()) }
    }

    fn cell(&self, plan: &EvaluationPlan, cell: &Cell, name: &str) -> Result<Vec<EpisodeResult>, StudyError> {
        let controller = plan.arms[cell.arm].controller()?;
        let condition = &plan.conditions[cell.condition];
        let robots = Robots::new(condition.robot.clone(), condition.draw.clone())?;
        let scenario = condition.scenario.with(&Overrides { impulse_n_s: cell.impulse_n_s, ..Overrides::default() })?;
        let episodes = 0..condition.episodes;
        let results = episodes.map(|index| {
            self.check()?;
            self.episode(&controller, &robots, &scenario, plan.seed, index, name)
        });
        results.collect()
    }

    /// The training scenario with pushes that nobody trained on; the same for every arm and seed.
    fn judge(
        &self,
        plan: &TrainingPlan,
        arm: &Learner,
        controller: &Controller,
        name: &str,
    ) -> Result<Vec<EpisodeResult>, StudyError> {
        let (scenario, robots) = (arm.config.train_scenario()?, arm.config.robots()?);
        let results = (0..u64::from(plan.judged_episodes)).map(|index| {
            self.check()?;
            self.episode(controller, &robots, &scenario, plan.seed, index, name)
        });
        results.collect()
    }

    fn episode(
        &self,
        controller: &Controller,
        robots: &Robots,
        scenario: &Scenario,
        seed: u64,
        index: u64,
        name: &str,
    ) -> Result<EpisodeResult, StudyError> {
        // The robot of an episode is the same for every arm and impulse.
        let robot = robots.of((seed << 20) + index)?;
        let result = run_episode(controller, &robot, &scenario.episode(JUDGE_SEED + seed, index), Watch::Nothing)?;
        self.progress.episode(Some(name.to_owned()));
        Ok(result)
    }

    fn chain(&self, plan: &TrainingPlan, arm: &Learner, seed: u64, name: &str) -> Result<Vec<SessionData>, StudyError> {
        let mut base = arm.config.start_set().map_err(TrainError::from)?;
        let mut sessions = vec![];
        for (index, session) in plan.sessions.iter().enumerate() {
            let method = arm.config.methods[0];
            let place = self.folder.session(&format!("arms/{}", arm.name), seed, index as u8 + 1)?;
            let mut training = Session::open(&arm.config, method, *session, base, seed, &place)?;
            self.progress.skip(training.episodes().min(plan.episodes).into());
            training.run(&arm.config, |_| {
                self.progress.episode(Some(format!("{name} {}", session.name())));
                self.check()
            })?;
            let trained = training.trained()?;
            let controller = trained.controller(base, *session);
            let held = match &trained.policy {
                Some(policy) => self.judge(plan, arm, &Controller::Constants(training.habit(policy)?), name)?,
                None => vec![],
            };
            let handed_on = match &trained.policy {
                Some(_) => self.judge(plan, arm, &Controller::Constants(trained.constants), name)?,
                None => vec![],
            };
            let metrics = read_metrics(&place.join("metrics.csv"))?;
            let column = |name| metrics.numbers(name).unwrap_or_default();
            sessions.push(SessionData {
                rewards: column(columns::REWARD),
                noisy: column(columns::NOISY).iter().map(|noisy| *noisy > 0.5).collect(),
                broken: trained.broken,
                set: trained.constants.values().to_vec(),
                judged: self.judge(plan, arm, &controller, name)?,
                held,
                handed_on,
            });
            base = trained.constants;
        }
        Ok(sessions)
    }
}
