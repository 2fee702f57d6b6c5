//! The stored parameters: the last two blocks of the flash, behind the store's trait (data sheet: "NVMCTRL").
//!
//! The chip erases blocks of 8 KiB and writes pages of 512 bytes; the store thinks in rows of 256 and pages of 64. Each of
//! its rows gets a block of its own and each of its pages the beginning of a page of its own:
//!
//! ```text
//!  0x000f_c000  row 0  │ page 0: 64 bytes, 448 left erased │ page 1 │ page 2 │ page 3 │ 12 pages never written
//!  0x000f_e000  row 1  │ likewise
//! ```
//!
//! So erasing one slot cannot touch the other, and every page of the chip is written once between two erasures, as its
//! error correction asks.
//!
//! The blocks lie in the second bank and the program in the first (`memory.x`): the program runs on while a block is
//! erased (up to 200 ms) or a page written (3 ms). Reading the bank meanwhile would stall the bus, so the store asks
//! [`Flash::idle`] first. The HAL's own functions wait for the end; these do not. SmartEEPROM would need fuses that a
//! newly flashed board does not have.
//!
//! A word torn by a power cut may fail the error correction, and the bus then refuses to hand it out: reads ignore bus
//! faults, the store sees whatever came and its check sum judges. UNVERIFIED on silicon: that a torn word is refused that
//! way and no other; both times; that a write to the second bank never stalls the first.

use core::arch::asm;

use atsamd_hal::nvm::{BLOCKSIZE, PAGESIZE};
use atsamd_hal::pac::nvmctrl::ctrlb::Cmdselect;
use atsamd_hal::pac::{Nvmctrl, SCB};

use crate::store::{Flash, FlashFault, PAGE, PAGES, ROW};

const FLASH: usize = 1024 * 1024;
const BLOCK: usize = BLOCKSIZE as usize;
const CHIP_PAGE: usize = PAGESIZE as usize;
const ROWS: usize = crate::store::SIZE / ROW;
const BASE: usize = FLASH - ROWS * BLOCK;
const _: () = assert!(PAGE <= CHIP_PAGE && PAGES * CHIP_PAGE <= BLOCK && BASE >= FLASH / 2);
/// Polls for the page buffer to be cleared: a few cycles are enough.
const PATIENCE: u32 = 1_000;
/// SCB.CCR: loads that fail on the bus are ignored at the priority of a fault (ARMv7-M, "Configuration and Control").
const IGNORE_BUS_FAULTS: u32 = 1 << 8;

/// The memory. Make one.
pub struct Nvm {
    nvm: Nvmctrl,
    busy: bool,
}

/// Where a store's page lies, by its number.
const fn address(page: usize) -> usize {
    BASE + page / PAGES * BLOCK + page % PAGES * CHIP_PAGE
}

const _: () = {
    assert!(address(0) == BASE && address(1) == BASE + CHIP_PAGE && address(PAGES) == BASE + BLOCK);
    assert!(address(ROWS * PAGES - 1) + CHIP_PAGE <= FLASH);
};

impl Nvm {
    /// Pages are written by command, not by filling the buffer. The line caches are off: they could hold old words of the
    /// blocks.
    pub fn start(nvm: Nvmctrl) -> Nvm {
        nvm.ctrla().modify(|_, control| control.wmode().man().cachedis0().set_bit().cachedis1().set_bit());
        Nvm { nvm, busy: false }
    }

    fn command(&mut self, command: Cmdselect, address: usize) -> Result<(), FlashFault> {
        if self.busy || self.nvm.status().read().ready().bit_is_clear() {
            return Err(FlashFault);
        }
        // Errors of the past would be taken for errors of this one. SAFETY: ones clear, any value is allowed.
        self.nvm.intflag().write(|clear| unsafe { clear.bits(u16::MAX) });
        // SAFETY: within the flash, as the callers check.
        self.nvm.addr().write(|to| unsafe { to.addr().bits(address as u32) });
        self.nvm.ctrlb().write(|control| control.cmdex().key().cmd().variant(command));
        Ok(())
    }
}

/// Runs `read` such that a load the bus refuses gives anything and does no more. Masks all interrupts meanwhile.
fn ignoring_bus_faults<T>(read: impl FnOnce() -> T) -> T {
    // SAFETY: CCR is changed by the one `Nvm` alone.
    let scb = unsafe { &*SCB::PTR };
    // SAFETY: allows ignoring faults, below, and is taken back. FAULTMASK is written in the thread or handler that runs
    // `read`; it cannot be interrupted, and `read` does nothing but load.
    unsafe {
        scb.ccr.modify(|ccr| ccr | IGNORE_BUS_FAULTS);
        asm!("cpsid f", "dsb", "isb");
    }
    let value = read();
    // SAFETY: as above.
    unsafe {
        asm!("dsb", "cpsie f", "isb");
        scb.ccr.modify(|ccr| ccr & !IGNORE_BUS_FAULTS);
    }
    value
}

impl Flash for Nvm {
    fn read(&self, offset: usize, into: &mut [u8]) {
        for (chunk, start) in into.chunks_mut(PAGE).zip((offset..).step_by(PAGE)) {
            // A page at a time: interrupts are masked for a few µs only.
            ignoring_bus_faults(|| {
                for (byte, at) in chunk.iter_mut().zip(start..) {
                    let from = address(at / PAGE) + at % PAGE;
                    // SAFETY: inside the flash; volatile, because it changes behind the compiler.
                    *byte = if at < ROWS * ROW { unsafe { (from as *const u8).read_volatile() } } else { 0xff };
                }
            });
        }
    }

    fn start_erase(&mut self, row: usize) -> Result<(), FlashFault> {
        if row >= ROWS {
            return Err(FlashFault);
        }
        self.command(Cmdselect::Eb, BASE + row * BLOCK)?;
        self.busy = true;
        Ok(())
    }

    fn start_write(&mut self, page: usize, data: &[u8; PAGE]) -> Result<(), FlashFault> {
        if page >= ROWS * PAGES {
            return Err(FlashFault);
        }
        let to = address(page);
        self.command(Cmdselect::Pbc, to)?;
        if !(0..PATIENCE).any(|_| self.nvm.status().read().ready().bit_is_set()) {
            return Err(FlashFault);
        }
        for (index, word) in data.as_chunks::<4>().0.iter().enumerate() {
            // SAFETY: inside the blocks; this fills the page buffer, in whole words and in order.
            unsafe { ((to + 4 * index) as *mut u32).write_volatile(u32::from_le_bytes(*word)) };
        }
        cortex_m::asm::dsb();
        self.command(Cmdselect::Wp, to)?;
        self.busy = true;
        Ok(())
    }

    fn idle(&mut self) -> Result<bool, FlashFault> {
        if self.nvm.status().read().ready().bit_is_clear() {
            return Ok(false);
        }
        if core::mem::take(&mut self.busy) {
            let flags = self.nvm.intflag().read();
            if flags.proge().bit() || flags.locke().bit() || flags.addre().bit() || flags.nvme().bit() {
                return Err(FlashFault);
            }
        }
        Ok(true)
    }
}
