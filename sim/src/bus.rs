//! The CAN bus of the simulated robot: encoded frames, arbitration by identifier, a latency, and plugs to pull.

use std::collections::VecDeque;

use sarah_protocol::bus::{Frame, NodeId};

/// Who is on the bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Station {
    /// The coordinator.
    Coordinator,
    /// One of the nodes.
    Node(NodeId),
}

impl Station {
    /// Everyone, coordinator first.
    pub const ALL: [Station; 4] = [
        Station::Coordinator,
        Station::Node(NodeId::Knee),
        Station::Node(NodeId::Hip),
        Station::Node(NodeId::Abductor),
    ];

    fn index(self) -> usize {
        match self {
            Station::Coordinator => 0,
            Station::Node(node) => 1 + node as usize,
        }
    }
}

struct InFlight {
    due_us: u64,
    from: Station,
    frame: Frame,
}

/// A broadcast bus: what one sends, all others receive `latency_us` later. Frames sent at the same instant arrive in the
/// order of their identifiers, as arbitration would have it.
pub struct Bus {
    latency_us: u64,
    in_flight: VecDeque<InFlight>,
    unplugged: [bool; 4],
}

impl Bus {
    /// An empty bus.
    pub fn new(latency_us: u32) -> Bus {
        Bus { latency_us: latency_us.into(), in_flight: VecDeque::new(), unplugged: [false; 4] }
    }

    /// Pulls or plugs a station's connector: it neither sends nor receives while unplugged.
    pub fn unplug(&mut self, station: Station, unplugged: bool) {
        self.unplugged[station.index()] = unplugged;
    }

    /// Puts a frame on the bus at `now_us`.
    pub fn send(&mut self, now_us: u64, from: Station, frame: Frame) {
        if self.unplugged[from.index()] {
            return;
        }
        let due_us = now_us + self.latency_us;
        let later = |other: &InFlight| (other.due_us, other.frame.id) <= (due_us, frame.id);
        let place = self.in_flight.iter().rposition(later).map_or(0, |index| index + 1);
        self.in_flight.insert(place, InFlight { due_us, from, frame });
    }

    /// When the next frame arrives.
    pub fn next_due_us(&self) -> Option<u64> {
        self.in_flight.front().map(|frame| frame.due_us)
    }

    /// The next frame that has arrived by `now_us`, with its sender.
    pub fn deliver(&mut self, now_us: u64) -> Option<(Station, Frame)> {
        if self.next_due_us()? > now_us {
            return None;
        }
        self.in_flight.pop_front().map(|arrived| (arrived.from, arrived.frame))
    }

    /// Whether `to` hears what `from` sends.
    pub fn hears(&self, from: Station, to: Station) -> bool {
        from != to && !self.unplugged[to.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u16, byte: u8) -> Frame {
        Frame { id, data: heapless::Vec::from_slice(&[byte]).expect("one byte fits") }
    }

    #[test]
    fn frames_arrive_after_the_latency_in_order_of_identifier() {
        let mut bus = Bus::new(300);
        for (id, byte) in [(0x30, 0), (0x10, 1), (0x30, 2), (0x20, 3)] {
            bus.send(1_000, Station::Coordinator, frame(id, byte));
        }
        assert!(bus.deliver(1_299).is_none());
        let order: Vec<u8> = std::iter::from_fn(|| bus.deliver(1_300)).map(|(_, f)| f.data[0]).collect();
        assert_eq!(order, [1, 3, 0, 2]);
    }

    #[test]
    fn an_unplugged_station_neither_sends_nor_hears() {
        let mut bus = Bus::new(0);
        let hip = Station::Node(NodeId::Hip);
        bus.unplug(hip, true);
        bus.send(0, hip, frame(0x101, 0));
        assert!(bus.deliver(10).is_none());
        assert!(!bus.hears(Station::Coordinator, hip));
        bus.unplug(hip, false);
        assert!(bus.hears(Station::Coordinator, hip));
    }
}
