//! The hip and the abductor node: LPG2 and LPG3, following the knee's flags.

use sarah_protocol::bus::{Gait, GaitEvent, Message, NodeId, limits};
use sarah_protocol::fixed::Q16;
use sarah_protocol::params::{Lpg, ParamSet};

use super::link::{NodeConfig, NodeLink, View};
use super::{Node, Sensors};
use crate::lpg::Drive;
use crate::lpg::rules::SwingRules;
use crate::lpg::swing::{Swing, SwingParams};

/// LPG2 or LPG3 on the bus.
#[derive(Clone, PartialEq, Debug)]
pub struct SwingNode {
    link: NodeLink,
    lpg: Swing,
    params: SwingParams,
    cycle: u32,
    /// The knee names a generation this node does not hold.
    missing: bool,
}

impl SwingNode {
    /// Braked and idle.
    pub fn new(id: NodeId, config: NodeConfig, rules: SwingRules) -> Self {
        SwingNode {
            link: NodeLink::new(id, config),
            lpg: Swing::new(rules),
            params: params_of(id, &config.default),
            cycle: 0,
            missing: false,
        }
    }

    /// The pattern generator, to look at.
    pub fn lpg(&self) -> &Swing {
        &self.lpg
    }

    /// Generation in force.
    pub fn generation(&self) -> u32 {
        self.link.applied().0
    }

    fn on_gait(&mut self, gait: &Gait) {
        self.cycle = gait.cycle;
        let boundary = matches!(gait.event, GaitEvent::CycleStart | GaitEvent::Boundary | GaitEvent::Beat);
        if boundary && gait.generation != self.link.applied().0 {
            self.missing = !self.link.swap_to(gait.generation);
            self.params = params_of(self.link.id(), self.link.applied().1);
        } else if boundary {
            self.missing = false;
        }
        // Legs that follow different generations would be a mixture nobody tested: stay braked for this cycle.
        if self.missing {
            self.lpg.abort();
        } else {
            self.lpg.on_gait(gait.event, gait.swing, self.link.motion(), &self.params);
        }
    }
}

impl Node for SwingNode {
    fn on_message(&mut self, message: &Message) -> Option<Message> {
        if let Message::Gait(gait) = message {
            self.on_gait(gait);
        }
        self.link.on_message(message)
    }

    fn control(&mut self, dt_us: u32, sensors: &Sensors, say: &mut impl FnMut(Message)) -> [Drive; 2] {
        let position = self.link.begin(dt_us, sensors);
        if self.missing {
            self.link.limit(limits::GENERATION_MISSING);
        }
        // Without a coordinator the knee still finishes its cycle, but a swing leg has no fresh lean to act on.
        if self.link.must_brake() || !self.link.fresh() {
            self.lpg.abort();
        }
        let (mut drive, timed_out) = self.lpg.tick(dt_us, position, &self.params);
        if timed_out {
            self.link.limit(limits::TIMED_OUT);
        }
        self.link.stop_at_ends(&mut drive);
        if self.link.status_is_due() {
            let view = View { phase: self.lpg.phase() as u8, cycle: self.cycle, ..View::default() };
            say(self.link.status(sensors, view));
        }
        drive
    }
}

fn params_of(id: NodeId, set: &ParamSet) -> SwingParams {
    let lpg = match id {
        NodeId::Abductor => Lpg::Abductor,
        NodeId::Hip | NodeId::Knee => Lpg::Hip,
    };
    // Both ranges hold five values, so the default is never used.
    SwingParams::of(set, lpg).unwrap_or(SwingParams {
        dead_band: Q16::MAX,
        lean_weight: Q16::ZERO,
        quadratic: Q16::ZERO,
        linear: Q16::ZERO,
        speed: Q16::ZERO,
    })
}

/// Soft end stop and plausibility bound of the hips, rad.
pub const HIP_SWING: (Q16, Q16) = (Q16::lit(0.78), Q16::lit(1.2));
/// Soft end stop and plausibility bound of the abductors, rad.
pub const ABDUCTOR_SWING: (Q16, Q16) = (Q16::lit(0.58), Q16::lit(1.0));
