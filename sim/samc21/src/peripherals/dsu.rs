//! DSU: device service unit (data sheet: "DSU – Device Service Unit"): what the device is.
//!
//! Its services belong to the debugger and are write-protected by PAC after reset; only the identification is modelled.

use super::Model;
use super::registers::{Map, Register};
use crate::context::Context;
use crate::violation::Kind;
use crate::width::Width;

const STATUSB: u32 = 0x02;
const DID: u32 = 0x18;

const MAP: Map = Map(&[
    Register::write_only(0x00, Width::Byte, 0xdd),
    Register::new(0x01, Width::Byte, 0x1f),
    Register::read_only(STATUSB, Width::Byte),
    Register::new(0x04, Width::Word, !0),
    Register::new(0x08, Width::Word, !3),
    Register::new(0x0c, Width::Word, !0),
    Register::new(0x10, Width::Word, !0).times(2),
    Register::read_only(DID, Width::Word),
]);

/// DID of the ATSAMC21J18A.
pub const ATSAMC21J18A: u32 = 0x1101_0500;

/// Identification.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Dsu;

impl Model for Dsu {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        MAP.read(offset, width, ctx).map_or(0, |part| match part.register {
            DID => part.of(ATSAMC21J18A),
            _ => 0,
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        if MAP.write(offset, width, value, ctx).is_some() {
            ctx.report(Kind::WriteProtected);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_an_atsamc21j18a() {
        let mut ctx = Context::default();
        assert_eq!(Dsu.read(DID, Width::Word, &mut ctx), 285_279_488);
        Dsu.write(0x04, Width::Word, 0, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::WriteProtected);
    }
}
