//! The 32 KiB of SRAM, shared by the CPU, the DMA controller and the CAN controllers. Code in it runs without wait
//! states.

use crate::Width;
use crate::code::Code;

/// First address.
pub const BASE: u32 = 0x2000_0000;
/// Bytes.
pub const SIZE: usize = 32 * 1024;

/// SRAM contents. Zero after power-on, though silicon promises nothing; kept over every other reset.
#[derive(Clone)]
pub struct Sram {
    bytes: Box<[u8; SIZE]>,
    pub(crate) code: Code<BASE>,
}

impl Default for Sram {
    fn default() -> Self {
        Sram { bytes: Box::new([0; SIZE]), code: Code::new(SIZE) }
    }
}

impl std::fmt::Debug for Sram {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Sram(..)")
    }
}

impl Sram {
    /// Whether `address` is in the SRAM.
    #[inline(always)]
    pub const fn contains(address: u32) -> bool {
        address.wrapping_sub(BASE) < SIZE as u32
    }

    /// Reads at `address`, which the caller has checked for range and alignment. Higher address bits are ignored.
    #[inline(always)]
    pub fn read(&self, address: u32, width: Width) -> u32 {
        match width {
            Width::Byte => u32::from(self.bytes[address as usize & (SIZE - 1)]),
            Width::Half => {
                let at = address as usize & (SIZE - 2);
                u32::from(u16::from_le_bytes([self.bytes[at], self.bytes[at + 1]]))
            }
            Width::Word => {
                let at = address as usize & (SIZE - 4);
                u32::from_le_bytes([self.bytes[at], self.bytes[at + 1], self.bytes[at + 2], self.bytes[at + 3]])
            }
        }
    }

    /// Writes at `address`, which the caller has checked for range and alignment. Higher address bits are ignored.
    #[inline(always)]
    pub fn write(&mut self, address: u32, width: Width, value: u32) {
        if self.code.is_known(address) {
            self.code.forget(address, width.bytes() as usize);
        }
        match width {
            Width::Byte => self.bytes[address as usize & (SIZE - 1)] = value as u8,
            Width::Half => {
                let at = address as usize & (SIZE - 2);
                self.bytes[at..at + 2].copy_from_slice(&(value as u16).to_le_bytes());
            }
            Width::Word => {
                let at = address as usize & (SIZE - 4);
                self.bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            }
        }
    }

    /// The contents are lost, as without power.
    pub(crate) fn lose(&mut self) {
        self.bytes.fill(0);
        self.code.forget_all();
    }

    /// All bytes.
    pub fn bytes(&self) -> &[u8; SIZE] {
        &self.bytes
    }
}
