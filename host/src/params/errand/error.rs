//! Why an errand fails.

use sarah_protocol::host::Refusal;
use sarah_protocol::params::ParamError;
use sarah_protocol::session::{NotNow, SessionError};
use thiserror::Error;

use crate::link::port::PortError;

/// Why an errand failed; one line each, with what to do.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum RobotError {
    /// The port does not open.
    #[error(transparent)]
    Port(#[from] PortError),
    /// Another firmware.
    #[error(transparent)]
    Firmware(#[from] SessionError),
    /// Nobody answers.
    #[error("no robot answers there; check that the coordinator has power, and that this is its port and no node's")]
    Silent,
    /// The port went away.
    #[error("the port is gone: {0}; check the cable, then look at what is in force: sarah params show --link …")]
    Lost(String),
    /// Another host writes.
    #[error("another host (session {by:#06x}) writes; quit that one, or wait 2 s if it has just gone")]
    OtherWriter {
        /// Its session.
        by: u16,
    },
    /// The robot restarted in the middle.
    #[error("the robot restarted meanwhile and runs its stored set; look at why it did, then try again")]
    Rebooted,
    /// The robot does not do it.
    #[error("the robot refused {what}: {why}; nothing was changed by it")]
    Refused {
        /// What it was asked.
        what: &'static str,
        /// Why not.
        why: Refusal,
    },
    /// The session does not even ask.
    #[error("not sent: {0}; try again")]
    NotNow(NotNow),
    /// The sets do not come.
    #[error("the robot greets but does not send its sets; look at the link's losses in `sarah monitor`")]
    NotRead,
    /// No answer of the nodes.
    #[error("generation was not staged within 8 s; see in `sarah monitor` whether all three nodes are heard")]
    NotStaged,
    /// No boundary.
    #[error(
        "generation {0} is staged but was not in force within 8 s: the robot came to no cycle boundary; it takes force \
         at the next one: let the robot stand still or disarm it (d in `sarah monitor`), then look: sarah params show --link …"
    )]
    NoBoundary(u32),
    /// Not written.
    #[error(
        "the robot did not say within 5 s that the set is written; look: sarah params show --link …, and commit again"
    )]
    NotKept,
    /// The robot has no such set.
    #[error("the robot has no {0} set; see which there are: sarah params show --link …")]
    NoSet(&'static str),
    /// A robot's set is asked for, but no robot is named.
    #[error("the {0} set is a robot's: name its port with --link serial:PATH")]
    NoLink(&'static str),
    /// What it says is no set.
    #[error("the robot sent a set that cannot be: {0}; flash matching firmware")]
    Impossible(ParamError),
}
