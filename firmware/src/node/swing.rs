//! The hip and the abductor node: LPG2 and LPG3, following the knee's flags.

use sarah_protocol::bus::{Gait, GaitEvent, Message, Motion, NodeId, limits};
use sarah_protocol::fixed::Q16;
use sarah_protocol::params::{Lpg, ParamSet};

use super::heard::{Ear, Heard};
use super::link::{NodeConfig, NodeLink, UNHEARD, View};
use super::{Controller, Sensors};
use crate::lpg::Drive;
use crate::lpg::rules::{self, SwingRules};
use crate::lpg::swing::{Sway, Swing, SwingParams};

/// What LPG2 or LPG3 makes of the bus.
#[derive(Clone, PartialEq, Debug)]
pub struct SwingEar {
    id: NodeId,
    lpg: Lpg,
    rules: SwingRules,
}

impl SwingEar {
    /// LPG2.
    pub const HIP: SwingEar = SwingEar { id: NodeId::Hip, lpg: Lpg::Hip, rules: rules::HIP };
    /// LPG3.
    pub const ABDUCTOR: SwingEar = SwingEar { id: NodeId::Abductor, lpg: Lpg::Abductor, rules: rules::ABDUCTOR };
}

impl Ear for SwingEar {
    type Motion = Sway;
    type Params = SwingParams;

    fn motion(&self, motion: &Motion) -> Sway {
        Sway::of(&self.rules, motion)
    }

    fn params(&self, set: &ParamSet) -> SwingParams {
        // Both ranges hold five values, so the default is never used.
        SwingParams::of(set, self.lpg).unwrap_or(SwingParams {
            dead_band: Q16::MAX,
            lean_weight: Q16::ZERO,
            quadratic: Q16::ZERO,
            linear: Q16::ZERO,
            speed: Q16::ZERO,
        })
    }
}

/// LPG2 or LPG3 on the bus.
#[derive(Clone, PartialEq, Debug)]
pub struct SwingNode {
    link: NodeLink<SwingParams>,
    lpg: Swing,
    /// Of the newest motion message.
    sway: Sway,
    cycle: u32,
    /// The knee names a generation this node does not hold.
    missing: bool,
}

impl SwingNode {
    /// Braked and idle; hears with `ear`.
    pub fn new(config: NodeConfig, ear: &SwingEar) -> Self {
        SwingNode {
            link: NodeLink::new(ear.id, &config, ear.params(&config.default)),
            lpg: Swing::new(ear.rules),
            sway: ear.motion(&UNHEARD),
            cycle: 0,
            missing: false,
        }
    }

    /// Which node this is.
    pub fn id(&self) -> NodeId {
        self.link.id()
    }

    /// The pattern generator, to look at.
    pub fn lpg(&self) -> &Swing {
        &self.lpg
    }

    /// Generation in force.
    pub fn generation(&self) -> u32 {
        self.link.generation()
    }

    fn on_gait(&mut self, gait: &Gait) {
        self.cycle = gait.cycle;
        if matches!(gait.event, GaitEvent::CycleStart | GaitEvent::Recovery | GaitEvent::Boundary | GaitEvent::Beat) {
            self.missing = !self.link.swap_to(gait.generation);
        }
        // Legs that follow different generations would be a mixture nobody tested: stay braked for this cycle.
        if self.missing {
            self.lpg.abort();
        } else {
            self.lpg.on_gait(gait.event, gait.swing, &self.sway, self.link.params());
        }
    }
}

impl Controller for SwingNode {
    type Heard = Heard<Sway, SwingParams>;

    fn take_in(&mut self, heard: &Self::Heard, say: &mut impl FnMut(Message)) {
        match heard {
            Heard::Motion(mode, sway) => {
                self.sway = *sway;
                self.link.moved(*mode);
            }
            Heard::Gait(gait) => self.on_gait(gait),
            other => self.link.take_in(other, say),
        }
    }

    fn control(&mut self, dt_us: u32, sensors: &Sensors, say: &mut impl FnMut(Message)) -> [Drive; 2] {
        self.link.begin(dt_us, sensors);
        if self.missing {
            self.link.limit(limits::GENERATION_MISSING);
        }
        // Without a coordinator the knee still finishes its cycle, but a swing leg has no fresh lean to act on.
        if self.link.must_brake() || !self.link.fresh() {
            self.lpg.abort();
        }
        let (mut drive, timed_out) = self.lpg.tick(dt_us, self.link.position(), self.link.params());
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

/// Soft end stop and plausibility bound of the hips, rad.
pub const HIP_SWING: (Q16, Q16) = (Q16::lit(0.78), Q16::lit(1.2));
/// Soft end stop and plausibility bound of the abductors, rad.
pub const ABDUCTOR_SWING: (Q16, Q16) = (Q16::lit(0.58), Q16::lit(1.0));
