//! The read-while-write section of the flash, behind the store's trait (data sheet: "NVMCTRL").
//!
//! 8 KiB at 0x0040_0000. The program runs on from the main array while a row is erased (6 ms) or a page written (2.5 ms);
//! reading the section itself would stall the bus until then, so the store asks [`Flash::idle`] first.
//! UNVERIFIED on silicon: whether the cache holds old words of this section; it is emptied after every operation.

use arbitrary_int::u22;

use super::regs::nvmctrl::*;
use crate::store::{Flash, FlashFault, PAGE, ROW};

const BASE: usize = 0x0040_0000;
const SIZE: usize = 8 * 1024;
/// Polls for the page buffer to be cleared: a few cycles are enough.
const PATIENCE: u32 = 1_000;

/// The section. Make one.
pub struct Nvm {
    busy: bool,
}

fn nvmctrl() -> MmioNvmctrl<'static> {
    // SAFETY: the controller lies there; after start-up the one `Nvm` alone writes it.
    unsafe { Nvmctrl::new_mmio_at(NVMCTRL) }
}

impl Nvm {
    /// Pages are written by command, not by filling the buffer.
    pub fn start() -> Nvm {
        nvmctrl().modify_ctrlb(|control| control.with_manw(true));
        Nvm { busy: false }
    }

    fn command(&mut self, command: Cmd, offset: usize) -> Result<(), FlashFault> {
        let mut nvm = nvmctrl();
        if offset >= SIZE || self.busy || !nvm.read_intflag().ready() {
            return Err(FlashFault);
        }
        // Errors of the past would be taken for errors of this one.
        nvm.write_status(ERRORS);
        nvm.write_addr(Addr::ZERO.with_addr(u22::new(((BASE + offset) / 2) as u32 & 0x3f_ffff)));
        nvm.write_ctrla(CtrlA::ZERO.with_cmd(command).with_cmdex(KEY));
        Ok(())
    }
}

const ERRORS: Status = Status::ZERO.with_proge(true).with_locke(true).with_nvme(true);

impl Flash for Nvm {
    fn read(&self, offset: usize, into: &mut [u8]) {
        for (index, byte) in into.iter_mut().enumerate() {
            let at = offset + index;
            // SAFETY: inside the section, which is always readable; volatile, because it changes behind the compiler.
            *byte = if at < SIZE { unsafe { ((BASE + at) as *const u8).read_volatile() } } else { 0xff };
        }
    }

    fn start_erase(&mut self, row: usize) -> Result<(), FlashFault> {
        self.command(Cmd::Rwweeer, row.saturating_mul(ROW))?;
        self.busy = true;
        Ok(())
    }

    fn start_write(&mut self, page: usize, data: &[u8; PAGE]) -> Result<(), FlashFault> {
        let offset = page.saturating_mul(PAGE);
        self.command(Cmd::Pbc, offset)?;
        if !(0..PATIENCE).any(|_| nvmctrl().read_intflag().ready()) {
            return Err(FlashFault);
        }
        for (index, word) in data.as_chunks::<4>().0.iter().enumerate() {
            let at = BASE + offset + 4 * index;
            // SAFETY: inside the section (`command` refused anything else); this fills the page buffer, in whole words.
            unsafe { (at as *mut u32).write_volatile(u32::from_le_bytes(*word)) };
        }
        self.command(Cmd::Rwweewp, offset)?;
        self.busy = true;
        Ok(())
    }

    fn idle(&mut self) -> Result<bool, FlashFault> {
        let mut nvm = nvmctrl();
        if !nvm.read_intflag().ready() {
            return Ok(false);
        }
        if !core::mem::take(&mut self.busy) {
            return Ok(true);
        }
        let status = nvm.read_status();
        if status.proge() || status.locke() || status.nvme() {
            nvm.write_status(ERRORS);
            return Err(FlashFault);
        }
        nvm.write_ctrla(CtrlA::ZERO.with_cmd(Cmd::Invall).with_cmdex(KEY));
        // True with the next call, when that is done too.
        Ok(false)
    }
}
