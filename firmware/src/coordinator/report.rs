//! What the coordinator tells its host: acks, events, telemetry.

use sarah_protocol::bus::{HaltReason, NodeId};
use sarah_protocol::fixed::Q16;
use sarah_protocol::host::{Ack, AckState, HelloReply, Refusal, Report, ToHost, VERSION};
use sarah_protocol::schema::schema_hash;
use sarah_protocol::telemetry::{Event, Telemetry, faults};

use super::generations::{News, Outcome, Request};
use super::{BusOutbox, Coordinator, HostOutbox};

impl Coordinator {
    pub(super) fn report(&mut self, news: Option<News>, bus: &mut BusOutbox, host: &mut HostOutbox) {
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

    pub(super) fn send_telemetry(&mut self, host: &mut HostOutbox) {
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
            gyro_bias: self.attitude.bias(),
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

    pub(super) fn hello(&self) -> HelloReply {
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

    pub(super) fn send(&mut self, session: u16, message: &ToHost, host: &mut HostOutbox) {
        if let Some(bytes) = message.encode(session, self.next_sequence()) {
            host.reply(bytes);
        }
    }

    pub(super) fn ack(&mut self, request: Request, state: AckState, host: &mut HostOutbox) {
        let ack = Ack { request: request.sequence, state };
        self.send(request.session, &ToHost::Report(Report::Ack(ack)), host);
    }

    pub(super) fn event(&mut self, event: Event, host: &mut HostOutbox) {
        let time_us = self.now_us;
        self.send(0, &ToHost::Report(Report::Event { time_us, event }), host);
    }
}
