//! OSCCTRL: OSC48M and the phase-locked loop DPLL96M (data sheet: "OSCCTRL – Oscillators Controller").
//!
//! Loop output = reference · (LDR + 1 + LDRFRAC / 16) / 2^PRESC. Lock takes [`LOCK_MICROS`] and the reference must lie
//! within 32 kHz to 2 MHz, the output within 48 to 96 MHz. XOSC is registers only: the board has no such crystal.

use super::Model;
use super::registers::{Map, Register, SyncBusy, crossing, ticks};
use crate::clocks::{Hertz, Source};
use crate::context::Context;
use crate::time::Cycles;
use crate::unit::Unit;
use crate::violation::Kind;
use crate::width::Width;

const INTENCLR: u32 = 0x00;
const INTENSET: u32 = 0x04;
const INTFLAG: u32 = 0x08;
const STATUS: u32 = 0x0c;
const XOSCCTRL: u32 = 0x10;
const CFDPRESC: u32 = 0x12;
const EVCTRL: u32 = 0x13;
const OSC48MCTRL: u32 = 0x14;
const OSC48MDIV: u32 = 0x15;
const OSC48MSTUP: u32 = 0x16;
const OSC48MSYNCBUSY: u32 = 0x18;
const DPLLCTRLA: u32 = 0x1c;
const DPLLRATIO: u32 = 0x20;
const DPLLCTRLB: u32 = 0x24;
const DPLLPRESC: u32 = 0x28;
const DPLLSYNCBUSY: u32 = 0x2c;
const DPLLSTATUS: u32 = 0x30;
const CAL48M: u32 = 0x38;

const INTERRUPTS: u32 = 0x0f13;

const MAP: Map = Map(&[
    Register::new(INTENCLR, Width::Word, INTERRUPTS),
    Register::new(INTENSET, Width::Word, INTERRUPTS),
    Register::new(INTFLAG, Width::Word, INTERRUPTS),
    Register::read_only(STATUS, Width::Word),
    Register::new(XOSCCTRL, Width::Half, 0xffde),
    Register::new(CFDPRESC, Width::Byte, 0x7),
    Register::new(EVCTRL, Width::Byte, 0x1),
    Register::new(OSC48MCTRL, Width::Byte, 0xc2),
    Register::new(OSC48MDIV, Width::Byte, 0xf),
    Register::new(OSC48MSTUP, Width::Byte, 0x7),
    Register::read_only(OSC48MSYNCBUSY, Width::Word),
    Register::new(DPLLCTRLA, Width::Byte, 0xc2),
    Register::new(DPLLRATIO, Width::Word, 0x000f_0fff),
    Register::new(DPLLCTRLB, Width::Word, 0x07ff_173f),
    Register::new(DPLLPRESC, Width::Byte, 0x3),
    Register::read_only(DPLLSYNCBUSY, Width::Byte),
    Register::read_only(DPLLSTATUS, Width::Byte),
    Register::new(CAL48M, Width::Word, 0x003f_033f),
]);

const OSC48MRDY: u32 = 1 << 4;
const DPLLLCKR: u32 = 1 << 8;
const DPLLLCKF: u32 = 1 << 9;
const ENABLE: u32 = 1 << 1;
const ONDEMAND: u32 = 1 << 7;
const LBYPASS: u32 = 1 << 12;
const LTIME: u32 = 7 << 8;

/// Bits of DPLLSYNCBUSY, and of OSC48MSYNCBUSY.
const SYNC_ENABLE: u32 = 1;
const SYNC_RATIO: u32 = 2;
const SYNC_PRESC: u32 = 3;
const SYNC_OSC48MDIV: u32 = 2;

/// Generic clock channels of the loop: its reference, and the 32 kHz of its lock timer.
const CHANNEL_REFERENCE: usize = 0;
const CHANNEL_LOCK_TIMER: usize = 1;

/// Time from a running reference to lock, µs: an assumption, about what the data sheets of this family give for a
/// 32 kHz reference; they give a fraction of it for a fast one.
pub const LOCK_MICROS: u64 = 1300;

/// The oscillators' registers and how far they have come.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Oscctrl {
    enabled: u32,
    flags: u32,
    xoscctrl: u32,
    cfdpresc: u32,
    evctrl: u32,
    osc48mctrl: u32,
    osc48mdiv: u32,
    osc48mstup: u32,
    osc48m_sync: SyncBusy,
    dpllctrla: u32,
    dpllratio: u32,
    dpllctrlb: u32,
    dpllpresc: u32,
    dpll_sync: SyncBusy,
    cal48m: u32,
    /// When the loop will lock, or has locked.
    locks_at: Option<Cycles>,
    locked: bool,
}

impl Default for Oscctrl {
    fn default() -> Self {
        Oscctrl {
            enabled: 0,
            flags: OSC48MRDY,
            xoscctrl: ONDEMAND,
            cfdpresc: 0,
            evctrl: 0,
            osc48mctrl: ONDEMAND | ENABLE,
            osc48mdiv: 11,
            osc48mstup: 7,
            osc48m_sync: SyncBusy::default(),
            dpllctrla: ONDEMAND,
            dpllratio: 0,
            dpllctrlb: 0,
            dpllpresc: 0,
            dpll_sync: SyncBusy::default(),
            cal48m: 0,
            locks_at: None,
            locked: false,
        }
    }
}

impl Model for Oscctrl {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                INTENCLR | INTENSET => self.enabled,
                INTFLAG => self.flags,
                STATUS => {
                    let osc48m = if self.osc48m_runs(ctx) { OSC48MRDY } else { 0 };
                    osc48m | if self.locked { DPLLLCKR } else { 0 }
                }
                XOSCCTRL => self.xoscctrl,
                CFDPRESC => self.cfdpresc,
                EVCTRL => self.evctrl,
                OSC48MCTRL => self.osc48mctrl,
                OSC48MDIV => self.osc48mdiv,
                OSC48MSTUP => self.osc48mstup,
                OSC48MSYNCBUSY => self.osc48m_sync.bits(ctx.now),
                DPLLCTRLA => self.dpllctrla,
                DPLLRATIO => self.dpllratio,
                DPLLCTRLB => self.dpllctrlb,
                DPLLPRESC => self.dpllpresc,
                DPLLSYNCBUSY => self.dpll_sync.bits(ctx.now),
                DPLLSTATUS => {
                    let clock = self.output(ctx).is_some() && (self.locked || self.dpllctrlb & LBYPASS != 0);
                    u32::from(self.locked) | u32::from(clock) << 1
                }
                _ => self.cal48m,
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        match part.register {
            INTENCLR => self.enabled &= !part.ones(),
            INTENSET => self.enabled |= part.ones(),
            INTFLAG => self.flags &= !part.ones(),
            XOSCCTRL => self.xoscctrl = part.onto(self.xoscctrl),
            CFDPRESC => self.cfdpresc = part.onto(self.cfdpresc),
            EVCTRL => self.evctrl = part.onto(self.evctrl),
            OSC48MCTRL => self.osc48mctrl = part.onto(self.osc48mctrl),
            OSC48MDIV => {
                if self.osc48m_sync.refuses(1 << SYNC_OSC48MDIV, ctx) {
                    return;
                }
                self.osc48mdiv = part.onto(self.osc48mdiv);
                let ticks = crossing(ctx.clocks.source(Source::Osc48m), ctx);
                self.osc48m_sync.start(SYNC_OSC48MDIV, ticks, ctx.now);
            }
            OSC48MSTUP => self.osc48mstup = part.onto(self.osc48mstup),
            DPLLCTRLA => self.synchronised(SYNC_ENABLE, ctx, |osc| osc.dpllctrla = part.onto(osc.dpllctrla)),
            DPLLRATIO => self.synchronised(SYNC_RATIO, ctx, |osc| osc.dpllratio = part.onto(osc.dpllratio)),
            DPLLPRESC => self.synchronised(SYNC_PRESC, ctx, |osc| osc.dpllpresc = part.onto(osc.dpllpresc)),
            DPLLCTRLB if self.dpllctrla & ENABLE != 0 => ctx.report(Kind::EnableProtected),
            DPLLCTRLB if part.onto(self.dpllctrlb) >> 4 & 3 == 3 => ctx.report(Kind::ReservedValue),
            DPLLCTRLB => self.dpllctrlb = part.onto(self.dpllctrlb),
            _ => self.cal48m = part.onto(self.cal48m),
        }
        self.update(ctx);
    }

    fn next_event(&self) -> Option<Cycles> {
        if self.locked { None } else { self.locks_at }
    }

    fn advance(&mut self, ctx: &mut Context) {
        self.update(ctx);
    }

    const NOTICES: bool = true;

    fn notice(&mut self, ctx: &mut Context) {
        self.update(ctx);
    }
}

impl Oscctrl {
    /// A write to the loop that must cross into its clock domain, at the speed of its reference.
    fn synchronised(&mut self, bit: u32, ctx: &mut Context, write: impl FnOnce(&mut Self)) {
        if self.dpll_sync.refuses(1 << bit, ctx) {
            return;
        }
        let was_on = self.dpllctrla & ENABLE != 0;
        write(self);
        let is_on = self.dpllctrla & ENABLE != 0;
        if is_on && !was_on {
            self.check(ctx);
        }
        // A loop that is off, and stays off, has no clock domain to cross into.
        let reference = self.reference(ctx);
        let ticks = match was_on || is_on {
            true if reference.is_some() => ticks(2, reference),
            _ => u64::from(3 * ctx.clocks.cpu_ticks),
        };
        self.dpll_sync.start(bit, ticks, ctx.now);
    }

    fn check(&self, ctx: &mut Context) {
        if self.dpllctrlb & LTIME != 0 && ctx.clocks.generic[CHANNEL_LOCK_TIMER].is_none() {
            ctx.report(Kind::Misuse("the loop's lock timer has no 32 kHz clock"));
        }
        let reference = self.reference(ctx);
        if reference.is_some_and(|hertz| !(32_000..=2_000_000).contains(&hertz.0)) {
            ctx.report(Kind::Misuse("the loop's reference is not within 32 kHz to 2 MHz"));
        }
        let output = self.loop_hertz(ctx);
        if output.is_some_and(|hertz| !(48_000_000..=96_000_000).contains(&hertz)) {
            ctx.report(Kind::Misuse("the loop's output is not within 48 to 96 MHz"));
        }
    }

    fn reference(&self, ctx: &Context) -> Option<Hertz> {
        match self.dpllctrlb >> 4 & 3 {
            0 => ctx.clocks.source(Source::Xosc32k),
            1 => {
                let divider = 2 * ((self.dpllctrlb >> 16 & 0x7ff) + 1);
                ctx.clocks.source(Source::Xosc).map(|xosc| Hertz(xosc.0 / divider))
            }
            _ => ctx.clocks.generic[CHANNEL_REFERENCE],
        }
    }

    /// The loop's frequency before its prescaler.
    fn loop_hertz(&self, ctx: &Context) -> Option<u64> {
        let sixteenths = u64::from((self.dpllratio & 0xfff) + 1) * 16 + u64::from(self.dpllratio >> 16 & 0xf);
        self.reference(ctx).map(|reference| u64::from(reference.0) * sixteenths / 16)
    }

    fn output(&self, ctx: &Context) -> Option<Hertz> {
        let on =
            self.dpllctrla & ENABLE != 0 && (self.dpllctrla & ONDEMAND == 0 || ctx.clocks.is_wanted(Source::Dpll96m));
        self.loop_hertz(ctx).filter(|_| on).map(|hertz| Hertz((hertz >> self.dpllpresc.min(2)) as u32))
    }

    fn osc48m_runs(&self, ctx: &Context) -> bool {
        self.osc48mctrl & ENABLE != 0 && (self.osc48mctrl & ONDEMAND == 0 || ctx.clocks.is_wanted(Source::Osc48m))
    }

    /// Recomputes both clocks; starts, finishes or loses the lock.
    fn update(&mut self, ctx: &mut Context) {
        let output = self.output(ctx);
        match (output, self.locks_at) {
            (None, _) => {
                if std::mem::take(&mut self.locked) {
                    self.flags |= DPLLLCKF;
                }
                self.locks_at = None;
            }
            (Some(_), None) => self.locks_at = Some(ctx.now + Cycles::from_micros(LOCK_MICROS).0),
            (Some(_), Some(at)) if at <= ctx.now && !self.locked => {
                self.locked = true;
                self.flags |= DPLLLCKR;
            }
            _ => {}
        }
        let mut clocks = ctx.clocks.clone();
        clocks.sources[Source::Dpll96m as usize] = output.filter(|_| self.locked || self.dpllctrlb & LBYPASS != 0);
        let osc48m = Hertz(48_000_000 / (self.osc48mdiv + 1));
        clocks.sources[Source::Osc48m as usize] = self.osc48m_runs(ctx).then_some(osc48m);
        let reference = [Source::Xosc32k, Source::Xosc].get((self.dpllctrlb >> 4 & 3) as usize).copied();
        clocks.wanted_by_dpll = match reference {
            Some(source) if self.dpllctrla & ENABLE != 0 => 1 << source as u8,
            _ => 0,
        };
        if clocks != ctx.clocks {
            ctx.clocks = clocks;
            ctx.wires.changed = true;
        }
        ctx.set_system_irq(Unit::Oscctrl, self.flags & self.enabled != 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_crystal() -> (Oscctrl, Context) {
        let mut ctx = Context::default();
        ctx.clocks.sources[Source::Xosc32k as usize] = Some(Hertz(32_768));
        (Oscctrl::default(), ctx)
    }

    /// × 2929 11/16: 96 MHz exactly.
    const RATIO: u32 = 2928 | 11 << 16;

    fn settle(osc: &mut Oscctrl, ctx: &mut Context) {
        while osc.read(DPLLSYNCBUSY, Width::Byte, ctx) != 0 {
            ctx.now += 10;
        }
    }

    fn start(osc: &mut Oscctrl, ctx: &mut Context, ratio: u32, control: u32) {
        osc.write(DPLLRATIO, Width::Word, ratio, ctx);
        settle(osc, ctx);
        osc.write(DPLLCTRLB, Width::Word, control, ctx);
        osc.write(DPLLCTRLA, Width::Byte, ENABLE, ctx);
        settle(osc, ctx);
    }

    #[test]
    fn osc48m_runs_at_4_mhz_after_reset_and_at_48_undivided() {
        let (mut osc, mut ctx) = with_crystal();
        osc.notice(&mut ctx);
        assert_eq!(ctx.clocks.source(Source::Osc48m), Some(Hertz(4_000_000)));
        osc.write(OSC48MDIV, Width::Byte, 0, &mut ctx);
        assert_eq!(ctx.clocks.source(Source::Osc48m), Some(Hertz(48_000_000)));
        osc.write(OSC48MDIV, Width::Byte, 3, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::SyncBusy);
    }

    #[test]
    fn the_loop_makes_96_mhz_of_the_crystal_once_it_has_locked() {
        let (mut osc, mut ctx) = with_crystal();
        start(&mut osc, &mut ctx, RATIO, 0);
        assert_eq!(osc.read(DPLLSTATUS, Width::Byte, &mut ctx), 0);
        assert_eq!(ctx.clocks.source(Source::Dpll96m), None);
        ctx.now = osc.next_event().expect("it will lock");
        osc.advance(&mut ctx);
        assert_eq!(osc.read(DPLLSTATUS, Width::Byte, &mut ctx), 3);
        assert_eq!(ctx.clocks.source(Source::Dpll96m), Some(Hertz(96_000_000)));
        assert_eq!((osc.next_event(), ctx.violations()), (None, &[][..]));
    }

    #[test]
    fn with_the_lock_bypassed_the_clock_is_there_before_the_lock() {
        let (mut osc, mut ctx) = with_crystal();
        start(&mut osc, &mut ctx, RATIO, LBYPASS);
        assert_eq!(osc.read(DPLLSTATUS, Width::Byte, &mut ctx), 2);
        assert_eq!(ctx.clocks.source(Source::Dpll96m), Some(Hertz(96_000_000)));
    }

    #[test]
    fn without_its_reference_the_loop_never_locks_and_loses_a_lock_it_had() {
        let (mut osc, mut ctx) = with_crystal();
        start(&mut osc, &mut ctx, RATIO, 0);
        ctx.now = osc.next_event().expect("it will lock");
        osc.advance(&mut ctx);
        ctx.clocks.sources[Source::Xosc32k as usize] = None;
        osc.notice(&mut ctx);
        assert_eq!((osc.read(DPLLSTATUS, Width::Byte, &mut ctx), osc.next_event()), (0, None));
        assert_eq!(osc.read(INTFLAG, Width::Word, &mut ctx) & DPLLLCKF, DPLLLCKF);
    }

    #[test]
    fn an_output_out_of_range_is_reported() {
        let (mut osc, mut ctx) = with_crystal();
        start(&mut osc, &mut ctx, 999, 0);
        assert!(matches!(ctx.violations()[0].kind, Kind::Misuse(_)));
    }

    #[test]
    fn the_reference_cannot_be_changed_while_the_loop_runs() {
        let (mut osc, mut ctx) = with_crystal();
        start(&mut osc, &mut ctx, RATIO, 0);
        osc.write(DPLLCTRLB, Width::Word, 1 << 4, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::EnableProtected);
    }
}
