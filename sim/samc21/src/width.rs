//! Width of a bus access.

/// Bytes moved by one access.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
#[repr(u8)]
pub enum Width {
    /// 8 bits.
    Byte = 1,
    /// 16 bits.
    Half = 2,
    /// 32 bits.
    Word = 4,
}

impl Width {
    /// Number of bytes.
    pub const fn bytes(self) -> u32 {
        self as u32
    }

    /// Mask of the bits an access carries.
    pub const fn mask(self) -> u32 {
        match self {
            Width::Byte => 0xff,
            Width::Half => 0xffff,
            Width::Word => 0xffff_ffff,
        }
    }

    /// Whether `address` is a multiple of the width.
    pub const fn aligns(self, address: u32) -> bool {
        address & (self as u32 - 1) == 0
    }
}
