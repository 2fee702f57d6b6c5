//! EIC: external interrupts (data sheet: "EIC – External Interrupt Controller"). Sixteen lines and the NMI, each from
//! whichever pin has function A and its number.
//!
//! Edges are seen as the outside makes them: synchronisation of the pin (two to three cycles of its clock) and the
//! majority filter are shorter than the steps in which the outside acts. Events are registers only.

use super::Model;
use super::registers::{Map, Register, SyncBusy, crossing};
use crate::clocks::{Hertz, Source};
use crate::context::Context;
use crate::irq::Irq;
use crate::pins::{Function, PA, PB};
use crate::violation::Kind;
use crate::width::Width;

const CTRLA: u32 = 0x00;
const NMICTRL: u32 = 0x01;
const NMIFLAG: u32 = 0x02;
const SYNCBUSY: u32 = 0x04;
const EVCTRL: u32 = 0x08;
const INTENCLR: u32 = 0x0c;
const INTENSET: u32 = 0x10;
const INTFLAG: u32 = 0x14;
const ASYNCH: u32 = 0x18;
const CONFIG: u32 = 0x1c;

const LINES: u32 = 0xffff;

const MAP: Map = Map(&[
    Register::new(CTRLA, Width::Byte, 0x13),
    Register::new(NMICTRL, Width::Byte, 0x1f),
    Register::new(NMIFLAG, Width::Half, 0x01),
    Register::read_only(SYNCBUSY, Width::Word),
    Register::new(EVCTRL, Width::Word, LINES),
    Register::new(INTENCLR, Width::Word, LINES),
    Register::new(INTENSET, Width::Word, LINES),
    Register::new(INTFLAG, Width::Word, LINES),
    Register::new(ASYNCH, Width::Word, LINES),
    Register::new(CONFIG, Width::Word, !0).times(2),
]);

const SWRST: u32 = 1 << 0;
const ENABLE: u32 = 1 << 1;
/// Clocked by OSCULP32K instead of its generic clock.
const CKSEL: u32 = 1 << 4;

const SYNC_SWRST: u32 = 0;
const SYNC_ENABLE: u32 = 1;

/// Generic clock channel.
const CHANNEL: usize = 2;

/// Line of a pin, by group and number; 16 is the NMI (data sheet: "Multiplexed Signals").
const fn line(group: usize, pin: u32) -> Option<u32> {
    Some(match (group, pin) {
        (PA, 8) => 16,
        (PA, 24..=25) => pin - 12,
        (PA, 27) => 15,
        (PA, 28) => 8,
        (PA, 30..=31) => pin - 20,
        (PA, 0..=23) => pin % 16,
        (PB, 0..=17) => pin % 16,
        (PB, 22..=23 | 30..=31) => pin % 16,
        _ => return None,
    })
}

/// The external interrupt controller.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Eic {
    ctrla: u32,
    nmictrl: u32,
    nmiflag: u32,
    evctrl: u32,
    enabled: u32,
    flags: u32,
    asynch: u32,
    config: [u32; 2],
    sync: SyncBusy,
    /// Levels when last looked at; bit 16 is the NMI's.
    levels: u32,
}

impl Eic {
    fn clock(&self, ctx: &Context) -> Option<Hertz> {
        if self.ctrla & CKSEL != 0 { ctx.clocks.source(Source::Osculp32k) } else { ctx.clocks.generic[CHANNEL] }
    }

    /// Levels of all lines. A line without a pin is low.
    fn see(&self, ctx: &Context) -> u32 {
        let mut levels = 0;
        for (group, pins) in ctx.wires.pins.iter().enumerate() {
            let seen = pins.seen();
            for (pin, function) in (0..).zip(pins.function) {
                if function == Some(Function::A)
                    && let Some(line) = line(group, pin)
                {
                    levels |= (seen >> pin & 1) << line;
                }
            }
        }
        levels
    }

    /// Lines whose detection `sense` is satisfied by the step from `before` to `after`.
    fn detect(sense: u32, before: bool, after: bool) -> bool {
        match sense {
            1 => !before && after,
            2 => before && !after,
            3 => before != after,
            4 => after,
            5 => !after,
            _ => false,
        }
    }

    /// Whether an edge would be noticed at all.
    fn is_watching(&self) -> bool {
        self.ctrla & ENABLE != 0 || self.nmictrl & 7 != 0
    }

    fn look(&mut self, ctx: &mut Context) {
        if !self.is_watching() {
            return;
        }
        let (before, after) = (self.levels, self.see(ctx));
        self.levels = after;
        if self.ctrla & ENABLE != 0 {
            let clocked = self.clock(ctx).is_some();
            for line in 0..16 {
                let sense = self.config[line / 8] >> (4 * (line % 8)) & 7;
                let sees = clocked || self.asynch >> line & 1 != 0;
                if sees && Eic::detect(sense, before >> line & 1 != 0, after >> line & 1 != 0) {
                    self.flags |= 1 << line;
                }
            }
        }
        if Eic::detect(self.nmictrl & 7, before >> 16 & 1 != 0, after >> 16 & 1 != 0) && self.nmiflag == 0 {
            self.nmiflag = 1;
            ctx.pend_nmi();
        }
        ctx.set_irq(Irq::Eic, self.flags & self.enabled != 0);
    }

    fn set_control(&mut self, new: u32, ctx: &mut Context) {
        if self.sync.refuses(1 << SYNC_SWRST | 1 << SYNC_ENABLE, ctx) {
            return;
        }
        if new & SWRST != 0 {
            *self = Eic::default();
            self.sync.start(SYNC_SWRST, u64::from(3 * ctx.clocks.cpu_ticks), ctx.now);
            return;
        }
        if self.ctrla & new & ENABLE != 0 && (self.ctrla ^ new) & CKSEL != 0 {
            ctx.report(Kind::EnableProtected);
            return;
        }
        let toggled = (self.ctrla ^ new) & ENABLE != 0;
        self.ctrla = new;
        if toggled {
            let clock = self.clock(ctx);
            // Lines that are all asynchronous need no clock; then there is nothing to cross into either.
            if clock.is_none() && self.asynch == 0 {
                ctx.report(Kind::Unclocked);
            }
            let ticks = if clock.is_some() || self.asynch == 0 { crossing(clock, ctx) } else { 0 };
            self.sync.start(SYNC_ENABLE, ticks, ctx.now);
        }
    }
}

impl Model for Eic {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                CTRLA => self.ctrla,
                NMICTRL => self.nmictrl,
                NMIFLAG => self.nmiflag,
                SYNCBUSY => self.sync.bits(ctx.now),
                EVCTRL => self.evctrl,
                INTENCLR | INTENSET => self.enabled,
                INTFLAG => self.flags,
                ASYNCH => self.asynch,
                _ => self.config[part.index],
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        if !self.is_watching() {
            // What was there before it began to watch is no edge.
            self.levels = self.see(ctx);
        }
        match part.register {
            CTRLA => self.set_control(part.onto(self.ctrla), ctx),
            EVCTRL | ASYNCH | CONFIG if self.ctrla & ENABLE != 0 => ctx.report(Kind::EnableProtected),
            NMICTRL => self.nmictrl = part.onto(self.nmictrl),
            NMIFLAG => self.nmiflag &= !part.ones(),
            EVCTRL => self.evctrl = part.onto(self.evctrl),
            INTENCLR => self.enabled &= !part.ones(),
            INTENSET => self.enabled |= part.ones(),
            INTFLAG => self.flags &= !part.ones(),
            ASYNCH => self.asynch = part.onto(self.asynch),
            _ => {
                let new = part.onto(self.config[part.index]);
                if (0..8).any(|line| new >> (4 * line) & 7 > 5) {
                    ctx.report(Kind::ReservedValue);
                }
                self.config[part.index] = new;
            }
        }
        self.look(ctx);
        ctx.set_irq(Irq::Eic, self.flags & self.enabled != 0);
    }

    const NOTICES: bool = true;

    fn notice(&mut self, ctx: &mut Context) {
        self.look(ctx);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// EXTINT14 on PB14 senses `sense`.
    fn eic(sense: u32) -> (Eic, Context) {
        let (mut eic, mut ctx) = (Eic::default(), Context::default());
        ctx.clocks.generic[CHANNEL] = Some(Hertz(48_000_000));
        ctx.wires.pins[PB].function[14] = Some(Function::A);
        eic.write(CONFIG + 4, Width::Word, sense << 24, &mut ctx);
        eic.write(INTENSET, Width::Word, 1 << 14, &mut ctx);
        eic.write(CTRLA, Width::Byte, ENABLE, &mut ctx);
        (eic, ctx)
    }

    fn set(eic: &mut Eic, ctx: &mut Context, high: bool) {
        ctx.wires.pins[PB].drive(14, high);
        eic.notice(ctx);
    }

    #[test]
    fn a_rising_edge_interrupts_until_its_flag_is_cleared() {
        let (mut eic, mut ctx) = eic(1);
        set(&mut eic, &mut ctx, true);
        assert_eq!((eic.read(INTFLAG, Width::Word, &mut ctx), ctx.lines), (1 << 14, Irq::Eic.bit()));
        eic.write(INTFLAG, Width::Word, 1 << 14, &mut ctx);
        set(&mut eic, &mut ctx, false);
        assert_eq!((eic.read(INTFLAG, Width::Word, &mut ctx), ctx.lines), (0, 0));
        assert_eq!(ctx.violations(), []);
    }

    #[test]
    fn a_level_from_before_is_no_edge() {
        let (mut eic, mut ctx) = (Eic::default(), Context::default());
        ctx.clocks.generic[CHANNEL] = Some(Hertz(48_000_000));
        ctx.wires.pins[PB].function[14] = Some(Function::A);
        ctx.wires.pins[PB].drive(14, true);
        eic.write(CONFIG + 4, Width::Word, 1 << 24, &mut ctx);
        eic.write(CTRLA, Width::Byte, ENABLE, &mut ctx);
        assert_eq!(eic.flags, 0);
    }

    #[test]
    fn a_level_interrupts_as_long_as_it_lasts() {
        let (mut eic, mut ctx) = eic(4);
        set(&mut eic, &mut ctx, true);
        eic.write(INTFLAG, Width::Word, 1 << 14, &mut ctx);
        assert_eq!(ctx.lines, Irq::Eic.bit());
    }

    #[test]
    fn a_pin_without_function_a_is_not_seen() {
        let (mut eic, mut ctx) = eic(1);
        ctx.wires.pins[PB].function[14] = None;
        set(&mut eic, &mut ctx, true);
        assert_eq!(ctx.lines, 0);
    }

    #[test]
    fn sensing_cannot_be_changed_while_enabled() {
        let (mut eic, mut ctx) = eic(1);
        eic.write(CONFIG + 4, Width::Word, 0, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::EnableProtected);
    }

    #[test]
    fn without_a_clock_an_edge_goes_unseen_unless_asynchronous() {
        let (mut eic, mut ctx) = eic(1);
        ctx.clocks.generic[CHANNEL] = None;
        set(&mut eic, &mut ctx, true);
        assert_eq!(eic.flags, 0);
        eic.asynch = 1 << 14;
        set(&mut eic, &mut ctx, false);
        set(&mut eic, &mut ctx, true);
        assert_eq!(eic.flags, 1 << 14);
    }

    #[test]
    fn the_nmi_pin_cannot_be_masked() {
        let (mut eic, mut ctx) = (Eic::default(), Context::default());
        ctx.wires.pins[PA].function[8] = Some(Function::A);
        eic.write(NMICTRL, Width::Byte, 1, &mut ctx);
        ctx.wires.pins[PA].drive(8, true);
        eic.notice(&mut ctx);
        assert!(ctx.nmi);
    }
}
