//! The CAN-FD bus between chips (ISO 11898-1:2015): arbitration, durations, acknowledgement, error frames.
//!
//! It runs between slices, as an [`Exchange`]. A frame starts at the exchange after its offer, with the offer's time, and
//! what it brought is decided at the last exchange before its end; so a station that was reset or unplugged meanwhile has
//! left the frame. Every station sees only what its bit timing lets it understand.
//!
//! ```text
//!  offered ─► start: arbitration, errors to come ─► wire ─► end: who understood, who acknowledged ─► events
//! ```
//!
//! Nothing here is random but [`CanBus::set_noise`], and that is drawn from a seed.

pub mod bits;
mod segment;

use crate::chip::Chip;
use crate::machine::Exchange;
use crate::time::Cycles;
use crate::wires::{CanError, CanEvent, CanFrame, CanPort};

use segment::Segment;

/// A chip's CAN controller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Station {
    /// Index of the chip.
    pub chip: usize,
    /// CAN0 or CAN1.
    pub port: usize,
}

/// One attempt to send a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Record {
    /// Index of the station that sent it.
    pub sender: usize,
    /// Start of the frame.
    pub start: Cycles,
    /// Its end, or the detection of the error.
    pub end: Cycles,
    /// The frame.
    pub frame: CanFrame,
    /// Why it failed, if it did.
    pub error: Option<CanError>,
}

/// Stations on a common pair of wires. An unplugged one keeps a piece of wire of its own.
#[derive(Clone, Debug, Default)]
pub struct CanBus {
    stations: Vec<Member>,
    /// The common wires, then one piece for each station.
    segments: Vec<Segment>,
    disturbance: Disturbance,
    log: Option<Vec<Record>>,
}

/// A station and what the bus keeps about it.
#[derive(Clone, Debug)]
struct Member {
    station: Station,
    segment: usize,
    /// Until when an error-passive station lets others go first.
    suspended: Cycles,
    /// While it waits to join: from when on it counts recessive bits.
    listening: Option<Cycles>,
}

/// What spoils frames.
#[derive(Clone, Debug, Default)]
struct Disturbance {
    jammed: bool,
    next: u32,
    per_million: u32,
    random: u64,
}

impl Disturbance {
    /// Splitmix64.
    fn draw(&mut self) -> u64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.random;
        x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ x >> 31
    }

    /// Whether the frame that starts now is spoiled, and at which 256th of its length.
    fn strike(&mut self) -> Option<u64> {
        // The first and last bits are spared, so that the error falls into what all stations watch.
        let place = 64 + self.draw() % 128;
        let hit = self.draw() % 1_000_000 < self.per_million.into();
        let forced = self.jammed || self.next > 0;
        self.next = self.next.saturating_sub(1);
        (hit || forced).then_some(place)
    }
}

impl CanBus {
    /// A bus with all `stations` plugged in.
    pub fn new(stations: impl IntoIterator<Item = Station>) -> Self {
        let stations: Vec<_> = stations
            .into_iter()
            .map(|station| Member { station, segment: 0, suspended: Cycles(0), listening: None })
            .collect();
        let segments = (0..=stations.len()).map(|_| Segment::default()).collect();
        CanBus { stations, segments, disturbance: Disturbance::default(), log: None }
    }

    /// CAN0 of the first `chips` chips of a machine.
    pub fn of_chips(chips: usize) -> Self {
        Self::new((0..chips).map(|chip| Station { chip, port: 0 }))
    }

    /// Takes a station off the common wires. What it was sending is lost for the others.
    pub fn unplug(&mut self, station: usize) {
        self.stations[station].segment = station + 1;
    }

    /// Puts a station back.
    pub fn plug(&mut self, station: usize) {
        self.stations[station].segment = 0;
    }

    /// Destroys every frame while `jammed`.
    pub fn jam(&mut self, jammed: bool) {
        self.disturbance.jammed = jammed;
    }

    /// Destroys the next `count` frames.
    pub fn corrupt_next(&mut self, count: u32) {
        self.disturbance.next = count;
    }

    /// Destroys frames by chance, `per_million` of a million, the same ones for the same seed.
    pub fn set_noise(&mut self, per_million: u32, seed: u64) {
        self.disturbance.per_million = per_million;
        self.disturbance.random = seed;
    }

    /// Starts or stops recording attempts.
    pub fn record(&mut self, on: bool) {
        self.log = on.then(Vec::new);
    }

    /// Attempts recorded so far, removed.
    pub fn take_log(&mut self) -> Vec<Record> {
        self.log.as_mut().map(std::mem::take).unwrap_or_default()
    }

    fn port<'a>(&self, chips: &'a [Chip], member: usize) -> Option<&'a CanPort> {
        let Station { chip, port } = self.stations[member].station;
        chips.get(chip)?.wires().can.get(port)
    }

    fn port_mut<'a>(&self, chips: &'a mut [Chip], member: usize) -> Option<&'a mut CanPort> {
        let Station { chip, port } = self.stations[member].station;
        chips.get_mut(chip)?.wires_mut().can.get_mut(port)
    }

    /// Tells a station something, not in its past.
    fn tell(&self, chips: &mut [Chip], member: usize, at: Cycles, event: CanEvent) {
        if let Some(port) = self.port_mut(chips, member) {
            let at = port.events.back().map_or(at, |(last, _)| at.max(*last));
            port.events.push_back((at, event));
        }
    }

    fn note(&mut self, record: Record) {
        if let Some(log) = &mut self.log {
            log.push(record);
        }
    }
}

impl Exchange for CanBus {
    fn exchange(&mut self, now: Cycles, chips: &mut [Chip]) {
        for segment in 0..self.segments.len() {
            if segment == 0 || self.stations[segment - 1].segment == segment || self.segments[segment].is_busy() {
                self.run(segment, now, chips);
            }
        }
    }
}
