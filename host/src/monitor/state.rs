//! What the dashboard knows, and what becomes of a key. Pure: news, acts and time in, questions to the link out.

use sarah_protocol::bus::{HaltReason, Mode};
use sarah_protocol::host::{Command, HelloReply, Refusal};
use sarah_protocol::session::{News, SessionError, State};
use sarah_protocol::telemetry::{Event, Telemetry};

use super::energy::Estimate;
use super::keys::Act;
use super::log::Log;
use super::sets::Sets;
use super::trend::Trend;
use super::words::event_words;
use crate::link::live::{Ask, Heard, LinkHealth, Role, What};

/// A question that nobody answers is withdrawn after this, µs: motion must not follow from a forgotten word.
const ASKING_US: u64 = 10_000_000;
/// A message stays for this long, µs.
const NOTE_US: u64 = 8_000_000;
/// Telemetry older than this says nothing about now, µs.
pub(super) const OLD_US: u64 = 500_000;

/// Everything the screen shows.
#[derive(Clone, Debug)]
pub struct Dashboard {
    pub(super) role: Role,
    /// Newest snapshot, and when it was received.
    pub(super) telemetry: Option<(u64, Telemetry)>,
    pub(super) trend: Trend,
    pub(super) energy: Estimate,
    pub(super) sets: Sets,
    pub(super) log: Log,
    pub(super) robot: Option<HelloReply>,
    pub(super) health: Option<LinkHealth>,
    /// Why the port is gone, while it is.
    pub(super) down: Option<String>,
    pub(super) failed: Option<SessionError>,
    /// Session of another host that writes.
    pub(super) writer: Option<u16>,
    /// Why the robot last halted, until it is armed again.
    pub(super) halted: Option<HaltReason>,
    pub(super) help: bool,
    asked_us: Option<u64>,
    note: Option<(u64, String)>,
    quit: bool,
}

impl Dashboard {
    /// Knows nothing yet.
    pub fn new(role: Role) -> Dashboard {
        Dashboard {
            role,
            telemetry: None,
            trend: Trend::default(),
            energy: Estimate::default(),
            sets: Sets::default(),
            log: Log::default(),
            robot: None,
            health: None,
            down: None,
            failed: None,
            writer: None,
            halted: None,
            help: false,
            asked_us: None,
            note: None,
            quit: false,
        }
    }

    /// Takes in what the link heard.
    pub fn on(&mut self, heard: &Heard) {
        let at_us = heard.at_us;
        match &heard.what {
            What::News(news) => self.on_news(at_us, news),
            What::Up { port } => {
                self.down = None;
                self.log.push(at_us, format!("{port} is open"));
            }
            What::Down { why } => {
                self.down = Some(why.clone());
                self.asked_us = None;
                self.log.push(at_us, format!("the port is gone: {why}"));
            }
            // A set is asked for again anyway.
            What::NotNow { ask: Ask::Get(_), .. } => {}
            What::NotNow { ask, why } => self.say(at_us, format!("{} was not sent: {why}", ask_name(ask))),
        }
    }

    fn on_news(&mut self, at_us: u64, news: &News) {
        match news {
            News::Telemetry(telemetry) => return self.on_telemetry(at_us, telemetry),
            News::Params(report) => return self.sets.learn(report),
            News::Connected(reply) => {
                self.robot = Some(*reply);
                self.failed = None;
                self.sets.outdated();
            }
            News::Failed(error) => self.failed = Some(*error),
            News::Rebooted => {
                // What was known is of another boot.
                self.telemetry = None;
                self.trend = Trend::default();
                self.sets = Sets::default();
                self.halted = None;
                self.asked_us = None;
            }
            News::Claimed => self.writer = None,
            News::Event { event, .. } => match event {
                Event::Halted(reason) => {
                    self.halted = Some(*reason);
                    self.asked_us = None;
                }
                Event::Armed => self.halted = None,
                Event::Applied { .. } => self.sets.outdated(),
                _ => {}
            },
            News::Refused(Command::Claim, Refusal::Claimed { by }) => self.writer = Some(*by),
            News::Refused(Command::GetParams(_), _) => return,
            News::Refused(command, refusal) => {
                self.say(at_us, format!("{} was refused: {refusal}", command_name(command)));
            }
            News::Done(command) => {
                if let Some(done) = done_words(command) {
                    self.say(at_us, done);
                }
            }
            News::Staged(_) | News::Applied { .. } | News::Persisted(_) => self.sets.outdated(),
            News::Renumbered { .. } => {}
        }
        if let Some(words) = news_words(news) {
            self.log.push(at_us, words);
        }
    }

    fn on_telemetry(&mut self, at_us: u64, telemetry: &Telemetry) {
        let dt_s = self.trend.push(at_us, telemetry);
        self.energy.push(dt_s, telemetry);
        if self.telemetry.is_some_and(|(_, last)| last.generation != telemetry.generation) {
            self.sets.outdated();
        }
        self.telemetry = Some((at_us, *telemetry));
    }

    /// How the link is at this moment.
    pub fn set_health(&mut self, health: LinkHealth) {
        if health.robot.is_some() {
            self.robot = health.robot;
        }
        self.health = Some(health);
    }

    /// What the dashboard itself wants to ask now.
    pub fn due(&mut self, now_us: u64) -> Option<Ask> {
        let open = self.health.as_ref().is_some_and(|health| health.up && health.state == State::Open);
        if open { self.sets.due(now_us).map(Ask::Get) } else { None }
    }

    /// What a key leads to.
    pub fn act(&mut self, act: Act, now_us: u64) -> Option<Ask> {
        let asking = self.asking(now_us);
        if act != Act::Arm {
            self.asked_us = None;
        }
        match act {
            Act::EStop => {
                self.say(
                    now_us,
                    match self.is_down() {
                        false => "emergency stop sent",
                        true => "the link is down: the stop goes out when it is back; cut the power at the robot",
                    },
                );
                Some(Ask::EStop)
            }
            Act::Quit => {
                self.quit = true;
                None
            }
            Act::Help => {
                self.help = !self.help;
                None
            }
            Act::No if self.help => {
                self.help = false;
                None
            }
            Act::No if asking => self.refuse(now_us, "not armed"),
            Act::Yes if asking => {
                self.say(now_us, "arming");
                Some(Ask::Arm)
            }
            Act::Yes | Act::No => None,
            Act::Arm | Act::Disarm | Act::ClearEStop if self.role == Role::Observer => {
                self.refuse(now_us, "this monitor only watches (--observe): start it without --observe to use this key")
            }
            Act::Arm | Act::Disarm | Act::ClearEStop if self.is_down() => {
                self.refuse(now_us, "the link is down: nothing was sent")
            }
            Act::Arm | Act::Disarm | Act::ClearEStop if self.writer.is_some() => {
                self.refuse(now_us, "another host writes: quit it first; space stops the robot in any case")
            }
            Act::Arm if self.is_armed(now_us) => self.refuse(now_us, "the robot is armed already"),
            Act::Arm => {
                self.asked_us = Some(now_us);
                None
            }
            Act::Disarm => Some(Ask::Disarm),
            Act::ClearEStop => Some(Ask::ClearEStop),
        }
    }

    fn refuse(&mut self, now_us: u64, why: &str) -> Option<Ask> {
        self.say(now_us, why);
        None
    }

    fn say(&mut self, at_us: u64, text: impl Into<String>) {
        self.note = Some((at_us, text.into()));
    }

    /// The operator wants to leave.
    pub fn quits(&self) -> bool {
        self.quit
    }

    /// The question "arm?" stands.
    pub(super) fn asking(&self, now_us: u64) -> bool {
        self.asked_us.is_some_and(|at| now_us.saturating_sub(at) < ASKING_US)
    }

    /// The message of the moment.
    pub(super) fn note(&self, now_us: u64) -> Option<&str> {
        self.note.as_ref().filter(|(at, _)| now_us.saturating_sub(*at) < NOTE_US).map(|(_, text)| text.as_str())
    }

    /// Telemetry that is fresh enough to say something about now.
    pub(super) fn fresh(&self, now_us: u64) -> Option<&Telemetry> {
        self.telemetry.as_ref().filter(|_| self.age_us(now_us) < OLD_US).map(|(_, telemetry)| telemetry)
    }

    /// Age of the newest snapshot, µs.
    pub(super) fn age_us(&self, now_us: u64) -> u64 {
        self.telemetry.map_or(u64::MAX, |(at, _)| now_us.saturating_sub(at))
    }

    pub(super) fn is_down(&self) -> bool {
        self.down.is_some() || self.health.as_ref().is_some_and(|health| !health.up)
    }

    fn is_armed(&self, now_us: u64) -> bool {
        self.fresh(now_us).is_some_and(|telemetry| telemetry.mode == Mode::Armed)
    }
}

fn ask_name(ask: &Ask) -> &'static str {
    match ask {
        Ask::Params(_) => "the set",
        Ask::Arm => "arm",
        Ask::Disarm => "disarm",
        Ask::EStop => "the emergency stop",
        Ask::ClearEStop => "clear",
        Ask::Persist => "commit",
        Ask::Get(_) => "a question",
        Ask::Telemetry(_) => "the telemetry rate",
        Ask::Release => "release",
    }
}

fn command_name(command: &Command) -> &'static str {
    match command {
        Command::Claim => "the claim",
        Command::Release => "release",
        Command::Arm { .. } => "arm",
        Command::Disarm => "disarm",
        Command::ClearEStop => "clear",
        Command::Stage { .. } | Command::Commit { .. } => "the set",
        Command::Persist { .. } => "commit",
        Command::GetParams(_) | Command::Heartbeat { .. } | Command::SetTelemetry { .. } => "a request",
    }
}

fn done_words(command: &Command) -> Option<&'static str> {
    match command {
        Command::Arm { .. } => Some("armed"),
        Command::Disarm => Some("disarmed: the brakes are on"),
        Command::ClearEStop => Some("emergency stop cleared, still braked: press a to arm"),
        _ => None,
    }
}

fn news_words(news: &News) -> Option<String> {
    Some(match news {
        News::Connected(_) => "the robot said hello".into(),
        News::Failed(error) => error.to_string(),
        News::Rebooted => "the robot restarted: it is braked until armed".into(),
        News::Claimed => "this host is the writer".into(),
        News::Event { event, .. } => event_words(event),
        News::Refused(command, refusal) => format!("{} refused: {refusal}", command_name(command)),
        News::Staged(generation) => format!("generation {generation} staged"),
        News::Persisted(generation) => format!("generation {generation} stored"),
        // Events and telemetry tell the rest.
        _ => return None,
    })
}
