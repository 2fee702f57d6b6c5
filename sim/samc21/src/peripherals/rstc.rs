//! RSTC: reset controller (data sheet: "RSTC – Reset Controller"). Remembers the last reset's cause.

use super::Model;
use super::registers::{Map, Register};
use crate::context::Context;
use crate::reset::Reset;
use crate::width::Width;

const MAP: Map = Map(&[Register::read_only(0, Width::Byte)]);

/// The cause of the last reset.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Rstc {
    rcause: u8,
}

impl Model for Rstc {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| part.of(self.rcause.into()))
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        MAP.write(offset, width, value, ctx);
    }

    fn reset(&mut self, cause: Reset, _ctx: &mut Context) {
        self.rcause = cause.cause_bit();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::violation::Kind;

    #[test]
    fn rcause_is_the_last_resets_alone() {
        let (mut rstc, mut ctx) = (Rstc::default(), Context::default());
        rstc.reset(Reset::PowerOn, &mut ctx);
        assert_eq!(rstc.read(0, Width::Byte, &mut ctx), 0x01);
        rstc.reset(Reset::Watchdog, &mut ctx);
        assert_eq!(rstc.read(0, Width::Byte, &mut ctx), 0x20);
    }

    #[test]
    fn rcause_cannot_be_written() {
        let (mut rstc, mut ctx) = (Rstc::default(), Context::default());
        rstc.write(0, Width::Byte, 1, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::ReadOnly);
    }
}
