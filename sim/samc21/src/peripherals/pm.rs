//! PM: power manager (data sheet: "PM – Power Manager"). The sleep modes up to IDLE, which stop the CPU alone.
//!
//! STANDBY would stop clocks; it is not emulated, and choosing it is reported.

use super::Model;
use super::registers::{Map, Register};
use crate::context::Context;
use crate::violation::Kind;
use crate::width::Width;

const SLEEPCFG: u32 = 0x01;
const STDBYCFG: u32 = 0x08;

const MAP: Map = Map(&[Register::new(SLEEPCFG, Width::Byte, 0x07), Register::new(STDBYCFG, Width::Half, 0x0cc0)]);

/// Deepest mode that leaves the peripherals' clocks running.
const IDLE2: u32 = 2;

/// Sleep configuration.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Pm {
    sleepcfg: u32,
    stdbycfg: u32,
}

impl Default for Pm {
    fn default() -> Self {
        Pm { sleepcfg: 0, stdbycfg: 0x0400 }
    }
}

impl Model for Pm {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| match part.register {
            SLEEPCFG => part.of(self.sleepcfg),
            _ => part.of(self.stdbycfg),
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some(part) = MAP.write(offset, width, value, ctx) else { return };
        match part.register {
            SLEEPCFG => {
                self.sleepcfg = part.onto(self.sleepcfg);
                if self.sleepcfg > IDLE2 {
                    ctx.report(Kind::Misuse("this sleep mode is not emulated"));
                }
            }
            _ => self.stdbycfg = part.onto(self.stdbycfg),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standby_is_reported() {
        let (mut pm, mut ctx) = (Pm::default(), Context::default());
        pm.write(SLEEPCFG, Width::Byte, 2, &mut ctx);
        assert_eq!(ctx.violations(), []);
        pm.write(SLEEPCFG, Width::Byte, 4, &mut ctx);
        assert!(matches!(ctx.violations()[0].kind, Kind::Misuse(_)));
    }
}
