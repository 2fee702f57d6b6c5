//! NVMCTRL: non-volatile memory controller (data sheet: "NVMCTRL – Nonvolatile Memory Controller"). Wait states, cache,
//! page buffer, erasing and programming.
//!
//! Erasing and programming the main array holds the CPU, which executes from it; the RWWEE section is worked on while
//! the program runs on, and reading that section waits until it is done. A reset or power cut before the end leaves the
//! page or row torn: bytes changed up to where the work had come, one byte half way, the rest as before. Region locks
//! are registers only.

use super::Model;
use super::registers::{Map, Register};
use crate::clocks::Hertz;
use crate::context::Context;
use crate::irq::Irq;
use crate::nvm::{AUX_BASE, FLASH_SIZE, PAGE, ROW, RWWEE_BASE, RWWEE_SIZE, ReadMode};
use crate::reset::Reset;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

const CTRLA: u32 = 0x00;
const CTRLB: u32 = 0x04;
const PARAM: u32 = 0x08;
const INTENCLR: u32 = 0x0c;
const INTENSET: u32 = 0x10;
const INTFLAG: u32 = 0x14;
const STATUS: u32 = 0x18;
const ADDR: u32 = 0x1c;
const LOCK: u32 = 0x20;

const READY: u32 = 1 << 0;
const ERROR: u32 = 1 << 1;

const MAP: Map = Map(&[
    Register::new(INTFLAG, Width::Byte, READY | ERROR),
    Register::new(STATUS, Width::Half, 0x1e),
    Register::new(CTRLA, Width::Half, 0xff7f),
    Register::new(ADDR, Width::Word, 0x003f_ffff),
    Register::new(CTRLB, Width::Word, 0x000f_039e),
    Register::read_only(PARAM, Width::Word),
    Register::new(INTENCLR, Width::Byte, READY | ERROR),
    Register::new(INTENSET, Width::Byte, READY | ERROR),
    Register::read_only(LOCK, Width::Half),
]);

const STATUS_PRM: u32 = 1 << 0;
const STATUS_LOAD: u32 = 1 << 1;
const STATUS_PROGE: u32 = 1 << 2;

const KEY: u32 = 0xa5;
const MANW: u32 = 1 << 7;

/// Fastest CPU at no, one, two wait states, Hz. The last is the facts'; the others are those of the sister family's
/// table for 3.3 V.
const FASTEST: [u32; 3] = [20_000_000, 41_000_000, 48_000_000];

/// Programming a page and erasing a row, µs (data sheet: "NVM Characteristics", tFPP and tFRE).
pub const PAGE_MICROS: u64 = 2_500;
/// See [`PAGE_MICROS`].
pub const ROW_MICROS: u64 = 6_000;
/// CPU cycles of a command that changes no memory: an assumption.
const SHORT_COMMAND: u32 = 8;

/// What is being done to the memory.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Work {
    Erase { row: u32 },
    Program { page: u32, data: [u8; PAGE as usize] },
    Nothing,
}

/// Work, and from when to when.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Task {
    work: Work,
    from: Cycles,
    until: Cycles,
}

/// The controller.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Nvmctrl {
    ctrlb: u32,
    enabled: u32,
    error: bool,
    status: u32,
    addr: u32,
    buffer: [u8; PAGE as usize],
    task: Option<Task>,
    /// Clock of the CPU when its speed was last judged.
    judged: Hertz,
}

impl Default for Nvmctrl {
    fn default() -> Self {
        Nvmctrl {
            ctrlb: MANW,
            enabled: 0,
            error: false,
            status: 0,
            addr: 0,
            buffer: [0xff; PAGE as usize],
            task: None,
            judged: Hertz(0),
        }
    }
}

impl Model for Nvmctrl {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                CTRLB => self.ctrlb,
                // Pages of the main array, 64 bytes each, pages of RWWEE.
                PARAM => (FLASH_SIZE as u32 / PAGE) | 3 << 16 | (RWWEE_SIZE as u32 / PAGE) << 20,
                INTENCLR | INTENSET => self.enabled,
                INTFLAG => self.flags(ctx.now),
                STATUS => self.status,
                ADDR => self.addr,
                LOCK => 0xffff,
                _ => 0,
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        self.finish(ctx);
        match part.register {
            // Key and command go together.
            CTRLA if width != Width::Half => ctx.report(Kind::WrongWidth),
            CTRLA => self.command(part.ones(), ctx),
            CTRLB => {
                self.ctrlb = part.onto(self.ctrlb);
                if self.ctrlb >> 16 & 3 == 3 || self.ctrlb >> 8 & 3 == 2 {
                    ctx.report(Kind::ReservedValue);
                }
                self.set_timing(ctx);
                self.check_speed(ctx);
            }
            INTENCLR => self.enabled &= !part.ones(),
            INTENSET => self.enabled |= part.ones(),
            // READY shows the state and cannot be cleared.
            INTFLAG => self.error &= part.ones() & ERROR == 0,
            STATUS => self.status &= !(part.ones() & !(STATUS_PRM | STATUS_LOAD)),
            _ => self.addr = part.onto(self.addr),
        }
        self.update(ctx);
    }

    fn next_event(&self) -> Option<Cycles> {
        self.task.map(|task| task.until)
    }

    fn advance(&mut self, ctx: &mut Context) {
        self.finish(ctx);
        self.update(ctx);
    }

    const NOTICES: bool = true;

    fn notice(&mut self, ctx: &mut Context) {
        if ctx.clocks.cpu() != self.judged {
            self.check_speed(ctx);
        }
    }

    fn reset(&mut self, _cause: Reset, ctx: &mut Context) {
        if let Some(task) = self.task.take() {
            task.tear(ctx);
        }
        *self = Nvmctrl::default();
    }
}

impl Nvmctrl {
    /// Whether an operation is in progress.
    pub fn is_busy(&self) -> bool {
        self.task.is_some()
    }

    /// A store into non-volatile memory: into the page buffer (data sheet: "NVM Write").
    pub fn store(&mut self, address: u32, width: Width, value: u32, ctx: &mut Context) {
        if width == Width::Byte {
            ctx.report(Kind::WrongWidth);
            ctx.fail_access();
            return;
        }
        if let Some(task) = self.task {
            ctx.stall(task.until.since(ctx.now));
            self.finish(ctx);
        }
        let at = (address % PAGE) as usize;
        let bytes = width.bytes() as usize;
        self.buffer[at..at + bytes].copy_from_slice(&value.to_le_bytes()[..bytes]);
        self.addr = address / 2;
        self.status |= STATUS_LOAD;
        if self.ctrlb & MANW == 0 && at + bytes == PAGE as usize {
            let command = if address >= AUX_BASE {
                0x06
            } else if address >= RWWEE_BASE {
                0x1c
            } else {
                0x04
            };
            self.execute(command, ctx);
        }
        self.update(ctx);
    }

    fn flags(&self, now: Cycles) -> u32 {
        let busy = self.task.is_some_and(|task| now < task.until);
        (if busy { 0 } else { READY }) | if self.error { ERROR } else { 0 }
    }

    fn update(&self, ctx: &mut Context) {
        ctx.set_irq(Irq::Nvmctrl, self.flags(ctx.now) & self.enabled != 0);
    }

    fn set_timing(&self, ctx: &mut Context) {
        let mode = match (self.ctrlb >> 18 & 3, self.ctrlb >> 16 & 3) {
            (0, 0) => ReadMode::NoMissPenalty,
            (0, 1) => ReadMode::LowPower,
            _ => ReadMode::Uncached,
        };
        ctx.nvm.set_timing((self.ctrlb >> 1 & 0xf) as u8, mode);
    }

    fn check_speed(&mut self, ctx: &mut Context) {
        self.judged = ctx.clocks.cpu();
        let wait_states = (self.ctrlb >> 1 & 0xf) as usize;
        if FASTEST.get(wait_states).is_some_and(|fastest| ctx.clocks.cpu().0 > *fastest) {
            ctx.report(Kind::Misuse("too few flash wait states for the CPU's clock"));
        }
    }

    fn command(&mut self, value: u32, ctx: &mut Context) {
        if value >> 8 != KEY {
            ctx.report(Kind::WriteProtected);
            self.fail();
        } else if self.task.is_some() {
            ctx.report(Kind::Misuse("a command while another is in progress"));
            self.fail();
        } else {
            self.execute(value & 0x7f, ctx);
        }
    }

    fn fail(&mut self) {
        self.status |= STATUS_PROGE;
        self.error = true;
    }

    /// Byte address of ADDR, if it lies in `[base, base + size)`.
    fn target(&mut self, base: u32, size: usize, ctx: &mut Context) -> Option<u32> {
        let address = self.addr * 2;
        let inside = address.wrapping_sub(base) < size as u32;
        if !inside {
            ctx.report(Kind::Misuse("ADDR is outside the section that the command is for"));
            self.fail();
        }
        inside.then_some(address)
    }

    fn execute(&mut self, command: u32, ctx: &mut Context) {
        let (flash, rwwee, user) = ((0, FLASH_SIZE), (RWWEE_BASE, RWWEE_SIZE), (AUX_BASE + 0x4000, ROW as usize));
        match command {
            0x02 | 0x05 | 0x1a => {
                let (base, size) = if command == 0x02 {
                    flash
                } else if command == 0x05 {
                    user
                } else {
                    rwwee
                };
                let Some(address) = self.target(base, size, ctx) else { return };
                self.start(Work::Erase { row: address & !(ROW - 1) }, ROW_MICROS, ctx);
            }
            0x04 | 0x06 | 0x1c => {
                let (base, size) = if command == 0x04 {
                    flash
                } else if command == 0x06 {
                    user
                } else {
                    rwwee
                };
                let Some(address) = self.target(base, size, ctx) else { return };
                let page = address & !(PAGE - 1);
                self.check_erased(page, ctx);
                self.start(Work::Program { page, data: self.buffer }, PAGE_MICROS, ctx);
                self.clear_buffer();
            }
            0x44 => {
                self.clear_buffer();
                self.short(ctx);
            }
            0x46 => {
                ctx.nvm.invalidate_cache();
                self.short(ctx);
            }
            0x42 | 0x43 => {
                self.status = self.status & !STATUS_PRM | u32::from(command == 0x42);
                self.short(ctx);
            }
            0x40 | 0x41 | 0x45 => self.short(ctx),
            _ => {
                ctx.report(Kind::ReservedValue);
                self.fail();
            }
        }
    }

    fn clear_buffer(&mut self) {
        self.buffer = [0xff; PAGE as usize];
        self.status &= !STATUS_LOAD;
    }

    fn short(&mut self, ctx: &mut Context) {
        let until = ctx.now + u64::from(SHORT_COMMAND * ctx.clocks.cpu_ticks);
        self.task = Some(Task { work: Work::Nothing, from: ctx.now, until });
    }

    fn start(&mut self, work: Work, micros: u64, ctx: &mut Context) {
        let until = ctx.now + Cycles::from_micros(micros).0;
        self.task = Some(Task { work, from: ctx.now, until });
        if work.address() >= RWWEE_BASE && work.address() < AUX_BASE {
            ctx.nvm.hold_rwwee(until);
        } else {
            ctx.stall(until.since(ctx.now));
        }
    }

    /// Programming can only clear bits: what must become one must be one.
    fn check_erased(&self, page: u32, ctx: &mut Context) {
        let dirty = (0..PAGE).any(|at| {
            let (new, old) = (self.buffer[at as usize], ctx.nvm.read(page + at, Width::Byte).unwrap_or(0xff) as u8);
            new != 0xff && new & !old != 0
        });
        if dirty {
            ctx.report(Kind::Misuse("a page is programmed that was not erased"));
        }
    }

    /// Ends what is due.
    fn finish(&mut self, ctx: &mut Context) {
        if let Some(task) = self.task.take_if(|task| task.until <= ctx.now) {
            match task.work {
                Work::Erase { row } => ctx.nvm.erase_row(row),
                Work::Program { page, data } => ctx.nvm.program(page, &data),
                Work::Nothing => {}
            }
        }
    }
}

impl Work {
    const fn address(&self) -> u32 {
        match self {
            Work::Erase { row } => *row,
            Work::Program { page, .. } => *page,
            Work::Nothing => 0,
        }
    }
}

impl Task {
    /// Leaves the memory as it is when the power goes now.
    fn tear(&self, ctx: &mut Context) {
        let (passed, whole) = (ctx.now.since(self.from), self.until.since(self.from).max(1));
        let reached = |length: u32| (u64::from(length) * passed / whole).min(u64::from(length) - 1) as u32;
        match self.work {
            Work::Erase { row } => {
                let reached = reached(ROW);
                let half = ctx.nvm.read(row + reached, Width::Byte).unwrap_or(0xff) as u8 | 0xa5;
                ctx.nvm.load(row, &vec![0xff; reached as usize]);
                ctx.nvm.load(row + reached, &[half]);
            }
            Work::Program { page, data } => {
                let reached = reached(PAGE) as usize;
                ctx.nvm.program(page, &data[..reached]);
                ctx.nvm.program(page + reached as u32, &[data[reached] | 0xa5]);
            }
            Work::Nothing => {}
        }
    }
}

#[cfg(test)]
mod tests;
