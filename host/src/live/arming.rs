//! Who allowed the robot to move, and when that ends.
//!
//! Arming is the operator's word, given when the robot stands braked in front of them. It may cover the falls of a
//! training session ([`Consent::AfterFalls`]): then the robot is armed again when somebody has put it back on its feet
//! and it has stood still for a while. It never outlives a lost link, a restart, an emergency stop or a halt that was not
//! asked for, and a word that covers one arming is spent, or ten seconds later over: then it has to be said again.

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

/// The state of the arming, as this host sees it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Arming {
    consent: Consent,
    until_us: u64,
    /// An arm was asked for and not yet answered.
    asked: bool,
    retry_us: u64,
}

/// A refused arm is asked again after this, µs: the IMU still finds up, or a set is on its way.
const RETRY_US: u64 = 500_000;
/// A word for one arming is good for this long, µs.
const WORD_US: u64 = 10_000_000;

impl Arming {
    /// The operator allows it at `now_us`.
    pub fn allow(&mut self, consent: Consent, now_us: u64) {
        *self = Arming { consent, until_us: now_us.saturating_add(WORD_US), ..Arming::default() };
    }

    /// What is allowed at `now_us`.
    pub fn consent(&self, now_us: u64) -> Consent {
        match self.consent {
            Consent::Once if now_us > self.until_us => Consent::None,
            consent => consent,
        }
    }

    /// Consent is over.
    pub fn lose(&mut self) {
        *self = Arming::default();
    }

    /// Whether to ask the robot to arm now, which stands braked and still on its feet.
    pub fn ask(&mut self, now_us: u64) -> bool {
        let ask = self.consent(now_us) != Consent::None && !self.asked && now_us >= self.retry_us;
        self.asked |= ask;
        ask
    }

    /// The robot is armed; its telemetry may take a moment to say so.
    pub fn done(&mut self, now_us: u64) {
        self.again(now_us);
        if self.consent == Consent::Once {
            self.consent = Consent::None;
        }
    }

    /// The robot is not ready to be armed, or did not hear: asked again a little later.
    pub fn again(&mut self, now_us: u64) {
        self.asked = false;
        self.retry_us = now_us + RETRY_US;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowed(consent: Consent) -> Arming {
        let mut arming = Arming::default();
        arming.allow(consent, 0);
        arming
    }

    #[test]
    fn nothing_is_armed_without_a_word() {
        assert!(!Arming::default().ask(1));
    }

    #[test]
    fn one_word_arms_once() {
        let mut arming = allowed(Consent::Once);
        assert!(arming.ask(0) && !arming.ask(1), "asked once, then waits for the answer");
        arming.done(2);
        assert!(!arming.ask(RETRY_US + 2));
    }

    #[test]
    fn a_word_for_one_arming_is_over_after_a_while() {
        assert!(allowed(Consent::Once).ask(WORD_US));
        assert!(!allowed(Consent::Once).ask(WORD_US + 1));
        assert!(allowed(Consent::AfterFalls).ask(WORD_US + 1));
    }

    #[test]
    fn what_was_refused_or_not_heard_is_asked_again_a_little_later() {
        let mut arming = allowed(Consent::Once);
        assert!(arming.ask(0));
        arming.again(0);
        assert!(!arming.ask(RETRY_US - 1) && arming.ask(RETRY_US));
    }

    #[test]
    fn a_word_that_covers_falls_covers_nothing_else() {
        let mut arming = allowed(Consent::AfterFalls);
        for fall in 0..3 {
            assert!(arming.ask(fall * RETRY_US));
            arming.done(fall * RETRY_US);
            assert!(!arming.ask(fall * RETRY_US + 1), "telemetry has not come yet");
        }
        arming.lose();
        assert!(!arming.ask(10 * RETRY_US));
    }
}
