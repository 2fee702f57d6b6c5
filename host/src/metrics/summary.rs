//! Many episodes in one JSON object.

use super::{EpisodeResult, Outcome};
use crate::stats::{Proportion, iqm, median, percentile, wilson};
use crate::task::odometry::audit::AuditSummary;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A median.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Median {
    /// 50th percentile.
    pub median: Option<f64>,
}

/// A median and how bad it gets.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct MedianP95 {
    /// 50th percentile.
    pub median: Option<f64>,
    /// 95th percentile.
    pub p95: Option<f64>,
}

/// A median between its extremes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct MedianP5P95 {
    /// 50th percentile.
    pub median: Option<f64>,
    /// 5th percentile.
    pub p5: Option<f64>,
    /// 95th percentile.
    pub p95: Option<f64>,
}

/// Estimated time on one charge, h.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Autonomy {
    /// Recovering from pushes as often as here.
    pub mixed_h: f64,
    /// Standing, nobody pushing.
    pub standby_h: f64,
}

/// What a controller did in a scenario.
///
/// `survival` is survivors over **all** episodes: an episode that the simulation spoilt proves nothing, so it is not
/// counted as survived; `invalid` says how many there were. Steps, drift, settling and energy are those of survivors
/// (a fall ends early and would look cheap); rewards are those of all valid episodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Who balanced: `trained`, `default`, `braked`, `cma-es`…
    pub controller: String,
    /// In which scenario.
    pub scenario: String,
    /// Episodes run.
    pub episodes: u32,
    /// Episodes survived.
    pub survived: u32,
    /// Survived over run; 0 if none were run.
    pub survival: f64,
    /// 95 % Wilson interval of `survival`.
    pub survival_ci: [f64; 2],
    /// Step frequency while recovering, 1/s.
    pub steps_per_s: MedianP5P95,
    /// Trunk drift within 3 s of the push, m.
    pub drift_3s_m: MedianP95,
    /// Time until quiet, s. Survivors that never became quiet are left out here and counted in `never_settled`.
    pub settle_s: MedianP95,
    /// Energy per episode, J.
    pub energy_j: Median,
    /// The direction with the lowest survival, degrees; among equals the one with the greatest median drift.
    pub worst_direction_deg: Option<f32>,
    /// Survivors that never became quiet.
    pub never_settled: u32,
    /// Episodes with numbers that are not finite or a solver blow-up.
    pub invalid: u32,
    /// Interquartile mean of eq. 5 as printed.
    pub reward_paper: Option<f64>,
    /// Interquartile mean of the gated form.
    pub reward_gated: Option<f64>,
    /// Estimated time on one charge, where known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub autonomy: Option<Autonomy>,
    /// How far odometry was from the truth, where that was asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub odometry_error_m: Option<AuditSummary>,
}

impl Summary {
    /// Summarises episodes.
    pub fn new(controller: &str, scenario: &str, results: &[EpisodeResult]) -> Self {
        let valid: Vec<&EpisodeResult> = results.iter().filter(|result| result.outcome.is_valid()).collect();
        let survivors: Vec<&EpisodeResult> =
            valid.iter().copied().filter(|result| result.outcome == Outcome::Survived).collect();
        let of = |what: fn(&EpisodeResult) -> Option<f32>| -> Vec<f64> {
            survivors.iter().filter_map(|result| what(result)).map(f64::from).collect()
        };
        let steps = of(|result| result.steps_per_s);
        let drift = of(|result| result.drift_3s_m);
        let settle = of(|result| result.settle_s);
        let energy = of(|result| Some(result.energy_j.total()));
        let reward =
            |what: fn(&EpisodeResult) -> f32| iqm(&valid.iter().map(|result| what(result).into()).collect::<Vec<_>>());
        let survival = Proportion { count: survivors.len() as u32, of: results.len() as u32 };
        Self {
            controller: controller.into(),
            scenario: scenario.into(),
            episodes: survival.of,
            survived: survival.count,
            survival: survival.fraction().unwrap_or(0.0),
            survival_ci: wilson(survival).map_or([0.0, 1.0], |interval| [interval.low, interval.high]),
            steps_per_s: MedianP5P95 {
                median: median(&steps),
                p5: percentile(&steps, 5.0),
                p95: percentile(&steps, 95.0),
            },
            drift_3s_m: MedianP95 { median: median(&drift), p95: percentile(&drift, 95.0) },
            settle_s: MedianP95 { median: median(&settle), p95: percentile(&settle, 95.0) },
            energy_j: Median { median: median(&energy) },
            worst_direction_deg: worst(&by_direction(results)),
            never_settled: (survivors.len() - settle.len()) as u32,
            invalid: (results.len() - valid.len()) as u32,
            reward_paper: reward(|result| result.reward_paper),
            reward_gated: reward(|result| result.reward_gated),
            autonomy: None,
            odometry_error_m: None,
        }
    }
}

/// Survival in one direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DirectionSurvival {
    /// Direction of the push, degrees from forward to the left.
    pub direction_deg: f32,
    /// How often it survived.
    pub survival: Proportion,
    /// Median drift of the survivors, m.
    pub drift_3s_m: Option<f64>,
}

/// Survival by direction, in order of the angle. Episodes without a direction are left out.
pub fn by_direction(results: &[EpisodeResult]) -> Vec<DirectionSurvival> {
    let mut directions: BTreeMap<i64, Vec<&EpisodeResult>> = BTreeMap::new();
    for result in results {
        if let Some(direction) = result.direction_deg.filter(|direction| direction.is_finite()) {
            // Directions that differ by rounding are the same.
            directions.entry((f64::from(direction) * 1000.0).round() as i64).or_default().push(result);
        }
    }
    directions
        .into_iter()
        .map(|(key, results)| {
            let survivors = results.iter().filter(|result| result.outcome == Outcome::Survived);
            let drift: Vec<f64> = survivors.clone().filter_map(|result| result.drift_3s_m).map(f64::from).collect();
            DirectionSurvival {
                direction_deg: (key as f64 / 1000.0) as f32,
                survival: Proportion { count: survivors.count() as u32, of: results.len() as u32 },
                drift_3s_m: median(&drift),
            }
        })
        .collect()
}

fn worst(directions: &[DirectionSurvival]) -> Option<f32> {
    let badness = |direction: &DirectionSurvival| {
        (1.0 - direction.survival.fraction().unwrap_or(0.0), direction.drift_3s_m.unwrap_or(0.0))
    };
    directions
        .iter()
        .max_by(|a, b| {
            let (a, b) = (badness(a), badness(b));
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
        })
        .map(|direction| direction.direction_deg)
}

#[cfg(test)]
mod tests {
    use super::super::EnergyJ;
    use super::*;

    fn result(direction_deg: f32, outcome: Outcome, drift_3s_m: f32) -> EpisodeResult {
        EpisodeResult {
            direction_deg: Some(direction_deg),
            impulse_n_s: 18.0,
            seed: 7,
            outcome,
            steps: 6,
            steps_per_s: Some(3.0),
            drift_3s_m: Some(drift_3s_m),
            settle_s: Some(1.5),
            energy_j: EnergyJ { actuators: 80.0, brakes: 15.0, compute: 5.0 },
            reward_paper: 0.25,
            reward_gated: 0.5,
        }
    }

    #[test]
    fn the_json_has_the_promised_keys_in_order() {
        let json = serde_json::to_string(&Summary::new("braked", "push-grid", &[])).unwrap();
        let keys = [
            "controller",
            "scenario",
            "episodes",
            "survived",
            "survival",
            "survival_ci",
            "steps_per_s",
            "drift_3s_m",
            "settle_s",
            "energy_j",
            "worst_direction_deg",
        ];
        let places: Vec<_> = keys.iter().map(|key| json.find(&format!("\"{key}\":")).expect(key)).collect();
        assert!(places.is_sorted(), "{json}");
        assert!(json.contains(r#""steps_per_s":{"median":null,"p5":null,"p95":null}"#), "{json}");
        assert!(json.contains(r#""energy_j":{"median":null},"#), "{json}");
    }

    #[test]
    fn spoilt_episodes_are_counted_but_never_averaged_in_nor_survived() {
        let good = result(0.0, Outcome::Survived, 0.02);
        let spoilt = EpisodeResult {
            outcome: Outcome::Exploded { at_s: 2.0 },
            drift_3s_m: Some(f32::INFINITY),
            reward_paper: f32::NAN,
            reward_gated: f32::NAN,
            ..good.clone()
        };
        let summary = Summary::new("trained", "push-grid", &[good.clone(), spoilt, good]);
        assert_eq!((summary.episodes, summary.survived, summary.invalid), (3, 2, 1));
        assert_eq!(summary.survival, 2.0 / 3.0);
        assert_eq!(summary.reward_gated, Some(0.5));
        assert!((summary.drift_3s_m.p95.unwrap() - 0.02).abs() < 1e-6);
        assert_eq!(summary.energy_j.median, Some(100.0));
    }

    #[test]
    fn the_worst_direction_falls_most_often_then_drifts_most() {
        let fell = Outcome::Fell { at_s: 3.0 };
        let mut results = vec![
            result(0.0, Outcome::Survived, 0.02),
            result(90.0, Outcome::Survived, 0.05),
            result(180.0, Outcome::Survived, 0.03),
        ];
        assert_eq!(Summary::new("", "", &results).worst_direction_deg, Some(90.0));
        results.push(result(180.0, fell, 0.5));
        let summary = Summary::new("", "", &results);
        assert_eq!(summary.worst_direction_deg, Some(180.0));
        assert!(summary.drift_3s_m.p95.unwrap() < 0.06, "the drift of a fall is no drift");
    }
}
