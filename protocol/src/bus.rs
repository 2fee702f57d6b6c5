//! Coordinator ↔ nodes: one CAN-FD frame per message.
//!
//! ```text
//!  identifier (11 bit, lower wins arbitration)      payload: postcard, at most 64 bytes
//!  0x010  Halt      coordinator → nodes             brakes now, latched until the next arming
//!  0x020  Gait      knee → all                      flags of Fig. 2 and 3, and the generation in force
//!  0x030  Motion    coordinator → nodes             IMU products, one per IMU sample
//!  0x040  Activate  coordinator → nodes             "every node holds generation g": swap at the next boundary
//!  0x050  Stage     coordinator → nodes             a whole parameter set
//!  0x060+n Staged   node n → coordinator            answer to Stage
//!  0x100+n Status   node n → coordinator            100 Hz
//! ```
//!
//! A payload ends in zeros up to the next length CAN-FD knows (0–8, 12, 16, 20, 24, 32, 48, 64); a receiver accepts
//! trailing zeros and nothing else after the message. CAN checks its frames itself (CRC-17/21), so there is no CRC here.
//!
//! A set becomes active everywhere in one cycle or nowhere: `Stage` puts it into every node, `Activate` is sent only
//! after all three answered `Staged`, and the knee, which owns the cycle counter, names the generation in force in every
//! `Gait` frame. A node swaps when a boundary (`CycleStart`, `Recovery` or `Boundary`) names a generation it has staged.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::fixed::Q16;
use crate::params::{ParamError, RawParams};
use crate::write::write;

/// Largest payload of a CAN-FD frame in bytes.
pub const MAX_PAYLOAD: usize = 64;

/// One frame as it is on the bus.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Frame {
    /// 11-bit identifier; the lower one wins arbitration.
    pub id: u16,
    /// Payload bytes.
    pub data: Vec<u8, MAX_PAYLOAD>,
}

/// The three nodes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum NodeId {
    /// Linear actuators and foot pads.
    Knee,
    /// Hips.
    Hip,
    /// Abductors.
    Abductor,
}

impl NodeId {
    /// All nodes; `ALL[id as usize] == id`.
    pub const ALL: [NodeId; 3] = [NodeId::Knee, NodeId::Hip, NodeId::Abductor];
}

/// Left or right leg.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Hash, Serialize, Deserialize)]
#[repr(u8)]
pub enum Side {
    /// Left (+y).
    #[default]
    Left,
    /// Right (−y).
    Right,
}

impl Side {
    /// Both, in array order.
    pub const BOTH: [Side; 2] = [Side::Left, Side::Right];

    /// The opposite leg.
    pub const fn other(self) -> Side {
        match self {
            Side::Left => Side::Right,
            Side::Right => Side::Left,
        }
    }

    /// +1 for left, −1 for right: the sign of its y axis.
    pub const fn sign(self) -> i32 {
        match self {
            Side::Left => 1,
            Side::Right => -1,
        }
    }
}

/// What moved the gait on (paper, Fig. 2 and 3: green and red flags).
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum GaitEvent {
    /// A cycle begins: the swing leg kicks.
    CycleStart,
    /// The swing foot lost its load.
    LiftOff,
    /// The swing foot carries load again: a step.
    Touchdown,
    /// The knee is at rest again.
    CycleEnd,
    /// No cycle is running and the generation in force changed.
    Boundary,
    /// Nothing changed: repeated while idle so that a node that missed a frame catches up.
    Beat,
    /// A cycle begins that brings the swing leg back to rest: its hip and abductor go to zero.
    Recovery,
}

/// The knee's flags.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Gait {
    /// What happened.
    pub event: GaitEvent,
    /// Swing leg of the current or last cycle.
    pub swing: Side,
    /// Cycle number; wraps.
    pub cycle: u32,
    /// Parameter generation in force from this moment on; wraps, compared by [`crate::newer`].
    pub generation: u32,
}

/// Whether the actuators may move.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum Mode {
    /// All brakes engaged.
    #[default]
    Braked,
    /// The pattern generators may move the joints.
    Armed,
}

/// What the coordinator makes of the IMU. Sagittal forward and lateral left are positive.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Motion {
    /// Sample counter; wraps.
    pub sequence: u16,
    /// Whether the nodes may move.
    pub mode: Mode,
    /// Trunk acceleration magnitude including gravity, m/s² (eq. 1, IMU_A).
    pub acceleration: Q16,
    /// Trunk rotational speed magnitude, rad/s (eq. 1, IMU_G).
    pub rotation: Q16,
    /// Lean rate \[sagittal, lateral\], rad/s.
    pub rate: [Q16; 2],
    /// The same, low-passed, rad/s.
    pub slow_rate: [Q16; 2],
    /// Lean \[sagittal, lateral\], rad.
    pub lean: [Q16; 2],
}

/// Why everything brakes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum HaltReason {
    /// The operator's emergency stop.
    EmergencyStop,
    /// The arming host disarmed or its arming lapsed.
    Disarmed,
    /// A node restarted or reported a fault.
    NodeFault,
    /// The IMU stopped delivering.
    ImuLost,
}

/// A whole parameter set on its way into the nodes.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Stage {
    /// Its generation.
    pub generation: u32,
    /// The set, in the order of [`crate::params::SPECS`].
    pub params: RawParams,
}

/// A node's answer to [`Stage`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Staged {
    /// The generation answered.
    pub generation: u32,
    /// Accepted, or why not.
    pub result: Result<(), ParamError>,
}

/// Node state, 100 times a second.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Status {
    /// Joint positions \[left, right\]: m (knee) or rad.
    pub position: [Q16; 2],
    /// Pad loads in 0.1 N: left heel, left toe, right heel, right toe; zero except on the knee node.
    pub loads: [u16; 4],
    /// Phase of the pattern generator; 0 is idle.
    pub phase: u8,
    /// Factor (eq. 1) as the knee saw it last, Q16; zero elsewhere.
    pub factor: Q16,
    /// Steps counted since boot; zero except on the knee node; wraps.
    pub steps: u32,
    /// Cycle number; wraps.
    pub cycle: u32,
    /// Generation in force.
    pub applied: u32,
    /// Generation staged, if any.
    pub staged: Option<u32>,
    /// Reasons that limit motion right now, as [`limits`] bits.
    pub limits: u16,
    /// Drawn at boot: a change tells a restart.
    pub boot_nonce: u16,
}

/// Bits of [`Status::limits`]: why the node moves less than asked. Faults stop; limits explain.
pub mod limits {
    /// Mode is braked.
    pub const BRAKED: u16 = 1 << 0;
    /// Halted, latched.
    pub const HALTED: u16 = 1 << 1;
    /// No fresh motion message: finishing the cycle, then braked.
    pub const COORDINATOR_LOST: u16 = 1 << 2;
    /// A joint reached the end of its range and was braked there.
    pub const END_STOP: u16 = 1 << 3;
    /// A state ran into its time-out.
    pub const TIMED_OUT: u16 = 1 << 4;
    /// The knee named a generation this node does not hold.
    pub const GENERATION_MISSING: u16 = 1 << 5;
    /// A sensor value was outside its physical range and was replaced by the last good one.
    pub const SENSOR: u16 = 1 << 6;
}

/// Every message of the bus.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Message {
    /// Brakes now.
    Halt(HaltReason),
    /// The knee's flags.
    Gait(Gait),
    /// IMU products.
    Motion(Motion),
    /// All nodes hold this generation.
    Activate(u32),
    /// A set to stage.
    Stage(Stage),
    /// A node's answer.
    Staged(NodeId, Staged),
    /// A node's state.
    Status(NodeId, Status),
}

/// Why a frame is not a message.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum BusError {
    /// Nothing of ours has this identifier.
    #[error("no message has identifier {0:#05x}")]
    UnknownId(u16),
    /// The payload is not the message its identifier promises.
    #[error("payload of identifier {0:#05x} does not decode: firmware of another version on the bus?")]
    Malformed(u16),
}

const HALT: u16 = 0x010;
const GAIT: u16 = 0x020;
const MOTION: u16 = 0x030;
const ACTIVATE: u16 = 0x040;
const STAGE: u16 = 0x050;
const STAGED: u16 = 0x060;
const STATUS: u16 = 0x100;

impl Message {
    /// The frame of this message. Every message fits: the longest is proven by a test over extreme values.
    pub fn encode(&self) -> Frame {
        match self {
            Message::Halt(body) => frame(HALT, body),
            Message::Gait(body) => frame(GAIT, body),
            Message::Motion(body) => frame(MOTION, body),
            Message::Activate(body) => frame(ACTIVATE, body),
            Message::Stage(body) => frame(STAGE, body),
            Message::Staged(node, body) => frame(STAGED + *node as u16, body),
            Message::Status(node, body) => frame(STATUS + *node as u16, body),
        }
    }

    /// Total: any identifier and any bytes give a message or an error.
    pub fn decode(frame: &Frame) -> Result<Message, BusError> {
        Message::of(frame.id, &frame.data)
    }

    /// The same of identifier and payload, where they lie.
    pub fn of(id: u16, data: &[u8]) -> Result<Message, BusError> {
        match id {
            HALT => Ok(Message::Halt(body(id, data)?)),
            GAIT => Ok(Message::Gait(body(id, data)?)),
            MOTION => Ok(Message::Motion(body(id, data)?)),
            ACTIVATE => Ok(Message::Activate(body(id, data)?)),
            STAGE => Ok(Message::Stage(body(id, data)?)),
            _ => match (node(id, STAGED), node(id, STATUS)) {
                (Some(node), _) => Ok(Message::Staged(node, body(id, data)?)),
                (_, Some(node)) => Ok(Message::Status(node, body(id, data)?)),
                _ => Err(BusError::UnknownId(id)),
            },
        }
    }
}

fn node(id: u16, base: u16) -> Option<NodeId> {
    NodeId::ALL.get(id.wrapping_sub(base) as usize).copied()
}

fn frame<T: Serialize>(id: u16, body: &T) -> Frame {
    let mut data = Vec::new();
    // A buffer of the maximum length cannot fail the resize; a body that did not fit would be sent empty and be
    // refused by every receiver as malformed.
    if data.resize(MAX_PAYLOAD, 0).is_ok() {
        let used = write(body, &mut data).unwrap_or(0);
        data.truncate(padded(used));
    }
    Frame { id, data }
}

/// The shortest payload length of CAN-FD that holds `length` bytes.
const fn padded(length: usize) -> usize {
    match length {
        0..=8 => length,
        9..=24 => length.next_multiple_of(4),
        25..=32 => 32,
        33..=48 => 48,
        _ => MAX_PAYLOAD,
    }
}

fn body<'a, T: Deserialize<'a>>(id: u16, data: &'a [u8]) -> Result<T, BusError> {
    match postcard::take_from_bytes(data) {
        Ok((value, padding)) if padding.iter().all(|byte| *byte == 0) => Ok(value),
        _ => Err(BusError::Malformed(id)),
    }
}
