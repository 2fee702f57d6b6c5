//! How legs come home. They stay where a step put them; once the robot is calm they recover, one after the other, in cycles
//! that are no steps: a short leg grows back to rest where it stands, which levels the trunk, then a small cycle brings hip
//! and abductor home, again if the ground cut it short.

use sarah_protocol::bus::Side;
use sarah_protocol::fixed::Q16;

use super::rules::KNEE;

/// Which legs are away from rest, and how long to wait before one comes home.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Recovery {
    /// Legs that stepped and have not recovered since.
    displaced: [bool; 2],
    /// For so long the robot has been calm; saturates.
    calm_us: u32,
    /// For so long it must have been before the next recovery.
    patience_us: u32,
    /// Recoveries since the last step; saturates.
    count: u8,
    /// In the last one the leg grows where it stands.
    straightens: bool,
}

impl Recovery {
    /// Both legs at rest.
    pub(super) const fn home() -> Recovery {
        Recovery { displaced: [false; 2], calm_us: 0, patience_us: KNEE.calm_us, count: 0, straightens: false }
    }

    /// A tick between cycles.
    pub(super) fn watch(&mut self, calm: bool, dt_us: u32) {
        // Only a robot with legs to bring back has to know for how long it has been calm.
        if self.displaced[0] | self.displaced[1] {
            self.calm_us = if calm { self.calm_us.saturating_add(dt_us) } else { 0 };
        }
    }

    /// The leg that may come home now, from the strokes of \[left, right\].
    pub(super) fn due(&self, position: [Q16; 2]) -> Option<Side> {
        if self.calm_us < KNEE.straighten_us {
            return None;
        }
        // The shorter leg first: it is the one that tilts the trunk. To grow is gentle and needs no patience.
        let [left, right] = position;
        let shorter = if left < right { Side::Left } else { Side::Right };
        let due = [shorter, shorter.other()].into_iter().find(|side| self.displaced[*side as usize])?;
        let short = position[due as usize] < -KNEE.home;
        (short || self.calm_us >= self.patience_us).then_some(due)
    }

    /// A step begins, so long after the last cycle.
    pub(super) fn step(&mut self, rested_us: u32) {
        // A recovery that upsets the robot so that it steps again must not become a habit.
        if self.runs() {
            self.patience_us = match rested_us < KNEE.calm_us || self.displaced != [false; 2] {
                true => self.patience_us.saturating_mul(2).min(KNEE.patience_us),
                false => KNEE.calm_us,
            };
        }
        // A step turns both legs.
        (self.displaced, self.count, self.straightens, self.calm_us) = ([true; 2], 0, false, 0);
    }

    /// The recovery of `leg` begins, from this stroke.
    pub(super) fn begin(&mut self, leg: Side, position: Q16) {
        self.count = self.count.saturating_add(1);
        // A leg that is short tilts the trunk, which would fall onto it as soon as it is lifted: first it grows under load.
        self.straightens = position < -KNEE.home;
        self.displaced[leg as usize] = self.straightens && self.again();
        self.calm_us = 0;
    }

    /// The foot of `leg` is down again.
    pub(super) fn land(&mut self, leg: Side, position: Q16) {
        // The ground came early: hip and abductor have stopped on their way home.
        if self.runs() && position < -KNEE.home && self.again() {
            self.displaced[leg as usize] = true;
        }
    }

    /// The last cycle was a recovery.
    pub(super) fn runs(&self) -> bool {
        self.count > 0
    }

    /// The leg of the last recovery grows where it stands.
    pub(super) fn straightens(&self) -> bool {
        self.straightens
    }

    /// A leg that did not come all the way may try again.
    fn again(&self) -> bool {
        self.count < KNEE.recoveries
    }
}
