//! Non-volatile memory: the flash array, the RWWEE section and the auxiliary rows (data sheet: NVMCTRL, "Memory
//! organization", "Cache").
//!
//! The flash delivers 64 bits at a time, with the wait states of CTRLB.RWS. A direct-mapped cache of eight such lines
//! sits in front of it; instructions and data share it. Assumptions, where the data sheet is silent: a miss costs
//! exactly the wait states; without the cache the line read last stays at hand; RWWEE and the auxiliary space are not
//! cached but otherwise alike.

use crate::Width;
use crate::code::Code;
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

/// Contents of all non-volatile memory. Erased bytes read 0xff.
#[derive(Clone)]
pub struct Nvm {
    /// What executes from the flash.
    pub(crate) code: Code<0>,
    lines: [u32; CACHE_LINES],
    /// Bits of a line's number that choose its place in `lines`: none without cache.
    places: u32,
    /// CPU cycles that a line costs which is not at hand.
    miss: u64,
    /// Until then the RWWEE section is being worked on.
    rwwee_busy: Cycles,
    flash: Box<[u8]>,
    rwwee: Box<[u8]>,
    aux: Box<[u8]>,
}

impl Default for Nvm {
    fn default() -> Self {
        let erased = |size| vec![0xff; size].into_boxed_slice();
        Nvm {
            code: Code::new(FLASH_SIZE),
            lines: [NO_LINE; CACHE_LINES],
            places: CACHE_LINES as u32 - 1,
            miss: 0,
            rwwee_busy: Cycles(0),
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
        self.miss = u64::from(wait_states) + u64::from(mode == ReadMode::LowPower);
        self.places = if mode == ReadMode::Uncached { 0 } else { CACHE_LINES as u32 - 1 };
        self.invalidate_cache();
    }

    /// Empties the cache (command INVALL).
    pub fn invalidate_cache(&mut self) {
        self.lines = [NO_LINE; CACHE_LINES];
    }

    /// Reads the line around `address` in the main array; what it costs beyond the access, in CPU cycles.
    #[inline(always)]
    pub(crate) fn fetch(&mut self, address: u32) -> u64 {
        let line = address >> LINE_SHIFT;
        let place = &mut self.lines[(line & self.places) as usize % CACHE_LINES];
        if *place == line {
            return 0;
        }
        *place = line;
        self.miss
    }

    /// As [`Nvm::fetch`], of any section: the others displace what is cached.
    pub(crate) fn fetch_any(&mut self, address: u32) -> u64 {
        let line = address >> LINE_SHIFT;
        if address as usize >= FLASH_SIZE && self.lines[(line & self.places) as usize % CACHE_LINES] != line {
            self.invalidate_cache();
        }
        self.fetch(address)
    }

    /// Reads at an aligned `address` in the main array; `None` outside.
    #[inline(always)]
    pub(crate) fn read_flash(&self, address: u32, width: Width) -> Option<u32> {
        let at = address as usize;
        match width {
            Width::Byte => self.flash.get(at).map(|byte| u32::from(*byte)),
            Width::Half => {
                let bytes = self.flash.get(at..at + 2)?;
                Some(u32::from(u16::from_le_bytes([bytes[0], bytes[1]])))
            }
            Width::Word => {
                let bytes = self.flash.get(at..at + 4)?;
                Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
            }
        }
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

    fn changed(&mut self, address: u32, length: usize) {
        self.invalidate_cache();
        self.code.forget(address, length);
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
    fn a_line_is_at_hand_after_its_miss_until_another_takes_its_place() {
        let mut nvm = Nvm::default();
        nvm.set_timing(2, ReadMode::NoMissPenalty);
        assert_eq!([0x104, 0x100, 0x107, 0x108].map(|address| nvm.fetch(address)), [2, 0, 0, 2]);
        assert_eq!([0x140, 0x100, 0x108].map(|address| nvm.fetch(address)), [2, 2, 0]);
    }

    #[test]
    fn a_read_of_another_section_displaces_every_line() {
        let mut nvm = Nvm::default();
        nvm.set_timing(2, ReadMode::NoMissPenalty);
        nvm.fetch(0x100);
        assert_eq!([RWWEE_BASE + 8, RWWEE_BASE + 8].map(|address| nvm.fetch_any(address)), [2, 0]);
        assert_eq!(nvm.fetch(0x100), 2);
    }

    #[test]
    fn without_cache_only_the_last_line_is_at_hand() {
        let mut nvm = Nvm::default();
        nvm.set_timing(2, ReadMode::Uncached);
        assert_eq!([0x100, 0x108, 0x108, 0x100].map(|address| nvm.fetch(address)), [2, 2, 0, 2]);
    }
}
