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
mod hear;
mod news;
mod stats;

use heapless::Deque;

use crate::frame::{Bytes, Deframer};
use crate::host::{Command, Hello, HelloReply, ToHost, ToRobot, Which};
use crate::params::ParamSet;

use change::Change;
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
    /// A lane of its own: nothing that waits for its answer holds a disarm up.
    disarm: Option<Pending>,
    pending: Option<Pending>,
    /// The change's own lane: waiting for a boundary must not hold up the rest.
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
            disarm: None,
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

    /// The next change is numbered after this one, if that is newer than what the robot is known to have.
    pub fn number_after(&mut self, generation: u32) {
        self.learn_number(generation);
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

    /// Allows motion, on the boot this session knows; only while the conversation is open, because nobody expects motion
    /// from a word spoken into a pulled cable.
    pub fn arm(&mut self) -> Result<(), NotNow> {
        let robot = self.robot.filter(|_| self.state == State::Open).ok_or(NotNow::NotConnected)?;
        self.request(Command::Arm { boot_nonce: robot.boot_nonce })
    }

    /// The line was cut: the conversation begins again with a greeting, without waiting for the silence.
    pub fn cut(&mut self) {
        if !matches!(self.state, State::Failed(_)) {
            self.greet();
        }
    }

    /// Brakes now, ahead of whatever waits for its answer.
    pub fn disarm(&mut self) {
        self.forget_waiting(|command| matches!(command, Command::Arm { .. }));
        self.disarm = Some(self.number(ToRobot::Command(Command::Disarm)));
    }

    /// Emergency stop: ahead of everything, in any state, without a claim.
    pub fn e_stop(&mut self) {
        self.stop = Some(self.number(ToRobot::EStop));
        // Neither an arming nor a clearing of before may follow the stop.
        self.forget_waiting(lets_move);
    }

    /// Unlatches the emergency stop; the robot stays braked until armed. As [`HostSession::arm`], not into a pulled cable.
    pub fn clear_e_stop(&mut self) -> Result<(), NotNow> {
        if self.state != State::Open {
            return Err(NotNow::NotConnected);
        }
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
        if self.state == State::Open
            && let Some(disarm) = &mut self.disarm
            && let Some(bytes) = send(disarm, self.session, now_us, &mut self.stats)
        {
            return Some(bytes);
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
            // A stop that is repeated because its answer was lost must not arrive after the word that clears it.
            State::Open if self.stop.is_some() && self.queue.front() == Some(&Command::ClearEStop) => None,
            // Nor a disarm after the word that arms.
            State::Open if self.disarm.is_some() && matches!(self.queue.front(), Some(Command::Arm { .. })) => None,
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

    /// Back to the beginning. An unanswered request goes back in front, but none that lets the robot move: nobody expects
    /// motion from a word spoken before a silence.
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
        self.forget_waiting(lets_move);
    }

    fn forget(&mut self, sequence: u16) {
        self.disarm = None;
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

    fn forget_waiting(&mut self, which: impl Fn(&Command) -> bool) {
        self.queue.retain(|command| !which(command));
        self.pending.take_if(|pending| matches!(&pending.message, ToRobot::Command(command) if which(command)));
    }
}

/// Words that let the robot move, or a stop be forgotten: they hold for the moment they are spoken in.
fn lets_move(command: &Command) -> bool {
    matches!(command, Command::Arm { .. } | Command::ClearEStop)
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
