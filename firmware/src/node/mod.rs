//! One node: a pattern generator, its parameters, and its place on the bus.
//!
//! - [`link`]: what every node does alike: mode and halt, freshness of the IMU products, staged and applied parameters,
//!   end stops, status.
//! - [`knee`]: the node of LPG1; owns the cycle and the generation in force.
//! - [`swing`]: the node of LPG2 or LPG3; follows the knee's flags.
//!
//! A node is driven by two calls: [`Node::on_message`] for what came over the bus, [`Node::control`] at the control rate.
//! Neither blocks nor allocates; parsing never happens in the tick.

pub mod knee;
pub mod link;
pub mod swing;

use heapless::Vec;
use sarah_protocol::bus::{Message, NodeId};
use sarah_protocol::fixed::Q16;

use crate::lpg::Drive;
use crate::lpg::factor::PlainDivider;
use crate::lpg::rules;

pub use knee::KneeNode;
pub use link::NodeConfig;
pub use swing::SwingNode;

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

/// What the firmware images and the simulator run.
pub trait Node {
    /// A message from the bus; the answer, if it asks for one.
    fn on_message(&mut self, message: &Message) -> Option<Message>;
    /// One control tick, `dt_us` after the last: commands for the \[left, right\] actuator. Messages for the bus go to
    /// `say`, in order, and need no room in between.
    fn control(&mut self, dt_us: u32, sensors: &Sensors, say: &mut impl FnMut(Message)) -> [Drive; 2];

    /// The same for those who want the messages in hand.
    fn tick(&mut self, dt_us: u32, sensors: &Sensors) -> Outputs {
        let mut messages = Vec::new();
        let drive = self.control(dt_us, sensors, &mut |message| {
            // Eight slots hold everything one tick can raise; a message beyond is repeated by the next beat or status.
            let _ = messages.push(message);
        });
        Outputs { drive, messages }
    }
}

/// The node that belongs to `id`, as the simulator runs it; the images name theirs directly.
pub fn by_id(id: NodeId, config: NodeConfig) -> NodeKind {
    match id {
        NodeId::Knee => NodeKind::Knee(KneeNode::new(config, rules::KNEE, PlainDivider)),
        NodeId::Hip => NodeKind::Swing(SwingNode::new(id, config, rules::HIP)),
        NodeId::Abductor => NodeKind::Swing(SwingNode::new(id, config, rules::ABDUCTOR)),
    }
}

/// Any of the three nodes.
#[derive(Clone, Debug)]
pub enum NodeKind {
    /// LPG1.
    Knee(KneeNode<PlainDivider>),
    /// LPG2 or LPG3.
    Swing(SwingNode),
}

impl Node for NodeKind {
    fn on_message(&mut self, message: &Message) -> Option<Message> {
        match self {
            NodeKind::Knee(node) => node.on_message(message),
            NodeKind::Swing(node) => node.on_message(message),
        }
    }

    fn control(&mut self, dt_us: u32, sensors: &Sensors, say: &mut impl FnMut(Message)) -> [Drive; 2] {
        match self {
            NodeKind::Knee(node) => node.control(dt_us, sensors, say),
            NodeKind::Swing(node) => node.control(dt_us, sensors, say),
        }
    }
}
