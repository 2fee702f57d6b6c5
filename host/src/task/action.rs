//! From an action in [-1, 1] to the parameters of one training session, and back.

use std::ops::Range;

use sarah_protocol::params::{Lpg, ParamSet, SPECS};
use serde::{Deserialize, Serialize};

/// Which parameters a session trains.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scope {
    /// LPG1: P1 to P3.
    Knee,
    /// LPG2: H1 to H5.
    Hip,
    /// LPG3: V1 to V5.
    Abductor,
    /// All thirteen at once.
    All,
}

impl Scope {
    /// The paper's sessions (Table I), in their order.
    pub const SESSIONS: [Scope; 3] = [Scope::Knee, Scope::Hip, Scope::Abductor];

    /// Where its parameters stand in a set.
    pub const fn range(self) -> Range<usize> {
        match self {
            Scope::Knee => Lpg::Knee.range(),
            Scope::Hip => Lpg::Hip.range(),
            Scope::Abductor => Lpg::Abductor.range(),
            Scope::All => 0..SPECS.len(),
        }
    }

    /// Its name in files and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Scope::Knee => "knee",
            Scope::Hip => "hip",
            Scope::Abductor => "abductor",
            Scope::All => "all",
        }
    }
}

/// `base` with the session's parameters set by `action`: −1 is each one's minimum, +1 its maximum. What is not finite
/// counts as 0, what is beyond [-1, 1] as its nearer end.
pub fn decode(base: &ParamSet, scope: Scope, action: &[f32]) -> ParamSet {
    let mut values = *base.values();
    for ((value, spec), u) in values[scope.range()].iter_mut().zip(&SPECS[scope.range()]).zip(action) {
        let u = if u.is_finite() { u.clamp(-1.0, 1.0) } else { 0.0 };
        *value = (spec.min + (u + 1.0) * 0.5 * (spec.max - spec.min)).clamp(spec.min, spec.max);
    }
    // Every value is clamped into its range, so the set is valid.
    ParamSet::new(values).unwrap_or(*base)
}

/// The action that leads to the session's parameters in `set`.
pub fn encode(set: &ParamSet, scope: Scope) -> Vec<f32> {
    let values = &set.values()[scope.range()];
    SPECS[scope.range()]
        .iter()
        .zip(values)
        .map(|(spec, value)| ((value - spec.min) / (spec.max - spec.min) * 2.0 - 1.0).clamp(-1.0, 1.0))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoding_and_decoding_return_the_same_set() {
        let set = ParamSet::table_ii();
        for scope in Scope::SESSIONS.into_iter().chain([Scope::All]) {
            let back = decode(&sarah_firmware::default_params(), scope, &encode(&set, scope));
            for (a, b) in back.values()[scope.range()].iter().zip(&set.values()[scope.range()]) {
                assert!((a - b).abs() < 1e-5, "{a} {b}");
            }
        }
    }

    #[test]
    fn only_the_session_s_parameters_change_and_none_leaves_its_range() {
        let base = ParamSet::table_ii();
        for wild in [f32::NAN, f32::INFINITY, -7.0] {
            let set = decode(&base, Scope::Hip, &[wild; 5]);
            assert_eq!(set.values()[..3], base.values()[..3]);
            assert_eq!(set.values()[8..], base.values()[8..]);
            assert!(ParamSet::new(*set.values()).is_ok());
        }
    }
}
