//! Who may move: armed only by an explicit word, braked by any of many.
//!
//! ```text
//!             arm (ready, not stopped)
//!   Braked ───────────────────────────► Armed
//!     ▲  ◄── disarm, node fault ────────────┤        latched: needs a new arm
//!     │  ◄── IMU lost: after the cycle ─────┤        latched: needs a new arm
//!     └───── emergency stop ────────────────┘        latched: needs clear, then arm
//! ```
//!
//! Braking a leg in mid-air is worse than setting it down. When the IMU falls silent so does the coordinator: the nodes
//! start nothing new and the knee finishes its cycle; the halt follows when the longest cycle is over.
//!
//! After a halt the nodes unlatch only at a motion message that says braked, so a few of those go out before one may
//! say armed again.

use sarah_protocol::bus::{HaltReason, Mode};

use super::age::Age;
use crate::lpg::rules::KNEE;

/// Motion messages that must say braked after a halt.
const BRAKED_MOTIONS: u8 = 3;
/// A latched halt is repeated this often, µs: a node that missed it hears the next.
const REPEAT_US: u32 = 100_000;

/// The longest cycle: kick, retraction and extension, each at its time-out, µs.
const FINISH_US: u32 = 1_100_000;
const _: () = assert!(KNEE.kick_us + 2 * KNEE.stroke_us <= FINISH_US && KNEE.straighten_at_most_us <= FINISH_US);

/// The arming.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Safety {
    mode: Mode,
    stopped: bool,
    latched: Option<HaltReason>,
    /// Arm by itself as soon as everything is ready; any halt ends it.
    autonomous: bool,
    braked_motions: u8,
    repeat: Age,
    /// Left for the running cycle to end before the latched halt goes out, µs.
    finishing_us: u32,
}

impl Safety {
    /// Braked. `autonomous`: may arm by itself once.
    pub const fn new(autonomous: bool) -> Self {
        Safety {
            mode: Mode::Braked,
            stopped: false,
            latched: None,
            autonomous,
            braked_motions: 0,
            repeat: Age::NEVER,
            finishing_us: 0,
        }
    }

    /// `dt_us` passed. A halt to repeat, if due.
    pub fn advance(&mut self, dt_us: u32) -> Option<HaltReason> {
        self.repeat.advance(dt_us);
        self.finishing_us = self.finishing_us.saturating_sub(dt_us);
        let reason = self.latched?;
        if self.finishing_us == 0 && self.repeat.due(REPEAT_US) {
            self.braked_motions = 0;
            return Some(reason);
        }
        None
    }

    /// Brakes and latches. True if that is new.
    pub fn halt(&mut self, reason: HaltReason) -> bool {
        let stop = reason == HaltReason::EmergencyStop;
        let new = self.mode == Mode::Armed || self.latched.is_none() || (stop && !self.stopped);
        self.mode = Mode::Braked;
        self.autonomous = false;
        self.stopped |= stop;
        self.braked_motions = 0;
        self.finishing_us = 0;
        if new {
            // The emergency stop outranks what was latched before; nothing outranks it.
            self.latched = Some(if self.stopped { HaltReason::EmergencyStop } else { reason });
            self.repeat.reset();
        }
        new
    }

    /// As [`Safety::halt`], but lets the running cycle end first: until then nothing may be said to the nodes.
    pub fn halt_after_cycle(&mut self, reason: HaltReason) -> bool {
        let new = self.halt(reason);
        self.finishing_us = FINISH_US;
        new
    }

    /// The running cycle is given time to end: the nodes must hear nothing.
    pub const fn finishing(&self) -> bool {
        self.finishing_us > 0
    }

    /// Clears the emergency stop; stays latched until armed. True if there was one.
    pub fn clear(&mut self) -> bool {
        let was = self.stopped;
        self.stopped = false;
        if was {
            self.latched = Some(HaltReason::Disarmed);
        }
        was
    }

    /// Allows motion; the caller has checked that everything is ready. False while stopped. True if now armed.
    pub fn arm(&mut self) -> bool {
        if self.stopped {
            return false;
        }
        self.latched = None;
        self.finishing_us = 0;
        self.autonomous = false;
        self.mode = Mode::Armed;
        true
    }

    /// The mode for the next motion message.
    pub fn next_motion(&mut self) -> Mode {
        if self.braked_motions < BRAKED_MOTIONS {
            self.braked_motions += 1;
            return Mode::Braked;
        }
        self.mode
    }

    /// Braked or armed.
    pub const fn mode(&self) -> Mode {
        self.mode
    }

    /// The emergency stop is latched.
    pub const fn stopped(&self) -> bool {
        self.stopped
    }

    /// A halt is latched.
    pub const fn halted(&self) -> bool {
        self.latched.is_some()
    }

    /// Waits to arm by itself.
    pub const fn wants_to_arm(&self) -> bool {
        self.autonomous
    }
}
