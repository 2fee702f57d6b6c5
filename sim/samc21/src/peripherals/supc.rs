//! SUPC: supply controller (data sheet: "SUPC – Supply Controller"). Brown-out detector and references as registers.
//!
//! A brown-out itself comes from outside, as a reset of the chip; detector and regulator are always ready.

use super::Model;
use super::registers::{Map, Register};
use crate::context::Context;
use crate::reset::Reset;
use crate::unit::Unit;
use crate::violation::Kind;
use crate::width::Width;

const INTENCLR: u32 = 0x00;
const INTENSET: u32 = 0x04;
const INTFLAG: u32 = 0x08;
const STATUS: u32 = 0x0c;
const BODVDD: u32 = 0x10;
const VREG: u32 = 0x18;
const VREF: u32 = 0x1c;

const INTERRUPTS: u32 = 0b111;
const READY: u32 = 1 << 0;
const BODVDD_ENABLE: u32 = 1 << 1;

const MAP: Map = Map(&[
    Register::new(INTENCLR, Width::Word, INTERRUPTS),
    Register::new(INTENSET, Width::Word, INTERRUPTS),
    Register::new(INTFLAG, Width::Word, INTERRUPTS),
    Register::read_only(STATUS, Width::Word),
    Register::new(BODVDD, Width::Word, 0x003f_f17e),
    Register::new(VREG, Width::Word, 0x42),
    Register::new(VREF, Width::Word, 0x000f_00c6),
]);

/// The supply controller's registers.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Supc {
    enabled: u32,
    flags: u32,
    bodvdd: u32,
    vreg: u32,
    vref: u32,
}

impl Supc {
    fn update(&self, ctx: &mut Context) {
        ctx.set_system_irq(Unit::Supc, self.flags & self.enabled != 0);
    }
}

impl Model for Supc {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                INTENCLR | INTENSET => self.enabled,
                INTFLAG => self.flags,
                STATUS => u32::from(self.bodvdd & BODVDD_ENABLE != 0) * READY,
                BODVDD => self.bodvdd,
                VREG => self.vreg,
                _ => self.vref,
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        match part.register {
            INTENCLR => self.enabled &= !part.ones(),
            INTENSET => self.enabled |= part.ones(),
            INTFLAG => self.flags &= !part.ones(),
            BODVDD => {
                let new = part.onto(self.bodvdd);
                if self.bodvdd & new & BODVDD_ENABLE != 0 && new != self.bodvdd {
                    ctx.report(Kind::EnableProtected);
                    return;
                }
                if new & !self.bodvdd & BODVDD_ENABLE != 0 {
                    self.flags |= READY;
                }
                self.bodvdd = new;
            }
            VREG => self.vreg = part.onto(self.vreg),
            _ => self.vref = part.onto(self.vref),
        }
        self.update(ctx);
    }

    /// The brown-out detector outlasts every reset but those of the supply.
    fn reset(&mut self, cause: Reset, _ctx: &mut Context) {
        let bodvdd = if cause.is_of_supply() { 0 } else { self.bodvdd };
        *self = Supc { bodvdd, ..Supc::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_detectors_level_is_set_before_it_is_enabled() {
        let (mut supc, mut ctx) = (Supc::default(), Context::default());
        supc.write(BODVDD, Width::Word, 8 << 16, &mut ctx);
        supc.write(BODVDD, Width::Word, 8 << 16 | BODVDD_ENABLE, &mut ctx);
        assert_eq!(supc.read(STATUS, Width::Word, &mut ctx), READY);
        supc.write(BODVDD, Width::Word, 9 << 16 | BODVDD_ENABLE, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::EnableProtected);
    }
}
