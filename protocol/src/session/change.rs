//! One parameter change on its way: stage, then commit, each repeated until the robot says how far it is.

use crate::host::{AckState, Command, Refusal};
use crate::params::ParamSet;

/// How often the robot may answer that the number is stale before the change is given up.
const RENUMBERINGS: u8 = 4;

/// The change under way.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Change {
    pub generation: u32,
    params: ParamSet,
    committing: bool,
    renumbered: u8,
}

/// What an answer means for the change.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Step {
    /// Nothing new; keep repeating.
    Wait,
    /// Staged: the commit is to be sent.
    Staged,
    /// In force.
    Applied { cycle: u32 },
    /// Goes on under another number.
    Renumbered { from: u32 },
    /// Over.
    Refused(Refusal),
}

impl Change {
    pub const fn new(generation: u32, params: ParamSet) -> Self {
        Change { generation, params, committing: false, renumbered: 0 }
    }

    /// What to send, and to send again until the answer moves the change on.
    pub fn command(&self) -> Command {
        match self.committing {
            false => Command::Stage { generation: self.generation, params: *self.params.values() },
            true => Command::Commit { generation: self.generation },
        }
    }

    /// The robot answered the current command or an earlier copy of it.
    pub fn on_ack(&mut self, state: &AckState) -> Step {
        match *state {
            AckState::Staged { generation } if generation == self.generation && !self.committing => {
                self.committing = true;
                Step::Staged
            }
            AckState::Applied { generation, cycle } if generation == self.generation => Step::Applied { cycle },
            // Someone else's change is in the way: repeating is enough.
            AckState::Refused(Refusal::Busy(_)) => Step::Wait,
            AckState::Refused(Refusal::Stale { newest }) if !self.committing && self.renumbered < RENUMBERINGS => {
                let from = self.generation;
                self.generation = newest.wrapping_add(1);
                self.renumbered += 1;
                Step::Renumbered { from }
            }
            AckState::Refused(refusal) => Step::Refused(refusal),
            _ => Step::Wait,
        }
    }
}
