//! From an action in [-1, 1] to the parameters of one training session, and back.

use sarah_protocol::params::{Lpg, ParamSet, SPECS};

/// Number of actions of a session.
pub fn len(lpg: Lpg) -> usize {
    lpg.range().len()
}

/// `base` with the session's parameters set by `action`: −1 is each one's minimum, +1 its maximum. What is not finite
/// counts as 0, what is beyond [-1, 1] as its nearer end.
pub fn decode(base: &ParamSet, lpg: Lpg, action: &[f32]) -> ParamSet {
    let values: Vec<f32> = SPECS[lpg.range()]
        .iter()
        .zip(action)
        .map(|(spec, u)| {
            let u = if u.is_finite() { u.clamp(-1.0, 1.0) } else { 0.0 };
            (spec.min + (u + 1.0) * 0.5 * (spec.max - spec.min)).clamp(spec.min, spec.max)
        })
        .collect();
    // Every value is clamped into its range, so the set is valid.
    base.with(lpg, &values).unwrap_or(*base)
}

/// The action that leads to the session's parameters in `set`.
pub fn encode(set: &ParamSet, lpg: Lpg) -> Vec<f32> {
    let values = &set.values()[lpg.range()];
    SPECS[lpg.range()]
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
        for lpg in Lpg::ALL {
            let back = decode(&sarah_firmware::default_params(), lpg, &encode(&set, lpg));
            for (a, b) in back.values()[lpg.range()].iter().zip(&set.values()[lpg.range()]) {
                assert!((a - b).abs() < 1e-5, "{a} {b}");
            }
        }
    }

    #[test]
    fn only_the_session_s_parameters_change_and_none_leaves_its_range() {
        let base = ParamSet::table_ii();
        for wild in [f32::NAN, f32::INFINITY, -7.0] {
            let set = decode(&base, Lpg::Hip, &[wild; 5]);
            assert_eq!(set.values()[..3], base.values()[..3]);
            assert_eq!(set.values()[8..], base.values()[8..]);
            assert!(ParamSet::new(*set.values()).is_ok());
        }
    }
}
