//! Non-volatile memory: the flash array, the RWWEE section and the auxiliary rows (data sheet: NVMCTRL, "Memory
//! organization", "Cache").
//!
//! The flash delivers 64 bits at a time, with the wait states of CTRLB.RWS. A direct-mapped cache of eight such lines
//! sits in front of it; instructions and data share it. Assumptions, where the data sheet is silent: a miss costs
//! exactly the wait states; without the cache the line read last stays at hand; RWWEE and the auxiliary space are not
//! cached but otherwise alike.

use std::collections::BTreeSet;

use crate::Width;
use crate::cpu::decode::{Op, decode};
use crate::time::Cycles;

/// Bytes of the main array, from address 0.
pub const FLASH_SIZE: usize = 256 * 1024;
/// First address of the RWWEE section.
pub const RWWEE_BASE: u32 = 0x0040_0000;
/// Bytes of the RWWEE section.
pub const RWWEE_SIZE: usize = 8 * 1024;
/// First address of the auxiliary space (user row, calibration, serial number).
pub const AUX_BASE: u32 = 0x0080_0000;
/// Bytes of the auxiliary space.
pub const AUX_SIZE: usize = 0x1_0000;
/// Bytes written by one page write.
pub const PAGE: u32 = 64;
/// Bytes erased by one row erase.
pub const ROW: u32 = 256;

/// Lines of the cache, and the shift from an address to its line number.
const CACHE_LINES: usize = 8;
const LINE_SHIFT: u32 = 3;
/// Line number of nothing.
const NO_LINE: u32 = u32::MAX;

/// What the cache does (CTRLB.READMODE and CACHEDIS).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ReadMode {
    /// A hit costs nothing, a miss the wait states.
    NoMissPenalty,
    /// A miss costs one wait state more.
    LowPower,
    /// No cache, or one that waits for hits too.
    Uncached,
}

/// Contents of all non-volatile memory, decoded for execution. Erased bytes read 0xff.
#[derive(Clone, PartialEq, Eq)]
pub struct Nvm {
    /// The instruction that begins at each halfword of the flash.
    code: Box<[Op]>,
    /// Addresses at which execution halts, without the Thumb bit.
    watched: BTreeSet<u32>,
    lines: [u32; CACHE_LINES],
    wait_states: u8,
    /// Until then the RWWEE section is being worked on.
    rwwee_busy: Cycles,
    mode: ReadMode,
    flash: Box<[u8]>,
    rwwee: Box<[u8]>,
    aux: Box<[u8]>,
}

impl Default for Nvm {
    fn default() -> Self {
        let erased = |size| vec![0xff; size].into_boxed_slice();
        Nvm {
            code: vec![Op::Undefined; FLASH_SIZE / 2].into_boxed_slice(),
            watched: BTreeSet::new(),
            lines: [NO_LINE; CACHE_LINES],
            wait_states: 0,
            rwwee_busy: Cycles(0),
            mode: ReadMode::NoMissPenalty,
            flash: erased(FLASH_SIZE),
            rwwee: erased(RWWEE_SIZE),
            aux: erased(AUX_SIZE),
        }
    }
}

impl std::fmt::Debug for Nvm {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Nvm(..)")
    }
}

impl Nvm {
    /// Whether `address` is in non-volatile memory.
    pub fn contains(address: u32) -> bool {
        (address as usize) < FLASH_SIZE
            || address.wrapping_sub(RWWEE_BASE) < RWWEE_SIZE as u32
            || address.wrapping_sub(AUX_BASE) < AUX_SIZE as u32
    }

    /// Reads at an aligned `address`; `None` outside non-volatile memory.
    pub fn read(&self, address: u32, width: Width) -> Option<u32> {
        let (bytes, at) = self.section(address)?;
        let bytes = bytes.get(at..at + width.bytes() as usize)?;
        Some(match *bytes {
            [a] => u32::from(a),
            [a, b] => u32::from(u16::from_le_bytes([a, b])),
            [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
            _ => return None,
        })
    }

    /// Makes reading the RWWEE section wait until `until`.
    pub fn hold_rwwee(&mut self, until: Cycles) {
        self.rwwee_busy = until;
    }

    /// From when on `address` can be read.
    pub(crate) fn readable_from(&self, address: u32) -> Cycles {
        if address.wrapping_sub(RWWEE_BASE) < RWWEE_SIZE as u32 { self.rwwee_busy } else { Cycles(0) }
    }

    /// Sets the wait states and what the cache does, and empties it.
    pub fn set_timing(&mut self, wait_states: u8, mode: ReadMode) {
        (self.wait_states, self.mode) = (wait_states, mode);
        self.invalidate_cache();
    }

    /// Empties the cache (command INVALL).
    pub fn invalidate_cache(&mut self) {
        self.lines = [NO_LINE; CACHE_LINES];
    }

    /// The instruction at `pc`, `None` outside the flash.
    #[inline(always)]
    pub(crate) fn instruction(&self, pc: u32) -> Option<Op> {
        self.code.get(pc as usize >> 1).copied()
    }

    /// Whether reading at `address` costs no wait state.
    #[inline(always)]
    pub(crate) fn is_at_hand(&self, address: u32) -> bool {
        let line = address >> LINE_SHIFT;
        self.lines[line as usize % CACHE_LINES] == line
    }

    /// Reads the line around `address`; what it costs, in CPU cycles.
    #[inline(never)]
    pub(crate) fn fetch_line(&mut self, address: u32) -> u64 {
        let line = address >> LINE_SHIFT;
        let cached = self.mode != ReadMode::Uncached && (address as usize) < FLASH_SIZE;
        if !cached {
            self.invalidate_cache();
        }
        self.lines[line as usize % CACHE_LINES] = line;
        u64::from(self.wait_states) + u64::from(self.mode == ReadMode::LowPower)
    }

    /// Replaces bytes, as a debugger's flash loader would. Bytes outside non-volatile memory are ignored.
    pub fn load(&mut self, address: u32, data: &[u8]) {
        for (address, byte) in (address..).zip(data) {
            if let Some((bytes, at)) = self.section_mut(address) {
                bytes[at] = *byte;
            }
        }
        self.changed(address, data.len());
    }

    /// Programs up to a page from `address`: bits go from one to zero only.
    pub fn program(&mut self, address: u32, data: &[u8]) {
        for (address, byte) in (address..).zip(data) {
            if let Some((bytes, at)) = self.section_mut(address) {
                bytes[at] &= *byte;
            }
        }
        self.changed(address, data.len());
    }

    /// Erases the row of [`ROW`] bytes around `address` to 0xff.
    pub fn erase_row(&mut self, address: u32) {
        self.load(address & !(ROW - 1), &[0xff; ROW as usize]);
    }

    /// Flash contents.
    pub fn flash(&self) -> &[u8] {
        &self.flash
    }

    /// RWWEE contents.
    pub fn rwwee(&self) -> &[u8] {
        &self.rwwee
    }

    /// Decodes anew what has changed, from the halfword before: it may begin a 32-bit instruction.
    fn changed(&mut self, address: u32, length: usize) {
        self.invalidate_cache();
        let first = (address as usize / 2).saturating_sub(1);
        let last = (address as usize + length).div_ceil(2).min(FLASH_SIZE / 2);
        let half = |at: usize| self.flash.get(at * 2..at * 2 + 2).map_or(0xffff, |b| u16::from_le_bytes([b[0], b[1]]));
        for at in first..last {
            let pc = at as u32 * 2;
            self.code[at] = match self.watched.contains(&pc) {
                true => Op::Watched,
                false => decode(pc, half(at), half(at + 1)),
            };
        }
    }

    /// Halts execution before the instruction at `pc` in the flash, or no longer. What the chip reads there is unchanged,
    /// and so is its timing.
    pub fn watch(&mut self, pc: u32, on: bool) {
        if pc as usize >= FLASH_SIZE {
            return;
        }
        match on {
            true => {
                self.watched.insert(pc & !1);
                self.code[pc as usize >> 1] = Op::Watched;
            }
            false => {
                self.watched.remove(&(pc & !1));
                let op = self.unwatched(pc);
                self.code[pc as usize >> 1] = op;
            }
        }
    }

    /// The instruction at `pc` in the flash, watched or not.
    pub(crate) fn unwatched(&self, pc: u32) -> Op {
        let half = |pc: u32| self.read(pc & !1, Width::Half).map_or(0xffff, |half| half as u16);
        decode(pc & !1, half(pc), half(pc.wrapping_add(2)))
    }

    fn section(&self, address: u32) -> Option<(&[u8], usize)> {
        match address >> 20 {
            0 if (address as usize) < FLASH_SIZE => Some((&self.flash, address as usize)),
            4 if address - RWWEE_BASE < RWWEE_SIZE as u32 => Some((&self.rwwee, (address - RWWEE_BASE) as usize)),
            8 if address - AUX_BASE < AUX_SIZE as u32 => Some((&self.aux, (address - AUX_BASE) as usize)),
            _ => None,
        }
    }

    fn section_mut(&mut self, address: u32) -> Option<(&mut [u8], usize)> {
        match address >> 20 {
            0 if (address as usize) < FLASH_SIZE => Some((&mut self.flash, address as usize)),
            4 if address - RWWEE_BASE < RWWEE_SIZE as u32 => Some((&mut self.rwwee, (address - RWWEE_BASE) as usize)),
            8 if address - AUX_BASE < AUX_SIZE as u32 => Some((&mut self.aux, (address - AUX_BASE) as usize)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programming_clears_bits_and_erasing_a_row_sets_them() {
        let mut nvm = Nvm::default();
        nvm.program(RWWEE_BASE + 260, &[0x0f]);
        nvm.program(RWWEE_BASE + 260, &[0xf1]);
        assert_eq!(nvm.read(RWWEE_BASE + 260, Width::Byte), Some(0x01));
        nvm.erase_row(RWWEE_BASE + 300);
        assert_eq!(nvm.read(RWWEE_BASE + 260, Width::Byte), Some(0xff));
    }

    #[test]
    fn changed_flash_is_decoded_anew_with_the_instruction_that_reaches_into_it() {
        let mut nvm = Nvm::default();
        nvm.load(0x100, &[0x00, 0xf0, 0x00, 0xf8]);
        assert_eq!(nvm.instruction(0x100), Some(Op::BranchLink { target: 0x104 }));
        nvm.load(0x102, &[0x01, 0xf8]);
        assert_eq!(nvm.instruction(0x100), Some(Op::BranchLink { target: 0x106 }));
    }

    #[test]
    fn a_line_is_at_hand_after_its_miss_until_another_takes_its_place() {
        let mut nvm = Nvm::default();
        nvm.set_timing(2, ReadMode::NoMissPenalty);
        assert!(!nvm.is_at_hand(0x104));
        assert_eq!(nvm.fetch_line(0x104), 2);
        assert!(nvm.is_at_hand(0x100) && nvm.is_at_hand(0x107) && !nvm.is_at_hand(0x108));
        nvm.fetch_line(0x140);
        assert!(!nvm.is_at_hand(0x100));
    }

    #[test]
    fn without_cache_only_the_last_line_is_at_hand() {
        let mut nvm = Nvm::default();
        nvm.set_timing(2, ReadMode::Uncached);
        nvm.fetch_line(0x100);
        nvm.fetch_line(0x108);
        assert!(nvm.is_at_hand(0x108) && !nvm.is_at_hand(0x100));
    }
}
