//! What went into and came out of the control code, as it is stored: postcard entries, one after the other.
//!
//! ```text
//!   Born     what the chips were born with; the first entry
//!   Passed   at_us, chip, what        in the order in which it happened, chip by chip
//! ```

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use sarah_firmware::calibration::{Command, Counts};
use sarah_firmware::coordinator::ImuSample;
use sarah_firmware::default_params;
use sarah_protocol::bus::{Frame, NodeId};
use sarah_protocol::params::{ParamError, ParamSet, RawParams};
use sarah_sim::bus::Station;
use sarah_sim::chips::Birth;
use sarah_sim::tap::{Passing, Tap};
use serde::{Deserialize, Serialize};

/// One entry.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub enum Entry {
    /// The beginning.
    Born(Born),
    /// One thing went in or out.
    Passed {
        /// When, µs since power-up.
        at_us: u64,
        /// Of which chip: 0 is the coordinator, 1 + n is node n.
        chip: u8,
        /// What.
        what: Passed,
    },
}

/// What the control code is rebuilt from.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct Born {
    /// The outputs are emulated chips', which lag and have boot nonces of their own; the coordinator is not on the tape.
    pub emulated: bool,
    /// Boot nonce of the coordinator.
    pub boot_nonce: u32,
    /// It arms once, without a host.
    pub arm_at_boot: bool,
    /// Nominal time between its IMU samples, µs.
    pub imu_period_us: u32,
    /// The set built into the nodes.
    pub default: RawParams,
    /// The set in its memory.
    pub stored: RawParams,
}

/// A frame of the bus.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub struct Framed {
    /// Identifier.
    pub id: u16,
    /// Payload.
    pub data: Vec<u8>,
}

/// What an actuator is told: the brake, or direction (forward) and duty.
pub type Told = Option<(bool, u16)>;

/// [`Passing`], to keep.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
pub enum Passed {
    /// In: a frame from the bus.
    Frame(Framed),
    /// In: a control tick of a node.
    Tick {
        /// Since the tick before, µs.
        dt_us: u32,
        /// Positions, counts.
        position: [u16; 2],
        /// Loads, counts.
        load: [u16; 4],
    },
    /// In: a turn of the coordinator.
    Turn {
        /// Bytes from the host.
        host: Vec<u8>,
        /// Accelerometer, counts.
        accel: [i16; 3],
        /// Gyro, counts.
        gyro: [i16; 3],
    },
    /// Out: commands for the left and the right actuator.
    Commands([Told; 2]),
    /// Out: a frame for the bus.
    Sent(Framed),
    /// Out: bytes for the host.
    Host(Vec<u8>),
    /// Out: a set went into memory.
    Stored(u32),
}

impl Born {
    /// Of a simulated robot that runs the library.
    pub fn of(birth: &Birth) -> Born {
        Born {
            emulated: false,
            boot_nonce: birth.boot_nonce,
            arm_at_boot: birth.arm_at_boot,
            imu_period_us: birth.imu_period_us,
            default: *birth.default.values(),
            stored: *birth.stored.values(),
        }
    }

    /// Of emulated chips with images of this source.
    pub fn emulated() -> Born {
        let set = *default_params().values();
        Born { emulated: true, boot_nonce: 0, arm_at_boot: false, imu_period_us: 0, default: set, stored: set }
    }

    /// What the chips are born with.
    pub fn birth(&self) -> Result<Birth, ParamError> {
        Ok(Birth {
            boot_nonce: self.boot_nonce,
            arm_at_boot: self.arm_at_boot,
            imu_period_us: self.imu_period_us,
            default: ParamSet::new(self.default)?,
            stored: ParamSet::new(self.stored)?,
        })
    }
}

impl From<&Frame> for Framed {
    fn from(frame: &Frame) -> Framed {
        Framed { id: frame.id, data: frame.data.to_vec() }
    }
}

impl From<&Framed> for Frame {
    /// A payload longer than any is cut off: it is then another frame, and refused as such.
    fn from(framed: &Framed) -> Frame {
        Frame { id: framed.id, data: framed.data.iter().copied().take(sarah_protocol::bus::MAX_PAYLOAD).collect() }
    }
}

/// A command, to keep.
pub fn told(command: Command) -> Told {
    match command {
        Command::Brake => None,
        Command::Run { forward, duty } => Some((forward, duty)),
    }
}

/// A chip's number on the tape.
pub fn number(chip: Station) -> u8 {
    match chip {
        Station::Coordinator => 0,
        Station::Node(id) => 1 + id as u8,
    }
}

/// The node with this number, if it is one.
pub fn node(chip: u8) -> Option<NodeId> {
    NodeId::ALL.get(usize::from(chip).checked_sub(1)?).copied()
}

fn keep(what: Passing<'_>) -> Passed {
    match what {
        Passing::Frame(frame) => Passed::Frame(frame.into()),
        Passing::Tick { dt_us, counts: Counts { position, load } } => {
            Passed::Tick { dt_us, position: *position, load: *load }
        }
        Passing::Turn { host, imu: ImuSample { accel, gyro } } => {
            Passed::Turn { host: host.to_vec(), accel: *accel, gyro: *gyro }
        }
        Passing::Commands(commands) => Passed::Commands(commands.map(told)),
        Passing::Sent(frame) => Passed::Sent(frame.into()),
        Passing::Told(bytes) => Passed::Host(bytes.to_vec()),
        Passing::Stored(generation) => Passed::Stored(generation),
    }
}

/// A tape being written; clones are the same tape.
#[derive(Clone, Debug, Default)]
pub struct Tape(Arc<Mutex<Vec<u8>>>);

impl Tape {
    /// Begins with what the chips were born with.
    pub fn new(born: Born) -> Tape {
        let tape = Tape::default();
        tape.push(&Entry::Born(born));
        tape
    }

    /// The bytes since the last call: whole entries.
    pub fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.bytes())
    }

    fn push(&self, entry: &Entry) {
        let mut bytes = self.bytes();
        let before = std::mem::take(&mut *bytes);
        // Into a vector every entry fits.
        *bytes = postcard::to_extend(entry, before).unwrap_or_default();
    }

    fn bytes(&self) -> MutexGuard<'_, Vec<u8>> {
        // A panic elsewhere leaves whole entries.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Tap for Tape {
    fn passes(&mut self, at_us: u64, chip: Station, what: Passing<'_>) {
        self.push(&Entry::Passed { at_us, chip: number(chip), what: keep(what) });
    }
}

/// The entries in `bytes`, each with the number of bytes after it; an error ends them.
pub fn entries(mut bytes: &[u8]) -> impl Iterator<Item = (Result<Entry, postcard::Error>, usize)> {
    std::iter::from_fn(move || {
        if bytes.is_empty() {
            return None;
        }
        let entry = postcard::take_from_bytes(bytes).map(|(entry, rest)| {
            bytes = rest;
            entry
        });
        if entry.is_err() {
            bytes = &[];
        }
        Some((entry, bytes.len()))
    })
}
