//! The knee node: LPG1, owner of the cycle and of the generation in force.

use sarah_protocol::bus::{Gait, GaitEvent, Message, NodeId, limits};
use sarah_protocol::fixed::Q16;

use super::link::{NodeConfig, NodeLink, View};
use super::{Node, Sensors};
use crate::lpg::Drive;
use crate::lpg::factor::Divider;
use crate::lpg::fall::Fall;
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
    rules: KneeRules,
    /// The newest motion message; `None` until the tick after it, so that hearing it and working it out share the time of
    /// two ticks.
    fall: Option<Fall>,
    /// Generation to put into force at the next boundary.
    activate: Option<u32>,
    since_beat_us: u32,
}

impl<D: Divider> KneeNode<D> {
    /// Braked and idle.
    pub fn new(config: NodeConfig, rules: KneeRules, divider: D) -> Self {
        let link = NodeLink::new(NodeId::Knee, config);
        KneeNode {
            fall: None,
            link,
            lpg: Knee::new(rules),
            params: KneeParams::from(&config.default),
            divider,
            rules,
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

    fn say(&mut self, event: GaitEvent, say: &mut impl FnMut(Message)) {
        self.since_beat_us = 0;
        say(Message::Gait(Gait {
            event,
            swing: self.lpg.swing(),
            cycle: self.lpg.cycle(),
            generation: self.link.applied().0,
        }));
    }
}

impl<D: Divider> Node for KneeNode<D> {
    fn on_message(&mut self, message: &Message) -> Option<Message> {
        match message {
            Message::Activate(generation) if self.link.staged() == Some(*generation) => {
                self.activate = Some(*generation);
            }
            Message::Motion(_) => self.fall = None,
            _ => {}
        }
        self.link.on_message(message)
    }

    fn control(&mut self, dt_us: u32, sensors: &Sensors, say: &mut impl FnMut(Message)) -> [Drive; 2] {
        let position = self.link.begin(dt_us, sensors);
        self.since_beat_us = self.since_beat_us.saturating_add(dt_us);

        if self.link.must_brake() && self.lpg.abort() {
            self.say(GaitEvent::CycleEnd, say);
        }
        if self.lpg.phase() == Phase::Idle {
            if let Some(generation) = self.activate.take()
                && self.link.swap_to(generation)
            {
                self.params = KneeParams::from(self.link.applied().1);
                self.say(GaitEvent::Boundary, say);
            } else if self.since_beat_us >= BEAT_PERIOD_US {
                self.say(GaitEvent::Beat, say);
            }
        }

        let fall = *self.fall.get_or_insert_with(|| Fall::of(&self.divider, &self.rules, self.link.motion()));
        let [left_heel, left_toe, right_heel, right_toe] = sensors.load;
        let inputs = KneeInputs {
            dt_us,
            load: [left_heel + left_toe, right_heel + right_toe],
            position,
            fall: &fall,
            may_start: !self.link.must_brake() && self.link.fresh(),
        };
        let mut decided = self.lpg.tick(&self.divider, &inputs, &self.params);
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
                factor: fall.factor(),
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
