//! The coordinator: IMU in, motion out; parameter generations, arming, and what happens when someone falls silent.
//!
//! ```text
//!   IMU ──► on_imu ──► Motion ─────────────┐
//!   bus ──► on_bus (Status, Staged, Gait)  ├─► BusOutbox ──► bus
//!  host ──► on_host_bytes (commands)       │
//!           tick (time-outs, retries) ─────┴─► HostOutbox ──► host (replies before telemetry)
//!                  └──► Action::Store ──► flash ──► on_stored
//! ```
//!
//! | lost | what happens |
//! |---|---|
//! | host | the applied set stays; after `host_silence_us` it is flagged stale; after `host_fallback_us` the stored set is staged and takes over at a cycle boundary. Motion stays allowed: balancing needs no host |
//! | IMU | no new cycle, the running one ends, then a halt, latched until armed |
//! | a node, or a node restarts | halt, latched until armed; the applied set is staged anew |
//! | emergency stop | halt, latched until cleared **and** armed |
//!
//! - `generations`: whole sets or nothing. `safety`: the arming. `writer`: one host at a time.
//! - `nodes`: who is alive. `outbox`: what waits to be sent. `age`: time that does not wrap.
//! - `config`: what it is born with. `commands`: what each host command does. `report`: what the host hears.

mod age;
mod commands;
mod config;
mod generations;
mod nodes;
mod outbox;
mod report;
mod safety;
mod writer;

use sarah_protocol::bus::{Frame, HaltReason, Message, Mode};
use sarah_protocol::fixed::Q16;
use sarah_protocol::frame::Deframer;
use sarah_protocol::host::{AckState, Refusal, ToRobot};
use sarah_protocol::params::ParamSet;
use sarah_protocol::telemetry::Event;

pub use crate::attitude::ImuSample;
pub use config::{Config, Identity};
pub use outbox::{BusOutbox, HostOutbox};

use crate::attitude::Attitude;
use age::Age;
use generations::{Generations, Request};
use nodes::Nodes;
use safety::Safety;
use writer::Writer;

/// Something only the shell can do.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Action {
    /// Write this set to non-volatile memory, then call [`Coordinator::on_stored`].
    Store(ParamSet, u32),
}

/// A persist under way.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Storing {
    generation: u32,
    params: ParamSet,
    request: Request,
    handed_out: bool,
}

/// The coordinator's whole state. Every call is bounded: no loop depends on anything but the length of its input.
#[derive(Clone, Debug)]
pub struct Coordinator {
    config: Config,
    attitude: Attitude,
    sample: ImuSample,
    lean: [Q16; 2],
    motion_sequence: u16,
    imu_age: Age,
    imu_seen: bool,
    imu_lost: bool,
    nodes: Nodes,
    generations: Generations,
    safety: Safety,
    writer: Writer,
    fell_back: bool,
    split: bool,
    staging_failed: bool,
    storing: Option<Storing>,
    /// The word carried out last that lets the robot move or a stop be forgotten.
    carried_out: Option<Request>,
    deframer: Deframer,
    frame_errors: u32,
    sequence: u16,
    telemetry_period_us: u32,
    telemetry_age: Age,
    dropped: u32,
    now_us: u32,
    tick_us: u32,
    started: bool,
}

impl Coordinator {
    /// Braked, unclaimed, having heard nobody.
    pub fn new(config: Config) -> Self {
        Coordinator {
            config,
            attitude: Attitude::new(),
            sample: ImuSample::default(),
            lean: [Q16::ZERO; 2],
            motion_sequence: 0,
            imu_age: Age::default(),
            imu_seen: false,
            imu_lost: false,
            nodes: Nodes::new(),
            generations: Generations::new(config.default, config.stored),
            safety: Safety::new(config.arm_at_boot),
            writer: Writer::new(),
            fell_back: false,
            split: false,
            staging_failed: false,
            storing: None,
            carried_out: None,
            deframer: Deframer::new(),
            frame_errors: 0,
            sequence: 0,
            telemetry_period_us: config.telemetry_period_us,
            telemetry_age: Age::NEVER,
            dropped: 0,
            now_us: 0,
            tick_us: 0,
            started: false,
        }
    }

    /// Braked or armed.
    pub const fn mode(&self) -> Mode {
        self.safety.mode()
    }

    /// Generation in force and its set.
    pub fn applied(&self) -> (u32, &ParamSet) {
        (self.generations.applied().number, &self.generations.applied().params)
    }

    /// Frames from the host that failed their check; wraps.
    pub const fn frame_errors(&self) -> u32 {
        self.frame_errors
    }

    /// An IMU sample: updates the attitude and tells the nodes.
    pub fn on_imu(&mut self, now_us: u32, sample: &ImuSample, bus: &mut BusOutbox) {
        self.advance(now_us);
        let dt_us = if self.imu_seen { self.imu_age.us() } else { self.config.imu_period_us };
        self.imu_seen = true;
        self.imu_age.reset();
        self.sample = *sample;
        let mut motion = self.attitude.update(dt_us, sample);
        self.lean = motion.lean;
        self.motion_sequence = self.motion_sequence.wrapping_add(1);
        motion.sequence = self.motion_sequence;
        if !self.safety.finishing() {
            motion.mode = self.safety.next_motion();
            bus.motion(motion);
        }
    }

    /// A frame from the bus. What is not ours, or does not decode, is ignored: its sender repeats what matters.
    pub fn on_bus(&mut self, now_us: u32, frame: &Frame, bus: &mut BusOutbox, host: &mut HostOutbox) {
        self.advance(now_us);
        match Message::decode(frame) {
            Ok(Message::Gait(gait)) => self.generations.on_gait(&gait),
            Ok(Message::Staged(node, staged)) => {
                let news = self.generations.on_staged(node, &staged);
                self.report(news, bus, host);
            }
            Ok(Message::Status(node, status)) => {
                let event = self.nodes.heard(node, &status);
                if let Some(event) = event {
                    self.event(event, host);
                }
                if let Some(Event::NodeRestarted(_)) = event {
                    self.halt_if_armed(HaltReason::NodeFault, bus, host);
                    let news = self.generations.node_restarted();
                    self.report(news, bus, host);
                }
                let news = self.generations.on_status(node, &status, &self.nodes);
                self.report(news, bus, host);
                if self.nodes.unfit(node) {
                    self.halt_if_armed(HaltReason::NodeFault, bus, host);
                }
            }
            _ => {}
        }
    }

    /// Bytes from the host, any number, in any pieces. Costs time in proportion to their number and nothing else; hand
    /// over no more at once than fits between two IMU samples.
    pub fn on_host_bytes(&mut self, now_us: u32, bytes: &[u8], bus: &mut BusOutbox, host: &mut HostOutbox) {
        self.advance(now_us);
        for byte in bytes {
            let heard = match self.deframer.push(*byte) {
                None => continue,
                Some(Ok(packet)) => Ok((packet.header, ToRobot::decode(&packet))),
                Some(Err(error)) => Err(error),
            };
            match heard {
                Ok((header, message)) => self.on_message(header, message, bus, host),
                Err(_) => self.frame_errors = self.frame_errors.wrapping_add(1),
            }
        }
    }

    /// The shell has carried out [`Action::Store`], or failed to.
    pub fn on_stored(&mut self, generation: u32, ok: bool, host: &mut HostOutbox) {
        let Some(storing) = self.storing.filter(|storing| storing.generation == generation) else { return };
        self.storing = None;
        if ok {
            self.generations.set_stored(storing.params);
        }
        let state = if ok { AckState::Persisted { generation } } else { AckState::Refused(Refusal::Storage) };
        self.ack(storing.request, state, host);
    }

    /// Time-outs, retries, telemetry. Call at 1 kHz or so.
    pub fn tick(&mut self, now_us: u32, bus: &mut BusOutbox, host: &mut HostOutbox) -> Option<Action> {
        self.advance(now_us);
        let dt_us = core::mem::take(&mut self.tick_us);

        if let Some(reason) = self.safety.advance(dt_us) {
            bus.halt(reason);
        }
        self.watch_imu(host);
        if let Some(node) = self.nodes.newly_lost(self.config.node_silence_us) {
            self.event(Event::NodeLost(node), host);
            self.halt_if_armed(HaltReason::NodeFault, bus, host);
        }
        self.watch_host(dt_us, host);

        let (news, message) = self.generations.tick(dt_us, &self.nodes);
        self.report(news, bus, host);
        if let Some(message) = message {
            // Refused when full: repeated 20 ms later.
            let _ = bus.command(message);
        }
        if self.safety.wants_to_arm() && self.ready().is_ok() && self.safety.arm() {
            self.event(Event::Armed, host);
        }

        self.telemetry_age.advance(dt_us);
        if self.telemetry_period_us != 0 && self.telemetry_age.due(self.telemetry_period_us) {
            self.send_telemetry(host);
        }
        let storing = self.storing.as_mut().filter(|storing| !storing.handed_out)?;
        storing.handed_out = true;
        Some(Action::Store(storing.params, storing.generation))
    }

    /// Takes the clock to `now_us`. Whoever calls late or out of order cannot turn it back.
    fn advance(&mut self, now_us: u32) {
        if !core::mem::replace(&mut self.started, true) {
            self.now_us = now_us;
        }
        let dt_us = now_us.wrapping_sub(self.now_us);
        // Nothing passes between the calls of one turn.
        if dt_us == 0 || dt_us > u32::MAX / 2 {
            return;
        }
        self.now_us = now_us;
        self.imu_age.advance(dt_us);
        self.nodes.advance(dt_us);
        self.tick_us = self.tick_us.saturating_add(dt_us);
    }

    fn watch_imu(&mut self, host: &mut HostOutbox) {
        let lost = self.imu_age.reached(self.config.imu_silence_us);
        if lost && !self.imu_lost && self.safety.mode() == Mode::Armed {
            self.safety.halt_after_cycle(HaltReason::ImuLost);
            self.event(Event::Halted(HaltReason::ImuLost), host);
        }
        if self.imu_lost && !lost {
            self.event(Event::ImuBack, host);
        }
        self.imu_lost = lost;
    }

    fn watch_host(&mut self, dt_us: u32, host: &mut HostOutbox) {
        if self.writer.advance(dt_us, self.config.writer_lapse_us) {
            self.event(Event::WriterLapsed, host);
            // The next host does not know what this one asked for.
            self.telemetry_period_us = self.config.telemetry_period_us;
        }
        let silent = self.writer.silence().reached(self.config.host_fallback_us);
        if silent && !self.fell_back && self.generations.on_host_set() {
            self.fell_back = self.generations.fall_back();
        }
        self.fell_back &= silent && self.generations.on_host_set();
    }

    /// A fault before the first arming has nothing to stop, and must not keep an unattended robot from starting.
    fn halt_if_armed(&mut self, reason: HaltReason, bus: &mut BusOutbox, host: &mut HostOutbox) {
        if self.safety.mode() == Mode::Armed {
            self.halt(reason, bus, host);
        }
    }

    fn halt(&mut self, reason: HaltReason, bus: &mut BusOutbox, host: &mut HostOutbox) {
        bus.halt(reason);
        if self.safety.halt(reason) {
            self.event(Event::Halted(reason), host);
        }
    }

    fn stale(&self) -> bool {
        self.generations.on_host_set() && self.writer.silence().reached(self.config.host_silence_us)
    }
}

#[cfg(test)]
mod tests;
