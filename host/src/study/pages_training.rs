//! A training study as tables and figures.

use std::fmt::Write;
use std::path::Path;

use sarah_protocol::params::ParamSet;

use super::StudyError;
use super::learning::{ArmRow, SHARE, WINDOW, median_seed, rows};
use super::plan::TrainingPlan;
use super::report::{Pages, csv};
use super::unit::{ArmData, SessionData};
use crate::figures::{Curve, IntervalRow, RewardSeries, intervals, rewards};
use crate::report::{NamedFigure, Table, number};
use crate::run::{Origin, RunError, param_set_text};
use crate::stats::Interval;

/// Curves in one figure, with the first arm in each: more cannot be told apart.
const CURVES: usize = 4;

/// Tables and figures of the arms and seeds that are saved, and the set of each arm's median seed.
pub fn pages(plan: &TrainingPlan, arms: &[ArmData], revision: &str) -> Result<Pages, StudyError> {
    let (seeds, summaries) = rows(plan, arms);
    let table = table(plan, &summaries);
    let reference = &plan.arms[0].name;
    let mut body = format!("## What each arm learned\n\n{}\n", table.markdown());
    let _ = writeln!(
        body,
        "Judged: mean reward over {} episodes of common pushes that nobody trained on, then the interquartile mean \
         over seeds, with its 95 % bootstrap interval over seeds. Gain: the mean of what the session added to \
         what it began with, push by push; its interval draws seeds and pushes. Modulation: the mean of what the agent earned beyond its \
         own average set held constant, push by push; only of agents whose action depends on the state. Better than {reference}: the probability that a seed \
         of this arm is judged higher than one of {reference}, with its interval. Stable after: the first episode from \
         which the mean reward of the {WINDOW} episodes that end there stays, to the end, at {:.0} % or more of the \
         arm's final reward (the interquartile mean over seeds of the mean of the last {WINDOW} training episodes); \
         interquartile mean over seeds with its interval. A seed that never became stable counts with all its {} \
         episodes: where not all did, the figure is a lower bound.",
        plan.judged_episodes,
        SHARE * 100.0,
        plan.episodes,
    );
    let mut figures = vec![];
    for (index, session) in plan.sessions.iter().enumerate() {
        figures.extend(curves(arms, index, session.name()));
        figures.extend(judged(&summaries, session.name()));
    }
    body.push_str("\n`params/` has the set that each arm's median seed ends with, judged after the last session.\n");
    let sets = arms.iter().filter_map(|arm| median_set(plan, arm, revision).transpose());
    Ok(Pages {
        body,
        headline: table.text(),
        brief: table.terse(&["session"]).markdown(),
        tables: vec![("arms", csv(&summaries)), ("seeds", csv(&seeds))],
        figures,
        sets: sets.collect::<Result<_, _>>()?,
    })
}

/// The arm's name and its parameter file; `None` while no seed is finished.
fn median_set(plan: &TrainingPlan, arm: &ArmData, revision: &str) -> Result<Option<(String, String)>, StudyError> {
    let Some((seed, values)) = median_seed(arm) else { return Ok(None) };
    let name = &arm.arm.name;
    let damaged = |why: String| RunError::damaged(Path::new(&format!("evaluated/{name}.seed-{seed}")), why);
    let raw = values.try_into().map_err(|_| damaged("a set has 13 numbers".into()))?;
    let set = ParamSet::new(raw).map_err(|why| damaged(why.to_string()))?;
    let origin = Origin {
        run: Some(plan.title.clone()),
        seed: Some(seed),
        revision: Some(revision.to_owned()),
        agent: Some(name.clone()),
    };
    Ok(Some((name.clone(), param_set_text(&set, Some(&origin)))))
}

fn table(plan: &TrainingPlan, rows: &[ArmRow]) -> Table {
    let better = format!("better than {}", plan.arms[0].name);
    let mut table = Table::new([
        "session",
        "arm",
        "seeds",
        "start",
        "judged",
        "gain",
        "modulation",
        "survived",
        &better,
        "stable after (episodes)",
        "stable seeds",
    ]);
    let with_interval = |[estimate, low, high]: [Option<f64>; 3], decimals: usize| match estimate {
        Some(_) => format!("{} ({} – {})", number(estimate, decimals), number(low, decimals), number(high, decimals)),
        None => number(None, 0),
    };
    for row in rows {
        let bound = if row.stable < row.seeds { "≥ " } else { "" };
        table.row([
            row.session.clone(),
            row.arm.clone(),
            row.seeds.to_string(),
            number(row.start, 3),
            with_interval([row.judged, row.judged_low, row.judged_high], 3),
            with_interval([row.gain, row.gain_low, row.gain_high], 3),
            with_interval([row.modulation, row.modulation_low, row.modulation_high], 3),
            format!("{}/{}", row.survived, row.of),
            with_interval([row.improvement, row.improvement_low, row.improvement_high], 2),
            bound.to_owned() + &with_interval([row.stability_iqm, row.stability_low, row.stability_high], 0),
            format!("{}/{}", row.stable, row.seeds),
        ]);
    }
    table
}

/// The first arm with a few others, figure by figure.
fn curves(arms: &[ArmData], index: usize, session: &str) -> Vec<NamedFigure> {
    let Some((first, others)) = arms.split_first() else { return vec![] };
    let groups: Vec<Vec<&ArmData>> = if others.is_empty() {
        vec![vec![first]]
    } else {
        others.chunks(CURVES - 1).map(|group| [first].into_iter().chain(group).collect()).collect()
    };
    let figure = |(number, group): (usize, Vec<&ArmData>)| {
        let series: Vec<RewardSeries> = group.iter().map(|arm| series(arm, index)).collect();
        NamedFigure {
            name: format!("learning-{session}-{}", number + 1),
            caption: format!("Learning curves of the {session} session, mean of {WINDOW} episodes"),
            figure: rewards(&format!("Learning, {session}"), "reward", &series),
        }
    };
    groups.into_iter().enumerate().map(figure).collect()
}

fn series(arm: &ArmData, index: usize) -> RewardSeries {
    let curve = |noisy: bool| {
        let run = |data: &SessionData| -> Vec<f64> {
            let marked = data.rewards.iter().zip(&data.noisy);
            marked.map(|(reward, explored)| if *explored == noisy { *reward } else { f64::NAN }).collect()
        };
        let mut runs: Vec<Vec<f64>> =
            arm.chains.iter().filter_map(|(_, sessions)| sessions.get(index)).map(run).collect();
        // A kind of episode that never happened is no curve.
        runs.retain(|run| run.iter().any(|value| value.is_finite()));
        let length = runs.iter().map(Vec::len).max().unwrap_or(0);
        Curve { episodes: (0..length).map(|episode| episode as f64).collect(), runs }.smoothed(WINDOW)
    };
    RewardSeries { label: arm.arm.name.clone(), noisy: curve(true), noise_free: curve(false) }
}

fn judged(rows: &[ArmRow], session: &str) -> Option<NamedFigure> {
    let of_session = rows.iter().filter(|row| row.session == session);
    let shown: Vec<IntervalRow> = of_session
        .enumerate()
        .filter_map(|(series, row)| {
            let interval = Interval { low: row.judged_low?, estimate: row.judged?, high: row.judged_high? };
            Some(IntervalRow { label: row.arm.clone(), series, interval })
        })
        .collect();
    (!shown.is_empty()).then(|| NamedFigure {
        name: format!("judged-{session}"),
        caption: format!("Judged reward after the {session} session: interquartile mean over seeds, 95 % interval"),
        figure: intervals(
            &format!("Judged, {session}"),
            "reward on common pushes, IQM over seeds with 95 % interval",
            &shown,
        ),
    })
}
