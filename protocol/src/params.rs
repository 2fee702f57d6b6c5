//! The thirteen trained parameters (paper, Table I), each with its unit, limits and rate limit.
//!
//! A [`ParamSet`] always holds a valid set: it can only be made through [`ParamSet::new`], which refuses what is not
//! finite or out of range and says which field and why. On the wire a set travels as [`RawParams`].

use serde::{Deserialize, Serialize};

/// Number of trained parameters.
pub const COUNT: usize = 13;

/// Which pattern generator a parameter belongs to; also the paper's training session (Table I).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash, Serialize, Deserialize)]
pub enum Lpg {
    /// LPG1, linear actuators; session 1.
    Knee,
    /// LPG2, hips; session 2.
    Hip,
    /// LPG3, abductors; session 3.
    Abductor,
}

impl Lpg {
    /// All three, in the order of the training sessions.
    pub const ALL: [Lpg; 3] = [Lpg::Knee, Lpg::Hip, Lpg::Abductor];

    /// Where its parameters stand in a set.
    pub const fn range(self) -> core::ops::Range<usize> {
        match self {
            Lpg::Knee => 0..3,
            Lpg::Hip => 3..8,
            Lpg::Abductor => 8..13,
        }
    }
}

/// What a parameter is and what it may be.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Spec {
    /// The paper's name, e.g. `P1`.
    pub symbol: &'static str,
    /// What it does, in a few words.
    pub meaning: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Smallest accepted value.
    pub min: f32,
    /// Largest accepted value.
    pub max: f32,
    /// Largest change one generation may make: half of the range, so any point is two generations away.
    pub max_change: f32,
    /// Our unit in terms of the paper's dimensionless figures: `Table II value × this` is in [`Spec::unit`].
    pub paper_unit: f32,
    /// The final value of the paper's Table II, in the paper's own figures.
    pub table_ii: f32,
    /// The spread printed with it.
    pub table_ii_spread: f32,
}

const fn spec(
    symbol: &'static str,
    meaning: &'static str,
    unit: &'static str,
    range: (f32, f32),
    paper_unit: f32,
    (table_ii, table_ii_spread): (f32, f32),
) -> Spec {
    Spec {
        symbol,
        meaning,
        unit,
        min: range.0,
        max: range.1,
        max_change: (range.1 - range.0) * 0.5,
        paper_unit,
        table_ii,
        table_ii_spread,
    }
}

/// The parameters in wire order.
///
/// The paper gives no units. Ours are chosen so that its figures land on our robot's scale: one of its speed units is
/// 0.3 m/s (linear) or 1.8 rad/s (rotary: the shared 2.77 is then the top speed), its second coefficient counts the
/// pendulum's natural frequency (3.76 1/s), its third and fourth count 0.04 rad. The robot walks in place with them and
/// falls to most pushes: a start to learn from, not a claim about the original.
pub static SPECS: [Spec; COUNT] = [
    spec("P1", "kick: speed of the first extension", "m/s", (0.02, 0.9), 0.3, (1.81, 0.05)),
    spec("P2", "lift: speed of the retraction", "m/s", (0.2, 0.9), 0.3, (1.45, 0.05)),
    spec("P3", "rest: speed of the second extension", "m/s", (0.2, 0.9), 0.3, (2.09, 0.05)),
    spec("H1", "hip dead band: below it the hip returns to rest", "rad/s", (0.0, 1.0), 1.0, (0.05, 0.01)),
    spec("H2", "hip weight of lean against lean rate", "1/s", (0.0, 8.0), 3.76, (1.13, 0.03)),
    spec("H3", "hip quadratic coefficient", "rad s²/rad²", (0.0, 0.4), 0.04, (2.31, 0.03)),
    spec("H4", "hip linear coefficient", "s", (0.0, 0.6), 0.04, (1.72, 0.05)),
    spec("H5", "hip speed", "rad/s", (0.5, 5.0), 1.8, (1.51, 0.05)),
    spec("V1", "abductor dead band: below it the abductor returns to rest", "rad/s", (0.0, 1.0), 1.0, (0.07, 0.01)),
    spec("V2", "abductor weight of lean against lean rate", "1/s", (0.0, 8.0), 3.76, (1.06, 0.03)),
    spec("V3", "abductor quadratic coefficient", "rad s²/rad²", (0.0, 0.6), 0.04, (2.54, 0.03)),
    spec("V4", "abductor linear coefficient", "s", (0.0, 0.9), 0.04, (1.85, 0.05)),
    spec("V5", "abductor speed", "rad/s", (0.5, 5.0), 1.8, (2.77, 0.05)),
];

/// Thirteen numbers nobody has checked yet: the wire form.
pub type RawParams = [f32; COUNT];

/// Why a set was refused.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum ParamError {
    /// NaN or infinite.
    #[error("{} is not a finite number", symbol(*index))]
    NotFinite {
        /// Position in the set.
        index: u8,
    },
    /// Outside `min..=max`.
    #[error("{} = {value} {} is outside {} to {}", symbol(*index), unit(*index), limits(*index).0, limits(*index).1)]
    OutOfRange {
        /// Position in the set.
        index: u8,
        /// The refused value, in the parameter's unit.
        value: f32,
    },
    /// Changes faster than one generation may.
    #[error("{} would change by {change} {}, at most {} per generation", symbol(*index), unit(*index), max_change(*index))]
    TooFast {
        /// Position in the set.
        index: u8,
        /// The refused change, in the parameter's unit.
        change: f32,
    },
}

// Error values cross the wire, so an index may come from a stranger: these look it up without a panic.
fn at(index: u8) -> Option<&'static Spec> {
    SPECS.get(index as usize)
}
fn symbol(index: u8) -> &'static str {
    at(index).map_or("?", |s| s.symbol)
}
fn unit(index: u8) -> &'static str {
    at(index).map_or("", |s| s.unit)
}
fn limits(index: u8) -> (f32, f32) {
    at(index).map_or((f32::NAN, f32::NAN), |s| (s.min, s.max))
}
fn max_change(index: u8) -> f32 {
    at(index).map_or(f32::NAN, |s| s.max_change)
}

/// A complete, checked set: every value finite and within its limits.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ParamSet(RawParams);

impl ParamSet {
    /// Checks every value; the first that fails is named.
    pub fn new(values: RawParams) -> Result<ParamSet, ParamError> {
        for (index, (value, spec)) in values.iter().zip(&SPECS).enumerate() {
            let index = index as u8;
            if !value.is_finite() {
                return Err(ParamError::NotFinite { index });
            }
            if *value < spec.min || *value > spec.max {
                return Err(ParamError::OutOfRange { index, value: *value });
            }
        }
        Ok(ParamSet(values))
    }

    /// Table II of the paper in our units, limited to our robot's ranges.
    pub fn table_ii() -> ParamSet {
        ParamSet(core::array::from_fn(|i| {
            let spec = &SPECS[i];
            (spec.table_ii * spec.paper_unit).clamp(spec.min, spec.max)
        }))
    }

    /// The values, in the order of [`SPECS`].
    pub fn values(&self) -> &RawParams {
        &self.0
    }

    /// Refuses a successor that changes any value by more than its [`Spec::max_change`].
    pub fn check_change(&self, next: &ParamSet) -> Result<(), ParamError> {
        for (index, ((from, to), spec)) in self.0.iter().zip(&next.0).zip(&SPECS).enumerate() {
            let change = to - from;
            // A few rounding steps of grace: `from + max_change` in f32 must pass.
            if change.abs() > spec.max_change * 1.000_01 {
                return Err(ParamError::TooFast { index: index as u8, change });
            }
        }
        Ok(())
    }

    /// The point nearest to `goal` that one generation may reach from here; repeated, it arrives in two.
    pub fn towards(&self, goal: &ParamSet) -> ParamSet {
        ParamSet(core::array::from_fn(|i| {
            let (from, to, most) = (self.0[i], goal.0[i], SPECS[i].max_change);
            if (to - from).abs() <= most { to } else { from + most.copysign(to - from) }
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_refused_by_its_first_bad_field_and_says_which() {
        let mut values = *ParamSet::table_ii().values();
        values[4] = f32::NAN;
        assert_eq!(ParamSet::new(values), Err(ParamError::NotFinite { index: 4 }));
        values[4] = 9.0;
        let refusal = ParamSet::new(values).expect_err("9.0 is out of range");
        assert_eq!(refusal.to_string(), "H2 = 9 1/s is outside 0 to 8");
    }

    #[test]
    fn table_ii_is_a_valid_set_in_our_units() {
        let set = ParamSet::table_ii();
        assert_eq!(ParamSet::new(*set.values()), Ok(set));
        assert!((set.values()[0] - 0.543).abs() < 1e-6);
        assert!((set.values()[4] - 4.2488).abs() < 1e-4);
    }

    #[test]
    fn any_set_is_two_permitted_generations_away_from_any_other() {
        let low = ParamSet::new(core::array::from_fn(|i| SPECS[i].min)).expect("minimum is valid");
        let high = ParamSet::new(core::array::from_fn(|i| SPECS[i].max)).expect("maximum is valid");
        assert!(matches!(low.check_change(&high), Err(ParamError::TooFast { index: 0, .. })));
        let middle = low.towards(&high);
        assert_eq!(low.check_change(&middle), Ok(()));
        assert_eq!(middle.check_change(&high), Ok(()));
        assert_eq!(middle.towards(&high), high);
    }

    #[test]
    fn an_error_from_a_stranger_prints_without_panicking() {
        assert_eq!(ParamError::NotFinite { index: 200 }.to_string(), "? is not a finite number");
    }
}
