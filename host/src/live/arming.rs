//! Who allowed the robot to move, and when that ends.
//!
//! Arming is the operator's word. It may cover the falls of a training session ([`Consent::AfterFalls`]): then the robot
//! is armed again when somebody has put it back on its feet and it has stood still for a while. It never outlives a lost
//! link, a restart, an emergency stop or a halt that was not asked for: then the word has to be said again.

/// What the operator has allowed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Consent {
    /// Nothing.
    #[default]
    None,
    /// Arm once.
    Once,
    /// Arm, and again after every fall.
    AfterFalls,
}

/// Why consent ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Lost {
    /// The port was gone.
    Link,
    /// The robot is another boot.
    Restart,
    /// Brakes that this host did not ask for.
    Halt,
    /// The operator's stop.
    Stop,
}

/// The state of the arming, as this host sees it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Arming {
    consent: Consent,
    /// An arm was asked for and not yet answered.
    asked: bool,
    retry_us: u64,
}

/// A refused arm is asked again after this, µs: the IMU still finds up, or a set is on its way.
const RETRY_US: u64 = 500_000;

impl Arming {
    /// The operator allows it.
    pub fn allow(&mut self, consent: Consent) {
        *self = Arming { consent, ..Arming::default() };
    }

    /// What is allowed.
    pub fn consent(&self) -> Consent {
        self.consent
    }

    /// Consent is over. True if there was one.
    pub fn lose(&mut self) -> bool {
        let had = self.consent != Consent::None;
        *self = Arming::default();
        had
    }

    /// Whether to ask the robot to arm now, which stands braked and still on its feet.
    pub fn ask(&mut self, now_us: u64) -> bool {
        let ask = self.consent != Consent::None && !self.asked && now_us >= self.retry_us;
        self.asked |= ask;
        ask
    }

    /// The robot is armed; its telemetry may take a moment to say so.
    pub fn done(&mut self, now_us: u64) {
        self.refused(now_us);
        if self.consent == Consent::Once {
            self.consent = Consent::None;
        }
    }

    /// The robot is not ready to be armed.
    pub fn refused(&mut self, now_us: u64) {
        self.asked = false;
        self.retry_us = now_us + RETRY_US;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_armed_without_a_word() {
        assert!(!Arming::default().ask(10_000_000));
    }

    #[test]
    fn one_word_arms_once() {
        let mut arming = Arming::default();
        arming.allow(Consent::Once);
        assert!(arming.ask(0) && !arming.ask(1), "asked once, then waits for the answer");
        arming.done(1);
        assert!(!arming.ask(10_000_000));
    }

    #[test]
    fn a_refusal_is_asked_again_a_little_later() {
        let mut arming = Arming::default();
        arming.allow(Consent::Once);
        assert!(arming.ask(0));
        arming.refused(0);
        assert!(!arming.ask(RETRY_US - 1) && arming.ask(RETRY_US));
    }

    #[test]
    fn a_word_that_covers_falls_covers_nothing_else() {
        let mut arming = Arming::default();
        arming.allow(Consent::AfterFalls);
        for fall in 0..3 {
            assert!(arming.ask(fall * RETRY_US));
            arming.done(fall * RETRY_US);
            assert!(!arming.ask(fall * RETRY_US + 1), "telemetry has not come yet");
        }
        assert!(arming.lose());
        assert!(!arming.ask(10_000_000) && !arming.lose());
    }
}
