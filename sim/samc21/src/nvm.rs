//! Non-volatile memory: the flash array, the RWWEE section and the auxiliary rows (data sheet: NVMCTRL, "Memory
//! organization").

use crate::Width;

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

/// Contents of all non-volatile memory. Erased bytes read 0xff.
#[derive(Clone, PartialEq, Eq)]
pub struct Nvm {
    flash: Box<[u8]>,
    rwwee: Box<[u8]>,
    aux: Box<[u8]>,
}

impl Default for Nvm {
    fn default() -> Self {
        let erased = |size| vec![0xff; size].into_boxed_slice();
        Nvm { flash: erased(FLASH_SIZE), rwwee: erased(RWWEE_SIZE), aux: erased(AUX_SIZE) }
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

    /// Replaces bytes, as a debugger's flash loader would. Bytes outside non-volatile memory are ignored.
    pub fn load(&mut self, address: u32, data: &[u8]) {
        for (address, byte) in (address..).zip(data) {
            if let Some((bytes, at)) = self.section_mut(address) {
                bytes[at] = *byte;
            }
        }
    }

    /// Programs up to a page from `address`: bits go from one to zero only.
    pub fn program(&mut self, address: u32, data: &[u8]) {
        for (address, byte) in (address..).zip(data) {
            if let Some((bytes, at)) = self.section_mut(address) {
                bytes[at] &= *byte;
            }
        }
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
