//! The host's side of the conversation: a pure state machine, bytes and time in, bytes and news out.
//!
//! ```text
//!             hello                 same version and schema            claimed
//!   Greeting ───────► … answer … ─────────────────────────► Claiming ─────────► Open
//!      ▲                  └─ another ──► Failed (says which)     ▲ └─ another host writes: asks again   │
//!      └──────────── silence, or "not claimed" ─────────────────────────────────────────────────────────┘
//! ```
//!
//! Every request is repeated under its number until it is answered; the robot answers a repeated request as it did the
//! first. After a reboot of the robot nothing that was asked before is repeated: above all no arming.

mod change;
mod news;
mod stats;

use heapless::Deque;

use crate::frame::{Bytes, Deframer, Header};
use crate::host::{
    Ack, AckState, Command, Hello, HelloReply, MessageError, Refusal, Report, ToHost, ToRobot, VERSION, Which,
};
use crate::newer;
use crate::params::ParamSet;
use crate::schema::schema_hash;
use crate::telemetry::Event;

use change::{Change, Step};
pub use news::{News, NotNow, SessionError, State};
pub use stats::LinkStats;

/// An unanswered request is repeated after this, µs.
const RETRY_US: u64 = 100_000;
/// The writer says that it lives this often, µs; its claim lapses after 2 s.
const HEARTBEAT_US: u64 = 500_000;
/// Without a frame for this long the link is taken for lost, µs.
const SILENCE_US: u64 = 1_500_000;

/// A request that waits for its answer.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Pending {
    message: ToRobot,
    sequence: u16,
    sent_us: Option<u64>,
    answered: bool,
    repeated: bool,
}

/// One conversation with one robot.
#[derive(Clone, Debug)]
pub struct HostSession {
    session: u16,
    writer: bool,
    state: State,
    robot: Option<HelloReply>,
    deframer: Deframer,
    sequence: u16,
    stop: Option<Pending>,
    pending: Option<Pending>,
    /// The change's own lane: waiting for a boundary must not hold up a disarm.
    changing: Option<Pending>,
    queue: Deque<Command, 8>,
    change: Option<Change>,
    newest: u32,
    applied: u32,
    staged: Option<u32>,
    persisted: Option<u32>,
    stats: LinkStats,
    heard_us: u64,
    beat_us: u64,
}

impl HostSession {
    /// A session that claims the robot. `session` tells hosts apart: draw it at random, not 0.
    pub fn new(session: u16) -> Self {
        HostSession {
            session,
            writer: true,
            state: State::Greeting,
            robot: None,
            deframer: Deframer::new(),
            sequence: 0,
            stop: None,
            pending: None,
            changing: None,
            queue: Deque::new(),
            change: None,
            newest: 0,
            applied: 0,
            staged: None,
            persisted: None,
            stats: LinkStats::default(),
            heard_us: 0,
            beat_us: 0,
        }
    }

    /// A session that only reads.
    pub fn observer(session: u16) -> Self {
        HostSession { writer: false, ..HostSession::new(session) }
    }

    /// Where the conversation is.
    pub fn state(&self) -> State {
        self.state
    }

    /// The robot's last hello.
    pub fn robot(&self) -> Option<&HelloReply> {
        self.robot.as_ref()
    }

    /// Generation in force, as far as the robot told.
    pub fn applied(&self) -> u32 {
        self.applied
    }

    /// Generation last staged by this session.
    pub fn staged(&self) -> Option<u32> {
        self.staged
    }

    /// Generation last persisted by this session.
    pub fn persisted(&self) -> Option<u32> {
        self.persisted
    }

    /// Generation of the change under way.
    pub fn changing(&self) -> Option<u32> {
        self.change.map(|change| change.generation)
    }

    /// How good the link is.
    pub fn stats(&self) -> &LinkStats {
        &self.stats
    }

    /// Stages and commits a set. Its generation; the outcome comes as news.
    pub fn apply(&mut self, params: &ParamSet) -> Result<u32, NotNow> {
        if let Some(change) = self.change {
            return Err(NotNow::Changing(change.generation));
        }
        self.newest = self.newest.wrapping_add(1);
        self.change = Some(Change::new(self.newest, *params));
        Ok(self.newest)
    }

    /// Keeps the applied set over power cycles.
    pub fn persist(&mut self) -> Result<(), NotNow> {
        self.request(Command::Persist { generation: self.applied })
    }

    /// Allows motion, on the boot this session knows.
    pub fn arm(&mut self) -> Result<(), NotNow> {
        let boot_nonce = self.robot.ok_or(NotNow::NotConnected)?.boot_nonce;
        self.request(Command::Arm { boot_nonce })
    }

    /// Brakes now.
    pub fn disarm(&mut self) -> Result<(), NotNow> {
        self.forget_arming();
        self.queue.push_front(Command::Disarm).map_err(|_| NotNow::Full)
    }

    /// Emergency stop: ahead of everything, in any state, without a claim.
    pub fn e_stop(&mut self) {
        self.stop = Some(self.number(ToRobot::EStop));
        // An arming that still waits must not follow the stop.
        self.forget_arming();
    }

    /// Unlatches the emergency stop; the robot stays braked until armed.
    pub fn clear_e_stop(&mut self) -> Result<(), NotNow> {
        self.request(Command::ClearEStop)
    }

    /// Lets others write. The session claims again with the next reconnection.
    pub fn release(&mut self) -> Result<(), NotNow> {
        self.request(Command::Release)
    }

    /// Asks for a set.
    pub fn get_params(&mut self, which: Which) -> Result<(), NotNow> {
        self.request(Command::GetParams(which))
    }

    /// Telemetry frames per second; 0 is off.
    pub fn set_telemetry(&mut self, rate_hz: u16) -> Result<(), NotNow> {
        self.request(Command::SetTelemetry { rate_hz })
    }

    fn request(&mut self, command: Command) -> Result<(), NotNow> {
        self.queue.push_back(command).map_err(|_| NotNow::Full)
    }

    /// The next frame to send at this moment, if any; call until it returns `None`.
    pub fn poll(&mut self, now_us: u64) -> Option<Bytes> {
        if let Some(stop) = &mut self.stop
            && let Some(bytes) = send(stop, self.session, now_us, &mut self.stats)
        {
            return Some(bytes);
        }
        if matches!(self.state, State::Failed(_)) {
            return None;
        }
        if self.state != State::Greeting && now_us.saturating_sub(self.heard_us) > SILENCE_US {
            self.greet();
        }
        if self.pending.is_none()
            && let Some(message) = self.next_message(now_us)
        {
            self.pending = Some(self.number(message));
        }
        if let Some(pending) = &mut self.pending
            && let Some(bytes) = send(pending, self.session, now_us, &mut self.stats)
        {
            return Some(bytes);
        }
        if self.state != State::Open {
            return None;
        }
        if self.changing.is_none() {
            let change = self.change?;
            self.changing = Some(self.number(ToRobot::Command(change.command())));
        }
        send(self.changing.as_mut()?, self.session, now_us, &mut self.stats)
    }

    fn number(&mut self, message: ToRobot) -> Pending {
        self.sequence = self.sequence.wrapping_add(1);
        Pending { message, sequence: self.sequence, sent_us: None, answered: false, repeated: false }
    }

    fn next_message(&mut self, now_us: u64) -> Option<ToRobot> {
        let beat = now_us.saturating_sub(self.beat_us) >= HEARTBEAT_US;
        match self.state {
            State::Failed(_) => None,
            State::Greeting => Some(ToRobot::Hello(Hello::ours())),
            State::Claiming => Some(ToRobot::Command(Command::Claim)),
            State::Open if beat => {
                self.beat_us = now_us;
                Some(if self.writer {
                    ToRobot::Command(Command::Heartbeat { host_us: now_us as u32 })
                } else {
                    ToRobot::Hello(Hello::ours())
                })
            }
            State::Open => self.queue.pop_front().map(ToRobot::Command),
        }
    }

    /// Bytes from the robot, in any pieces.
    pub fn on_bytes(&mut self, now_us: u64, bytes: &[u8], news: &mut impl FnMut(News)) {
        for byte in bytes {
            let heard = match self.deframer.push(*byte) {
                None => continue,
                Some(Err(_)) => {
                    self.stats.frame_errors = self.stats.frame_errors.saturating_add(1);
                    continue;
                }
                Some(Ok(packet)) => (packet.header, ToHost::decode(&packet)),
            };
            let (header, message) = heard;
            self.heard(now_us, header, message, news);
        }
    }

    fn heard(
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
        news(refusal.map_or(News::Done(command), |refusal| News::Refused(command, refusal)));
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

    fn learn_number(&mut self, generation: u32) {
        if newer(generation, self.newest) {
            self.newest = generation;
        }
    }

    fn measure(&mut self, now_us: u64, pending: &Pending) {
        if let Pending { sent_us: Some(sent), answered: false, repeated: false, .. } = pending {
            self.stats.round_trip(now_us.saturating_sub(*sent));
        }
    }

    /// Back to the beginning. An unanswered request goes back in front, except an arming: nobody expects motion from a
    /// word spoken before a silence.
    fn greet(&mut self) {
        self.state = State::Greeting;
        self.changing = None;
        let again = self.pending.take().and_then(|pending| match pending.message {
            ToRobot::Command(Command::Claim | Command::Heartbeat { .. }) => None,
            ToRobot::Command(command) => Some(command),
            _ => None,
        });
        if let Some(command) = again {
            // Full: the newer requests are kept.
            let _ = self.queue.push_front(command);
        }
        self.forget_arming();
    }

    fn forget(&mut self, sequence: u16) {
        self.pending = None;
        self.changing = None;
        self.queue.clear();
        self.change = None;
        self.newest = 0;
        self.applied = 0;
        self.staged = None;
        self.persisted = None;
        self.stats.restart();
        self.stats.received(sequence);
    }

    fn forget_arming(&mut self) {
        self.queue.retain(|command| !matches!(command, Command::Arm { .. }));
        self.pending.take_if(|pending| matches!(pending.message, ToRobot::Command(Command::Arm { .. })));
    }
}

fn send(pending: &mut Pending, session: u16, now_us: u64, stats: &mut LinkStats) -> Option<Bytes> {
    match pending.sent_us {
        Some(sent) if now_us.saturating_sub(sent) < RETRY_US => return None,
        Some(_) if pending.answered => {}
        Some(_) => {
            pending.repeated = true;
            stats.retries = stats.retries.saturating_add(1);
        }
        None => {}
    }
    pending.sent_us = Some(now_us);
    pending.message.encode(session, pending.sequence)
}
