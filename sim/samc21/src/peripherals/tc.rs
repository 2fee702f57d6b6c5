//! TC: timer/counter in its 8-, 16- and 32-bit modes (data sheet: "TC – Timer/Counter").
//!
//! COUNT reads what the last READSYNC command copied, or what was last written: the running counter itself is in another
//! clock domain. In 32-bit mode an even instance takes the odd one beside it over; both need their bus clock. Not
//! modelled: capture, events, DMA requests, outputs to pins.

mod registers;

use super::Model;
use super::counter::Counter;
use super::registers::{Map, SyncBusy, crossing};
use crate::clocks::Hertz;
use crate::context::Context;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

use registers::*;

/// One timer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Tc {
    index: usize,
    ctrla: u32,
    ctrlb: u32,
    evctrl: u32,
    enabled: u32,
    flags: u32,
    /// STATUS but STOP, which is the counter's.
    buffers_valid: u32,
    wave: u32,
    drvctrl: u32,
    dbgctrl: u32,
    sync: SyncBusy,
    counter: Counter,
    /// What COUNT reads.
    copied: u32,
    /// A command that is crossing, and when it arrives.
    command: Option<(u32, Cycles)>,
    per: u32,
    perbuf: u32,
    cc: [u32; 2],
    ccbuf: [u32; 2],
    clock: Option<Hertz>,
}

impl Default for Tc {
    fn default() -> Self {
        Tc::new(0)
    }
}

impl Tc {
    /// TC number `index`.
    pub fn new(index: usize) -> Self {
        Tc {
            index,
            ctrla: 0,
            ctrlb: 0,
            evctrl: 0,
            enabled: 0,
            flags: 0,
            buffers_valid: 0,
            wave: 0,
            drvctrl: 0,
            dbgctrl: 0,
            sync: SyncBusy::default(),
            counter: Counter::default(),
            copied: 0,
            command: None,
            per: 0xff,
            perbuf: 0xff,
            cc: [0; 2],
            ccbuf: [0; 2],
            clock: None,
        }
    }

    fn map(&self) -> &'static Map {
        match self.ctrla & MODE {
            MODE_8 => &MAP_8,
            MODE_32 => &MAP_32,
            _ => &MAP_16,
        }
    }

    /// Starts crossing into the counter's clock domain; reports if that has no clock.
    fn cross(&mut self, bit: u32, ctx: &mut Context) -> Cycles {
        if self.clock.is_none() {
            ctx.report(Kind::Unclocked);
        }
        self.sync.start(bit, crossing(self.clock, ctx), ctx.now)
    }

    /// Takes over what decides how far and which way the counter counts.
    fn reshape(&mut self, now: Cycles) {
        let max = match self.ctrla & MODE {
            MODE_8 => 0xff,
            MODE_32 => 0xffff_ffff,
            _ => 0xffff,
        };
        let top = match self.wave {
            // MFRQ and MPWM: CC0.
            1 | 3 => self.cc[0].into(),
            _ if self.ctrla & MODE == MODE_8 => self.per.into(),
            _ => max,
        };
        self.counter.reshape(top, max, self.ctrlb & DIR != 0, now);
    }

    fn prescaler(&self) -> u64 {
        PRESCALERS[(self.ctrla >> 8 & 7) as usize]
    }

    fn swrst(&mut self, ctx: &mut Context) {
        let clock = self.clock;
        *self = Tc { clock, ..Tc::new(self.index) };
        self.cross(SYNC_SWRST, ctx);
    }

    fn set_control(&mut self, new: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_ENABLE, ctx) {
            return;
        }
        if new & SWRST != 0 {
            self.swrst(ctx);
            return;
        }
        let (old, mut new) = (self.ctrla, new);
        if old & ENABLE != 0 && (old ^ new) & !ENABLE != 0 {
            ctx.report(Kind::EnableProtected);
            new = old & !ENABLE | new & ENABLE;
        }
        if new & MODE == MODE || new & MODE == MODE_32 && INSTANCES[self.index].2.is_none() {
            ctx.report(Kind::ReservedValue);
            return;
        }
        self.ctrla = new;
        self.reshape(ctx.now);
        if (old ^ new) & ENABLE == 0 {
            return;
        }
        let done = self.cross(SYNC_ENABLE, ctx);
        if new & ENABLE == 0 {
            self.counter.stop(ctx.now);
            return;
        }
        if new & MODE == MODE_32 && INSTANCES[self.index].2.is_some_and(|client| !ctx.clocks.bus_runs(client)) {
            ctx.report(Kind::Misuse("32-bit mode while the timer beside has no bus clock"));
        }
        self.counter.set_clock(self.clock, self.prescaler(), ctx.now);
        if self.clock.is_some() {
            self.counter.start(done);
        }
    }

    fn set_ctrlb(&mut self, new: u32, command: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_CTRLB, ctx) {
            return;
        }
        if command > 4 << 5 {
            ctx.report(Kind::ReservedValue);
            return;
        }
        let done = self.cross(SYNC_CTRLB, ctx);
        self.ctrlb = new;
        self.reshape(ctx.now);
        if command != 0 {
            self.command = Some((command >> 5, done));
        }
    }

    /// What a command does when it arrives.
    fn obey(&mut self, command: u32, at: Cycles) {
        match command {
            // RETRIGGER
            1 if self.ctrla & ENABLE != 0 && self.clock.is_some() => {
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

    /// CC and PER take over what their buffers hold.
    fn take_buffers(&mut self, at: Cycles) {
        let valid = std::mem::take(&mut self.buffers_valid);
        for (n, (cc, buffer)) in self.cc.iter_mut().zip(self.ccbuf).enumerate() {
            if valid & STATUS_CCBUFV << n != 0 {
                *cc = buffer;
            }
        }
        if valid & STATUS_PERBUFV != 0 {
            self.per = self.perbuf;
        }
        self.reshape(at);
    }

    /// Whether buffers are taken over at the next overflow.
    fn awaits_overflow(&self) -> bool {
        self.ctrlb & ONESHOT != 0 || self.buffers_valid != 0 && self.ctrlb & LUPD == 0
    }

    /// Everything that has happened up to now.
    fn catch_up(&mut self, ctx: &mut Context) {
        loop {
            let overflow = self.counter.next_overflow().filter(|_| self.awaits_overflow());
            let command = self.command.map(|(_, at)| at);
            match [overflow, command].into_iter().flatten().min().filter(|at| *at <= ctx.now) {
                None => break,
                Some(at) if command == Some(at) => {
                    self.look(at);
                    if let Some((command, at)) = self.command.take() {
                        self.obey(command, at);
                    }
                }
                Some(at) => {
                    self.look(at);
                    if self.ctrlb & LUPD == 0 {
                        self.take_buffers(at);
                    }
                    if self.ctrlb & ONESHOT != 0 {
                        self.counter.stop(at);
                    }
                }
            }
        }
        self.look(ctx.now);
        ctx.set_irq(INSTANCES[self.index].0, self.flags & self.enabled != 0);
    }

    /// Sets the flags of everything the counter passed up to `at`.
    fn look(&mut self, at: Cycles) {
        for (flag, pass) in self.passes() {
            if pass.is_some_and(|pass| pass <= at) {
                self.flags |= flag;
            }
        }
        self.counter.look(at);
    }

    /// When each flag is set next.
    fn passes(&self) -> [(u32, Option<Cycles>); 3] {
        [
            (OVF, self.counter.next_overflow()),
            (MC, self.counter.next_pass(self.cc[0].into())),
            (MC << 1, self.counter.next_pass(self.cc[1].into())),
        ]
    }

    fn status(&self) -> u32 {
        self.buffers_valid | if self.counter.is_running() { 0 } else { STATUS_STOP }
    }
}

impl Model for Tc {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        self.catch_up(ctx);
        self.map().read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                CTRLA => self.ctrla,
                CTRLBCLR | CTRLBSET => self.ctrlb | self.command.map_or(0, |(command, _)| command << 5),
                EVCTRL => self.evctrl,
                INTENCLR | INTENSET => self.enabled,
                INTFLAG => self.flags,
                STATUS => self.status(),
                WAVE => self.wave,
                DRVCTRL => self.drvctrl,
                DBGCTRL => self.dbgctrl,
                SYNCBUSY => self.sync.bits(ctx.now),
                COUNT => self.copied,
                PER => self.per,
                CC => self.cc[part.index],
                PERBUF => self.perbuf,
                _ => self.ccbuf[part.index],
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        self.catch_up(ctx);
        let Some(part) = self.map().write(offset, width, value, ctx) else { return };
        if self.sync.refuses(1 << SYNC_SWRST, ctx) {
            return;
        }
        let (ones, is_on) = (part.ones(), self.ctrla & ENABLE != 0);
        match part.register {
            CTRLA => self.set_control(part.onto(self.ctrla), ctx),
            CTRLBCLR => self.set_ctrlb(self.ctrlb & !(ones & !CMD), 0, ctx),
            CTRLBSET => self.set_ctrlb(self.ctrlb | ones & !CMD, ones & CMD, ctx),
            EVCTRL | WAVE | DRVCTRL if is_on => ctx.report(Kind::EnableProtected),
            EVCTRL => self.evctrl = part.onto(self.evctrl),
            WAVE => {
                self.wave = ones;
                self.reshape(ctx.now);
            }
            DRVCTRL => self.drvctrl = ones,
            DBGCTRL => self.dbgctrl = ones,
            INTENCLR => self.enabled &= !ones,
            INTENSET => self.enabled |= ones,
            INTFLAG => self.flags &= !ones,
            STATUS => self.buffers_valid &= !ones,
            COUNT => {
                if !self.sync.refuses(1 << SYNC_COUNT, ctx) {
                    let done = self.cross(SYNC_COUNT, ctx);
                    self.copied = part.onto(self.copied);
                    self.counter.set(self.copied.into(), done);
                }
            }
            PER => {
                if !self.sync.refuses(1 << SYNC_PER, ctx) {
                    self.cross(SYNC_PER, ctx);
                    self.per = ones;
                    self.reshape(ctx.now);
                }
            }
            CC => {
                let bit = SYNC_CC + part.index as u32;
                if !self.sync.refuses(1 << bit, ctx) {
                    self.cross(bit, ctx);
                    self.cc[part.index] = part.onto(self.cc[part.index]);
                    self.reshape(ctx.now);
                }
            }
            PERBUF => {
                self.perbuf = ones;
                self.buffers_valid |= STATUS_PERBUFV;
            }
            _ => {
                self.ccbuf[part.index] = part.onto(self.ccbuf[part.index]);
                self.buffers_valid |= STATUS_CCBUFV << part.index;
            }
        }
        self.catch_up(ctx);
    }

    /// Flags that nobody has asked for wait until somebody looks.
    fn next_event(&self) -> Option<Cycles> {
        let wanted = self.enabled & !self.flags;
        if wanted == 0 {
            return None;
        }
        self.passes().into_iter().filter(|(flag, _)| wanted & flag != 0).filter_map(|(_, at)| at).min()
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
        }
    }

    fn reset(&mut self, _cause: Reset, _ctx: &mut Context) {
        *self = Tc::new(self.index);
    }
}

#[cfg(test)]
mod tests;
