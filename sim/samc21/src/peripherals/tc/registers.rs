//! Registers of a TC: where they are, which bits they have (data sheet: "Register Summary"), and how the instances differ.

use super::super::registers::{Map, Register};
use crate::irq::Irq;
use crate::unit::Unit;
use crate::width::Width;

pub(super) const CTRLA: u32 = 0x00;
pub(super) const CTRLBCLR: u32 = 0x04;
pub(super) const CTRLBSET: u32 = 0x05;
pub(super) const EVCTRL: u32 = 0x06;
pub(super) const INTENCLR: u32 = 0x08;
pub(super) const INTENSET: u32 = 0x09;
pub(super) const INTFLAG: u32 = 0x0a;
pub(super) const STATUS: u32 = 0x0b;
pub(super) const WAVE: u32 = 0x0c;
pub(super) const DRVCTRL: u32 = 0x0d;
pub(super) const DBGCTRL: u32 = 0x0f;
pub(super) const SYNCBUSY: u32 = 0x10;
pub(super) const COUNT: u32 = 0x14;
pub(super) const PER: u32 = 0x1b;
pub(super) const CC: u32 = 0x1c;
pub(super) const PERBUF: u32 = 0x2f;
pub(super) const CCBUF: u32 = 0x30;

pub(super) const INTERRUPTS: u32 = 0x33;

/// The registers, the first ones those used most; the last are those whose width depends on the mode.
macro_rules! map {
    ($($own:expr),*) => {
        Map(&[
            Register::new(INTFLAG, Width::Byte, INTERRUPTS),
            Register::new(CTRLBSET, Width::Byte, 0xe7),
            Register::read_only(SYNCBUSY, Width::Word),
            Register::new(CTRLBCLR, Width::Byte, 0xe7),
            Register::new(INTENCLR, Width::Byte, INTERRUPTS),
            Register::new(INTENSET, Width::Byte, INTERRUPTS),
            Register::new(CTRLA, Width::Word, 0x0033_0fff),
            Register::new(EVCTRL, Width::Half, 0x3137),
            Register::new(STATUS, Width::Byte, 0x3b),
            Register::new(WAVE, Width::Byte, 0x03),
            Register::new(DRVCTRL, Width::Byte, 0x03),
            Register::new(DBGCTRL, Width::Byte, 0x01),
            $($own),*
        ])
    };
}

pub(super) const MAP_8: Map = map!(
    Register::new(COUNT, Width::Byte, 0xff),
    Register::new(PER, Width::Byte, 0xff),
    Register::new(CC, Width::Byte, 0xff).times(2),
    Register::new(PERBUF, Width::Byte, 0xff),
    Register::new(CCBUF, Width::Byte, 0xff).times(2)
);
pub(super) const MAP_16: Map = map!(
    Register::new(COUNT, Width::Half, 0xffff),
    Register::new(CC, Width::Half, 0xffff).times(2),
    Register::new(CCBUF, Width::Half, 0xffff).times(2)
);
pub(super) const MAP_32: Map = map!(
    Register::new(COUNT, Width::Word, !0),
    Register::new(CC, Width::Word, !0).times(2),
    Register::new(CCBUF, Width::Word, !0).times(2)
);

pub(super) const SWRST: u32 = 1 << 0;
pub(super) const ENABLE: u32 = 1 << 1;
pub(super) const MODE: u32 = 3 << 2;
pub(super) const MODE_8: u32 = 1 << 2;
pub(super) const MODE_32: u32 = 2 << 2;

pub(super) const DIR: u32 = 1 << 0;
pub(super) const LUPD: u32 = 1 << 1;
pub(super) const ONESHOT: u32 = 1 << 2;
pub(super) const CMD: u32 = 7 << 5;

pub(super) const OVF: u32 = 1 << 0;
/// INTFLAG.MC0; MC1 is the bit above.
pub(super) const MC: u32 = 1 << 4;

pub(super) const STATUS_STOP: u32 = 1 << 0;
pub(super) const STATUS_PERBUFV: u32 = 1 << 3;
/// STATUS.CCBUFV0; CCBUFV1 is the bit above.
pub(super) const STATUS_CCBUFV: u32 = 1 << 4;

pub(super) const SYNC_SWRST: u32 = 0;
pub(super) const SYNC_ENABLE: u32 = 1;
pub(super) const SYNC_CTRLB: u32 = 2;
pub(super) const SYNC_COUNT: u32 = 4;
pub(super) const SYNC_PER: u32 = 5;
/// SYNCBUSY.CC0; CC1 is the bit above.
pub(super) const SYNC_CC: u32 = 6;

/// CTRLA.PRESCALER.
pub(super) const PRESCALERS: [u64; 8] = [1, 2, 4, 8, 16, 64, 256, 1024];

/// Interrupt line, generic clock channel and unit of the client in 32-bit mode, by instance.
pub(super) const INSTANCES: [(Irq, usize, Option<Unit>); 5] = [
    (Irq::Tc0, 30, Some(Unit::Tc1)),
    (Irq::Tc1, 30, None),
    (Irq::Tc2, 31, Some(Unit::Tc3)),
    (Irq::Tc3, 31, None),
    (Irq::Tc4, 32, None),
];
