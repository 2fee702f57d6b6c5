//! What an evaluation study says, row by row: every cell by itself, and every arm against the first on common pushes.

use serde::Serialize;

use super::StudyError;
use super::plan::{EvaluationPlan, Plan};
use super::unit::{Cell, Unit, cells};
use crate::metrics::{EpisodeResult, Outcome, Summary, by_direction};
use crate::run::Layout;
use crate::stats::{Interval, Proportion, Statistic, mean, paired_difference, wilson};

/// Seed of every bootstrap: tables depend on data alone.
pub const BOOTSTRAP_SEED: u64 = 1;

/// A cell with its results.
#[derive(Clone, Debug)]
pub struct CellData<'a> {
    /// Which.
    pub cell: Cell,
    /// The arm's name.
    pub arm: &'a str,
    /// The condition's name.
    pub condition: &'a str,
    /// Its episodes, in order of their index.
    pub results: Vec<EpisodeResult>,
}

/// Reads the cells that are saved.
pub fn load_cells<'a>(
    study: &Plan,
    plan: &'a EvaluationPlan,
    layout: &Layout,
) -> Result<Vec<CellData<'a>>, StudyError> {
    let mut data = vec![];
    for cell in cells(plan) {
        if let Some(results) = Unit::Cell(cell).load(study, layout)? {
            let (arm, condition) = (&plan.arms[cell.arm].name, &plan.conditions[cell.condition].name);
            data.push(CellData { cell, arm, condition, results });
        }
    }
    Ok(data)
}

/// A cell in numbers. Distances in metres, times in seconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs, reason = "the names are those of the columns")]
pub struct CellRow {
    pub condition: String,
    pub impulse_n_s: Option<f32>,
    pub arm: String,
    pub episodes: u32,
    pub survived: u32,
    pub survival: f64,
    pub survival_low: f64,
    pub survival_high: f64,
    pub steps_per_s_median: Option<f64>,
    pub drift_3s_m_median: Option<f64>,
    pub drift_3s_m_p95: Option<f64>,
    pub settle_s_median: Option<f64>,
    pub settle_s_p95: Option<f64>,
    pub never_settled: u32,
    pub worst_direction_deg: Option<f32>,
    pub worst_direction_survival: Option<f64>,
    pub reward_gated: Option<f64>,
    pub reward_gated_mean: Option<f64>,
    pub invalid: u32,
}

impl CellRow {
    /// The numbers of a cell.
    pub fn of(data: &CellData) -> CellRow {
        let sum = Summary::new(data.arm, data.condition, &data.results);
        let directions = by_direction(&data.results);
        let worst = directions.iter().find(|one| Some(one.direction_deg) == sum.worst_direction_deg);
        CellRow {
            condition: data.condition.into(),
            impulse_n_s: data.cell.impulse_n_s,
            arm: data.arm.into(),
            episodes: sum.episodes,
            survived: sum.survived,
            survival: sum.survival,
            survival_low: sum.survival_ci[0],
            survival_high: sum.survival_ci[1],
            steps_per_s_median: sum.steps_per_s.median,
            drift_3s_m_median: sum.drift_3s_m.median,
            drift_3s_m_p95: sum.drift_3s_m.p95,
            settle_s_median: sum.settle_s.median,
            settle_s_p95: sum.settle_s.p95,
            never_settled: sum.never_settled,
            worst_direction_deg: sum.worst_direction_deg,
            worst_direction_survival: worst.and_then(|worst| worst.survival.fraction()),
            reward_gated: sum.reward_gated,
            reward_gated_mean: mean(&data.results.iter().filter_map(|one| Measure::Reward.of(one)).collect::<Vec<_>>()),
            invalid: sum.invalid,
        }
    }
}

/// Survival in one direction of a cell.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs, reason = "the names are those of the columns")]
pub struct DirectionRow {
    pub condition: String,
    pub impulse_n_s: Option<f32>,
    pub arm: String,
    pub direction_deg: f32,
    pub episodes: u32,
    pub survived: u32,
    pub survival_low: f64,
    pub survival_high: f64,
    pub drift_3s_m_median: Option<f64>,
}

impl DirectionRow {
    /// The directions of a cell.
    pub fn of(data: &CellData) -> Vec<DirectionRow> {
        let row = |direction: crate::metrics::DirectionSurvival| {
            let Proportion { count, of } = direction.survival;
            let interval = wilson(direction.survival);
            DirectionRow {
                condition: data.condition.into(),
                impulse_n_s: data.cell.impulse_n_s,
                arm: data.arm.into(),
                direction_deg: direction.direction_deg,
                episodes: of,
                survived: count,
                survival_low: interval.map_or(0.0, |interval| interval.low),
                survival_high: interval.map_or(1.0, |interval| interval.high),
                drift_3s_m_median: direction.drift_3s_m,
            }
        };
        by_direction(&data.results).into_iter().map(row).collect()
    }
}

/// What of an episode is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// 1 if it survived, else 0: an episode that the simulation spoilt did not.
    Survival,
    /// Drift, m, of pairs that both survived.
    #[serde(rename = "drift_3s_m")]
    Drift,
    /// Time until quiet, s, of pairs that both survived and settled.
    #[serde(rename = "settle_s")]
    Settle,
    /// Gated reward of pairs that are both valid.
    #[serde(rename = "reward_gated")]
    Reward,
}

impl Measure {
    /// All of them.
    pub const ALL: [Measure; 4] = [Measure::Survival, Measure::Drift, Measure::Settle, Measure::Reward];

    fn of(self, result: &EpisodeResult) -> Option<f64> {
        let survived = result.outcome == Outcome::Survived;
        match self {
            Measure::Survival => Some(f64::from(u8::from(survived))),
            Measure::Drift => result.drift_3s_m.filter(|_| survived).map(f64::from),
            Measure::Settle => result.settle_s.filter(|_| survived).map(f64::from),
            Measure::Reward => result.outcome.is_valid().then(|| result.reward_gated.into()),
        }
    }
}

/// An arm less the first arm, on common pushes: the mean of the differences with its 95 % bootstrap interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs, reason = "the names are those of the columns")]
pub struct DifferenceRow {
    pub condition: String,
    pub impulse_n_s: Option<f32>,
    pub arm: String,
    pub less: String,
    pub measure: Measure,
    pub pairs: u32,
    pub difference: f64,
    pub low: f64,
    pub high: f64,
}

impl DifferenceRow {
    fn of(data: &CellData, reference: &CellData, measure: Measure) -> Option<DifferenceRow> {
        let pairs: Vec<(f64, f64)> = data
            .results
            .iter()
            .zip(&reference.results)
            .filter_map(|(ours, theirs)| measure.of(ours).zip(measure.of(theirs)))
            .collect();
        let (ours, theirs): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
        // Both have as many values, so only no pair at all gives nothing.
        let Interval { low, estimate, high } =
            paired_difference(&ours, &theirs, Statistic::Mean, BOOTSTRAP_SEED).ok().flatten()?;
        Some(DifferenceRow {
            condition: data.condition.into(),
            impulse_n_s: data.cell.impulse_n_s,
            arm: data.arm.into(),
            less: reference.arm.into(),
            measure,
            pairs: pairs.len() as u32,
            difference: estimate,
            low,
            high,
        })
    }
}

/// Every arm less the first arm, cell by cell.
pub fn differences(data: &[CellData]) -> Vec<DifferenceRow> {
    let mut rows = vec![];
    for ours in data.iter().filter(|data| data.cell.arm != 0) {
        let same = |other: &&CellData| other.cell == Cell { arm: 0, ..ours.cell };
        if let Some(reference) = data.iter().find(same) {
            rows.extend(Measure::ALL.iter().filter_map(|measure| DifferenceRow::of(ours, reference, *measure)));
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::EnergyJ;

    fn episode(direction_deg: f32, survived: bool, drift_m: f32) -> EpisodeResult {
        EpisodeResult {
            direction_deg: Some(direction_deg),
            impulse_n_s: 24.0,
            seed: 1,
            outcome: if survived { Outcome::Survived } else { Outcome::Fell { at_s: 2.0 } },
            steps: 4,
            steps_per_s: Some(3.0),
            drift_3s_m: Some(drift_m),
            settle_s: survived.then_some(2.0),
            energy_j: EnergyJ::default(),
            reward_paper: 0.0,
            reward_gated: if survived { 0.75 } else { 0.25 },
        }
    }

    fn data(arm: usize, results: Vec<EpisodeResult>) -> CellData<'static> {
        let cell = Cell { arm, condition: 0, impulse_n_s: Some(24.0) };
        CellData { cell, arm: ["ours", "theirs"][arm], condition: "nominal", results }
    }

    #[test]
    fn a_cell_has_the_numbers_worked_out_by_hand() {
        // Wilson, 3 of 4: (0.75 + z²/8 ± z·√(0.75·0.25/4 + z²/64)) / (1 + z²/4) with z = 1.96.
        let results = vec![
            episode(0.0, true, 0.01),
            episode(90.0, true, 0.03),
            episode(180.0, false, 1.0),
            episode(0.0, true, 0.02),
        ];
        let row = CellRow::of(&data(0, results.clone()));
        assert_eq!((row.episodes, row.survived, row.survival), (4, 3, 0.75));
        assert!((row.survival_low - 0.3006).abs() < 1e-4 && (row.survival_high - 0.9544).abs() < 1e-4, "{row:?}");
        assert!((row.drift_3s_m_median.unwrap() - 0.02).abs() < 1e-6, "a fall's drift is none");
        assert_eq!((row.worst_direction_deg, row.worst_direction_survival), (Some(180.0), Some(0.0)));
        assert_eq!((row.reward_gated, row.reward_gated_mean), (Some(0.75), Some(0.625)), "interquartile, and plain");
        let directions = DirectionRow::of(&data(0, results));
        let counts: Vec<_> = directions.iter().map(|row| (row.direction_deg, row.survived, row.episodes)).collect();
        assert_eq!(counts, [(0.0, 2, 2), (90.0, 1, 1), (180.0, 0, 1)]);
    }

    #[test]
    fn differences_are_those_of_pairs() {
        let ours = data(0, vec![episode(0.0, true, 0.01), episode(90.0, true, 0.02), episode(180.0, true, 0.05)]);
        let theirs = data(1, vec![episode(0.0, true, 0.03), episode(90.0, false, 0.9), episode(180.0, true, 0.05)]);
        let rows = differences(&[ours, theirs]);
        let of = |measure| rows.iter().find(|row: &&DifferenceRow| row.measure == measure).unwrap();
        let survival = of(Measure::Survival);
        assert_eq!((survival.pairs, survival.arm.as_str(), survival.less.as_str()), (3, "theirs", "ours"));
        assert!((survival.difference + 1.0 / 3.0).abs() < 1e-12 && survival.low == -1.0 && survival.high == 0.0);
        // The pair of which one fell has no drift: (0.02 + 0) / 2.
        let drift = of(Measure::Drift);
        assert_eq!(drift.pairs, 2);
        assert!((drift.difference - 0.01).abs() < 1e-7, "{drift:?}");
        assert!((of(Measure::Reward).difference + 0.5 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_is_compared_with_what_is_missing() {
        assert_eq!(differences(&[data(1, vec![episode(0.0, true, 0.01)])]), vec![]);
    }
}
