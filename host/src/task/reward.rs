//! The reward of one decision (paper, eq. 5), as printed and gated.
//!
//! As printed, `(1−|x|)(1−|y|)·z·2^−(f−3)²`, a robot that stands quietly earns 2⁻⁹ of one that steps without need. The
//! gated form asks for three steps per second only while the robot is disturbed:
//! `(1−|x|)(1−|y|)·z·[a·2^−(f−3)² + (1−a)]`. Every result says which one it is.

use serde::{Deserialize, Serialize};

/// Step frequency the paper trains for, 1/s.
pub const IDEAL_STEPS_PER_S: f32 = 3.0;
/// Trunk rotation above which a tick counts as disturbed, rad/s.
pub const DISTURBED_RAD_S: f32 = 0.19;
/// Step frequency is counted over this long, s.
pub const FREQUENCY_WINDOW_S: f32 = 2.0;

/// Which form is trained on.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RewardForm {
    /// Eq. 5 as printed.
    Paper,
    /// Eq. 5 while disturbed, standing still otherwise.
    #[default]
    Gated,
}

/// What a decision did, as far as the reward looks at it.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Deed {
    /// Trunk displacement forward and left from the episode's origin, m.
    pub displacement_m: [f32; 2],
    /// Trunk height over standing height.
    pub height: f32,
    /// Steps per second over the last [`FREQUENCY_WINDOW_S`].
    pub steps_per_s: f32,
    /// Fraction of the decision's ticks that were disturbed: stepping, or turning faster than [`DISTURBED_RAD_S`].
    pub disturbed: f32,
}

impl Deed {
    /// The reward in `[0, ~1]`.
    pub fn reward(&self, form: RewardForm) -> f32 {
        let [x, y] = self.displacement_m.map(|d| (1.0 - d.abs()).max(0.0));
        let error = self.steps_per_s - IDEAL_STEPS_PER_S;
        let frequency = (-error * error).exp2();
        let stepping = match form {
            RewardForm::Paper => frequency,
            RewardForm::Gated => self.disturbed * frequency + (1.0 - self.disturbed),
        };
        x * y * self.height.max(0.0) * stepping
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDEAL: Deed = Deed { displacement_m: [0.0; 2], height: 1.0, steps_per_s: 3.0, disturbed: 1.0 };

    #[test]
    fn three_steps_a_second_on_the_spot_earn_one_in_both_forms() {
        for form in [RewardForm::Paper, RewardForm::Gated] {
            assert_eq!(IDEAL.reward(form), 1.0);
        }
    }

    #[test]
    fn standing_quietly_earns_nearly_nothing_as_printed_and_one_when_gated() {
        let quiet = Deed { steps_per_s: 0.0, disturbed: 0.0, ..IDEAL };
        assert_eq!(quiet.reward(RewardForm::Paper), 1.0 / 512.0);
        assert_eq!(quiet.reward(RewardForm::Gated), 1.0);
    }

    #[test]
    fn displacement_costs_in_proportion_and_never_pays() {
        let away = Deed { displacement_m: [0.25, -0.5], ..IDEAL };
        assert!((away.reward(RewardForm::Paper) - 0.375).abs() < 1e-6);
        let far = Deed { displacement_m: [-1.5, -1.5], ..IDEAL };
        assert_eq!(far.reward(RewardForm::Paper), 0.0);
    }
}
