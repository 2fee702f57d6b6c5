//! What each model does next.

use crate::time::Cycles;
use crate::unit::Unit;

/// When each unit's model acts next.
#[derive(Clone, Debug)]
pub(super) struct Calendar {
    /// By unit number.
    due: [Cycles; Unit::COUNT],
    /// The earliest of them.
    next: Cycles,
}

impl Default for Calendar {
    fn default() -> Self {
        Calendar { due: [Cycles::NEVER; Unit::COUNT], next: Cycles::NEVER }
    }
}

impl Calendar {
    /// When the first model acts.
    #[inline]
    pub fn next(&self) -> Cycles {
        self.next
    }

    /// When a unit's model acts.
    #[inline]
    pub fn due(&self, unit: Unit) -> Cycles {
        self.due[unit as usize]
    }

    /// Enters a model's next event; whether it is the first now, and earlier than the first before.
    #[inline]
    pub fn enter(&mut self, unit: Unit, due: Option<Cycles>) -> bool {
        let due = due.unwrap_or(Cycles::NEVER);
        let before = std::mem::replace(&mut self.due[unit as usize], due);
        if due < self.next {
            self.next = due;
            return true;
        }
        if before == self.next && due != before {
            self.next = self.due.iter().copied().min().unwrap_or(Cycles::NEVER);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_event_comes_first_whoever_changes_his_mind() {
        let mut calendar = Calendar::default();
        assert!(calendar.enter(Unit::Tc0, Some(Cycles(50))));
        assert!(!calendar.enter(Unit::Tc1, Some(Cycles(70))));
        assert!(calendar.enter(Unit::Tc1, Some(Cycles(30))));
        assert!(!calendar.enter(Unit::Tc1, Some(Cycles(90))));
        assert_eq!((calendar.next(), calendar.due(Unit::Tc1)), (Cycles(50), Cycles(90)));
        assert!(!calendar.enter(Unit::Tc0, None));
        assert_eq!(calendar.next(), Cycles(90));
    }
}
