//! What LPG1 reads from the IMU: Factor, and where and how fast the trunk falls.
//!
//! All of it follows from the newest motion message and the rules alone. Those come at 1 kHz at most, so it is worked out
//! when one arrives and not in every tick.

use sarah_protocol::bus::Motion;
use sarah_protocol::fixed::Q16;

use super::factor::{self, Divider};
use super::longer;
use super::rules::KneeRules;

/// One motion message in the eyes of LPG1.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fall {
    /// Factor (eq. 1), Q30.
    pub factor_q30: u32,
    /// The fall goes to the left.
    pub left: bool,
    /// ξ is above [`KneeRules::chain_xi`].
    pub chains: bool,
    /// ξ is above [`KneeRules::brake_xi`].
    pub brakes: bool,
}

impl Fall {
    /// From a motion message.
    #[inline(never)]
    pub fn of<D: Divider>(divider: &D, rules: &KneeRules, motion: &Motion) -> Fall {
        let ([rate_x, rate_y], [lean_x, lean_y]) = (motion.rate, motion.lean);
        // ξ along each axis: where the fall is heading, rad/s.
        let x = rate_x + rules.pendulum.times(lean_x);
        let y = rate_y + rules.pendulum.times(lean_y);
        Fall {
            factor_q30: factor::factor(divider, motion.acceleration, motion.rotation),
            left: y > Q16::ZERO,
            chains: longer(x, y, rules.chain_xi),
            brakes: longer(x, y, rules.brake_xi),
        }
    }

    /// Factor (eq. 1).
    pub fn factor(&self) -> Q16 {
        factor::q30_to_q16(self.factor_q30)
    }
}
