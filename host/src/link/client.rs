//! What a host wants of a robot, over one session: whole parameter sets, in as many generations as their rate limits
//! ask for. Bytes and time in, bytes and news out; it owns no port and no clock.

use sarah_protocol::frame::Bytes;
use sarah_protocol::host::{Command, Which};
use sarah_protocol::newer;
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::{HostSession, News, State};

/// A session with a goal.
#[derive(Clone, Debug)]
pub struct Client {
    session: HostSession,
    goal: Option<ParamSet>,
    /// The set in force and its generation.
    applied: Option<(u32, ParamSet)>,
    pending: Option<ParamSet>,
    asked: bool,
}

impl Client {
    /// Of a robot that runs the set `applied` as its generation 0; `None` if that has to be asked.
    pub fn new(session: HostSession, applied: Option<ParamSet>) -> Client {
        Client { session, goal: None, applied: applied.map(|set| (0, set)), pending: None, asked: false }
    }

    /// The conversation.
    pub fn session(&self) -> &HostSession {
        &self.session
    }

    /// The conversation, for single requests.
    pub fn session_mut(&mut self) -> &mut HostSession {
        &mut self.session
    }

    /// Asks for a set. It takes force at a cycle boundary; a newer wish replaces it.
    pub fn set_params(&mut self, goal: ParamSet) {
        self.goal = Some(goal);
    }

    /// Whether the last set asked for is in force, or was refused.
    pub fn settled(&self) -> bool {
        self.goal.is_none() && self.pending.is_none()
    }

    /// The set in force, as far as it is known.
    pub fn applied(&self) -> Option<&ParamSet> {
        self.applied.as_ref().map(|(_, set)| set)
    }

    /// The next frame to send at this moment, if any; call until it returns `None`.
    pub fn poll(&mut self, now_us: u64) -> Option<Bytes> {
        self.pursue();
        self.session.poll(now_us)
    }

    fn pursue(&mut self) {
        if self.pending.is_some() {
            return;
        }
        // The robot may go to a set of its own: the stored one, when its host was silent for long.
        self.applied.take_if(|(generation, _)| newer(self.session.applied(), *generation));
        let Some((_, applied)) = self.applied else {
            if !self.asked && self.session.state() == State::Open {
                self.asked = self.session.get_params(Which::Applied).is_ok();
            }
            return;
        };
        let Some(goal) = self.goal else { return };
        if goal == applied {
            self.goal = None;
            return;
        }
        let next = applied.towards(&goal);
        // Refused only while another change is under way; asked again with the next poll.
        if self.session.apply(&next).is_ok() {
            self.pending = Some(next);
        }
    }

    /// Bytes from the robot, in any pieces.
    pub fn on_bytes(&mut self, now_us: u64, bytes: &[u8], news: &mut Vec<News>) {
        let first = news.len();
        self.session.on_bytes(now_us, bytes, &mut |item| news.push(item));
        for item in &news[first..] {
            self.learn(item);
        }
    }

    fn learn(&mut self, item: &News) {
        match item {
            News::Applied { generation, .. } => {
                self.applied = self.pending.take().map(|set| (*generation, set));
            }
            News::Params(report) if report.which == Which::Applied => {
                self.asked = false;
                let set = report.params.and_then(|raw| ParamSet::new(raw).ok());
                self.applied = set.map(|set| (report.generation, set));
            }
            // A boot knows nothing of what was asked of the one before.
            News::Rebooted => *self = Client::new(self.session.clone(), None),
            News::Connected(_) | News::Refused(Command::GetParams(Which::Applied), _) => self.asked = false,
            // Where the robot stands now has to be asked.
            News::Refused(Command::Stage { .. } | Command::Commit { .. }, _) => {
                *self = Client::new(self.session.clone(), None);
            }
            _ => {}
        }
    }
}
