//! What each host command does.
//!
//! | command | needs | effect |
//! |---|---|---|
//! | hello | – | hello |
//! | emergency stop | – | halt, latched |
//! | get params | – | answer |
//! | claim | no other live writer | becomes the writer |
//! | everything else | the claim | see [`Command`] |

use sarah_protocol::bus::{HaltReason, NodeId};
use sarah_protocol::frame::Header;
use sarah_protocol::host::{
    AckState, Command, MessageError, NotReady, ParamsReport, Refusal, Report, ToHost, ToRobot, Which,
};
use sarah_protocol::telemetry::Event;

use super::generations::Request;
use super::{BusOutbox, Coordinator, HostOutbox, Mode, Storing};

/// Fastest telemetry, frames per second.
const MAX_RATE_HZ: u16 = 1000;

impl Coordinator {
    pub(super) fn on_message(
        &mut self,
        header: Header,
        message: Result<ToRobot, MessageError>,
        bus: &mut BusOutbox,
        host: &mut HostOutbox,
    ) {
        let request = Request { session: header.session, sequence: header.sequence };
        self.writer.heard(header.session);
        let state = match message {
            // Frozen, so that a host of any version understands why nothing else is answered.
            Ok(ToRobot::Hello(_)) | Err(MessageError::Version(_)) => {
                let hello = self.hello();
                return self.send(header.session, &ToHost::Hello(hello), host);
            }
            Ok(ToRobot::EStop) => {
                self.halt(HaltReason::EmergencyStop, bus, host);
                Ok(AckState::Received)
            }
            Ok(ToRobot::Command(Command::GetParams(which))) => {
                let report = self.params(which);
                return self.send(header.session, &ToHost::Report(Report::Params(report)), host);
            }
            Ok(ToRobot::Command(command)) => self.on_command(&command, request, bus, host),
            Err(MessageError::Malformed) => Err(Refusal::Malformed),
        };
        self.ack(request, state.unwrap_or_else(AckState::Refused), host);
    }

    fn on_command(
        &mut self,
        command: &Command,
        request: Request,
        bus: &mut BusOutbox,
        host: &mut HostOutbox,
    ) -> Result<AckState, Refusal> {
        match command {
            Command::GetParams(_) => return Ok(AckState::Received),
            Command::Claim => return self.writer.claim(request.session).map(|()| AckState::Received),
            _ => self.writer.check(request.session)?,
        }
        match *command {
            Command::Release => {
                self.writer.release(request.session)?;
                self.telemetry_period_us = self.config.telemetry_period_us;
            }
            // A repeated word has had its effect: what stopped the robot since then holds.
            Command::Arm { .. } | Command::ClearEStop if self.carried_out == Some(request) => {}
            Command::Arm { boot_nonce } => {
                self.arm(boot_nonce, host)?;
                self.carried_out = Some(request);
            }
            Command::Disarm => self.halt(HaltReason::Disarmed, bus, host),
            Command::ClearEStop => {
                if self.safety.clear() {
                    self.event(Event::EStopCleared, host);
                }
                self.carried_out = Some(request);
            }
            Command::Stage { generation, params } => return self.generations.stage(generation, params, request),
            Command::Commit { generation } => return self.generations.commit(generation, request),
            Command::Persist { generation } => return self.persist(generation, request),
            Command::SetTelemetry { rate_hz } => {
                if rate_hz > MAX_RATE_HZ {
                    return Err(Refusal::OutOfRange);
                }
                self.telemetry_period_us = 1_000_000u32.checked_div(u32::from(rate_hz)).unwrap_or(0);
            }
            Command::Claim | Command::Heartbeat { .. } | Command::GetParams(_) => {}
        }
        Ok(AckState::Received)
    }

    fn arm(&mut self, boot_nonce: u32, host: &mut HostOutbox) -> Result<(), Refusal> {
        let current = self.config.identity.boot_nonce;
        if boot_nonce != current {
            return Err(Refusal::Rebooted { current });
        }
        if self.safety.stopped() {
            return Err(Refusal::EStop);
        }
        if self.safety.mode() == Mode::Armed {
            return Ok(());
        }
        self.ready().map_err(Refusal::NotReady)?;
        if self.safety.arm() {
            self.event(Event::Armed, host);
        }
        Ok(())
    }

    /// Whether motion may be allowed.
    pub(super) fn ready(&self) -> Result<(), NotReady> {
        if !self.imu_seen || self.imu_age.reached(self.config.imu_silence_us) || !self.attitude.settled() {
            return Err(NotReady::Imu);
        }
        let unfit = || NodeId::ALL.into_iter().find(|node| self.nodes.unfit(*node));
        if let Some(node) = self.nodes.missing().or_else(unfit) {
            return Err(NotReady::Node(node));
        }
        if self.generations.settled(&self.nodes) { Ok(()) } else { Err(NotReady::Generations) }
    }

    fn persist(&mut self, generation: u32, request: Request) -> Result<AckState, Refusal> {
        let applied = *self.generations.applied();
        if applied.number != generation {
            return Err(Refusal::NotApplied { applied: applied.number });
        }
        match &mut self.storing {
            Some(storing) if storing.generation == generation => storing.request = request,
            Some(storing) => return Err(Refusal::Busy(storing.generation)),
            None if *self.generations.stored() == applied.params => return Ok(AckState::Persisted { generation }),
            None => {
                self.storing = Some(Storing { generation, params: applied.params, request, handed_out: false });
            }
        }
        Ok(AckState::Received)
    }

    fn params(&self, which: Which) -> ParamsReport {
        let (generation, params) = match which {
            Which::Applied => {
                let applied = self.generations.applied();
                (applied.number, Some(applied.params))
            }
            Which::Stored => (0, Some(*self.generations.stored())),
            Which::Staged => self.generations.staged().map_or((0, None), |set| (set.number, Some(set.params))),
        };
        ParamsReport { which, generation, params: params.map(|set| *set.values()) }
    }
}
