//! What a message says to a node.
//!
//! A node has two parts. Its [`Ear`] works out what follows from a message alone, as soon as the message comes in and
//! where there is time for it; the other part, a [`Controller`](super::Controller), takes the result in between two of its
//! ticks and has little left to do. An image runs the first in thread mode and the second in the tick's interrupt.

use sarah_protocol::bus::{Gait, Message, Mode, Motion};
use sarah_protocol::params::{ParamError, ParamSet};

/// A message as a node uses it: `M` is what the node makes of a motion message, `P` its parameters.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Heard<M, P> {
    /// Brakes now.
    Halt,
    /// IMU products, and whether the node may move.
    Motion(Mode, M),
    /// The knee's flags.
    Gait(Gait),
    /// Every node holds this generation.
    Activate(u32),
    /// A set to stage under a generation, or why it is none.
    Stage(u32, Result<P, ParamError>),
    /// Nothing for this node.
    Other,
}

/// The part of a node that hears.
pub trait Ear {
    /// What the node makes of a motion message.
    type Motion: Copy;
    /// Its share of a parameter set.
    type Params: Copy;

    /// Makes that of a motion message.
    fn motion(&self, motion: &Motion) -> Self::Motion;

    /// Takes its share of a set.
    fn params(&self, set: &ParamSet) -> Self::Params;

    /// What a message says.
    fn hear(&self, message: &Message) -> Heard<Self::Motion, Self::Params> {
        match message {
            Message::Halt(_) => Heard::Halt,
            Message::Motion(motion) => Heard::Motion(motion.mode, self.motion(motion)),
            Message::Gait(gait) => Heard::Gait(*gait),
            Message::Activate(generation) => Heard::Activate(*generation),
            Message::Stage(stage) => {
                Heard::Stage(stage.generation, ParamSet::new(stage.params).map(|set| self.params(&set)))
            }
            Message::Staged(..) | Message::Status(..) => Heard::Other,
        }
    }
}
