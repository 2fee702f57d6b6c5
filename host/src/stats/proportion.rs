//! Proportions, such as survival, with honest intervals.

use super::Interval;
use serde::{Deserialize, Serialize};

/// The 97.5 % point of the normal distribution, for two-sided 95 % intervals.
const Z_95: f64 = 1.959_963_984_540_054;

/// How many of how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Proportion {
    /// Successes.
    pub count: u32,
    /// Trials.
    pub of: u32,
}

impl Proportion {
    /// The fraction; `None` without trials.
    pub fn fraction(self) -> Option<f64> {
        (self.of > 0).then(|| f64::from(self.count) / f64::from(self.of))
    }
}

/// The Wilson score interval, 95 %. Unlike the textbook interval it stays within 0 and 1 and does not collapse
/// when every trial succeeds: 24 of 24 is 0.86 to 1.
pub fn wilson(proportion: Proportion) -> Option<Interval> {
    let fraction = proportion.fraction()?;
    let n = f64::from(proportion.of);
    let z2 = Z_95 * Z_95;
    let centre = (fraction + z2 / (2.0 * n)) / (1.0 + z2 / n);
    let half = Z_95 / (1.0 + z2 / n) * (fraction * (1.0 - fraction) / n + z2 / (4.0 * n * n)).sqrt();
    // At 0 and n the bounds are 0 and 1 exactly; rounding must not say otherwise.
    let low = if proportion.count == 0 { 0.0 } else { (centre - half).max(0.0) };
    let high = if proportion.count == proportion.of { 1.0 } else { (centre + half).min(1.0) };
    Some(Interval { low, estimate: fraction, high })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn agrees_with_published_values() {
        // Newcombe (1998), table I, method 3.
        for (count, of, low, high) in
            [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)]
        {
            let interval = wilson(Proportion { count, of }).unwrap();
            assert!((interval.low - low).abs() < 5e-5 && (interval.high - high).abs() < 5e-5, "{interval:?}");
        }
        assert_eq!(wilson(Proportion { count: 0, of: 0 }), None);
    }

    proptest! {
        #[test]
        fn contains_the_fraction_and_stays_within_zero_and_one(of in 1_u32..5000, part in 0.0..=1.0) {
            let interval = wilson(Proportion { count: (part * f64::from(of)) as u32, of }).unwrap();
            prop_assert!(0.0 <= interval.low && interval.low <= interval.estimate);
            prop_assert!(interval.estimate <= interval.high && interval.high <= 1.0);
        }
    }
}
