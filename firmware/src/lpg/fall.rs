//! What LPG1 reads from the IMU: Factor and Step, and where and how fast the trunk falls.
//!
//! All of it follows from one motion message and the rules. Those messages come at 1 kHz at most, so it is worked out when
//! one comes in, and never in a tick.

use sarah_protocol::bus::Motion;
use sarah_protocol::fixed::Q16;

use super::factor::{self, Divider, FACTOR_THRESHOLD_Q30};
use super::longer;
use super::rules::KneeRules;

/// One motion message in the eyes of LPG1.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fall {
    /// Factor (eq. 1).
    pub factor: Q16,
    /// Step (eq. 2) within the limits, m: the height of a cycle that starts now. 0 if none may.
    pub step: Q16,
    /// Factor is above the threshold.
    pub starts: bool,
    /// The fall goes to the left.
    pub left: bool,
    /// ξ is above [`KneeRules::chain_xi`].
    pub chains: bool,
    /// ξ is above [`KneeRules::brake_xi`].
    pub brakes: bool,
}

impl Fall {
    /// From a motion message.
    pub fn of<D: Divider>(divider: &D, rules: &KneeRules, motion: &Motion) -> Fall {
        let ([rate_x, rate_y], [lean_x, lean_y]) = (motion.rate, motion.lean);
        // ξ along each axis: where the fall is heading, rad/s.
        let x = rate_x + rules.pendulum.times(lean_x);
        let y = rate_y + rules.pendulum.times(lean_y);
        let factor = factor::factor(divider, motion.acceleration, motion.rotation);
        let (starts, chains) = (factor > FACTOR_THRESHOLD_Q30, longer(x, y, rules.chain_xi));
        let mut step = Q16::ZERO;
        if starts || chains {
            let (shortest, longest) = rules.step;
            step = factor::q30_to_q16(factor::step(divider, factor)).max(shortest).min(longest);
        }
        Fall {
            factor: factor::q30_to_q16(factor),
            step,
            starts,
            left: y > Q16::ZERO,
            chains,
            brakes: longer(x, y, rules.brake_xi),
        }
    }
}
