//! Host ↔ coordinator: the messages, and how they become serial frames.
//!
//! ```text
//!  version 0, frozen for ever: fixed layout, little-endian; a longer body is accepted, its tail ignored
//!    "SARA" │ version u8 │ schema u32                                              hello, host → robot
//!    "HARA" │ version u8 │ schema u32 │ boot nonce u32 │ board u8 │ nodes u8 │ build [u8;16]   its answer
//!    "STOP"                                                                        emergency stop, host → robot
//!  version 1: postcard
//!    Command                                                                       host → robot
//!    Report                                                                        robot → host
//! ```
//!
//! Because the frozen messages outlive every schema, two builds that cannot talk can still say so, and any host can
//! stop any robot. A robot answers a frame of a version it does not speak with its hello.

use serde::{Deserialize, Serialize};

use crate::frame::{self, Bytes, Header, MAX_BODY, Packet};
use crate::params::RawParams;
use crate::telemetry::{Event, Telemetry};
use crate::write::write;

/// Version of everything that is not frozen.
pub const VERSION: u8 = 1;
/// Header version of the frozen messages.
pub const FROZEN: u8 = 0;

pub use crate::refusal::{NotReady, Refusal};

const HELLO: [u8; 4] = *b"SARA";
const HELLO_REPLY: [u8; 4] = *b"HARA";
const STOP: [u8; 4] = *b"STOP";

/// A host introduces itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Hello {
    /// [`VERSION`] of its build.
    pub version: u8,
    /// [`crate::schema::schema_hash`] of its build.
    pub schema: u32,
}

impl Hello {
    /// This build.
    pub const fn ours() -> Hello {
        Hello { version: VERSION, schema: crate::schema::schema_hash() }
    }
}

/// The robot introduces itself.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct HelloReply {
    /// [`VERSION`] of its firmware.
    pub version: u8,
    /// [`crate::schema::schema_hash`] of its firmware.
    pub schema: u32,
    /// Drawn at boot; arming names it, so that an arming never outlives a reboot.
    pub boot_nonce: u32,
    /// Which board; 0 is simulated.
    pub board: u8,
    /// Nodes heard lately: bit n is node n.
    pub nodes: u8,
    /// Firmware build, ASCII, padded with zeros.
    pub build: [u8; 16],
}

/// Which parameter set is meant.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Which {
    /// In force in every node.
    Applied,
    /// In non-volatile memory.
    Stored,
    /// Held by the nodes, not yet in force.
    Staged,
}

/// Host → robot. All but `Claim` and `GetParams` need the claim.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum Command {
    /// Become the one writer.
    Claim,
    /// Let others write.
    Release,
    /// Allow motion, on the boot that the hello named.
    Arm {
        /// [`HelloReply::boot_nonce`].
        boot_nonce: u32,
    },
    /// Brake now.
    Disarm,
    /// Unlatch the emergency stop; still braked.
    ClearEStop,
    /// Check a set and put it into every node.
    Stage {
        /// Newer than any before.
        generation: u32,
        /// The set.
        params: RawParams,
    },
    /// Put a staged generation into force at the next cycle boundary.
    Commit {
        /// The staged generation.
        generation: u32,
    },
    /// Keep the applied set over power cycles.
    Persist {
        /// The applied generation.
        generation: u32,
    },
    /// Ask for a set.
    GetParams(Which),
    /// The writer lives. Refused after a reboot or a lapse, which is how the host learns of it.
    Heartbeat {
        /// Its own time, µs; for logs.
        host_us: u32,
    },
    /// Telemetry frames per second, up to 1000; 0 turns it off.
    SetTelemetry {
        /// Frames per second.
        rate_hz: u16,
    },
}

/// How far a request has come. Received is not staged is not applied is not persisted.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum AckState {
    /// Understood and done, or under way.
    Received,
    /// All three nodes hold the set.
    Staged {
        /// Its generation.
        generation: u32,
    },
    /// All three nodes run the set.
    Applied {
        /// Its generation.
        generation: u32,
        /// The cycle from which on.
        cycle: u32,
    },
    /// The set is in non-volatile memory.
    Persisted {
        /// Its generation.
        generation: u32,
    },
    /// Not done, and why.
    Refused(Refusal),
}

/// Answer to a command.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Ack {
    /// Sequence of the command.
    pub request: u16,
    /// How far it has come.
    pub state: AckState,
}

/// Answer to [`Command::GetParams`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ParamsReport {
    /// Which set was asked for.
    pub which: Which,
    /// Its generation; 0 for the stored set.
    pub generation: u32,
    /// The set, if there is one.
    pub params: Option<RawParams>,
}

/// Robot → host.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum Report {
    /// Answer to a command.
    Ack(Ack),
    /// Answer to [`Command::GetParams`].
    Params(ParamsReport),
    /// Snapshot.
    Telemetry(Telemetry),
    /// Something happened.
    Event {
        /// When, coordinator time in µs.
        time_us: u32,
        /// What.
        event: Event,
    },
}

/// Everything a robot may hear.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ToRobot {
    /// Frozen.
    Hello(Hello),
    /// Frozen; needs no claim, no hello, no common version.
    EStop,
    /// Of this version.
    Command(Command),
}

/// Everything a host may hear.
// Telemetry is the common case: boxing is not possible, and shrinking the rest saves nothing.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ToHost {
    /// Frozen.
    Hello(HelloReply),
    /// Of this version.
    Report(Report),
}

/// Why a frame with a right check sum is not a message.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum MessageError {
    /// The other side speaks another version.
    #[error("protocol version {0}, here {VERSION}")]
    Version(u8),
    /// The body is not a message of the version it claims.
    #[error("body does not decode")]
    Malformed,
}

impl ToRobot {
    /// The frame of this message.
    pub fn encode(&self, session: u16, sequence: u16) -> Option<Bytes> {
        match self {
            ToRobot::Hello(hello) => {
                frozen(session, sequence, &[&HELLO, &[hello.version], &hello.schema.to_le_bytes()])
            }
            ToRobot::EStop => frozen(session, sequence, &[&STOP]),
            ToRobot::Command(command) => versioned(session, sequence, command),
        }
    }

    /// Total: any packet gives a message or an error.
    pub fn decode(packet: &Packet<'_>) -> Result<ToRobot, MessageError> {
        match packet.header.version {
            FROZEN => {
                let (magic, mut rest) = packet.body.split_first_chunk().ok_or(MessageError::Malformed)?;
                match *magic {
                    HELLO => Ok(ToRobot::Hello(Hello { version: u8_le(&mut rest)?, schema: u32_le(&mut rest)? })),
                    STOP => Ok(ToRobot::EStop),
                    _ => Err(MessageError::Malformed),
                }
            }
            VERSION => postcard_body(packet.body).map(ToRobot::Command),
            other => Err(MessageError::Version(other)),
        }
    }
}

impl ToHost {
    /// The frame of this message.
    pub fn encode(&self, session: u16, sequence: u16) -> Option<Bytes> {
        match self {
            ToHost::Hello(h) => frozen(
                session,
                sequence,
                &[
                    &HELLO_REPLY,
                    &[h.version],
                    &h.schema.to_le_bytes(),
                    &h.boot_nonce.to_le_bytes(),
                    &[h.board, h.nodes],
                    &h.build,
                ],
            ),
            ToHost::Report(report) => versioned(session, sequence, report),
        }
    }

    /// Total: any packet gives a message or an error.
    pub fn decode(packet: &Packet<'_>) -> Result<ToHost, MessageError> {
        match packet.header.version {
            FROZEN => {
                let (magic, mut rest) = packet.body.split_first_chunk().ok_or(MessageError::Malformed)?;
                if *magic != HELLO_REPLY {
                    return Err(MessageError::Malformed);
                }
                Ok(ToHost::Hello(HelloReply {
                    version: u8_le(&mut rest)?,
                    schema: u32_le(&mut rest)?,
                    boot_nonce: u32_le(&mut rest)?,
                    board: u8_le(&mut rest)?,
                    nodes: u8_le(&mut rest)?,
                    build: take(&mut rest)?,
                }))
            }
            VERSION => postcard_body(packet.body).map(ToHost::Report),
            other => Err(MessageError::Version(other)),
        }
    }
}

fn frozen(session: u16, sequence: u16, parts: &[&[u8]]) -> Option<Bytes> {
    let mut body: heapless::Vec<u8, MAX_BODY> = heapless::Vec::new();
    for part in parts {
        body.extend_from_slice(part).ok()?;
    }
    frame::encode(Header { version: FROZEN, session, sequence }, &body)
}

fn versioned<T: Serialize>(session: u16, sequence: u16, message: &T) -> Option<Bytes> {
    let mut buffer = [0; MAX_BODY];
    let used = write(message, &mut buffer)?;
    frame::encode(Header { version: VERSION, session, sequence }, buffer.get(..used)?)
}

fn postcard_body<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T, MessageError> {
    match postcard::take_from_bytes(body) {
        Ok((value, [])) => Ok(value),
        _ => Err(MessageError::Malformed),
    }
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], MessageError> {
    let (head, tail) = rest.split_first_chunk::<N>().ok_or(MessageError::Malformed)?;
    *rest = tail;
    Ok(*head)
}

fn u8_le(rest: &mut &[u8]) -> Result<u8, MessageError> {
    take(rest).map(u8::from_le_bytes)
}

fn u32_le(rest: &mut &[u8]) -> Result<u32, MessageError> {
    take(rest).map(u32::from_le_bytes)
}
