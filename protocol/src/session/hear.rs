//! What each message of the robot means for the session.

use super::change::Step;
use super::{HostSession, News, Pending, SessionError, State};
use crate::frame::Header;
use crate::host::{Ack, AckState, Command, HelloReply, MessageError, Refusal, Report, ToHost, ToRobot, VERSION, Which};
use crate::newer;
use crate::schema::schema_hash;
use crate::telemetry::Event;

impl HostSession {
    pub(super) fn heard(
        &mut self,
        now_us: u64,
        header: Header,
        message: Result<ToHost, MessageError>,
        news: &mut impl FnMut(News),
    ) {
        self.stats.received(header.sequence);
        if header.session != 0 && header.session != self.session {
            return;
        }
        self.heard_us = now_us;
        match message {
            Ok(ToHost::Hello(reply)) => self.on_hello(now_us, header.sequence, &reply, news),
            // Before the hello nothing is believed: the bytes may mean something else over there.
            Ok(ToHost::Report(_)) if matches!(self.state, State::Greeting | State::Failed(_)) => {}
            Ok(ToHost::Report(report)) => self.on_report(now_us, &report, news),
            Err(_) => self.stats.undecodable = self.stats.undecodable.saturating_add(1),
        }
    }

    fn on_hello(&mut self, now_us: u64, sequence: u16, reply: &HelloReply, news: &mut impl FnMut(News)) {
        let (ours, theirs) = (schema_hash(), reply.schema);
        let error = if reply.version != VERSION {
            Some(SessionError::Version { ours: VERSION, theirs: reply.version })
        } else if theirs != ours {
            Some(SessionError::Schema { ours, theirs })
        } else {
            None
        };
        if let Some(error) = error {
            if self.state != State::Failed(error) {
                self.state = State::Failed(error);
                self.pending = None;
                news(News::Failed(error));
            }
            return;
        }
        if let Some(pending) = self.pending.take_if(|pending| matches!(pending.message, ToRobot::Hello(_))) {
            self.measure(now_us, &pending);
        }
        let rebooted = self.robot.is_some_and(|before| before.boot_nonce != reply.boot_nonce);
        if rebooted {
            self.forget(sequence);
            news(News::Rebooted);
        }
        self.robot = Some(*reply);
        if rebooted || self.state == State::Greeting {
            self.state = if self.writer { State::Claiming } else { State::Open };
            self.beat_us = now_us;
            news(News::Connected(*reply));
        }
    }

    fn on_report(&mut self, now_us: u64, report: &Report, news: &mut impl FnMut(News)) {
        match report {
            Report::Ack(ack) => self.on_ack(now_us, ack, news),
            Report::Params(params) => {
                if params.which == Which::Applied {
                    // A late answer to an earlier question: the one asked now is still to come.
                    if newer(self.applied, params.generation) {
                        return;
                    }
                    self.learn(params.generation);
                }
                let asked = ToRobot::Command(Command::GetParams(params.which));
                if let Some(pending) = self.pending.take_if(|pending| pending.message == asked) {
                    self.measure(now_us, &pending);
                    news(News::Params(*params));
                }
            }
            Report::Telemetry(telemetry) => {
                self.learn(telemetry.generation);
                news(News::Telemetry(*telemetry));
            }
            Report::Event { time_us, event } => {
                if let Event::Applied { generation, .. } = event {
                    self.learn(*generation);
                }
                news(News::Event { time_us: *time_us, event: *event });
            }
        }
    }

    fn on_ack(&mut self, now_us: u64, ack: &Ack, news: &mut impl FnMut(News)) {
        self.stop.take_if(|stop| stop.sequence == ack.request);
        // Staged, applied and persisted come when they come; the request itself may be answered long before.
        match ack.state {
            AckState::Staged { generation } => self.staged = Some(generation),
            AckState::Applied { generation, .. } => self.learn(generation),
            AckState::Persisted { generation } if self.persisted != Some(generation) => {
                self.persisted = Some(generation);
                news(News::Persisted(generation));
            }
            _ => {}
        }
        let refusal = if let AckState::Refused(refusal) = ack.state { Some(refusal) } else { None };
        if let Some(changing) = self.changing.filter(|changing| changing.sequence == ack.request) {
            self.measure(now_us, &changing);
            if refusal == Some(Refusal::NotClaimed) {
                return self.greet();
            }
            self.changing = Some(Pending { answered: true, ..changing });
            return self.on_change(&ack.state, news);
        }
        if let Some(disarm) = self.disarm.take_if(|disarm| disarm.sequence == ack.request) {
            self.measure(now_us, &disarm);
            if refusal == Some(Refusal::NotClaimed) && self.writer {
                // Said again under the next claim.
                self.disarm = Some(Pending { answered: true, ..disarm });
                return self.greet();
            }
            return news(outcome(Command::Disarm, refusal));
        }
        let Some(pending) = self.pending.filter(|pending| pending.sequence == ack.request) else {
            // A duplicate; or what an earlier copy of the change has come to.
            if refusal.is_none() {
                self.on_change(&ack.state, news);
            }
            return;
        };
        self.measure(now_us, &pending);
        self.pending = Some(Pending { answered: true, ..pending });
        let ToRobot::Command(command) = pending.message else { return };
        match command {
            Command::Release => self.finish(command, refusal, news),
            // A reboot or a lapse: the hello tells which.
            _ if refusal == Some(Refusal::NotClaimed) => self.greet(),
            Command::Heartbeat { .. } => self.pending = None,
            Command::Claim => match refusal {
                None => {
                    self.pending = None;
                    self.state = State::Open;
                    news(News::Claimed);
                }
                // Stays pending: asked again until the other one lets go or lapses.
                Some(refusal) if !pending.answered => news(News::Refused(command, refusal)),
                Some(_) => {}
            },
            // Repeated until the set is written.
            Command::Persist { .. } if ack.state == AckState::Received => {}
            _ => self.finish(command, refusal, news),
        }
    }

    fn finish(&mut self, command: Command, refusal: Option<Refusal>, news: &mut impl FnMut(News)) {
        self.pending = None;
        news(outcome(command, refusal));
    }

    fn on_change(&mut self, state: &AckState, news: &mut impl FnMut(News)) {
        let Some(change) = &mut self.change else { return };
        let command = change.command();
        let step = change.on_ack(state);
        let generation = change.generation;
        match step {
            Step::Wait => return,
            Step::Staged => news(News::Staged(generation)),
            Step::Applied { cycle } => {
                self.change = None;
                news(News::Applied { generation, cycle });
            }
            Step::Renumbered { from } => {
                self.learn_number(generation);
                news(News::Renumbered { from, to: generation });
            }
            Step::Refused(refusal) => {
                self.change = None;
                news(News::Refused(command, refusal));
            }
        }
        self.changing = None;
    }

    fn learn(&mut self, applied: u32) {
        self.applied = applied;
        self.learn_number(applied);
    }

    pub(super) fn learn_number(&mut self, generation: u32) {
        if newer(generation, self.newest) {
            self.newest = generation;
        }
    }

    fn measure(&mut self, now_us: u64, pending: &Pending) {
        if let Pending { sent_us: Some(sent), answered: false, repeated: false, .. } = pending {
            self.stats.round_trip(now_us.saturating_sub(*sent));
        }
    }
}

fn outcome(command: Command, refusal: Option<Refusal>) -> News {
    refusal.map_or(News::Done(command), |refusal| News::Refused(command, refusal))
}
