//! Why the robot does not do what it was asked. Every refusal names its reason, and the field if there is one.

use serde::{Deserialize, Serialize};

use crate::bus::NodeId;
use crate::params::ParamError;

/// Why the robot does not arm.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum NotReady {
    /// The IMU is silent, or the attitude filter is still finding up.
    #[error("the IMU does not deliver yet")]
    Imu,
    /// This node is silent.
    #[error("node {0:?} is silent")]
    Node(NodeId),
    /// The nodes do not run the same generation yet.
    #[error("the nodes do not run the same parameter generation yet")]
    Generations,
}

/// Why a request was refused.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum Refusal {
    /// Claim first.
    #[error("this session has not claimed the robot")]
    NotClaimed,
    /// Another host writes.
    #[error("the robot is claimed by session {by:#06x}")]
    Claimed {
        /// Its session.
        by: u16,
    },
    /// The set breaks a limit.
    #[error("{0}")]
    Params(ParamError),
    /// A node refused the set.
    #[error("node {0:?} refused: {1}")]
    Node(NodeId, ParamError),
    /// Not newer than what the robot has seen.
    #[error("generation is stale: the robot has seen {newest}")]
    Stale {
        /// The newest generation the robot knows.
        newest: u32,
    },
    /// The same generation with another set.
    #[error("generation {0} was staged with other values")]
    Duplicate(u32),
    /// An activation is under way.
    #[error("generation {0} is being activated")]
    Busy(u32),
    /// Commit of what the nodes do not all hold.
    #[error("generation {0} is not staged")]
    NotStaged(u32),
    /// Persist of what is not in force.
    #[error("only the applied generation, {applied}, can be persisted")]
    NotApplied {
        /// Generation in force.
        applied: u32,
    },
    /// A node did not answer in time, or restarted meanwhile.
    #[error("a node did not take part: nothing was changed")]
    NodeSilent,
    /// The emergency stop is latched.
    #[error("emergency stop is latched: clear it first")]
    EStop,
    /// Arming is not possible now.
    #[error("not ready: {0}")]
    NotReady(NotReady),
    /// The arming names another boot.
    #[error("the robot has restarted: its boot nonce is {current:#010x}")]
    Rebooted {
        /// The nonce of this boot.
        current: u32,
    },
    /// Non-volatile memory failed.
    #[error("the set could not be written")]
    Storage,
    /// A value is out of range.
    #[error("value out of range")]
    OutOfRange,
    /// The body does not decode.
    #[error("message does not decode")]
    Malformed,
}
