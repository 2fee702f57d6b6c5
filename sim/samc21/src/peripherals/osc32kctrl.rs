//! OSC32KCTRL: 32 kHz oscillators (data sheet: "OSC32KCTRL – 32KHz Oscillators Controller").
//!
//! The watch crystal is ready after the cycles of XOSC32K.STARTUP and three more. It starts unless
//! [`crate::Wires::crystal_fails`]; the clock failure detector is registers only. OSCULP32K always runs.

use super::Model;
use super::registers::{Map, Register, ticks};
use crate::clocks::{Hertz, Source};
use crate::context::Context;
use crate::reset::Reset;
use crate::time::Cycles;
use crate::unit::Unit;
use crate::violation::Kind;
use crate::width::Width;

const INTENCLR: u32 = 0x00;
const INTENSET: u32 = 0x04;
const INTFLAG: u32 = 0x08;
const STATUS: u32 = 0x0c;
const RTCCTRL: u32 = 0x10;
const XOSC32K: u32 = 0x14;
const CFDCTRL: u32 = 0x16;
const EVCTRL: u32 = 0x17;
const OSC32K: u32 = 0x18;
const OSCULP32K: u32 = 0x1c;

const INTERRUPTS: u32 = 0b111;

const MAP: Map = Map(&[
    Register::new(INTENCLR, Width::Word, INTERRUPTS),
    Register::new(INTENSET, Width::Word, INTERRUPTS),
    Register::new(INTFLAG, Width::Word, INTERRUPTS),
    Register::read_only(STATUS, Width::Word),
    Register::new(RTCCTRL, Width::Word, 0x7),
    Register::new(XOSC32K, Width::Half, 0x17de),
    Register::new(CFDCTRL, Width::Byte, 0x7),
    Register::new(EVCTRL, Width::Byte, 0x1),
    Register::new(OSC32K, Width::Word, 0x007f_17ce),
    Register::new(OSCULP32K, Width::Word, 0x9f00),
]);

const XOSC32KRDY: u32 = 1 << 0;
const OSC32KRDY: u32 = 1 << 1;
/// ENABLE and ONDEMAND of either oscillator.
const ENABLE: u32 = 1 << 1;
const ONDEMAND: u32 = 1 << 7;
const WRTLOCK: u32 = 1 << 12;
const XTALEN: u32 = 1 << 2;
const XOSC32K_EN32K: u32 = 1 << 3;
const OSC32K_EN32K: u32 = 1 << 2;
/// XOSC32K.STARTUP in cycles.
const STARTUP: [u64; 8] = [1, 32, 2048, 4096, 16384, 32768, 65536, 131_072];

/// All of them, nominally.
const HERTZ: Hertz = Hertz(32_768);

/// The oscillators' registers and how far they have come.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Osc32kctrl {
    enabled: u32,
    flags: u32,
    rtcctrl: u32,
    xosc32k: u32,
    cfdctrl: u32,
    evctrl: u32,
    osc32k: u32,
    osculp32k: u32,
    status: u32,
    /// When XOSC32K and OSC32K will be ready, while they start.
    ready: [Option<Cycles>; 2],
}

impl Default for Osc32kctrl {
    fn default() -> Self {
        Osc32kctrl {
            enabled: 0,
            flags: 0,
            rtcctrl: 0,
            xosc32k: ONDEMAND,
            cfdctrl: 0,
            evctrl: 0,
            osc32k: 0x003f_0080,
            osculp32k: 0,
            status: 0,
            ready: [None; 2],
        }
    }
}

impl Model for Osc32kctrl {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                INTENCLR | INTENSET => self.enabled,
                INTFLAG => self.flags,
                STATUS => self.status,
                RTCCTRL => self.rtcctrl,
                XOSC32K => self.xosc32k,
                CFDCTRL => self.cfdctrl,
                EVCTRL => self.evctrl,
                OSC32K => self.osc32k,
                _ => self.osculp32k,
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        match part.register {
            INTENCLR => self.enabled &= !part.ones(),
            INTENSET => self.enabled |= part.ones(),
            INTFLAG => self.flags &= !part.ones(),
            RTCCTRL => self.rtcctrl = part.onto(self.rtcctrl),
            XOSC32K if self.xosc32k & WRTLOCK != 0 => ctx.report(Kind::WriteProtected),
            OSC32K if self.osc32k & WRTLOCK != 0 => ctx.report(Kind::WriteProtected),
            XOSC32K => {
                let new = part.onto(self.xosc32k);
                if self.xosc32k & new & ENABLE != 0 && (self.xosc32k ^ new) & 0x071c != 0 {
                    ctx.report(Kind::Misuse("XOSC32K is changed while it runs"));
                }
                self.xosc32k = new;
            }
            CFDCTRL => self.cfdctrl = part.onto(self.cfdctrl),
            EVCTRL => self.evctrl = part.onto(self.evctrl),
            OSC32K => self.osc32k = part.onto(self.osc32k),
            _ => self.osculp32k = part.onto(self.osculp32k),
        }
        self.update(ctx);
    }

    fn next_event(&self) -> Option<Cycles> {
        self.ready.iter().flatten().min().copied()
    }

    fn advance(&mut self, ctx: &mut Context) {
        self.update(ctx);
    }

    const NOTICES: bool = true;

    fn notice(&mut self, ctx: &mut Context) {
        self.update(ctx);
    }

    /// The oscillators outlast every reset but those of the supply.
    fn reset(&mut self, cause: Reset, ctx: &mut Context) {
        if cause.is_of_supply() {
            *self = Osc32kctrl::default();
        }
        self.publish(ctx);
    }
}

impl Osc32kctrl {
    /// Starts and stops oscillators as their registers and those who ask for them say.
    fn update(&mut self, ctx: &mut Context) {
        let clocks = &ctx.clocks;
        let runs =
            |control: u32, source| control & ENABLE != 0 && (control & ONDEMAND == 0 || clocks.is_wanted(source));
        let crystal = runs(self.xosc32k, Source::Xosc32k) && !(ctx.wires.crystal_fails && self.xosc32k & XTALEN != 0);
        let internal = runs(self.osc32k, Source::Osc32k);
        let startup = STARTUP[(self.xosc32k >> 8 & 7) as usize];
        // OSC32K.STARTUP is three cycles and up; the shortest is taken for all.
        for (index, (runs, cycles)) in [(crystal, startup + 3), (internal, 3)].into_iter().enumerate() {
            let (status, ready) = (&mut self.status, &mut self.ready[index]);
            let bit = XOSC32KRDY << index;
            if !runs {
                *status &= !bit;
                *ready = None;
            } else if *status & bit == 0 {
                let at = *ready.get_or_insert(ctx.now + ticks(cycles, Some(HERTZ)));
                if at <= ctx.now {
                    *status |= bit;
                    self.flags |= bit;
                    *ready = None;
                }
            }
        }
        self.publish(ctx);
    }

    fn publish(&self, ctx: &mut Context) {
        let output = |ready, wanted: bool| (self.status & ready != 0 && wanted).then_some(HERTZ);
        let before = ctx.clocks.sources;
        ctx.clocks.sources[Source::Xosc32k as usize] = output(XOSC32KRDY, self.xosc32k & XOSC32K_EN32K != 0);
        ctx.clocks.sources[Source::Osc32k as usize] = output(OSC32KRDY, self.osc32k & OSC32K_EN32K != 0);
        ctx.wires.changed |= ctx.clocks.sources != before;
        ctx.set_system_irq(Unit::Osc32kctrl, self.flags & self.enabled != 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Crystal, 32 kHz output, 16384 cycles of start-up.
    const CRYSTAL: u32 = 4 << 8 | XTALEN | XOSC32K_EN32K;

    fn started(control: u32) -> (Osc32kctrl, Context) {
        let (mut osc, mut ctx) = (Osc32kctrl::default(), Context::default());
        osc.write(XOSC32K, Width::Half, control, &mut ctx);
        osc.write(XOSC32K, Width::Half, control | ENABLE, &mut ctx);
        (osc, ctx)
    }

    fn wait(osc: &mut Osc32kctrl, ctx: &mut Context) {
        ctx.now = osc.next_event().expect("it starts");
        osc.advance(ctx);
    }

    #[test]
    fn the_crystal_is_ready_after_its_start_up_time() {
        let (mut osc, mut ctx) = started(CRYSTAL);
        assert_eq!(osc.read(STATUS, Width::Word, &mut ctx), 0);
        wait(&mut osc, &mut ctx);
        assert!((0.5..0.501).contains(&ctx.now.as_secs_f64()));
        assert_eq!(osc.read(STATUS, Width::Word, &mut ctx), XOSC32KRDY);
        assert_eq!(ctx.clocks.source(Source::Xosc32k), Some(HERTZ));
        assert_eq!((osc.next_event(), ctx.violations()), (None, &[][..]));
    }

    #[test]
    fn a_broken_crystal_is_never_ready() {
        let (mut osc, mut ctx) = started(CRYSTAL);
        ctx.wires.crystal_fails = true;
        osc.notice(&mut ctx);
        assert_eq!(osc.next_event(), None);
    }

    #[test]
    fn on_demand_it_waits_to_be_asked() {
        let (mut osc, mut ctx) = started(CRYSTAL | ONDEMAND);
        assert_eq!(osc.next_event(), None);
        ctx.clocks.wanted_by_dpll = 1 << Source::Xosc32k as u8;
        osc.notice(&mut ctx);
        wait(&mut osc, &mut ctx);
        assert_eq!(osc.read(STATUS, Width::Word, &mut ctx), XOSC32KRDY);
    }

    #[test]
    fn the_crystal_runs_on_through_a_reset_that_is_not_of_the_supply() {
        let (mut osc, mut ctx) = started(CRYSTAL);
        wait(&mut osc, &mut ctx);
        ctx.clocks = Default::default();
        osc.reset(Reset::Watchdog, &mut ctx);
        assert_eq!(ctx.clocks.source(Source::Xosc32k), Some(HERTZ));
        osc.reset(Reset::PowerOn, &mut ctx);
        assert_eq!(ctx.clocks.source(Source::Xosc32k), None);
    }
}
