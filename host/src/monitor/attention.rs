//! What the operator must know now, the most pressing first, each with what to do about it.

use sarah_protocol::bus::{Mode, limits};
use sarah_protocol::session::State;
use sarah_protocol::telemetry::{Telemetry, faults};

use super::state::Dashboard;
use super::text::duration;
use super::words::{Advice, fault_advice, limit_advice, reason_of, reset_words};
use crate::link::live::Role;

/// How pressing something is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Level {
    /// As it should be.
    Calm,
    /// Worth a look.
    Notice,
    /// The robot cannot do what it should, or nobody knows what it does.
    Alarm,
}

impl Dashboard {
    /// The state in a few words.
    pub fn headline(&self, now_us: u64) -> (Level, String) {
        if self.failed.is_some() {
            return (Level::Alarm, "WRONG FIRMWARE".into());
        }
        if self.is_down() {
            return (Level::Alarm, "LINK DOWN".into());
        }
        let Some(telemetry) = self.fresh(now_us) else {
            return match self.telemetry {
                Some(_) => (Level::Alarm, "NO TELEMETRY".into()),
                None => (Level::Notice, "CONNECTING".into()),
            };
        };
        match telemetry.mode {
            _ if telemetry.faults & faults::E_STOP != 0 => (Level::Alarm, "EMERGENCY STOP".into()),
            Mode::Braked if telemetry.faults & faults::HALTED != 0 => {
                let level = if telemetry.faults == faults::HALTED { Level::Notice } else { Level::Alarm };
                (level, self.halted.map_or("HALTED".into(), |reason| format!("HALTED: {}", reason_of(reason))))
            }
            // Nothing was stopped: it has not been armed yet.
            Mode::Braked if telemetry.faults != 0 => (Level::Alarm, "BRAKED, not ready".into()),
            Mode::Braked => (Level::Notice, "BRAKED".into()),
            Mode::Armed if telemetry.faults != 0 => (Level::Alarm, format!("ARMED, {}", self.gait_words(telemetry))),
            Mode::Armed => (Level::Calm, format!("ARMED, {}", self.gait_words(telemetry))),
        }
    }

    fn gait_words(&self, telemetry: &Telemetry) -> &'static str {
        match telemetry.phases[0] {
            0 if self.trend.steps_per_s() == 0.0 => "stands quietly",
            0 => "has just stepped",
            _ => "steps",
        }
    }

    /// Everything that needs a look. Never empty: if all is well it says so.
    pub fn attention(&self, now_us: u64) -> Vec<(Level, Advice)> {
        let mut all = vec![];
        self.link_attention(now_us, &mut all);
        if let Some(telemetry) = self.fresh(now_us) {
            self.robot_attention(telemetry, &mut all);
        }
        if all.is_empty() {
            let quiet = match self.telemetry {
                Some(_) => Advice::new("no faults, nothing limits motion", ""),
                None => Advice::new("no telemetry yet", ""),
            };
            all.push((Level::Calm, quiet));
        }
        all
    }

    fn link_attention(&self, now_us: u64, all: &mut Vec<(Level, Advice)>) {
        let mut say = |level, what: String, remedy: &str| all.push((level, Advice::new(what, remedy)));
        if let Some(error) = &self.failed {
            // The error itself says what to flash.
            say(Level::Alarm, error.to_string(), "space stops the robot even so");
            return;
        }
        if self.is_down() {
            let why = self.down.as_deref().unwrap_or("the port is not open");
            let remedy = "it is tried again by itself; check the USB cable. The robot goes on balancing meanwhile";
            return say(Level::Alarm, format!("the link is down ({why})"), remedy);
        }
        let state = self.health.as_ref().map(|health| health.state);
        match self.telemetry {
            None if self.robot.is_none() && state == Some(State::Greeting) => {
                let remedy = "check that the coordinator has power, and that this is its port and no node's";
                return say(Level::Notice, "waiting for the robot's hello".into(), remedy);
            }
            Some(_) if self.fresh(now_us).is_none() => {
                let what = format!("no telemetry for {}; what is shown is old", duration(self.age_us(now_us)));
                say(Level::Alarm, what, "check power and cable of the coordinator; it goes on by itself");
            }
            _ => {}
        }
        if let Some(session) = self.writer.filter(|_| self.role == Role::Writer) {
            let what = format!("another host writes (session {session:#06x})");
            say(Level::Notice, what, "quit that one to use a, d and c here; space stops the robot in any case");
        }
    }

    fn robot_attention(&self, telemetry: &Telemetry, all: &mut Vec<(Level, Advice)>) {
        let mut say = |level, advice| all.push((level, advice));
        // That it is halted follows from any other fault, and the headline has said it.
        let faults = match telemetry.faults & !faults::HALTED {
            0 => telemetry.faults,
            causes => causes,
        };
        for advice in fault_advice(faults, self.halted) {
            say(Level::Alarm, advice);
        }
        // While braked every node says so: the mode has said it once.
        let expected = match telemetry.mode {
            Mode::Braked => limits::BRAKED | limits::HALTED,
            Mode::Armed => 0,
        };
        for advice in limit_advice(&telemetry.limits.map(|bits| bits & !expected)) {
            say(Level::Notice, advice);
        }
        if telemetry.mode == Mode::Braked && telemetry.faults == 0 {
            let remedy = if self.role == Role::Writer { "press a to arm" } else { "its writing host arms it" };
            say(Level::Notice, Advice::new("the brakes are on, nothing is wrong", remedy));
        }
        if telemetry.stale {
            let what = "the set in force came from a host that is silent; the stored set returns soon";
            say(Level::Notice, Advice::new(what, "reconnect that host, or keep sets with `sarah params commit`"));
        }
        if let (cause, Some(remedy)) = reset_words(telemetry.reset_cause) {
            say(Level::Notice, Advice::new(format!("the coordinator last started because of: {cause}"), remedy));
        }
    }
}
