//! The knee node: LPG1, owner of the cycle and of the generation in force.

use sarah_protocol::bus::{Gait, GaitEvent, Message, NodeId, limits};
use sarah_protocol::fixed::Q16;

use super::link::{NodeConfig, NodeLink, View};
use super::{Node, Outputs, Sensors};
use crate::lpg::factor::Divider;
use crate::lpg::knee::{Knee, KneeInputs, KneeParams, Phase};
use crate::lpg::rules::KneeRules;

/// While idle the flags are repeated this often, so that a node that missed one catches up.
pub const BEAT_PERIOD_US: u32 = 100_000;

/// LPG1 on the bus.
#[derive(Clone, PartialEq, Debug)]
pub struct KneeNode<D> {
    link: NodeLink,
    lpg: Knee,
    params: KneeParams,
    divider: D,
    /// Generation to put into force at the next boundary.
    activate: Option<u32>,
    since_beat_us: u32,
}

impl<D: Divider> KneeNode<D> {
    /// Braked and idle.
    pub fn new(config: NodeConfig, rules: KneeRules, divider: D) -> Self {
        KneeNode {
            link: NodeLink::new(NodeId::Knee, config),
            lpg: Knee::new(rules),
            params: KneeParams::from(&config.default),
            divider,
            activate: None,
            since_beat_us: 0,
        }
    }

    /// The pattern generator, to look at.
    pub fn lpg(&self) -> &Knee {
        &self.lpg
    }

    /// Generation in force.
    pub fn generation(&self) -> u32 {
        self.link.applied().0
    }

    fn say(&mut self, event: GaitEvent, out: &mut Outputs) {
        self.since_beat_us = 0;
        out.send(Message::Gait(Gait {
            event,
            swing: self.lpg.swing(),
            cycle: self.lpg.cycle(),
            generation: self.link.applied().0,
        }));
    }
}

impl<D: Divider> Node for KneeNode<D> {
    fn on_message(&mut self, message: &Message) -> Option<Message> {
        if let Message::Activate(generation) = message
            && self.link.staged() == Some(*generation)
        {
            self.activate = Some(*generation);
        }
        self.link.on_message(message)
    }

    fn tick(&mut self, dt_us: u32, sensors: &Sensors) -> Outputs {
        let sensors = self.link.begin(dt_us, sensors);
        self.since_beat_us = self.since_beat_us.saturating_add(dt_us);
        let mut out = Outputs::default();

        if self.link.must_brake() && self.lpg.abort() {
            self.say(GaitEvent::CycleEnd, &mut out);
        }
        if self.lpg.phase() == Phase::Idle {
            if let Some(generation) = self.activate.take()
                && self.link.swap_to(generation)
            {
                self.params = KneeParams::from(self.link.applied().1);
                self.say(GaitEvent::Boundary, &mut out);
            } else if self.since_beat_us >= BEAT_PERIOD_US {
                self.say(GaitEvent::Beat, &mut out);
            }
        }

        let [left_heel, left_toe, right_heel, right_toe] = sensors.load;
        let inputs = KneeInputs {
            dt_us,
            load: [left_heel + left_toe, right_heel + right_toe],
            position: sensors.position,
            motion: self.link.motion(),
            may_start: !self.link.must_brake() && self.link.fresh(),
        };
        let decided = self.lpg.tick(&self.divider, &inputs, &self.params);
        for event in &decided.events {
            self.say(*event, &mut out);
        }
        if decided.timed_out {
            self.link.limit(limits::TIMED_OUT);
        }
        out.drive = decided.drive;
        let view = View {
            phase: self.lpg.phase() as u8,
            factor: self.lpg.factor(),
            steps: self.lpg.steps(),
            cycle: self.lpg.cycle(),
        };
        self.link.finish(&mut out, view);
        out
    }
}

/// Soft end stop and plausibility bound of the linear actuators, m.
pub const STROKE: (Q16, Q16) = (Q16::lit(0.118), Q16::lit(0.16));
