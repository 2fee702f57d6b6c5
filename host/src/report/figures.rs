//! Which figures a report has, and how metrics become curves.

use super::RunReport;
use crate::figures::{
    self, BarRow, Curve, Figure, ParameterCurve, PolarSeries, RewardSeries, filmstrip, imu, survival_bars,
    survival_polar, trunk,
};
use crate::run::{MetricsTable, ParamSpec};
use crate::stats::Proportion;

/// Columns of `metrics.csv` that figures read. Parameters have columns named by their symbols.
pub mod columns {
    /// Episode, from 0.
    pub const EPISODE: &str = "episode";
    /// Simulated time so far, s; the wall time of TensorBoard.
    pub const TIME_S: &str = "time_s";
    /// Mean reward of the episode.
    pub const REWARD: &str = "reward";
    /// 1 if exploration noise was on, else 0.
    pub const NOISY: &str = "noisy";
}

/// Episodes in the running mean of rewards: pushes differ more than episodes in a row do.
const SMOOTHING: usize = 10;

/// The curves of a session.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionCurves {
    /// 1 to 3.
    pub session: u8,
    /// The parameters that our agent trained.
    pub parameters: Vec<ParameterCurve>,
    /// The reward of each agent.
    pub rewards: Vec<RewardSeries>,
}

/// Curves from metrics: for each agent (ours first) its name and one table per seed. `specs` are the parameters
/// that this session trained.
pub fn session_curves(session: u8, specs: &[ParamSpec<'_>], agents: &[(&str, Vec<MetricsTable>)]) -> SessionCurves {
    let ours = agents.first().map_or(&[][..], |(_, tables)| tables);
    let parameters = specs.iter().map(|spec| ParameterCurve {
        symbol: spec.symbol.into(),
        unit: spec.unit.into(),
        what: spec.what.into(),
        curve: curve(ours, |table| table.numbers(spec.symbol)),
    });
    let rewards = agents.iter().map(|(label, tables)| {
        let with_noise = |wanted: bool| {
            curve(tables, |table| {
                let rewards = table.numbers(columns::REWARD)?;
                let noisy = table.numbers(columns::NOISY).unwrap_or_else(|| vec![0.0; rewards.len()]);
                let kept = rewards.iter().zip(noisy).map(
                    |(&reward, noisy)| {
                        if (noisy > 0.5) == wanted { reward } else { f64::NAN }
                    },
                );
                Some(kept.collect())
            })
            .smoothed(SMOOTHING)
        };
        RewardSeries { label: (*label).into(), noisy: with_noise(true), noise_free: with_noise(false) }
    });
    SessionCurves { session, parameters: parameters.collect(), rewards: rewards.collect() }
}

/// One run per table that has the column; all as long as the longest, with gaps where a seed has no more episodes.
fn curve(tables: &[MetricsTable], column: impl Fn(&MetricsTable) -> Option<Vec<f64>>) -> Curve {
    let mut runs: Vec<Vec<f64>> = tables.iter().filter_map(column).collect();
    let length = runs.iter().map(Vec::len).max().unwrap_or(0);
    runs.iter_mut().for_each(|run| run.resize(length, f64::NAN));
    // A kind of episode that never happened is no curve.
    runs.retain(|run| run.iter().any(|value| value.is_finite()));
    Curve { episodes: (0..length).map(|episode| episode as f64).collect(), runs }
}

/// A figure with the name of its files and what it shows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedFigure {
    /// File name without extension.
    pub name: String,
    /// What it shows, one sentence.
    pub caption: String,
    /// The drawing.
    pub figure: Figure,
}

/// Every figure that the data of a run allows.
pub fn draw_figures(report: &RunReport, curves: &[SessionCurves]) -> Vec<NamedFigure> {
    let mut all = Vec::new();
    let mut add = |name: String, caption: String, figure| all.push(NamedFigure { name, caption, figure });
    if let Some(episode) = &report.episode {
        if !episode.poses.is_empty() {
            let caption = "The robot recovering from a push, drawn from the run's own trace; dark feet carry.";
            add("robot".into(), caption.into(), filmstrip("", &episode.poses, episode.push));
        }
        let caption = "The trunk in that episode (figure 8 of the paper).";
        add("fig8-trunk".into(), caption.into(), trunk("Trunk after a push", &episode.trace, episode.push));
        let caption = "The IMU in that episode (figure 9 of the paper).";
        add("fig9-imu".into(), caption.into(), imu("IMU after a push", &episode.trace, episode.push));
    }
    for (index, evaluation) in report.evaluations.iter().enumerate() {
        let suffix = if index == 0 { String::new() } else { format!("-{}", index + 1) };
        let bars: Vec<BarRow> = evaluation
            .controllers
            .iter()
            .map(|one| BarRow {
                label: one.summary.controller.clone(),
                survival: Proportion { count: one.summary.survived, of: one.summary.episodes },
            })
            .collect();
        let title = format!("Survival: {}", evaluation.title);
        add(format!("survival{suffix}"), format!("{title}."), survival_bars(&title, &bars));
        let polar: Vec<PolarSeries> = evaluation
            .controllers
            .iter()
            .filter(|one| one.directions.len() > 2)
            .map(|one| PolarSeries {
                label: one.summary.controller.clone(),
                points: one
                    .directions
                    .iter()
                    .map(|direction| (direction.direction_deg, direction.survival.fraction().unwrap_or(f64::NAN)))
                    .collect(),
            })
            .collect();
        if !polar.is_empty() {
            let caption = format!("Survival by direction of the push: {}.", evaluation.title);
            add(format!("survival-by-direction{suffix}"), caption, survival_polar(&title, &polar));
        }
    }
    for one in curves {
        let session = one.session;
        let symbols: Vec<&str> = one.parameters.iter().map(|parameter| parameter.symbol.as_str()).collect();
        let range = match symbols[..] {
            [first, .., last] => format!("{first}–{last}"),
            _ => symbols.concat(),
        };
        let caption = format!("Parameters {range} over the episodes of session {session} (figure 6 of the paper).");
        let title = format!("Session {session}: parameters {range}");
        add(format!("fig6-session-{session}"), caption, figures::parameters(&title, &one.parameters));
        let reward = report.sessions.iter().find(|report| report.session == session).map(|report| &report.reward);
        let axis = reward.map_or("reward".into(), |reward| format!("reward ({reward})"));
        let caption = format!(
            "Reward over the episodes of session {session}, running mean of {SMOOTHING} (figure 7 of the paper)."
        );
        let title = format!("Session {session}: reward");
        add(format!("fig7-session-{session}"), caption, figures::rewards(&title, &axis, &one.rewards));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metrics_split_into_noisy_and_noise_free_curves() {
        let table = MetricsTable {
            columns: ["episode", "noisy", "reward", "P1"].map(String::from).to_vec(),
            rows: vec![
                vec![Some(0.0), Some(1.0), Some(0.2), Some(0.5)],
                vec![Some(1.0), Some(0.0), Some(0.4), Some(0.6)],
            ],
        };
        let spec = ParamSpec { symbol: "P1", unit: "m/s", what: "kick", min: 0.0, max: 1.0 };
        let curves = session_curves(1, &[spec], &[("eNAF", vec![table])]);
        assert_eq!(curves.parameters[0].curve.runs, vec![vec![0.5, 0.6]]);
        assert_eq!(curves.rewards[0].noisy.runs[0][0], 0.2);
        assert!(curves.rewards[0].noise_free.runs[0][0].is_nan());
        assert_eq!(curves.rewards[0].noise_free.runs[0][1], 0.4);
    }
}
