//! The knee node: LPG1, owner of the cycle and of the generation in force.

use sarah_protocol::bus::{Gait, GaitEvent, Message, Motion, NodeId, limits};
use sarah_protocol::fixed::Q16;
use sarah_protocol::params::ParamSet;

use super::heard::{Ear, Heard};
use super::link::{NodeConfig, NodeLink, UNHEARD, View};
use super::{Controller, Sensors};
use crate::lpg::Drive;
use crate::lpg::factor::Divider;
use crate::lpg::fall::Fall;
use crate::lpg::knee::{Knee, KneeInputs, KneeParams, Phase};

/// While idle the flags are repeated this often, so that a node that missed one catches up.
pub const BEAT_PERIOD_US: u32 = 100_000;

/// What LPG1 makes of the bus.
#[derive(Clone, PartialEq, Debug)]
pub struct KneeEar<D> {
    divider: D,
}

impl<D> KneeEar<D> {
    /// That divides with this.
    pub const fn new(divider: D) -> Self {
        KneeEar { divider }
    }
}

impl<D: Divider> Ear for KneeEar<D> {
    type Motion = Fall;
    type Params = KneeParams;

    fn motion(&self, motion: &Motion) -> Fall {
        Fall::of(&self.divider, motion)
    }

    fn params(&self, set: &ParamSet) -> KneeParams {
        KneeParams::from(set)
    }
}

/// LPG1 on the bus.
#[derive(Clone, PartialEq, Debug)]
pub struct KneeNode {
    link: NodeLink<KneeParams>,
    /// Of the newest motion message.
    fall: Fall,
    lpg: Knee,
    since_beat_us: u32,
    /// Generation to put into force at the next boundary.
    activate: Option<u32>,
}

impl KneeNode {
    /// Braked and idle; hears with `ear`.
    pub fn new<D: Divider>(config: NodeConfig, ear: &KneeEar<D>) -> Self {
        KneeNode {
            link: NodeLink::new(NodeId::Knee, &config, ear.params(&config.default)),
            fall: ear.motion(&UNHEARD),
            lpg: Knee::idle(),
            since_beat_us: 0,
            activate: None,
        }
    }

    /// The pattern generator, to look at.
    pub fn lpg(&self) -> &Knee {
        &self.lpg
    }

    /// Generation in force.
    pub fn generation(&self) -> u32 {
        self.link.generation()
    }

    fn say(&mut self, event: GaitEvent, say: &mut impl FnMut(Message)) {
        self.since_beat_us = 0;
        say(Message::Gait(Gait {
            event,
            swing: self.lpg.swing(),
            cycle: self.lpg.cycle(),
            generation: self.link.generation(),
        }));
    }

    /// At rest: a boundary, where a generation may come into force, and now and then a beat.
    fn rest(&mut self, say: &mut impl FnMut(Message)) {
        if let Some(generation) = self.activate.take()
            && self.link.swap_to(generation)
        {
            self.say(GaitEvent::Boundary, say);
        } else if self.since_beat_us >= BEAT_PERIOD_US {
            self.say(GaitEvent::Beat, say);
        }
    }
}

impl Controller for KneeNode {
    type Heard = Heard<Fall, KneeParams>;

    fn take_in(&mut self, heard: &Self::Heard, say: &mut impl FnMut(Message)) {
        match heard {
            Heard::Motion(mode, fall) => {
                self.fall = *fall;
                self.link.moved(*mode);
            }
            Heard::Activate(generation) if self.link.staged() == Some(*generation) => {
                self.activate = Some(*generation);
            }
            other => self.link.take_in(other, say),
        }
    }

    fn control(&mut self, dt_us: u32, sensors: &Sensors, say: &mut impl FnMut(Message)) -> [Drive; 2] {
        self.link.begin(dt_us, sensors);
        self.since_beat_us = self.since_beat_us.saturating_add(dt_us);

        if self.link.must_brake() && self.lpg.abort() {
            self.say(GaitEvent::CycleEnd, say);
        }
        if self.lpg.phase() == Phase::Idle {
            self.rest(say);
        }

        let [left_heel, left_toe, right_heel, right_toe] = sensors.load;
        let inputs = KneeInputs {
            dt_us,
            load: [left_heel + left_toe, right_heel + right_toe],
            position: self.link.position(),
            sensed: self.link.sensed(),
            fall: &self.fall,
            may_start: !self.link.must_brake() && self.link.fresh(),
        };
        let mut decided = self.lpg.tick(&inputs, self.link.params());
        for event in &decided.events {
            self.say(*event, say);
        }
        if decided.timed_out {
            self.link.limit(limits::TIMED_OUT);
        }
        self.link.stop_at_ends(&mut decided.drive);
        if self.link.status_is_due() {
            let view = View {
                phase: self.lpg.phase() as u8,
                factor: self.fall.factor,
                steps: self.lpg.steps(),
                cycle: self.lpg.cycle(),
            };
            say(self.link.status(sensors, view));
        }
        decided.drive
    }
}

/// Soft end stop and plausibility bound of the linear actuators, m.
pub const STROKE: (Q16, Q16) = (Q16::lit(0.118), Q16::lit(0.16));
