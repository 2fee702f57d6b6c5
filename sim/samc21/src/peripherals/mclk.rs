//! MCLK: main clock (data sheet: "MCLK – Main Clock"). The CPU's divider, and which bus interfaces are clocked.

use super::Model;
use super::registers::{Map, Register};
use crate::context::Context;
use crate::unit::Unit;
use crate::violation::Kind;
use crate::width::Width;

const INTENCLR: u32 = 0x01;
const INTENSET: u32 = 0x02;
const INTFLAG: u32 = 0x03;
const CPUDIV: u32 = 0x04;
const AHBMASK: u32 = 0x10;
const APBAMASK: u32 = 0x14;
const APBBMASK: u32 = 0x18;
const APBCMASK: u32 = 0x1c;

const CKRDY: u32 = 1 << 0;

const MAP: Map = Map(&[
    Register::new(INTENCLR, Width::Byte, CKRDY),
    Register::new(INTENSET, Width::Byte, CKRDY),
    Register::new(INTFLAG, Width::Byte, CKRDY),
    Register::new(CPUDIV, Width::Byte, 0xff),
    Register::new(AHBMASK, Width::Word, 0x1fff),
    Register::new(APBAMASK, Width::Word, 0x1fff),
    Register::new(APBBMASK, Width::Word, 0x0027),
    Register::new(APBCMASK, Width::Word, 0x00ff_fe7f),
]);

/// Interrupt registers; divider and masks are [`crate::Clocks`] itself.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Mclk {
    enabled: u32,
    flags: u32,
}

impl Default for Mclk {
    fn default() -> Self {
        Mclk { enabled: 0, flags: CKRDY }
    }
}

impl Model for Mclk {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                INTENCLR | INTENSET => self.enabled,
                INTFLAG => self.flags,
                CPUDIV => ctx.clocks.cpu_divider,
                AHBMASK => ctx.clocks.ahb,
                APBAMASK => ctx.clocks.apb[0],
                APBBMASK => ctx.clocks.apb[1],
                _ => ctx.clocks.apb[2],
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        let before = ctx.clocks.clone();
        let clocks = &mut ctx.clocks;
        match part.register {
            INTENCLR => self.enabled &= !part.ones(),
            INTENSET => self.enabled |= part.ones(),
            INTFLAG => self.flags &= !part.ones(),
            CPUDIV if !part.ones().is_power_of_two() => ctx.report(Kind::ReservedValue),
            CPUDIV => {
                clocks.cpu_divider = part.ones();
                clocks.set_cpu_ticks();
                // The new clock is there within a few cycles; nobody could see the flag low.
                self.flags |= CKRDY;
            }
            AHBMASK => clocks.ahb = part.onto(clocks.ahb),
            APBAMASK => clocks.apb[0] = part.onto(clocks.apb[0]),
            APBBMASK => clocks.apb[1] = part.onto(clocks.apb[1]),
            _ => clocks.apb[2] = part.onto(clocks.apb[2]),
        }
        ctx.wires.changed |= ctx.clocks != before;
        ctx.set_system_irq(Unit::Mclk, self.flags & self.enabled != 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_interface_is_clocked_by_its_mask_bit() {
        let (mut mclk, mut ctx) = (Mclk::default(), Context::default());
        assert!(!ctx.clocks.bus_runs(Unit::Tc4));
        mclk.write(APBCMASK, Width::Word, 1 << 16, &mut ctx);
        assert!(ctx.clocks.bus_runs(Unit::Tc4) && ctx.wires.changed);
        assert_eq!(mclk.read(APBCMASK, Width::Word, &mut ctx), 1 << 16);
    }

    #[test]
    fn masks_after_reset_are_those_of_the_data_sheet() {
        let (mut mclk, mut ctx) = (Mclk::default(), Context::default());
        let masks = [AHBMASK, APBAMASK, APBBMASK, APBCMASK].map(|mask| mclk.read(mask, Width::Word, &mut ctx));
        assert_eq!(masks, [7423, 4095, 7, 0]);
    }

    #[test]
    fn a_divider_that_is_no_power_of_two_is_refused() {
        let (mut mclk, mut ctx) = (Mclk::default(), Context::default());
        mclk.write(CPUDIV, Width::Byte, 3, &mut ctx);
        assert_eq!((ctx.violations()[0].kind, ctx.clocks.cpu_divider), (Kind::ReservedValue, 1));
    }
}
