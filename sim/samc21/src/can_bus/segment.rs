//! One piece of wire: what is on it, and how a frame begins and ends there.

use super::bits::{DELIMITER, FLAG, INTERMISSION, Shape, priority};
use super::{CanBus, Record};
use crate::chip::Chip;
use crate::machine::SLICE;
use crate::time::Cycles;
use crate::wires::{CanError, CanEvent, CanFrame, CanPort, CanTiming};

/// Recessive bits of one sequence that a station waits for before it joins.
const SEQUENCE: u64 = 11;
/// Bits into a frame at which stations with other bit rates have seen an error.
const MISMATCH: u64 = 20;

/// A frame under way.
#[derive(Clone, Debug)]
pub(super) struct OnWire {
    frame: CanFrame,
    shape: Shape,
    timing: CanTiming,
    start: Cycles,
    /// Usually one; more if several stations send the same identifier.
    senders: Vec<usize>,
    /// Everybody else who followed from the start.
    listeners: Vec<usize>,
    /// Ticks after the start at which everybody sees an error, and as what the sender sees it.
    error: Option<(u64, CanError)>,
}

impl OnWire {
    /// Ticks after the start when the outcome is certain.
    fn length(&self) -> u64 {
        self.error.map_or_else(|| self.shape.to_acknowledge(&self.timing), |(at, _)| at)
    }
}

/// State of the wire.
#[derive(Clone, Debug, Default)]
pub(super) struct Segment {
    on_wire: Option<OnWire>,
    /// From when on the next frame may start.
    free: Cycles,
    /// Since when it is recessive, as far as known.
    recessive: Cycles,
}

impl Segment {
    pub(super) fn is_busy(&self) -> bool {
        self.on_wire.is_some()
    }
}

/// Whether a station with these settings can follow a frame of that timing: bit rates agree to half a percent.
fn understands(port: &CanPort, frame: &CanFrame, timing: &CanTiming) -> bool {
    let near = |a: u32, b: u32| a.abs_diff(b) * 200 <= a.max(b);
    port.timing.is_some_and(|own| {
        near(own.nominal, timing.nominal)
            && (port.fd || !frame.fd)
            && (!frame.bit_rate_switch || near(own.data, timing.data))
    })
}

impl CanBus {
    /// One piece of wire from the last exchange to this one.
    pub(super) fn run(&mut self, segment: usize, now: Cycles, chips: &mut [Chip]) {
        if let Some(on_wire) = &self.segments[segment].on_wire
            && on_wire.start + on_wire.length() <= now + SLICE
            && let Some(on_wire) = self.segments[segment].on_wire.take()
        {
            self.end(segment, on_wire, now, chips);
        }
        if self.segments[segment].on_wire.is_none() {
            self.let_join(segment, now, chips);
            self.begin(segment, now, chips);
        }
    }

    fn members(&self, segment: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.stations.len()).filter(move |member| self.stations[*member].segment == segment)
    }

    /// Counts the sequences of recessive bits for those who wait to join.
    fn let_join(&mut self, segment: usize, now: Cycles, chips: &mut [Chip]) {
        for member in 0..self.stations.len() {
            if self.stations[member].segment != segment {
                continue;
            }
            let Some(port) = self.port(chips, member) else { continue };
            let (Some(timing), 1..) = (port.timing, port.joining) else {
                self.stations[member].listening = None;
                continue;
            };
            let recessive = self.segments[segment].recessive;
            let from = self.stations[member].listening.map_or(now.max(recessive), |from| from.max(recessive));
            let sequence = SEQUENCE * u64::from(timing.nominal);
            let passed = (now.since(from) / sequence).min(port.joining.into());
            self.stations[member].listening = Some(from + passed * sequence);
            if passed > 0
                && let Some(port) = self.port_mut(chips, member)
            {
                port.joining -= passed as u16;
                if port.joining == 0 {
                    self.stations[member].listening = None;
                    self.tell(chips, member, now + 1, CanEvent::Joined);
                }
            }
        }
    }

    /// Starts the frame that wins arbitration, if one is offered and the wire is free.
    fn begin(&mut self, segment: usize, now: Cycles, chips: &mut [Chip]) {
        let free = self.segments[segment].free;
        let offer = |member: usize| {
            let port = self.port(chips, member)?;
            let (since, frame) = port.offered?;
            let from = since.max(self.stations[member].suspended);
            (port.takes_part() && !port.silent && !port.transmitting).then_some((from, frame))
        };
        let offers: Vec<_> =
            self.members(segment).filter_map(|m| offer(m).map(|(from, frame)| (m, from, frame))).collect();
        let Some(start) = offers.iter().map(|(_, from, _)| free.max(*from)).min().filter(|start| *start <= now) else {
            return;
        };
        let rivals = offers.iter().filter(|(_, from, _)| *from <= start);
        let Some(best) = rivals.clone().map(|(_, _, frame)| priority(frame)).min() else { return };
        let senders: Vec<usize> =
            rivals.clone().filter(|(_, _, frame)| priority(frame) == best).map(|(member, ..)| *member).collect();
        let losers: Vec<usize> =
            rivals.filter(|(_, _, frame)| priority(frame) != best).map(|(member, ..)| *member).collect();
        let Some((_, _, frame)) = offers.iter().find(|(member, ..)| *member == senders[0]).copied() else { return };
        let Some(timing) = self.port(chips, senders[0]).and_then(|port| port.timing) else { return };

        let listeners: Vec<usize> = self
            .members(segment)
            .filter(|member| !senders.contains(member))
            .filter(|member| self.port(chips, *member).is_some_and(CanPort::takes_part))
            .collect();
        let shape = Shape::of(&frame);
        let error = self.foresee(&offers, &senders, &listeners, &frame, &timing, shape, chips);
        for member in &senders {
            if let Some(port) = self.port_mut(chips, *member) {
                port.transmitting = true;
            }
        }
        for member in losers {
            self.tell(chips, member, now + 1, CanEvent::ArbitrationLost);
        }
        self.segments[segment].on_wire = Some(OnWire { frame, shape, timing, start, senders, listeners, error });
    }

    /// The error that everybody will see, if there is to be one.
    #[expect(clippy::too_many_arguments, reason = "all that is known at the start of a frame")]
    fn foresee(
        &mut self,
        offers: &[(usize, Cycles, CanFrame)],
        senders: &[usize],
        listeners: &[usize],
        frame: &CanFrame,
        timing: &CanTiming,
        shape: Shape,
        chips: &[Chip],
    ) -> Option<(u64, CanError)> {
        let mismatch = MISMATCH * u64::from(timing.nominal);
        let struck = self.disturbance.strike().map(|place| (shape.to_acknowledge(timing) * place / 256).max(mismatch));
        if let Some(at) = struck {
            return Some((at, CanError::Bit0));
        }
        let differ = offers.iter().any(|(member, _, other)| senders.contains(member) && other != frame);
        if differ {
            return Some((mismatch, CanError::Bit1));
        }
        let objects = |member: &usize| {
            self.port(chips, *member)
                .is_some_and(|port| !port.silent && !port.passive && !understands(port, frame, timing))
        };
        (listeners.iter().any(objects) || senders[1..].iter().any(objects)).then_some((mismatch, CanError::Bit1))
    }

    /// Ends a frame: tells everybody what they saw.
    fn end(&mut self, segment: usize, mut wire: OnWire, now: Cycles, chips: &mut [Chip]) {
        let nominal = u64::from(wire.timing.nominal);
        let still_here = |bus: &CanBus, member: usize, chips: &[Chip]| {
            bus.stations[member].segment == segment && bus.port(chips, member).is_some_and(CanPort::takes_part)
        };
        let still_sends = |bus: &CanBus, member: usize, chips: &[Chip]| {
            still_here(bus, member, chips) && bus.port(chips, member).is_some_and(|port| port.transmitting)
        };
        let senders = wire.senders.clone();
        for member in senders.iter().copied() {
            if still_sends(self, member, chips) {
                continue;
            }
            // Reset, or unplugged: the others see the frame break off, and the sender does not see its own bits.
            wire.error = wire.error.or(Some((wire.length(), CanError::Bit0)));
            if self.port(chips, member).is_some_and(|port| port.transmitting) {
                self.tell_error(chips, member, now + 1, CanError::Bit0, (true, false, 8));
            }
        }
        wire.senders.retain(|member| still_sends(self, *member, chips));
        wire.listeners.retain(|member| still_here(self, *member, chips));
        let understood = |bus: &CanBus, member: usize, chips: &[Chip]| {
            bus.port(chips, member).is_some_and(|port| understands(port, &wire.frame, &wire.timing))
        };
        let acknowledged = wire.listeners.iter().any(|member| {
            understood(self, *member, chips) && self.port(chips, *member).is_some_and(|port| !port.silent)
        });
        let unanswered = wire.error.is_none() && !acknowledged;
        if unanswered {
            wire.error = Some((wire.shape.to_acknowledge(&wire.timing), CanError::Acknowledge));
        }
        let after = match wire.error {
            Some((at, error)) => {
                let detected = (wire.start + at).max(now + 1);
                let data_phase = wire.shape.to_switch(&wire.timing).is_some_and(|switch| {
                    (switch..wire.shape.to_delimiter(&wire.timing)).contains(&at) && error != CanError::Acknowledge
                });
                for member in &wire.senders {
                    let passive = self.port(chips, *member).is_some_and(|port| port.passive);
                    let weight = if unanswered && passive { 0 } else { 8 };
                    self.tell_error(chips, *member, detected, error, (true, data_phase, weight));
                }
                for member in &wire.listeners {
                    // With no other error than the missing acknowledgement, who understood follows to the end.
                    let understands = understood(self, *member, chips);
                    if !(unanswered && understands) {
                        let first = !understands && self.port(chips, *member).is_some_and(|port| !port.passive);
                        let weight = if first { 9 } else { 1 };
                        self.tell_error(chips, *member, detected, CanError::Stuff, (false, data_phase, weight));
                    }
                }
                let flags = if wire.listeners.is_empty() { FLAG } else { 2 * FLAG };
                detected + (flags + DELIMITER) * nominal
            }
            None => {
                let end = wire.start + wire.shape.to_end(&wire.timing);
                // Receivers take a frame as valid one bit before its end, the sender at its end (10.7).
                for member in &wire.listeners {
                    match understood(self, *member, chips) {
                        true => self.tell(chips, *member, Cycles(end.0 - nominal), CanEvent::Received(wire.frame)),
                        false => self.tell_error(
                            chips,
                            *member,
                            wire.start + MISMATCH * nominal,
                            CanError::Stuff,
                            (false, false, 1),
                        ),
                    }
                }
                for member in &wire.senders {
                    self.tell(chips, *member, end, CanEvent::Sent);
                }
                end
            }
        };
        for member in &wire.senders {
            if self.port(chips, *member).is_some_and(|port| port.passive) {
                self.stations[*member].suspended = after + (INTERMISSION + DELIMITER) * nominal;
            }
        }
        self.segments[segment].free = after + INTERMISSION * nominal;
        self.segments[segment].recessive = Cycles(after.0 - DELIMITER * nominal);
        let end = wire.error.map_or(after, |(at, _)| wire.start + at);
        self.note(Record {
            sender: senders[0],
            start: wire.start,
            end,
            frame: wire.frame,
            error: wire.error.map(|(_, error)| error),
        });
    }

    /// `role`: sending, in the data phase, weight.
    fn tell_error(&self, chips: &mut [Chip], member: usize, at: Cycles, error: CanError, role: (bool, bool, u16)) {
        let (sending, data_phase, weight) = role;
        self.tell(chips, member, at, CanEvent::Error { error, sending, data_phase, weight });
    }
}
