//! What the coordinator knows of the three nodes.

use sarah_protocol::bus::{NodeId, Status, limits};
use sarah_protocol::telemetry::Event;

use super::age::Age;

/// After so many status messages in a row, a tenth of a second, a node without positions or still halted is unfit.
const UNFIT: u8 = 10;

/// One node.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Health {
    status: Option<Status>,
    silence: Age,
    alive: bool,
    /// Status messages in a row that told of missing positions or of a latched halt.
    unfit: u8,
}

/// All three, by [`NodeId`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Nodes([Health; 3]);

impl Nodes {
    /// None heard yet.
    pub const fn new() -> Self {
        Nodes([Health { status: None, silence: Age::NEVER, alive: false, unfit: 0 }; 3])
    }

    /// `dt_us` passed.
    pub fn advance(&mut self, dt_us: u32) {
        for node in &mut self.0 {
            node.silence.advance(dt_us);
        }
    }

    /// The first node that fell silent since the last call.
    pub fn newly_lost(&mut self, silence_us: u32) -> Option<NodeId> {
        for (node, id) in self.0.iter_mut().zip(NodeId::ALL) {
            if node.alive && node.silence.reached(silence_us) {
                node.alive = false;
                return Some(id);
            }
        }
        None
    }

    /// A node spoke: whether it came back or restarted.
    pub fn heard(&mut self, id: NodeId, status: &Status) -> Option<Event> {
        let node = self.0.get_mut(id as usize)?;
        let restarted = node.status.is_some_and(|before| before.boot_nonce != status.boot_nonce);
        let back = node.status.is_some() && !node.alive;
        let unfit =
            if status.limits & (limits::SENSOR | limits::HALTED) == 0 { 0 } else { node.unfit.saturating_add(1) };
        *node = Health { status: Some(*status), silence: Age::default(), alive: true, unfit };
        if restarted {
            Some(Event::NodeRestarted(id))
        } else if back {
            Some(Event::NodeBack(id))
        } else {
            None
        }
    }

    /// It cannot take part: for a tenth of a second its positions have been missing, or a halt has held it.
    pub fn unfit(&self, id: NodeId) -> bool {
        self.0.get(id as usize).is_some_and(|node| node.unfit >= UNFIT)
    }

    /// A silent node, if any.
    pub fn missing(&self) -> Option<NodeId> {
        self.0.iter().zip(NodeId::ALL).find(|(node, _)| !node.alive).map(|(_, id)| id)
    }

    /// Bit n: node n is heard.
    pub fn map(&self) -> u8 {
        self.0.iter().rev().fold(0, |map, node| map << 1 | u8::from(node.alive))
    }

    /// The last status of a node.
    pub fn status(&self, id: NodeId) -> Option<&Status> {
        self.0.get(id as usize)?.status.as_ref()
    }

    /// A node that does not run `generation`, if any.
    pub fn without(&self, generation: u32) -> Option<NodeId> {
        NodeId::ALL.into_iter().find(|id| self.status(*id).is_none_or(|status| status.applied != generation))
    }
}
