//! Means and order statistics.

/// The arithmetic mean.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The `percent`-th percentile (0 to 100) by linear interpolation between closest ranks, at rank
/// `percent/100·(n-1)`: Hyndman and Fan's type 7, the default of NumPy and R.
pub fn percentile(values: &[f64], percent: f64) -> Option<f64> {
    let sorted = sorted(values);
    let last = sorted.len().checked_sub(1)?;
    let rank = percent.clamp(0.0, 100.0) / 100.0 * last as f64;
    let below = rank.floor() as usize;
    let (low, high) = (sorted[below], sorted[(below + 1).min(last)]);
    Some(low + (high - low) * (rank - below as f64))
}

/// The 50th [`percentile`].
pub fn median(values: &[f64]) -> Option<f64> {
    percentile(values, 50.0)
}

/// The interquartile mean: the mean of what is left when the lowest and the highest quarter (rounded down) are
/// taken away. Robust like the median, but it uses half of the data instead of one or two values (Agarwal et al.,
/// 2021).
pub fn iqm(values: &[f64]) -> Option<f64> {
    let sorted = sorted(values);
    let cut = sorted.len() / 4;
    mean(&sorted[cut..sorted.len() - cut])
}

/// How probable it is that a value drawn from `ours` exceeds one drawn from `theirs`, ties counted half.
pub fn probability_of_improvement(ours: &[f64], theirs: &[f64]) -> Option<f64> {
    let pairs = ours.len() * theirs.len();
    let wins: f64 = ours
        .iter()
        .flat_map(|ours| theirs.iter().map(move |theirs| ours.partial_cmp(theirs)))
        .map(|order| match order {
            Some(std::cmp::Ordering::Greater) => 1.0,
            Some(std::cmp::Ordering::Equal) => 0.5,
            _ => 0.0,
        })
        .sum();
    (pairs > 0).then(|| wins / pairs as f64)
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn agree_with_numpy_and_scipy() {
        let values = [3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0, 5.0, 3.0];
        // numpy.percentile(values, [5, 25, 50, 95]); scipy.stats.trim_mean(values, 0.25)
        assert_eq!(percentile(&values, 5.0), Some(1.0));
        assert_eq!(percentile(&values, 25.0), Some(2.25));
        assert_eq!(median(&values), Some(3.5));
        assert!((percentile(&values, 95.0).unwrap() - 7.65).abs() < 1e-12);
        assert!((iqm(&values).unwrap() - 22.0 / 6.0).abs() < 1e-12);
        assert_eq!(probability_of_improvement(&[1.0, 2.0], &[1.0, 0.0]), Some(0.875));
    }

    #[test]
    fn nothing_has_no_statistics() {
        assert_eq!([mean(&[]), median(&[]), iqm(&[]), probability_of_improvement(&[], &[1.0])], [None; 4]);
    }

    proptest! {
        #[test]
        fn lie_within_the_data(values in prop::collection::vec(-1e6_f64..1e6, 1..50), percent in 0.0..100.0) {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min) - 1e-6;
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 1e-6;
            for value in [mean(&values), iqm(&values), percentile(&values, percent)] {
                prop_assert!((low..=high).contains(&value.unwrap()));
            }
        }

        #[test]
        fn improvement_and_its_converse_make_one(
            a in prop::collection::vec(-3..3, 1..20), b in prop::collection::vec(-3..3, 1..20)
        ) {
            let [a, b] = [a, b].map(|values| values.into_iter().map(f64::from).collect::<Vec<_>>());
            let sum = probability_of_improvement(&a, &b).unwrap() + probability_of_improvement(&b, &a).unwrap();
            prop_assert!((sum - 1.0).abs() < 1e-12);
        }
    }
}
