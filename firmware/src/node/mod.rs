//! One node: a pattern generator, its parameters, and its place on the bus.
//!
//! - [`heard`]: what a message says to a node, worked out when it comes in.
//! - [`link`]: what every node does alike: mode and halt, freshness of the IMU products, staged and applied parameters,
//!   end stops, status.
//! - [`knee`]: the node of LPG1; owns the cycle and the generation in force.
//! - [`swing`]: the node of LPG2 or LPG3; follows the knee's flags.
//!
//! An image runs a node in two parts: an [`Ear`] in thread mode, a [`Controller`] in the tick. The simulator runs both as
//! one [`Node`]. Neither blocks nor allocates; parsing never happens in the tick.

pub mod heard;
pub mod knee;
pub mod link;
pub mod reckoning;
pub mod swing;

use heapless::Vec;
use sarah_protocol::bus::{Message, NodeId};
use sarah_protocol::fixed::Q16;

use crate::lpg::Drive;
use crate::lpg::factor::PlainDivider;

pub use heard::Ear;
pub use knee::{KneeEar, KneeNode};
pub use link::NodeConfig;
pub use swing::{SwingEar, SwingNode};

/// What the node's own sensors say.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Sensors {
    /// Joint position \[left, right\]: m or rad.
    pub position: [Q16; 2],
    /// Pad loads in N: left heel, left toe, right heel, right toe. Only the knee node has pads.
    pub load: [Q16; 4],
}

/// What a tick produces.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Outputs {
    /// Command for the \[left, right\] actuator.
    pub drive: [Drive; 2],
    /// Messages for the bus, in order. A tick raises at most 7.
    pub messages: Vec<Message, 8>,
}

/// The part of a node that runs in the control tick.
pub trait Controller {
    /// What its [`Ear`] gives it.
    type Heard: Copy;

    /// Takes in what a message said. Answers go to `say`.
    fn take_in(&mut self, heard: &Self::Heard, say: &mut impl FnMut(Message));

    /// One control tick, `dt_us` after the last: commands for the \[left, right\] actuator. Messages for the bus go to
    /// `say`, in order, and need no room in between.
    fn control(&mut self, dt_us: u32, sensors: &Sensors, say: &mut impl FnMut(Message)) -> [Drive; 2];
}

/// A whole node.
pub trait Node {
    /// A message from the bus; the answer, if it asks for one.
    fn on_message(&mut self, message: &Message) -> Option<Message>;
    /// One control tick, `dt_us` after the last.
    fn tick(&mut self, dt_us: u32, sensors: &Sensors) -> Outputs;
}

/// The node that belongs to `id`, as the simulator runs it; the images name the parts of theirs directly.
pub fn by_id(id: NodeId, config: NodeConfig) -> NodeKind {
    match id {
        NodeId::Knee => NodeKind::Knee(KneeNode::new(config, &knee_ear())),
        NodeId::Hip => NodeKind::Swing(SwingNode::new(config, &SwingEar::HIP)),
        NodeId::Abductor => NodeKind::Swing(SwingNode::new(config, &SwingEar::ABDUCTOR)),
    }
}

/// Any of the three nodes.
#[derive(Clone, Debug)]
pub enum NodeKind {
    /// LPG1.
    Knee(KneeNode),
    /// LPG2 or LPG3.
    Swing(SwingNode),
}

const fn knee_ear() -> KneeEar<PlainDivider> {
    KneeEar::new(PlainDivider)
}

impl Node for NodeKind {
    fn on_message(&mut self, message: &Message) -> Option<Message> {
        let mut answer = None;
        let mut say = |message| answer = Some(message);
        match self {
            NodeKind::Knee(node) => node.take_in(&knee_ear().hear(message), &mut say),
            NodeKind::Swing(node) => {
                let ear = if node.id() == NodeId::Hip { SwingEar::HIP } else { SwingEar::ABDUCTOR };
                node.take_in(&ear.hear(message), &mut say);
            }
        }
        answer
    }

    fn tick(&mut self, dt_us: u32, sensors: &Sensors) -> Outputs {
        let mut messages = Vec::new();
        let mut say = |message| {
            // Eight slots hold everything one tick can raise; a message beyond is repeated by the next beat or status.
            let _ = messages.push(message);
        };
        let drive = match self {
            NodeKind::Knee(node) => node.control(dt_us, sensors, &mut say),
            NodeKind::Swing(node) => node.control(dt_us, sensors, &mut say),
        };
        Outputs { drive, messages }
    }
}
