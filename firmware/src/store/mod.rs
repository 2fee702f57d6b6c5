//! The stored parameter set: survives a power cut at any moment, as the old set or the new one, never a mixture.
//!
//! Two slots of one row each, written in turn. The slot in force is never touched while the other is written:
//!
//! ```text
//!  write    erase row ─► verify ─► page 0 ─► verify ─► page 1 ─► verify ─► marker ─► verify ─► stored
//!               └──────────┴─────────┴──── anything wrong: again, three times in all ────┘
//!  load     newest slot whose marker, CRC, layout, schema hash and limits are all right; else the built-in set
//! ```
//!
//! [`Store::step`] starts or checks one operation and returns: at most 256 bytes are read and no operation is waited
//! for. Call it every millisecond or so while a write is under way.
//!
//! - `flash`: what a memory must offer. `record`: a slot, byte by byte.

mod flash;
mod record;

use sarah_protocol::newer;
use sarah_protocol::params::{ParamError, ParamSet};

pub use flash::{Flash, FlashFault, PAGE, PAGES, ROW};

use record::{Record, WRITTEN};

/// Bytes the store occupies, from the start of the memory.
pub const SIZE: usize = 2 * ROW;
/// Complete attempts at one write before it is given up.
pub const ATTEMPTS: u8 = 3;
/// Steps, of a millisecond or so, until a memory that stays busy is taken for broken: the slowest erasure takes 200.
const WAIT_AT_MOST: u16 = 1000;

/// One of the two places.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Slot {
    /// The first row.
    A = 0,
    /// The second row.
    B = 1,
}

impl Slot {
    /// Both.
    pub const ALL: [Slot; 2] = [Slot::A, Slot::B];

    const fn other(self) -> Slot {
        match self {
            Slot::A => Slot::B,
            Slot::B => Slot::A,
        }
    }
}

/// What is kept with a set.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Kept {
    /// Number of the write; orders the slots, wraps.
    pub sequence: u32,
    /// The generation the robot knew the set by when it was stored.
    pub generation: u32,
    /// The firmware that stored it, ASCII, padded with zeros.
    pub build: [u8; 16],
}

/// What a slot holds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum SlotState {
    /// A whole set of this build's schema.
    Valid(Kept),
    /// Nothing: erased.
    Empty,
    /// A write or an erasure that was cut off.
    Unfinished,
    /// It was finished, but its check sum is wrong now.
    Corrupt,
    /// A build with another arrangement of the bytes wrote it.
    OtherLayout {
        /// Its arrangement.
        layout: u16,
    },
    /// A build with other parameters, limits or messages wrote it.
    OtherSchema {
        /// Its schema hash.
        schema: u32,
        /// Its number.
        sequence: u32,
    },
    /// The check sum is right, but this build would refuse the set.
    Refused(ParamError),
}

impl SlotState {
    /// In words, for a log.
    pub const fn words(&self) -> &'static str {
        match self {
            SlotState::Valid(_) => "valid",
            SlotState::Empty => "empty",
            SlotState::Unfinished => "unfinished: power was cut while it was written or erased",
            SlotState::Corrupt => "corrupt: check sum wrong",
            SlotState::OtherLayout { .. } => "written by firmware with another layout",
            SlotState::OtherSchema { .. } => "written by firmware with another schema",
            SlotState::Refused(_) => "outside this firmware's limits",
        }
    }
}

/// What a boot begins with, and why.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Loaded {
    /// The set to use.
    pub set: ParamSet,
    /// Where it came from; `None` is the built-in set.
    pub from: Option<(Slot, Kept)>,
    /// What each slot holds: tells why one was passed over.
    pub slots: [SlotState; 2],
}

/// Why a write was given up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WriteError {
    /// The memory reported an error.
    Fault,
    /// A row did not come up blank.
    NotErased,
    /// A page did not read back as written.
    NotWritten,
}

/// How a write stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// Nothing to do.
    Idle,
    /// Under way: call again.
    Busy,
    /// The set of this generation is stored, and the next boot begins with it.
    Stored {
        /// Its generation.
        generation: u32,
    },
    /// Given up; the set stored before is still there.
    Failed {
        /// The generation that is not stored.
        generation: u32,
        /// What went wrong last.
        why: WriteError,
    },
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Phase {
    Erase,
    Erasing,
    /// Index into [`WRITTEN`].
    Writing(usize),
}

#[derive(Clone, Debug)]
struct Job {
    record: Record,
    slot: Slot,
    kept: Kept,
    phase: Phase,
    attempts: u8,
    /// Steps in a row that found the memory busy.
    waited: u16,
}

/// The two slots and the write under way.
#[derive(Clone, Debug)]
pub struct Store {
    current: Option<(Slot, u32)>,
    target: Slot,
    job: Option<Job>,
}

impl Store {
    /// Reads both slots. `default` is the built-in set.
    pub fn load(flash: &impl Flash, default: &ParamSet) -> (Store, Loaded) {
        let (a, b) = (examine(flash, Slot::A), examine(flash, Slot::B));
        let slots = [&a, &b].map(|slot| match slot {
            Ok((_, kept)) => SlotState::Valid(*kept),
            Err(state) => *state,
        });
        let chosen = match (a, b) {
            (Ok((_, a)), Ok((set, b))) if newer(b.sequence, a.sequence) => Some((set, Slot::B, b)),
            (Ok((set, a)), _) => Some((set, Slot::A, a)),
            (_, Ok((set, b))) => Some((set, Slot::B, b)),
            _ => None,
        };
        let store = Store {
            current: chosen.map(|(_, slot, kept)| (slot, kept.sequence)),
            target: chosen.map_or(spare(&slots), |(_, slot, _)| slot.other()),
            job: None,
        };
        let set = chosen.map_or(*default, |(set, ..)| set);
        (store, Loaded { set, from: chosen.map(|(_, slot, kept)| (slot, kept)), slots })
    }

    /// Begins to store a set; [`Store::step`] does it. False while another write is under way.
    pub fn write(&mut self, set: &ParamSet, generation: u32, build: [u8; 16]) -> bool {
        if self.job.is_some() {
            return false;
        }
        let sequence = self.current.map_or(1, |(_, sequence)| sequence.wrapping_add(1));
        let kept = Kept { sequence, generation, build };
        let record = Record::new(set, &kept);
        self.job = Some(Job { record, slot: self.target, kept, phase: Phase::Erase, attempts: 1, waited: 0 });
        true
    }

    /// Does the next bit of the write under way.
    pub fn step(&mut self, flash: &mut impl Flash) -> Step {
        let Some(job) = &mut self.job else { return Step::Idle };
        let generation = job.kept.generation;
        match job.step(flash) {
            Ok(false) => Step::Busy,
            Ok(true) => {
                self.current = Some((job.slot, job.kept.sequence));
                self.target = job.slot.other();
                self.job = None;
                Step::Stored { generation }
            }
            Err(_) if job.attempts < ATTEMPTS => {
                job.attempts += 1;
                (job.phase, job.waited) = (Phase::Erase, 0);
                Step::Busy
            }
            Err(why) => {
                self.job = None;
                Step::Failed { generation, why }
            }
        }
    }
}

impl Job {
    fn step(&mut self, flash: &mut impl Flash) -> Result<bool, WriteError> {
        if !flash.idle().map_err(|_| WriteError::Fault)? {
            self.waited += 1;
            return if self.waited < WAIT_AT_MOST { Ok(false) } else { Err(WriteError::Fault) };
        }
        self.waited = 0;
        let next = match self.phase {
            // Always erased, also when it reads blank: an erasure that was cut off may only look complete.
            Phase::Erase => {
                flash.start_erase(self.slot as usize).map_err(|_| WriteError::Fault)?;
                self.phase = Phase::Erasing;
                return Ok(false);
            }
            Phase::Erasing if read(flash, self.slot) != Record::from_bytes([0xFF; ROW]) => {
                return Err(WriteError::NotErased);
            }
            Phase::Erasing => 0,
            Phase::Writing(index) => {
                let mut found = [0; PAGE];
                let page = WRITTEN.get(index).copied().unwrap_or_default();
                flash.read(self.slot as usize * ROW + page * PAGE, &mut found);
                if found != self.record.page(page) {
                    return Err(WriteError::NotWritten);
                }
                index + 1
            }
        };
        let Some(page) = WRITTEN.get(next) else { return Ok(true) };
        let data = self.record.page(*page);
        flash.start_write(self.slot as usize * PAGES + page, &data).map_err(|_| WriteError::Fault)?;
        self.phase = Phase::Writing(next);
        Ok(false)
    }
}

/// Not inlined, so that one row at a time is on the stack.
#[inline(never)]
fn examine(flash: &impl Flash, slot: Slot) -> Result<(ParamSet, Kept), SlotState> {
    read(flash, slot).parse()
}

fn read(flash: &impl Flash, slot: Slot) -> Record {
    let mut bytes = [0; ROW];
    flash.read(slot as usize * ROW, &mut bytes);
    Record::from_bytes(bytes)
}

/// The slot to sacrifice when neither is in use: one with nothing of value, else the older set of the other firmware.
fn spare(slots: &[SlotState; 2]) -> Slot {
    match slots {
        [SlotState::OtherSchema { sequence: a, .. }, SlotState::OtherSchema { sequence: b, .. }] if newer(*a, *b) => {
            Slot::B
        }
        [SlotState::OtherSchema { .. }, SlotState::OtherSchema { .. }] => Slot::A,
        [SlotState::OtherSchema { .. } | SlotState::OtherLayout { .. }, _] => Slot::B,
        _ => Slot::A,
    }
}
