//! TCC: timer/counter for control (data sheet: "TCC – Timer/Counter for Control Applications"). Single-slope pulses,
//! buffered duty cycles, patterns, faults; the outputs appear in [`crate::Wires::pwm`].
//!
//! While the counter is off, its outputs let go of their pins; stopped or in a non-recoverable fault they show what
//! DRVCTRL says. A compare value written directly counts for the whole period in progress. Reported as not emulated:
//! dual slope, ramps, dithering, dead time, swapped outputs, recoverable faults. Not modelled: capture, events, DMA
//! requests.

mod outputs;
mod registers;

use super::Model;
use super::counter::Counter;
use super::registers::{SyncBusy, crossing};
use crate::clocks::Hertz;
use crate::context::Context;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

use registers::*;

/// One timer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Tcc {
    index: usize,
    ctrla: u32,
    ctrlb: u32,
    fctrl: [u32; 2],
    wexctrl: u32,
    drvctrl: u32,
    dbgctrl: u32,
    evctrl: u32,
    enabled: u32,
    flags: u32,
    /// STATUS but STOP, which is the counter's.
    status: u32,
    sync: SyncBusy,
    counter: Counter,
    copied: u32,
    command: Option<(u32, Cycles)>,
    patt: u32,
    pattbuf: u32,
    wave: u32,
    per: u32,
    perbuf: u32,
    cc: [u32; 4],
    ccbuf: [u32; 4],
    clock: Option<Hertz>,
}

impl Default for Tcc {
    fn default() -> Self {
        Tcc::new(0)
    }
}

impl Tcc {
    /// The compare value of a channel that is in force, or will be from the next period on.
    pub fn upcoming(&self, channel: usize) -> u32 {
        let buffered = self.status & STATUS_CCBUFV << channel != 0;
        if buffered { self.ccbuf[channel] } else { self.cc[channel] }
    }

    /// TCC number `index`.
    pub fn new(index: usize) -> Self {
        Tcc {
            index,
            ctrla: 0,
            ctrlb: 0,
            fctrl: [0; 2],
            wexctrl: 0,
            drvctrl: 0,
            dbgctrl: 0,
            evctrl: 0,
            enabled: 0,
            flags: 0,
            status: 0,
            sync: SyncBusy::default(),
            counter: Counter::default(),
            copied: 0,
            command: None,
            patt: 0,
            pattbuf: 0,
            wave: 0,
            per: COUNTS,
            perbuf: COUNTS,
            cc: [0; 4],
            ccbuf: [0; 4],
            clock: None,
        }
    }

    /// A debugger has halted the CPU: with DBGCTRL.FDDBD a non-recoverable fault, until STATUS.DFS is cleared.
    pub fn debugger_halted(&mut self, ctx: &mut Context) {
        if self.dbgctrl & FDDBD != 0 && self.ctrla & ENABLE != 0 {
            self.catch_up(ctx);
            self.status |= STATUS_DFS;
            self.flags |= DFS;
            self.counter.stop(ctx.now);
            self.publish(ctx);
        }
    }

    fn cross(&mut self, bit: u32, ctx: &mut Context) -> Cycles {
        if self.clock.is_none() {
            ctx.report(Kind::Unclocked);
        }
        self.sync.start(bit, crossing(self.clock, ctx), ctx.now)
    }

    fn reshape(&mut self, now: Cycles) {
        let max = INSTANCES[self.index].4;
        let top = if self.wave & 7 == MFRQ { self.cc[0] } else { self.per };
        self.counter.reshape(u64::from(top).min(max), max, self.ctrlb & DIR != 0, now);
    }

    fn prescaler(&self) -> u64 {
        PRESCALERS[(self.ctrla >> 8 & 7) as usize]
    }

    fn set_control(&mut self, new: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_ENABLE, ctx) {
            return;
        }
        if new & SWRST != 0 {
            *self = Tcc { clock: self.clock, ..Tcc::new(self.index) };
            self.cross(SYNC_SWRST, ctx);
            return;
        }
        let (old, mut new) = (self.ctrla, new);
        if old & ENABLE != 0 && (old ^ new) & !ENABLE != 0 {
            ctx.report(Kind::EnableProtected);
            new = old & !ENABLE | new & ENABLE;
        }
        if new & RESOLUTION != 0 {
            ctx.report(Kind::Misuse("dithering is not emulated"));
        }
        self.ctrla = new;
        self.reshape(ctx.now);
        if (old ^ new) & ENABLE != 0 {
            let done = self.cross(SYNC_ENABLE, ctx);
            self.counter.stop(ctx.now);
            if new & ENABLE != 0 {
                self.counter.set_clock(self.clock, self.prescaler(), ctx.now);
                if self.clock.is_some() {
                    self.counter.start(done);
                }
            }
        }
    }

    fn set_ctrlb(&mut self, new: u32, command: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_CTRLB, ctx) {
            return;
        }
        let done = self.cross(SYNC_CTRLB, ctx);
        self.ctrlb = new;
        self.reshape(ctx.now);
        if command != 0 {
            self.command = Some((command >> 5, done));
        }
    }

    fn obey(&mut self, command: u32, at: Cycles) {
        match command {
            // RETRIGGER; a fault holds the counter.
            1 if self.ctrla & ENABLE != 0 && self.clock.is_some() && !self.is_faulted() => {
                self.counter.set(self.counter.start_value(), at);
                self.counter.start(at);
            }
            // STOP
            2 => self.counter.stop(at),
            // UPDATE
            3 => self.take_buffers(at),
            // READSYNC
            4 => self.copied = self.counter.value(at) as u32,
            _ => {}
        }
    }

    fn take_buffers(&mut self, at: Cycles) {
        let valid = self.status;
        self.status &= !(STATUS_BUFFERS);
        for (n, (cc, buffer)) in self.cc.iter_mut().zip(self.ccbuf).enumerate() {
            if valid & STATUS_CCBUFV << n != 0 {
                *cc = buffer;
            }
        }
        if valid & STATUS_PERBUFV != 0 {
            self.per = self.perbuf;
        }
        if valid & STATUS_PATTBUFV != 0 {
            self.patt = self.pattbuf;
        }
        self.reshape(at);
    }

    fn has_buffers(&self) -> bool {
        self.ctrlb & LUPD == 0 && self.status & (STATUS_BUFFERS) != 0
    }

    fn is_faulted(&self) -> bool {
        self.status & (STATUS_DFS | STATUS_FAULTS) != 0
    }

    /// Everything that has happened up to now.
    fn catch_up(&mut self, ctx: &mut Context) {
        loop {
            let waits = self.has_buffers() || self.ctrlb & ONESHOT != 0;
            let overflow = self.counter.next_overflow().filter(|_| waits);
            let command = self.command.map(|(_, at)| at);
            let Some(at) = [overflow, command].into_iter().flatten().min().filter(|at| *at <= ctx.now) else { break };
            self.look(at);
            if command == Some(at) {
                if let Some((command, at)) = self.command.take() {
                    self.obey(command, at);
                }
            } else {
                if self.has_buffers() {
                    self.take_buffers(at);
                }
                if self.ctrlb & ONESHOT != 0 {
                    self.counter.stop(at);
                }
            }
            self.publish(ctx);
        }
        self.look(ctx.now);
        ctx.set_irq(INSTANCES[self.index].0, self.flags & self.enabled != 0);
    }

    fn look(&mut self, at: Cycles) {
        for (flag, pass) in self.passes() {
            if pass.is_some_and(|pass| pass <= at) {
                self.flags |= flag;
            }
        }
        self.counter.look(at);
    }

    /// When each flag is set next.
    fn passes(&self) -> [(u32, Option<Cycles>); 5] {
        let compare = |n: usize| {
            let exists = n < INSTANCES[self.index].2;
            (MC << n, self.counter.next_pass(self.cc[n].into()).filter(|_| exists))
        };
        [(OVF, self.counter.next_overflow()), compare(0), compare(1), compare(2), compare(3)]
    }
}

impl Model for Tcc {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        self.catch_up(ctx);
        MAP.read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                CTRLA => self.ctrla,
                CTRLBCLR | CTRLBSET => self.ctrlb | self.command.map_or(0, |(command, _)| command << 5),
                SYNCBUSY => self.sync.bits(ctx.now),
                FCTRL => self.fctrl[part.index],
                WEXCTRL => self.wexctrl,
                DRVCTRL => self.drvctrl,
                DBGCTRL => self.dbgctrl,
                EVCTRL => self.evctrl,
                INTENCLR | INTENSET => self.enabled,
                INTFLAG => self.flags,
                STATUS => self.status | if self.counter.is_running() { 0 } else { STATUS_STOP },
                COUNT => self.copied,
                PATT => self.patt,
                WAVE => self.wave,
                PER => self.per,
                CC => self.cc[part.index],
                PATTBUF => self.pattbuf,
                PERBUF => self.perbuf,
                _ => self.ccbuf[part.index],
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        self.catch_up(ctx);
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        if self.sync.refuses(1 << SYNC_SWRST, ctx) {
            return;
        }
        if matches!(part.register, CC | CCBUF) && part.index >= INSTANCES[self.index].2 {
            ctx.report(Kind::NoRegister);
            return;
        }
        let synchronised = match part.register {
            COUNT => Some(SYNC_COUNT),
            PATT => Some(SYNC_PATT),
            WAVE => Some(SYNC_WAVE),
            PER => Some(SYNC_PER),
            CC => Some(SYNC_CC + part.index as u32),
            _ => None,
        };
        if synchronised.is_some_and(|bit| self.sync.refuses(1 << bit, ctx)) {
            return;
        }
        let done = synchronised.map_or(ctx.now, |bit| self.cross(bit, ctx));
        let ones = part.ones();
        match part.register {
            CTRLA => self.set_control(part.onto(self.ctrla), ctx),
            CTRLBCLR => self.set_ctrlb(self.ctrlb & !(ones & !CMD), 0, ctx),
            CTRLBSET => self.set_ctrlb(self.ctrlb | ones & !CMD, ones & CMD, ctx),
            FCTRL | WEXCTRL | DRVCTRL | EVCTRL if self.ctrla & ENABLE != 0 => ctx.report(Kind::EnableProtected),
            FCTRL => self.fctrl[part.index] = part.onto(self.fctrl[part.index]),
            WEXCTRL => self.wexctrl = part.onto(self.wexctrl),
            DRVCTRL => self.drvctrl = part.onto(self.drvctrl),
            DBGCTRL => self.dbgctrl = ones,
            EVCTRL => self.evctrl = part.onto(self.evctrl),
            INTENCLR => self.enabled &= !ones,
            INTENSET => self.enabled |= ones,
            INTFLAG => self.flags &= !ones,
            STATUS => {
                let was_faulted = self.is_faulted();
                self.status &= !ones;
                if was_faulted && !self.is_faulted() && self.ctrla & ENABLE != 0 && self.clock.is_some() {
                    self.counter.start(ctx.now);
                }
            }
            COUNT => {
                self.copied = part.onto(self.copied);
                self.counter.set(self.copied.into(), done);
            }
            PATT => self.patt = part.onto(self.patt),
            WAVE if !matches!(part.onto(self.wave) & 7, NFRQ | MFRQ | NPWM) => {
                ctx.report(Kind::Misuse("this waveform is not emulated"));
            }
            WAVE => self.wave = part.onto(self.wave),
            PER => self.per = part.onto(self.per),
            CC => self.cc[part.index] = part.onto(self.cc[part.index]),
            PATTBUF => {
                self.pattbuf = part.onto(self.pattbuf);
                self.status |= STATUS_PATTBUFV;
            }
            PERBUF => {
                self.perbuf = part.onto(self.perbuf);
                self.status |= STATUS_PERBUFV;
            }
            _ => {
                self.ccbuf[part.index] = part.onto(self.ccbuf[part.index]);
                self.status |= STATUS_CCBUFV << part.index;
            }
        }
        if self.wexctrl & DTIEN != 0 || self.wave & (SWAP | RAMP) != 0 || self.fctrl.iter().any(|f| f & 3 != 0) {
            ctx.report(Kind::Misuse("dead time, swapped outputs, ramps and recoverable faults are not emulated"));
        }
        self.reshape(ctx.now);
        self.catch_up(ctx);
        if !matches!(part.register, CCBUF | INTFLAG) {
            self.publish(ctx);
        }
    }

    fn next_event(&self) -> Option<Cycles> {
        let wanted = self.enabled & !self.flags | if self.has_buffers() { OVF } else { 0 };
        let command = self.command.map(|(_, at)| at);
        if wanted == 0 {
            return command;
        }
        let passes = self.passes().into_iter().filter(|(flag, _)| wanted & flag != 0).filter_map(|(_, at)| at);
        passes.chain(command).min()
    }

    fn advance(&mut self, ctx: &mut Context) {
        self.catch_up(ctx);
    }

    const NOTICES: bool = true;

    fn notice(&mut self, ctx: &mut Context) {
        let clock = ctx.clocks.generic[INSTANCES[self.index].1];
        if clock != self.clock {
            self.catch_up(ctx);
            self.clock = clock;
            self.counter.set_clock(clock, self.prescaler(), ctx.now);
            self.publish(ctx);
        }
    }

    fn reset(&mut self, _cause: Reset, _ctx: &mut Context) {
        *self = Tcc::new(self.index);
    }
}

#[cfg(test)]
mod tests;
