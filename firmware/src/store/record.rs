//! One stored set as bytes.
//!
//! ```text
//!  page 0    0 magic u32 │ 4 layout u16 │ 6 count u16 │ 8 schema hash u32 │ 12 sequence u32 │ 16 generation u32
//!           20 firmware build, 16 × ASCII │ 36 erased
//!  page 1   64 P1 … V5, 13 × f32 │ 116 erased │ 124 CRC-32 of bytes 0…123
//!  page 2  128 never written
//!  page 3  192 marker u32 │ 196 the CRC-32 again │ 200 erased          written last: makes the slot count
//! ```
//!
//! All little-endian. `sequence` orders the slots and is the store's own: generations begin anew at every boot.

use sarah_protocol::frame::checksum;
use sarah_protocol::params::{COUNT, ParamSet, RawParams};
use sarah_protocol::schema::schema_hash;

use super::flash::{PAGE, ROW};
use super::{Kept, SlotState};

const MAGIC: u32 = u32::from_le_bytes(*b"SRPS");
const MARKER: u32 = u32::from_le_bytes(*b"done");
/// Changes with the layout above.
const LAYOUT: u16 = 1;
const VALUES_AT: usize = PAGE;
const CRC_AT: usize = 2 * PAGE - 4;
const MARKER_PAGE: usize = 3;
const MARKER_AT: usize = MARKER_PAGE * PAGE;

const _: () = assert!(VALUES_AT + COUNT * 4 <= CRC_AT);

/// A row's content, and the order in which its pages are written.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Record([u8; ROW]);

/// The pages that are written, the marker's last.
pub(super) const WRITTEN: [usize; 3] = [0, 1, MARKER_PAGE];

impl Record {
    pub(super) fn new(set: &ParamSet, kept: &Kept) -> Record {
        let mut record = Record([0xFF; ROW]);
        record.put(0, &MAGIC.to_le_bytes());
        record.put(4, &LAYOUT.to_le_bytes());
        record.put(6, &(COUNT as u16).to_le_bytes());
        record.put(8, &schema_hash().to_le_bytes());
        record.put(12, &kept.sequence.to_le_bytes());
        record.put(16, &kept.generation.to_le_bytes());
        record.put(20, &kept.build);
        for (index, value) in set.values().iter().enumerate() {
            record.put(VALUES_AT + 4 * index, &value.to_le_bytes());
        }
        let crc = record.crc();
        record.put(CRC_AT, &crc.to_le_bytes());
        record.put(MARKER_AT, &MARKER.to_le_bytes());
        record.put(MARKER_AT + 4, &crc.to_le_bytes());
        record
    }

    pub(super) const fn from_bytes(bytes: [u8; ROW]) -> Record {
        Record(bytes)
    }

    pub(super) fn page(&self, index: usize) -> [u8; PAGE] {
        self.bytes(index * PAGE)
    }

    /// The set, if the row holds a whole one of this build's schema; else what it holds instead.
    pub(super) fn parse(&self) -> Result<(ParamSet, Kept), SlotState> {
        if self.0 == [0xFF; ROW] {
            return Err(SlotState::Empty);
        }
        // The marker first: before it is there, nothing else is promised.
        if self.word(MARKER_AT) != MARKER || self.word(MARKER_AT + 4) != self.word(CRC_AT) {
            return Err(SlotState::Unfinished);
        }
        if self.word(CRC_AT) != self.crc() || self.word(0) != MAGIC {
            return Err(SlotState::Corrupt);
        }
        let kept = Kept { sequence: self.word(12), generation: self.word(16), build: self.bytes(20) };
        let [layout, count] = [4, 6].map(|at| u16::from_le_bytes(self.bytes(at)));
        if layout != LAYOUT {
            return Err(SlotState::OtherLayout { layout });
        }
        if self.word(8) != schema_hash() || usize::from(count) != COUNT {
            return Err(SlotState::OtherSchema { schema: self.word(8), sequence: kept.sequence });
        }
        let values: RawParams = core::array::from_fn(|i| f32::from_le_bytes(self.bytes(VALUES_AT + 4 * i)));
        let set = ParamSet::new(values).map_err(SlotState::Refused)?;
        Ok((set, kept))
    }

    fn crc(&self) -> u32 {
        checksum(self.0.get(..CRC_AT).unwrap_or_default())
    }

    fn word(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        self.0.get(at..at + N).and_then(|bytes| bytes.try_into().ok()).unwrap_or([0xFF; N])
    }

    fn put(&mut self, at: usize, bytes: &[u8]) {
        if let Some(target) = self.0.get_mut(at..at + bytes.len()) {
            target.copy_from_slice(bytes);
        }
    }
}
