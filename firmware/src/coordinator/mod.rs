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
//! | IMU | halt, latched until armed |
//! | a node, or a node restarts | halt, latched until armed; the applied set is staged anew |
//! | emergency stop | halt, latched until cleared **and** armed |
//!
//! - [`generations`]: whole sets or nothing. [`safety`]: the arming. [`writer`]: one host at a time.
//! - [`nodes`]: who is alive. [`outbox`]: what waits to be sent. [`age`]: time that does not wrap.
//! - [`commands`]: what each host command does.

pub mod age;
pub mod commands;
pub mod generations;
pub mod nodes;
pub mod outbox;
pub mod safety;
pub mod writer;

use sarah_protocol::bus::{Frame, HaltReason, Message, Mode, NodeId};
use sarah_protocol::fixed::Q16;
use sarah_protocol::frame::Deframer;
use sarah_protocol::host::{AckState, HelloReply, Refusal, Report, ToHost, ToRobot, VERSION};
use sarah_protocol::params::ParamSet;
use sarah_protocol::schema::schema_hash;
use sarah_protocol::telemetry::{Event, ResetCause, Telemetry, faults};

pub use crate::attitude::ImuSample;
pub use outbox::{BusOutbox, HostOutbox};

use crate::attitude::Attitude;
use age::Age;
use generations::{Generations, News, Outcome, Request};
use nodes::Nodes;
use safety::Safety;
use writer::Writer;

/// Who this robot is, for the hello.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Identity {
    /// Drawn at boot.
    pub boot_nonce: u32,
    /// Which board; 0 is simulated.
    pub board: u8,
    /// Firmware build, ASCII, padded with zeros.
    pub build: [u8; 16],
    /// Why the chip started.
    pub reset_cause: ResetCause,
}

/// What the coordinator is born with. Times in µs.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Config {
    /// Who this is.
    pub identity: Identity,
    /// The set built into the nodes' images: generation 0.
    pub default: ParamSet,
    /// The set in non-volatile memory, or the default.
    pub stored: ParamSet,
    /// Arm once, without a host, as soon as IMU and nodes are there. For a robot that is to balance unattended from
    /// power-up; any halt ends it, and then only an explicit arm resumes. Off unless a deployment asks for it.
    pub arm_at_boot: bool,
    /// Nominal time between IMU samples; the first one counts as this much.
    pub imu_period_us: u32,
    /// The IMU is lost after this silence.
    pub imu_silence_us: u32,
    /// A node is lost after this silence.
    pub node_silence_us: u32,
    /// Between telemetry frames until a host asks for another rate.
    pub telemetry_period_us: u32,
    /// A silent writer loses its claim after this.
    pub writer_lapse_us: u32,
    /// The applied set is stale after this silence of its host.
    pub host_silence_us: u32,
    /// The stored set returns after this silence of its host.
    pub host_fallback_us: u32,
}

impl Config {
    /// The usual times: IMU 1 kHz, telemetry 100 Hz, IMU lost after 50 ms, node after 100 ms, host stale after 2 s, fall
    /// back after 10 s.
    pub const fn new(identity: Identity, default: ParamSet, stored: ParamSet) -> Config {
        Config {
            identity,
            default,
            stored,
            arm_at_boot: false,
            imu_period_us: 1_000,
            imu_silence_us: 50_000,
            node_silence_us: 100_000,
            telemetry_period_us: 10_000,
            writer_lapse_us: 2_000_000,
            host_silence_us: 2_000_000,
            host_fallback_us: 10_000_000,
        }
    }
}

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
        motion.mode = self.safety.next_motion();
        bus.motion(motion);
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
        self.watch_imu(bus, host);
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
        let dt_us = if self.started { now_us.wrapping_sub(self.now_us) } else { 0 };
        self.started = true;
        if dt_us > u32::MAX / 2 {
            return;
        }
        self.now_us = now_us;
        self.imu_age.advance(dt_us);
        self.nodes.advance(dt_us);
        self.tick_us = self.tick_us.saturating_add(dt_us);
    }

    fn watch_imu(&mut self, bus: &mut BusOutbox, host: &mut HostOutbox) {
        let lost = self.imu_age.reached(self.config.imu_silence_us);
        if lost && !self.imu_lost {
            self.halt_if_armed(HaltReason::ImuLost, bus, host);
        }
        if self.imu_lost && !lost {
            self.event(Event::ImuBack, host);
        }
        self.imu_lost = lost;
    }

    fn watch_host(&mut self, dt_us: u32, host: &mut HostOutbox) {
        if self.writer.advance(dt_us, self.config.writer_lapse_us) {
            self.event(Event::WriterLapsed, host);
        }
        let silent = self.writer.silence().reached(self.config.host_fallback_us);
        if silent && !self.fell_back && self.generations.on_host_set() {
            self.generations.fall_back();
            self.fell_back = true;
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

    fn report(&mut self, news: Option<News>, bus: &mut BusOutbox, host: &mut HostOutbox) {
        let Some(News { generation, request, outcome }) = news else { return };
        let (state, event) = match outcome {
            Outcome::Staged => (Some(AckState::Staged { generation }), None),
            Outcome::Applied { cycle } => {
                (self.split, self.staging_failed) = (false, false);
                (Some(AckState::Applied { generation, cycle }), Some(Event::Applied { generation, cycle }))
            }
            Outcome::Refused(node, error) => {
                (Some(AckState::Refused(Refusal::Node(node, error))), Some(Event::StagingFailed { generation }))
            }
            Outcome::Silent => {
                (Some(AckState::Refused(Refusal::NodeSilent)), Some(Event::StagingFailed { generation }))
            }
            Outcome::Late => {
                (Some(AckState::Refused(Refusal::Busy(generation))), Some(Event::StagingFailed { generation }))
            }
            Outcome::Split(node) => {
                self.split = true;
                (Some(AckState::Refused(Refusal::NodeSilent)), Some(Event::GenerationSplit(node)))
            }
            Outcome::Restaging => (None, Some(Event::Restaging { generation })),
        };
        self.staging_failed |= matches!(event, Some(Event::StagingFailed { .. }));
        if let (Some(request), Some(state)) = (request, state) {
            self.ack(request, state, host);
        }
        if let Some(event) = event {
            self.event(event, host);
        }
        if matches!(outcome, Outcome::Late | Outcome::Split(_)) {
            self.halt_if_armed(HaltReason::NodeFault, bus, host);
        }
    }

    fn send_telemetry(&mut self, host: &mut HostOutbox) {
        if !host.wants_telemetry() {
            self.dropped = self.dropped.wrapping_add(1);
            return;
        }
        let telemetry = ToHost::Report(Report::Telemetry(self.telemetry()));
        if let Some(bytes) = telemetry.encode(0, self.next_sequence()) {
            host.telemetry(bytes);
        }
    }

    /// The snapshot a host would get now.
    pub fn telemetry(&self) -> Telemetry {
        let [knee, hip, abductor] = NodeId::ALL.map(|id| self.nodes.status(id).copied());
        let joints = [&knee, &hip, &abductor].map(|status| status.map_or([Q16::ZERO; 2], |s| s.position));
        let [[l_knee, r_knee], [l_hip, r_hip], [l_abd, r_abd]] = joints;
        let applied = self.generations.applied();
        Telemetry {
            time_us: self.now_us,
            accel: self.sample.accel,
            gyro: self.sample.gyro,
            loads: knee.map_or([0; 4], |status| status.loads),
            joints: [l_abd, l_hip, l_knee, r_abd, r_hip, r_knee],
            lean: self.lean,
            phases: [&knee, &hip, &abductor].map(|status| status.map_or(0, |s| s.phase)),
            factor: knee.map_or(Q16::ZERO, |status| status.factor),
            steps: knee.map_or(0, |status| status.steps),
            cycle: knee.map_or(0, |status| status.cycle),
            generation: applied.number,
            generation_age_ms: self.generations.applied_age().us() / 1000,
            stale: self.stale(),
            mode: self.safety.mode(),
            faults: self.faults(),
            limits: [&knee, &hip, &abductor].map(|status| status.map_or(0, |s| s.limits)),
            reset_cause: self.config.identity.reset_cause,
            dropped: self.dropped,
        }
    }

    fn faults(&self) -> u16 {
        let bits = [
            (faults::E_STOP, self.safety.stopped()),
            (faults::HALTED, self.safety.halted()),
            (faults::IMU_LOST, self.imu_lost || !self.imu_seen),
            (faults::GENERATION_SPLIT, self.split),
            (faults::STAGING, self.staging_failed),
        ];
        let lost = u16::from(!self.nodes.map() & 0b111);
        bits.iter().fold(lost * faults::NODE_LOST, |all, (bit, set)| if *set { all | bit } else { all })
    }

    fn hello(&self) -> HelloReply {
        let identity = &self.config.identity;
        HelloReply {
            version: VERSION,
            schema: schema_hash(),
            boot_nonce: identity.boot_nonce,
            board: identity.board,
            nodes: self.nodes.map(),
            build: identity.build,
        }
    }

    fn next_sequence(&mut self) -> u16 {
        self.sequence = self.sequence.wrapping_add(1);
        self.sequence
    }

    fn send(&mut self, session: u16, message: &ToHost, host: &mut HostOutbox) {
        if let Some(bytes) = message.encode(session, self.next_sequence()) {
            host.reply(bytes);
        }
    }

    fn ack(&mut self, request: Request, state: AckState, host: &mut HostOutbox) {
        let ack = sarah_protocol::host::Ack { request: request.sequence, state };
        self.send(request.session, &ToHost::Report(Report::Ack(ack)), host);
    }

    fn event(&mut self, event: Event, host: &mut HostOutbox) {
        let time_us = self.now_us;
        self.send(0, &ToHost::Report(Report::Event { time_us, event }), host);
    }
}

#[cfg(test)]
mod tests;
