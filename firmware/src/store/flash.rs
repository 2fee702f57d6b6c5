//! What the store asks of a flash memory, and nothing else.
//!
//! The geometry is that of the SAM C21's RWWEE array (data sheet, "NVMCTRL"): 8 KiB in rows of four pages. Erasing works
//! on a row and sets every bit; writing works on a page and can only clear bits. The array is separate from the one the
//! program runs from, so the chip goes on executing meanwhile: starting and finishing are two calls.

/// Bytes that are written together.
pub const PAGE: usize = 64;
/// Bytes that are erased together.
pub const ROW: usize = 256;
/// Pages in a row.
pub const PAGES: usize = ROW / PAGE;

/// The hardware refused or reported an error.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FlashFault;

/// A memory that is erased by rows and written by pages. One operation at a time; the caller never starts another, and
/// never reads, before [`Flash::idle`] said yes.
pub trait Flash {
    /// Copies the bytes from `offset` on. What lies beyond the memory reads as erased.
    fn read(&self, offset: usize, into: &mut [u8]);

    /// Begins to erase a row (on the chip: up to 6 ms).
    fn start_erase(&mut self, row: usize) -> Result<(), FlashFault>;

    /// Begins to write an erased page (on the chip: up to 2.5 ms). `page` counts from the start of the memory.
    fn start_write(&mut self, page: usize, data: &[u8; PAGE]) -> Result<(), FlashFault>;

    /// Whether the operation has ended; an error is told once.
    fn idle(&mut self) -> Result<bool, FlashFault>;
}
