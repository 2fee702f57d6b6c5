//! Registers of a TCC: where they are, which bits they have (data sheet: "Register Summary"), and how the instances differ.

use super::super::registers::{Map, Register};
use crate::irq::Irq;
use crate::width::Width;

pub(super) const CTRLA: u32 = 0x00;
pub(super) const CTRLBCLR: u32 = 0x04;
pub(super) const CTRLBSET: u32 = 0x05;
pub(super) const SYNCBUSY: u32 = 0x08;
pub(super) const FCTRL: u32 = 0x0c;
pub(super) const WEXCTRL: u32 = 0x14;
pub(super) const DRVCTRL: u32 = 0x18;
pub(super) const DBGCTRL: u32 = 0x1e;
pub(super) const EVCTRL: u32 = 0x20;
pub(super) const INTENCLR: u32 = 0x24;
pub(super) const INTENSET: u32 = 0x28;
pub(super) const INTFLAG: u32 = 0x2c;
pub(super) const STATUS: u32 = 0x30;
pub(super) const COUNT: u32 = 0x34;
pub(super) const PATT: u32 = 0x38;
pub(super) const WAVE: u32 = 0x3c;
pub(super) const PER: u32 = 0x40;
pub(super) const CC: u32 = 0x44;
pub(super) const PATTBUF: u32 = 0x64;
pub(super) const PERBUF: u32 = 0x6c;
pub(super) const CCBUF: u32 = 0x70;

pub(super) const INTERRUPTS: u32 = 0x000f_fc0f;
pub(super) const COUNTS: u32 = 0x00ff_ffff;

pub(super) const MAP: Map = Map(&[
    Register::new(CCBUF, Width::Word, COUNTS).times(4),
    Register::new(INTFLAG, Width::Word, INTERRUPTS),
    Register::read_only(SYNCBUSY, Width::Word),
    Register::new(CTRLA, Width::Word, 0x0f80_ff63),
    Register::new(CTRLBCLR, Width::Byte, 0xff),
    Register::new(CTRLBSET, Width::Byte, 0xff),
    Register::new(FCTRL, Width::Word, 0x0fff_ffff & !(1 << 2)).times(2),
    Register::new(WEXCTRL, Width::Word, 0xffff_0f03),
    Register::new(DRVCTRL, Width::Word, !0),
    Register::new(DBGCTRL, Width::Byte, 0x05),
    Register::new(EVCTRL, Width::Word, 0x0f0f_f7ff),
    Register::new(INTENCLR, Width::Word, INTERRUPTS),
    Register::new(INTENSET, Width::Word, INTERRUPTS),
    Register::new(STATUS, Width::Word, 0x000f_f0ba),
    Register::new(COUNT, Width::Word, COUNTS),
    Register::new(PATT, Width::Half, 0xffff),
    Register::new(WAVE, Width::Word, 0x0f0f_0fb7),
    Register::new(PER, Width::Word, COUNTS),
    Register::new(CC, Width::Word, COUNTS).times(4),
    Register::new(PATTBUF, Width::Half, 0xffff),
    Register::new(PERBUF, Width::Word, COUNTS),
]);

pub(super) const SWRST: u32 = 1 << 0;
pub(super) const ENABLE: u32 = 1 << 1;
pub(super) const RESOLUTION: u32 = 3 << 5;
pub(super) const DIR: u32 = 1 << 0;
pub(super) const LUPD: u32 = 1 << 1;
pub(super) const ONESHOT: u32 = 1 << 2;
pub(super) const CMD: u32 = 7 << 5;
pub(super) const DTIEN: u32 = 0xf << 8;
pub(super) const SWAP: u32 = 0xf << 24;
pub(super) const RAMP: u32 = 3 << 4;
pub(super) const FDDBD: u32 = 1 << 2;

pub(super) const OVF: u32 = 1 << 0;
pub(super) const DFS: u32 = 1 << 11;
/// INTFLAG.MC0; the others follow.
pub(super) const MC: u32 = 1 << 16;

pub(super) const STATUS_STOP: u32 = 1 << 0;
pub(super) const STATUS_DFS: u32 = 1 << 3;
pub(super) const STATUS_PATTBUFV: u32 = 1 << 5;
pub(super) const STATUS_PERBUFV: u32 = 1 << 7;
pub(super) const STATUS_FAULTS: u32 = 3 << 14;
/// STATUS.CCBUFV0; the others follow.
pub(super) const STATUS_CCBUFV: u32 = 1 << 16;

/// All that say a buffer is full.
pub(super) const STATUS_BUFFERS: u32 = STATUS_PATTBUFV | STATUS_PERBUFV | 0xf << 16;

pub(super) const SYNC_SWRST: u32 = 0;
pub(super) const SYNC_ENABLE: u32 = 1;
pub(super) const SYNC_CTRLB: u32 = 2;
pub(super) const SYNC_COUNT: u32 = 4;
pub(super) const SYNC_PATT: u32 = 5;
pub(super) const SYNC_WAVE: u32 = 6;
pub(super) const SYNC_PER: u32 = 7;
pub(super) const SYNC_CC: u32 = 8;

pub(super) const NFRQ: u32 = 0;
pub(super) const MFRQ: u32 = 1;
pub(super) const NPWM: u32 = 2;

pub(super) const PRESCALERS: [u64; 8] = [1, 2, 4, 8, 16, 64, 256, 1024];

/// Interrupt line, generic clock channel, compare channels, outputs, largest count, by instance.
pub(super) const INSTANCES: [(Irq, usize, usize, usize, u64); 3] =
    [(Irq::Tcc0, 28, 4, 8, 0xff_ffff), (Irq::Tcc1, 28, 2, 4, 0xff_ffff), (Irq::Tcc2, 29, 2, 2, 0xffff)];
