//! WDT: watchdog timer (data sheet: "WDT – Watchdog Timer"). Counts its own 1.024 kHz; not cleared in time, it resets
//! the chip.
//!
//! A write to CLEAR takes effect when it has crossed into the slow clock, about 6 ms later: an expiry before that is not
//! prevented. In window mode a clear during the closed first part resets at once, as does any other value than the key.

use super::Model;
use super::registers::{Map, Register, SyncBusy, crossing};
use crate::clocks::Hertz;
use crate::context::Context;
use crate::irq::Irq;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

const CTRLA: u32 = 0x00;
const CONFIG: u32 = 0x01;
const EWCTRL: u32 = 0x02;
const INTENCLR: u32 = 0x04;
const INTENSET: u32 = 0x05;
const INTFLAG: u32 = 0x06;
const SYNCBUSY: u32 = 0x08;
const CLEAR: u32 = 0x0c;

const EW: u32 = 1 << 0;
const ENABLE: u32 = 1 << 1;
const WEN: u32 = 1 << 2;
const ALWAYSON: u32 = 1 << 7;

const MAP: Map = Map(&[
    Register::new(CTRLA, Width::Byte, ENABLE | WEN | ALWAYSON),
    Register::new(CONFIG, Width::Byte, 0xff),
    Register::new(EWCTRL, Width::Byte, 0x0f),
    Register::new(INTENCLR, Width::Byte, EW),
    Register::new(INTENSET, Width::Byte, EW),
    Register::new(INTFLAG, Width::Byte, EW),
    Register::read_only(SYNCBUSY, Width::Word),
    Register::write_only(CLEAR, Width::Byte, 0xff),
]);

const SYNC_ENABLE: u32 = 1;
const SYNC_WEN: u32 = 2;
const SYNC_ALWAYSON: u32 = 3;
const SYNC_CLEAR: u32 = 4;

/// What clears the watchdog.
const KEY: u32 = 0xa5;
/// Its clock, OSCULP32K / 32.
const CLOCK: Hertz = Hertz(1024);
/// Ticks per cycle of its clock.
const CYCLE: u64 = Cycles::HZ / 1024;
/// Largest code of PER, WINDOW and EWOFFSET.
const LONGEST: u32 = 11;

/// The watchdog.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Wdt {
    ctrla: u32,
    config: u32,
    ewctrl: u32,
    enabled: u32,
    flags: u32,
    sync: SyncBusy,
    /// Since when it has been counting; `None` while off. In the future while a write crosses.
    since: Option<Cycles>,
    /// A clear that is crossing, until when.
    clearing: Option<Cycles>,
    warned: bool,
}

impl Default for Wdt {
    fn default() -> Self {
        Wdt {
            ctrla: 0,
            config: 0xbb,
            ewctrl: 0x0b,
            enabled: 0,
            flags: 0,
            sync: SyncBusy::default(),
            since: None,
            clearing: None,
            warned: false,
        }
    }
}

/// Ticks of a period code.
const fn period(code: u32) -> u64 {
    CYCLE * (8 << if code < LONGEST { code } else { LONGEST })
}

impl Wdt {
    /// Length of the closed window, zero in normal mode.
    fn window(&self) -> u64 {
        if self.ctrla & WEN != 0 { period(self.config >> 4) } else { 0 }
    }

    fn expires(&self) -> Option<Cycles> {
        self.since.map(|since| since + self.window() + period(self.config & 0xf))
    }

    fn warns(&self) -> Option<Cycles> {
        // In window mode the warning marks the opening of the window.
        let after = if self.ctrla & WEN != 0 { self.window() } else { period(self.ewctrl) };
        self.since.filter(|_| !self.warned).map(|since| since + after)
    }

    /// What has happened up to now.
    fn catch_up(&mut self, ctx: &mut Context) {
        if self.expires().is_some_and(|at| at <= ctx.now.min(self.clearing.unwrap_or(ctx.now))) {
            self.since = None;
            self.clearing = None;
            ctx.request_reset(Reset::Watchdog);
            return;
        }
        if self.warns().is_some_and(|at| at <= ctx.now) {
            self.warned = true;
            self.flags |= EW;
        }
        if let Some(at) = self.clearing.filter(|at| *at <= ctx.now) {
            self.clearing = None;
            if self.since.is_some() {
                self.since = Some(at);
                self.warned = false;
            }
        }
        ctx.set_irq(Irq::Wdt, self.flags & self.enabled != 0);
    }

    fn set_control(&mut self, new: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_ENABLE | 1 << SYNC_WEN | 1 << SYNC_ALWAYSON, ctx) {
            return;
        }
        if self.ctrla & ALWAYSON != 0 {
            ctx.report(Kind::WriteProtected);
            return;
        }
        if self.ctrla & new & ENABLE != 0 && (self.ctrla ^ new) & WEN != 0 {
            ctx.report(Kind::EnableProtected);
            return;
        }
        let ticks = crossing(Some(CLOCK), ctx);
        for (bit, mask) in [(SYNC_ENABLE, ENABLE), (SYNC_WEN, WEN), (SYNC_ALWAYSON, ALWAYSON)] {
            if (self.ctrla ^ new) & mask != 0 {
                self.sync.start(bit, ticks, ctx.now);
            }
        }
        let was_on = self.ctrla & (ENABLE | ALWAYSON) != 0;
        self.ctrla = new;
        let is_on = new & (ENABLE | ALWAYSON) != 0;
        if is_on != was_on {
            self.since = is_on.then_some(ctx.now + ticks);
            self.warned = false;
        }
    }

    fn clear(&mut self, value: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_CLEAR, ctx) {
            return;
        }
        let Some(since) = self.since else { return };
        if value != KEY {
            ctx.report(Kind::Misuse("a watchdog is cleared by 0xa5 alone, anything else resets"));
            ctx.request_reset(Reset::Watchdog);
        } else if ctx.now < since + self.window() && self.window() != 0 {
            ctx.request_reset(Reset::Watchdog);
        } else {
            self.clearing = Some(self.sync.start(SYNC_CLEAR, crossing(Some(CLOCK), ctx), ctx.now));
        }
    }
}

impl Model for Wdt {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                CTRLA => self.ctrla,
                CONFIG => self.config,
                EWCTRL => self.ewctrl,
                INTENCLR | INTENSET => self.enabled,
                INTFLAG => self.flags,
                _ => self.sync.bits(ctx.now),
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        match part.register {
            CTRLA => self.set_control(part.onto(self.ctrla), ctx),
            CONFIG | EWCTRL if self.ctrla & (ENABLE | ALWAYSON) != 0 => ctx.report(Kind::EnableProtected),
            CONFIG if part.ones() & 0xf > LONGEST || part.ones() >> 4 > LONGEST => ctx.report(Kind::ReservedValue),
            EWCTRL if part.ones() > LONGEST => ctx.report(Kind::ReservedValue),
            CONFIG => self.config = part.onto(self.config),
            EWCTRL => self.ewctrl = part.onto(self.ewctrl),
            INTENCLR => self.enabled &= !part.ones(),
            INTENSET => self.enabled |= part.ones(),
            INTFLAG => self.flags &= !part.ones(),
            _ => self.clear(part.ones(), ctx),
        }
        self.catch_up(ctx);
    }

    fn next_event(&self) -> Option<Cycles> {
        [self.expires(), self.clearing, self.warns()].into_iter().flatten().min()
    }

    fn advance(&mut self, ctx: &mut Context) {
        self.catch_up(ctx);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn armed(config: u32, control: u32) -> (Wdt, Context) {
        let (mut wdt, mut ctx) = (Wdt::default(), Context::default());
        wdt.write(CONFIG, Width::Byte, config, &mut ctx);
        wdt.write(CTRLA, Width::Byte, control, &mut ctx);
        while wdt.read(SYNCBUSY, Width::Word, &mut ctx) != 0 {
            ctx.now += 100;
        }
        (wdt, ctx)
    }

    fn run(wdt: &mut Wdt, ctx: &mut Context, until: Cycles) {
        while let Some(at) = wdt.next_event().filter(|at| *at <= until) {
            ctx.now = ctx.now.max(at);
            wdt.advance(ctx);
        }
        ctx.now = until;
    }

    #[test]
    fn not_cleared_it_resets_after_its_period() {
        let (mut wdt, mut ctx) = armed(3, ENABLE);
        let start = wdt.since.expect("it counts");
        run(&mut wdt, &mut ctx, start + (64 * CYCLE - 1));
        assert_eq!(ctx.reset_request, None);
        run(&mut wdt, &mut ctx, start + 64 * CYCLE);
        assert_eq!(ctx.reset_request, Some(Reset::Watchdog));
    }

    #[test]
    fn cleared_every_10_ms_it_stays_quiet() {
        let (mut wdt, mut ctx) = armed(3, ENABLE);
        for _ in 0..100 {
            let until = ctx.now + Cycles::from_millis(10).0;
            run(&mut wdt, &mut ctx, until);
            wdt.write(CLEAR, Width::Byte, KEY, &mut ctx);
        }
        assert_eq!((ctx.reset_request, ctx.violations()), (None, &[][..]));
    }

    #[test]
    fn a_clear_that_comes_just_before_the_end_comes_too_late() {
        let (mut wdt, mut ctx) = armed(3, ENABLE);
        let end = wdt.expires().expect("it counts");
        run(&mut wdt, &mut ctx, Cycles(end.0 - CYCLE));
        wdt.write(CLEAR, Width::Byte, KEY, &mut ctx);
        run(&mut wdt, &mut ctx, end + CYCLE);
        assert_eq!(ctx.reset_request, Some(Reset::Watchdog));
    }

    #[test]
    fn a_wrong_key_resets_at_once() {
        let (mut wdt, mut ctx) = armed(3, ENABLE);
        wdt.write(CLEAR, Width::Byte, 0x5a, &mut ctx);
        assert_eq!(ctx.reset_request, Some(Reset::Watchdog));
    }

    #[test]
    fn clearing_again_while_the_last_clear_is_crossing_is_reported() {
        let (mut wdt, mut ctx) = armed(3, ENABLE);
        wdt.write(CLEAR, Width::Byte, KEY, &mut ctx);
        wdt.write(CLEAR, Width::Byte, KEY, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::SyncBusy);
    }

    #[test]
    fn the_early_warning_comes_before_the_reset() {
        let (mut wdt, mut ctx) = (Wdt::default(), Context::default());
        wdt.write(CONFIG, Width::Byte, 3, &mut ctx);
        wdt.write(EWCTRL, Width::Byte, 2, &mut ctx);
        wdt.write(INTENSET, Width::Byte, EW, &mut ctx);
        wdt.write(CTRLA, Width::Byte, ENABLE, &mut ctx);
        let start = wdt.since.expect("it counts");
        run(&mut wdt, &mut ctx, start + 32 * CYCLE);
        assert_eq!(wdt.read(INTFLAG, Width::Byte, &mut ctx), EW);
        assert_eq!(ctx.lines, Irq::Wdt.bit());
        assert_eq!(ctx.reset_request, None);
    }

    #[test]
    fn in_window_mode_a_clear_too_early_resets() {
        let (mut wdt, mut ctx) = armed(0x33, ENABLE | WEN);
        wdt.write(CLEAR, Width::Byte, KEY, &mut ctx);
        assert_eq!(ctx.reset_request, Some(Reset::Watchdog));
    }

    #[test]
    fn its_period_cannot_be_changed_while_it_runs() {
        let (mut wdt, mut ctx) = armed(3, ENABLE);
        wdt.write(CONFIG, Width::Byte, 11, &mut ctx);
        assert_eq!((ctx.violations()[0].kind, wdt.config), (Kind::EnableProtected, 3));
    }

    #[test]
    fn always_on_it_cannot_be_switched_off() {
        let (mut wdt, mut ctx) = armed(3, ALWAYSON);
        wdt.write(CTRLA, Width::Byte, 0, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::WriteProtected);
        assert!(wdt.expires().is_some());
    }
}
