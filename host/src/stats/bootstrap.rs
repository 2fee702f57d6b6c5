//! Bootstrap intervals: percentile method, 95 %, seeded.

use super::{iqm, mean, median, percentile, probability_of_improvement};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Resamples behind every interval.
pub const RESAMPLES: usize = 10_000;

/// An estimate with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower bound.
    pub low: f64,
    /// The estimate itself.
    pub estimate: f64,
    /// Upper bound.
    pub high: f64,
}

impl Interval {
    /// Whether the interval lies on one side of zero: the difference it speaks of is there.
    pub fn excludes_zero(&self) -> bool {
        self.low > 0.0 || self.high < 0.0
    }
}

/// What is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Statistic {
    /// The mean.
    Mean,
    /// The median.
    Median,
    /// The interquartile mean.
    Iqm,
}

impl Statistic {
    /// The statistic of `values`.
    pub fn of(self, values: &[f64]) -> Option<f64> {
        match self {
            Self::Mean => mean(values),
            Self::Median => median(values),
            Self::Iqm => iqm(values),
        }
    }
}

/// Input that cannot be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum BootstrapError {
    /// Pairs need partners.
    #[error("{after} results after and {before} before cannot be paired: evaluate both on the same pushes")]
    Unpaired {
        /// Results after.
        after: usize,
        /// Results before.
        before: usize,
    },
}

/// The interval of a statistic of independent values.
pub fn bootstrap(values: &[f64], statistic: Statistic, seed: u64) -> Option<Interval> {
    resample(statistic.of(values)?, seed, |rng, sample| {
        sample.extend((0..values.len()).map(|_| values[rng.random_range(0..values.len())]));
        statistic.of(sample)
    })
}

/// The interval of a statistic of values in rows and columns (seeds, and the pushes that all of them were judged on): rows
/// are drawn, and columns, and what lies where they cross is taken. A push that is hard is hard for every seed, so drawing
/// pushes anew for each seed would promise too much.
///
/// Rows shorter than the longest, and `None`, are holes.
pub fn bootstrap_crossed(rows: &[Vec<Option<f64>>], statistic: Statistic, seed: u64) -> Option<Interval> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let all: Vec<f64> = rows.iter().flatten().flatten().copied().collect();
    let mut drawn = Vec::with_capacity(columns);
    resample(statistic.of(&all)?, seed, |rng, sample| {
        drawn.clear();
        drawn.extend((0..columns).map(|_| rng.random_range(0..columns)));
        for _ in 0..rows.len() {
            let row = &rows[rng.random_range(0..rows.len())];
            sample.extend(drawn.iter().filter_map(|column| row.get(*column).copied().flatten()));
        }
        statistic.of(sample)
    })
}

/// The interval of a statistic of the differences `after[i] - before[i]`, for results on common pushes.
pub fn paired_difference(
    after: &[f64],
    before: &[f64],
    statistic: Statistic,
    seed: u64,
) -> Result<Option<Interval>, BootstrapError> {
    if after.len() != before.len() {
        return Err(BootstrapError::Unpaired { after: after.len(), before: before.len() });
    }
    let differences: Vec<f64> = after.iter().zip(before).map(|(after, before)| after - before).collect();
    Ok(bootstrap(&differences, statistic, seed))
}

/// The interval of the probability that a value drawn from `ours` exceeds one drawn from `theirs`: both are drawn anew.
pub fn improvement(ours: &[f64], theirs: &[f64], seed: u64) -> Option<Interval> {
    let mut other = Vec::new();
    resample(probability_of_improvement(ours, theirs)?, seed, |rng, sample| {
        sample.extend((0..ours.len()).map(|_| ours[rng.random_range(0..ours.len())]));
        other.clear();
        other.extend((0..theirs.len()).map(|_| theirs[rng.random_range(0..theirs.len())]));
        probability_of_improvement(sample, &other)
    })
}

fn resample(
    estimate: f64,
    seed: u64,
    mut draw: impl FnMut(&mut Pcg64Mcg, &mut Vec<f64>) -> Option<f64>,
) -> Option<Interval> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut sample = Vec::new();
    let estimates: Vec<f64> = (0..RESAMPLES)
        .filter_map(|_| {
            sample.clear();
            draw(&mut rng, &mut sample)
        })
        .collect();
    Some(Interval { low: percentile(&estimates, 2.5)?, estimate, high: percentile(&estimates, 97.5)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform(n: usize, seed: u64) -> Vec<f64> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        (0..n).map(|_| rng.random_range(0.0..1.0)).collect()
    }

    #[test]
    fn the_mean_of_many_has_the_interval_of_theory() {
        // Uniform on 0..1: the standard error of the mean is 1/sqrt(12 n).
        let values = uniform(400, 1);
        let interval = bootstrap(&values, Statistic::Mean, 2).unwrap();
        let half = 1.96 / (12.0_f64 * 400.0).sqrt();
        assert!(((interval.high - interval.low) / (2.0 * half) - 1.0).abs() < 0.1, "{interval:?}");
    }

    #[test]
    fn intervals_cover_the_truth_about_as_often_as_they_say() {
        let covered = (0..100).filter(|&seed| {
            let interval = bootstrap(&uniform(30, seed), Statistic::Mean, seed).unwrap();
            (interval.low..=interval.high).contains(&0.5)
        });
        assert!((86..=100).contains(&covered.count()));
    }

    #[test]
    fn the_same_seed_gives_the_same_interval() {
        let values = uniform(50, 3);
        assert_eq!(bootstrap(&values, Statistic::Iqm, 4), bootstrap(&values, Statistic::Iqm, 4));
        assert_ne!(bootstrap(&values, Statistic::Iqm, 4), bootstrap(&values, Statistic::Iqm, 5));
    }

    #[test]
    fn pairing_finds_a_small_gain_in_great_noise() {
        let before: Vec<f64> = uniform(50, 6).iter().map(|value| value * 10.0).collect();
        let after: Vec<f64> = before.iter().zip(uniform(50, 7)).map(|(before, gain)| before + gain).collect();
        let difference = paired_difference(&after, &before, Statistic::Mean, 8).unwrap().unwrap();
        assert!(difference.excludes_zero() && difference.low > 0.3, "{difference:?}");
        assert!(paired_difference(&after, &before[1..], Statistic::Mean, 8).is_err());
    }

    #[test]
    fn improvement_is_sure_of_what_is_apart_and_of_nothing_else() {
        let (low, high) = (uniform(10, 1), uniform(10, 2).iter().map(|value| value + 2.0).collect::<Vec<_>>());
        assert_eq!(improvement(&high, &low, 3), Some(Interval { low: 1.0, estimate: 1.0, high: 1.0 }));
        let same = improvement(&low, &low, 3).unwrap();
        assert!(same.estimate == 0.5 && same.low < 0.35 && same.high > 0.65, "{same:?}");
        assert_eq!(improvement(&low, &[], 3), None);
    }

    #[test]
    fn seeds_or_pushes_that_disagree_widen_the_interval() {
        let rows = |offset: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<Option<f64>>> {
            let row = |row: usize| uniform(50, row as u64).into_iter().enumerate();
            (0..5).map(|seed| row(seed).map(|(push, value)| Some(value + offset(seed, push))).collect()).collect()
        };
        let width = |interval: Option<Interval>| interval.map(|interval| interval.high - interval.low).unwrap();
        for rows in [rows(&|seed, _| seed as f64), rows(&|_, push| (push % 7) as f64)] {
            let all: Vec<f64> = rows.iter().flatten().flatten().copied().collect();
            let crossed = width(bootstrap_crossed(&rows, Statistic::Mean, 9));
            assert!(crossed > 1.8 * width(bootstrap(&all, Statistic::Mean, 9)), "{crossed}");
        }
        assert_eq!(bootstrap_crossed(&[vec![None], vec![]], Statistic::Mean, 9), None);
    }
}
