//! What LPG1 reads from the IMU: Factor and Step, and where and how fast the trunk falls.
//!
//! All of it follows from one motion message and the rules. Those messages come at 1 kHz at most, so it is worked out when
//! one comes in, and never in a tick.

use sarah_protocol::bus::Motion;
use sarah_protocol::fixed::Q16;

use super::arithmetic::longer;
use super::factor::{self, Divider, FACTOR_THRESHOLD_Q30};
use super::rules::KNEE;

/// One motion message in the eyes of LPG1.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fall {
    /// Factor (eq. 1).
    pub factor: Q16,
    /// Step (eq. 2) within the limits, m: the height of a cycle that starts now. 0 if none may.
    pub step: Q16,
    /// Factor is above the threshold and the feet will not hold the robot: [`super::rules::KneeRules::start_xi`].
    pub starts: bool,
    /// The fall goes to the left.
    pub left: bool,
    /// |ξ| is above [`super::rules::KneeRules::chain_xi`].
    pub chains: bool,
    /// Sagittal ξ is above [`super::rules::KneeRules::chain_sagittal_xi`].
    pub sagittal: bool,
    /// A foot that alone carries the robot may be lifted: [`super::rules::KneeRules::lift_xi`].
    pub lifts: bool,
    /// |ξ| is above [`super::rules::KneeRules::fall_xi`].
    pub falls: bool,
    /// The trunk turns slower than [`super::rules::KneeRules::calm`].
    pub calm: bool,
}

impl Fall {
    /// From a motion message.
    pub fn of<D: Divider>(divider: &D, motion: &Motion) -> Fall {
        let ([rate_x, rate_y], [slow_x, slow_y], [lean_x, lean_y]) = (motion.rate, motion.slow_rate, motion.lean);
        // ξ along each axis: where the fall is heading; and where it will be when what acts now has acted.
        let (x, y) = (rate_x + KNEE.pendulum.times(lean_x), rate_y + KNEE.pendulum.times(lean_y));
        let (x_ahead, y_ahead) = (x + KNEE.ahead.times(rate_x - slow_x), y + KNEE.ahead.times(rate_y - slow_y));
        let beyond = |[sagittal, lateral]: [Q16; 2]| x_ahead.abs() > sagittal || y_ahead.abs() > lateral;
        let factor = factor::factor(divider, motion.acceleration, motion.rotation);
        let starts = factor > FACTOR_THRESHOLD_Q30 && beyond(KNEE.start_xi);
        let chains = longer(x, y, KNEE.chain_xi);
        let mut step = Q16::ZERO;
        if starts || chains {
            let (shortest, longest) = KNEE.step;
            step = factor::q30_to_q16(factor::step(divider, factor)).max(shortest).min(longest);
        }
        Fall {
            factor: factor::q30_to_q16(factor),
            step,
            starts,
            left: y > Q16::ZERO,
            chains,
            sagittal: x.abs() > KNEE.chain_sagittal_xi,
            lifts: beyond(KNEE.lift_xi),
            falls: longer(x, y, KNEE.fall_xi),
            calm: motion.rotation < KNEE.calm,
        }
    }
}
