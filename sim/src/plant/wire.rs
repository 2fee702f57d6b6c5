//! What simulator and plant say to each other; one reply to every message, nothing unasked.
//!
//! ```text
//!   00 │ COBS( version u8 │ 0 u16 │ number u16 │ body │ CRC-32 u32 ) │ 00      the project's frame, protocol::frame
//!
//!   to the plant, body:                               from it, body:
//!   00 │ Setup, 92 bytes            begin anew        00 │ model u32 │ Snapshot │ n u8 │ name, n bytes
//!   01 │ Step, 41 bytes             advance by dt_s   01 │ Snapshot, 140 bytes
//!                                                     02 │ n u8 │ setting │ n u8 │ why it cannot
//! ```
//!
//! A reply carries the version and the number of its message. Integers and floats are little-endian, floats IEEE single;
//! fields follow each other as declared here, without gaps. This is postcard's encoding of these types; one byte suffices
//! for every length and kind.

use heapless::String;
use sarah_protocol::frame::{self, Bytes, FrameError, Header, MAX_BODY, Packet};
use serde::{Deserialize, Serialize};

/// Version of these words.
pub const VERSION: u8 = 1;
/// Longest name of a plant, bytes.
pub const NAME: usize = 24;
/// Longest name of a setting, bytes.
pub const SETTING: usize = 32;
/// Longest reason for a refusal, bytes.
pub const WHY: usize = 120;

/// To the plant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum ToPlant {
    /// Forget the robot there is; a new one stands on straight legs, square to the ground, brakes on.
    Setup(Setup),
    /// Do this for `dt_s`.
    Step(Step),
}

/// A robot to begin with: what of [`RobotConfig`](crate::robot::RobotConfig) concerns a plant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// CRC-32 of `sim/assets/sarah.xml`, little-endian.
    pub model: [u8; 4],
    /// Length of a step, s.
    pub dt_s: f32,
    /// Height of the lowest sole corner above the ground, m.
    pub drop_m: f32,
    /// Point mass at the trunk's centre of mass, kg.
    pub payload_kg: f32,
    /// Displacement of the trunk's centre of mass (x, y, z), m.
    pub com_shift_m: [f32; 3],
    /// Factor on every mass and inertia, before the payload.
    pub mass_scale: f32,
    /// Coulomb friction of feet on ground; not a number: the file's.
    pub friction: f32,
    /// Slope of the ground about y, then about x, rad, through the origin.
    pub slope_rad: [f32; 2],
    /// Factor on each actuator's top speed, in [`Joint`](crate::robot::Joint) order.
    pub speed_scales: [f32; 6],
    /// Factor on each actuator's force limit.
    pub force_scales: [f32; 6],
}

/// What acts on the robot during a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Bit i: the brake of joint i is released. Joints are those of [`Joint::ALL`](crate::robot::Joint::ALL).
    pub released: u8,
    /// Speed of each released joint, m/s or rad/s; 0 for braked ones.
    pub speeds: [f32; 6],
    /// Force on the trunk in world axes, N.
    pub force_n: [f32; 3],
    /// Point of application above the trunk's centre of mass, along world z, m.
    pub height_m: f32,
}

/// What has become of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    /// Origin of the trunk's frame in the world, m.
    pub position_m: [f32; 3],
    /// Unit quaternion x, y, z, w turning trunk axes into world axes.
    pub rotation_xyzw: [f32; 4],
    /// Velocity of that origin in world axes, m/s.
    pub velocity_m_s: [f32; 3],
    /// Angular velocity of the trunk in world axes, rad/s.
    pub angular_velocity_rad_s: [f32; 3],
    /// Coordinates of the joints, m or rad.
    pub joints: [f32; 6],
    /// Their speeds, m/s or rad/s.
    pub joint_speeds: [f32; 6],
    /// Force or torque of each motor, N or N·m, in the joint's sign; 0 while braked.
    pub efforts: [f32; 6],
    /// Normal force of the ground on each pad, N, mean over the step: left heel, left toe, right heel, right toe.
    pub pads_n: [f32; 4],
}

/// From the plant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum FromPlant {
    /// The new robot stands there.
    Ready {
        /// CRC-32 of the `sarah.xml` its model was made from, little-endian.
        model: [u8; 4],
        /// What has become of the robot: nothing yet.
        snapshot: Snapshot,
        /// Who simulates.
        name: String<NAME>,
    },
    /// The step is done.
    Done(Snapshot),
    /// It cannot simulate such a robot.
    Refused {
        /// Which field of [`RobotConfig`](crate::robot::RobotConfig) is at fault.
        setting: String<SETTING>,
        /// Why it cannot, and what it can.
        why: String<WHY>,
    },
}

/// The frame of a message or reply with this number; `None` if it were too long, which no value of these types is.
pub fn encode<T: Serialize>(number: u16, message: &T) -> Option<Bytes> {
    let mut body = [0; MAX_BODY];
    let body = postcard::to_slice(message, &mut body).ok()?;
    frame::encode(Header { version: VERSION, session: 0, sequence: number }, body)
}

/// Why a frame is not the reply that is waited for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// The frame itself.
    #[error("bytes that are no frame ({0})")]
    Frame(#[from] FrameError),
    /// Another version.
    #[error("version {0}")]
    Version(u8),
    /// Another number.
    #[error("a reply to message {theirs} instead of {ours}")]
    Number {
        /// That of the message.
        ours: u16,
        /// That of the reply.
        theirs: u16,
    },
    /// Another body.
    #[error("a body of {0} bytes that is no reply")]
    Body(usize),
}

/// What a frame says in answer to message `number`.
pub fn reply(number: u16, packet: Result<Packet<'_>, FrameError>) -> Result<FromPlant, WireError> {
    let Packet { header, body } = packet?;
    if header.version != VERSION {
        return Err(WireError::Version(header.version));
    }
    if header.sequence != number {
        return Err(WireError::Number { ours: number, theirs: header.sequence });
    }
    match postcard::take_from_bytes(body) {
        Ok((reply, [])) => Ok(reply),
        _ => Err(WireError::Body(body.len())),
    }
}
