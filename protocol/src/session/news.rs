//! What a session tells its host.

use crate::host::{Command, HelloReply, ParamsReport, Refusal};
use crate::telemetry::{Event, Telemetry};

/// Why there is no conversation.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum SessionError {
    /// The robot speaks another protocol version.
    #[error("the robot speaks protocol version {theirs}, this host version {ours}: flash matching firmware")]
    Version {
        /// Here.
        ours: u8,
        /// There.
        theirs: u8,
    },
    /// Same version, but messages or parameters differ.
    #[error("the robot's schema is {theirs:#010x}, this host's {ours:#010x}: flash matching firmware")]
    Schema {
        /// Here.
        ours: u32,
        /// There.
        theirs: u32,
    },
}

/// Why a request was not even sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum NotNow {
    /// No robot, or not the right one.
    #[error("no robot is connected")]
    NotConnected,
    /// One parameter change at a time.
    #[error("generation {0} is still under way")]
    Changing(u32),
    /// Too many requests wait for their answer.
    #[error("too many requests wait for an answer")]
    Full,
}

/// Where the conversation is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum State {
    /// Waiting for the robot's hello.
    Greeting,
    /// Waiting to become the writer.
    Claiming,
    /// Requests are heard. An observer gets here without a claim.
    Open,
    /// The two builds do not fit together.
    Failed(SessionError),
}

/// What the host learns.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum News {
    /// The robot said hello, for the first time or after a silence.
    Connected(HelloReply),
    /// Another build: see the error.
    Failed(SessionError),
    /// The robot is another boot than before: what was asked is forgotten, and it is braked until armed anew.
    Rebooted,
    /// This session is the writer.
    Claimed,
    /// The robot's snapshot.
    Telemetry(Telemetry),
    /// Something happened there.
    Event {
        /// Coordinator time, µs.
        time_us: u32,
        /// What.
        event: Event,
    },
    /// A parameter set it was asked for.
    Params(ParamsReport),
    /// A request was carried out.
    Done(Command),
    /// A request was refused.
    Refused(Command, Refusal),
    /// All nodes hold the generation.
    Staged(u32),
    /// All nodes run the generation.
    Applied {
        /// Its number.
        generation: u32,
        /// From this cycle on.
        cycle: u32,
    },
    /// The robot knew a newer generation: the change goes on under another number.
    Renumbered {
        /// Before.
        from: u32,
        /// Now.
        to: u32,
    },
    /// The generation is in non-volatile memory.
    Persisted(u32),
}
