//! DIVAS: divide and square root accelerator (data sheet: "Divide and Square Root Accelerator").
//!
//! Writing DIVISOR starts a division, writing SQRNUM a square root. Reading RESULT or REM, and starting the next
//! operation, waits on the bus until the one in progress is done, so firmware need not poll STATUS.BUSY.

use super::Model;
use crate::context::Context;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

const CTRLA: u32 = 0x00;
const STATUS: u32 = 0x04;
const DIVIDEND: u32 = 0x08;
const DIVISOR: u32 = 0x0c;
const RESULT: u32 = 0x10;
const REM: u32 = 0x14;
const SQRNUM: u32 = 0x18;

const CTRLA_SIGNED: u32 = 1 << 0;
/// Disable leading zero optimisation: every operation takes the longest time.
const CTRLA_DLZ: u32 = 1 << 1;
const STATUS_BUSY: u32 = 1 << 0;
const STATUS_DBZ: u32 = 1 << 1;

/// CPU cycles of the longest operation. The data sheet says 2 to 16; how many of them leading zeros save is an
/// assumption: two bits of the dividend (one result bit of a root) per cycle, two at least.
const LONGEST: u32 = 16;
const SHORTEST: u32 = 2;

/// The accelerator's registers and the operation in progress.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Divas {
    signed: bool,
    constant_time: bool,
    divided_by_zero: bool,
    dividend: u32,
    divisor: u32,
    root_of: u32,
    result: u32,
    remainder: u32,
    done: Cycles,
}

impl Model for Divas {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        match offset & !3 {
            CTRLA => u32::from(self.signed) | u32::from(self.constant_time) << 1,
            STATUS => {
                let busy = if ctx.now < self.done { STATUS_BUSY } else { 0 };
                busy | if self.divided_by_zero { STATUS_DBZ } else { 0 }
            }
            DIVIDEND => part(self.dividend, offset, width, ctx),
            DIVISOR => part(self.divisor, offset, width, ctx),
            SQRNUM => part(self.root_of, offset, width, ctx),
            RESULT => {
                self.wait(ctx);
                part(self.result, offset, width, ctx)
            }
            REM => {
                self.wait(ctx);
                part(self.remainder, offset, width, ctx)
            }
            _ => {
                ctx.report(Kind::NoRegister);
                0
            }
        }
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        match offset {
            CTRLA => {
                if value & !(CTRLA_SIGNED | CTRLA_DLZ) != 0 {
                    ctx.report(Kind::ReservedBits(value & !(CTRLA_SIGNED | CTRLA_DLZ)));
                }
                self.signed = value & CTRLA_SIGNED != 0;
                self.constant_time = value & CTRLA_DLZ != 0;
            }
            STATUS => {
                if value & !(STATUS_BUSY | STATUS_DBZ) != 0 {
                    ctx.report(Kind::ReservedBits(value & !(STATUS_BUSY | STATUS_DBZ)));
                }
                if value & STATUS_DBZ != 0 {
                    self.divided_by_zero = false;
                }
            }
            DIVIDEND | DIVISOR | SQRNUM if width != Width::Word => ctx.report(Kind::WrongWidth),
            DIVIDEND => {
                self.wait(ctx);
                self.dividend = value;
            }
            DIVISOR => {
                self.wait(ctx);
                self.divisor = value;
                self.divide(ctx);
            }
            SQRNUM => {
                self.wait(ctx);
                self.root_of = value;
                self.root(ctx);
            }
            RESULT | REM => ctx.report(Kind::ReadOnly),
            _ => ctx.report(Kind::NoRegister),
        }
    }
}

impl Divas {
    /// Division by zero leaves the dividend as the remainder and zero as the quotient (assumption), and sets DBZ.
    fn divide(&mut self, ctx: &Context) {
        let (dividend, divisor) = (self.dividend, self.divisor);
        (self.result, self.remainder) = if divisor == 0 {
            self.divided_by_zero = true;
            (0, dividend)
        } else if self.signed {
            let (dividend, divisor) = (dividend as i32, divisor as i32);
            (dividend.wrapping_div(divisor) as u32, dividend.wrapping_rem(divisor) as u32)
        } else {
            (dividend / divisor, dividend % divisor)
        };
        let magnitude = if self.signed { (dividend as i32).unsigned_abs() } else { dividend };
        self.start(magnitude, ctx);
    }

    fn root(&mut self, ctx: &Context) {
        self.result = self.root_of.isqrt();
        self.remainder = self.root_of - self.result * self.result;
        self.start(self.root_of, ctx);
    }

    fn start(&mut self, operand: u32, ctx: &Context) {
        let cycles = match self.constant_time {
            true => LONGEST,
            false => (32 - operand.leading_zeros()).div_ceil(2).clamp(SHORTEST, LONGEST),
        };
        self.done = ctx.now + u64::from(cycles * ctx.clocks.cpu_ticks);
    }

    /// Holds the bus until the operation in progress is done.
    fn wait(&self, ctx: &mut Context) {
        ctx.stall(self.done.since(ctx.now));
    }
}

/// The part of a 32-bit register that a narrower read sees. Only whole words have a meaning here.
fn part(register: u32, offset: u32, width: Width, ctx: &mut Context) -> u32 {
    if width != Width::Word {
        ctx.report(Kind::WrongWidth);
    }
    register >> (8 * (offset & 3))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn divas() -> (Divas, Context) {
        let mut ctx = Context::default();
        ctx.clocks.cpu_ticks = 1;
        (Divas::default(), ctx)
    }

    fn divide(divas: &mut Divas, ctx: &mut Context, dividend: u32, divisor: u32) -> (u32, u32) {
        divas.write(DIVIDEND, Width::Word, dividend, ctx);
        divas.write(DIVISOR, Width::Word, divisor, ctx);
        (divas.read(RESULT, Width::Word, ctx), divas.read(REM, Width::Word, ctx))
    }

    #[test]
    fn unsigned_division_gives_quotient_and_remainder() {
        let (mut divas, mut ctx) = divas();
        assert_eq!(divide(&mut divas, &mut ctx, 0xffff_fff0, 7), (0xffff_fff0 / 7, 0xffff_fff0 % 7));
    }

    #[test]
    fn signed_division_truncates_towards_zero() {
        let (mut divas, mut ctx) = divas();
        divas.write(CTRLA, Width::Byte, CTRLA_SIGNED, &mut ctx);
        assert_eq!(divide(&mut divas, &mut ctx, -7i32 as u32, 2), (-3i32 as u32, -1i32 as u32));
        assert_eq!(divide(&mut divas, &mut ctx, i32::MIN as u32, -1i32 as u32), (i32::MIN as u32, 0));
    }

    #[test]
    fn square_root_is_the_integer_below() {
        let (mut divas, mut ctx) = divas();
        divas.write(SQRNUM, Width::Word, u32::MAX, &mut ctx);
        assert_eq!(divas.read(RESULT, Width::Word, &mut ctx), 65535);
        assert_eq!(divas.read(REM, Width::Word, &mut ctx), u32::MAX - 65535 * 65535);
    }

    #[test]
    fn division_by_zero_sets_a_flag_that_writing_one_clears() {
        let (mut divas, mut ctx) = divas();
        divide(&mut divas, &mut ctx, 5, 0);
        assert_eq!(divas.read(STATUS, Width::Byte, &mut ctx) & STATUS_DBZ, STATUS_DBZ);
        divas.write(STATUS, Width::Byte, STATUS_DBZ, &mut ctx);
        assert_eq!(divas.read(STATUS, Width::Byte, &mut ctx) & STATUS_DBZ, 0);
    }

    #[test]
    fn leading_zeros_save_time_unless_disabled() {
        let (mut divas, mut ctx) = divas();
        let mut cycles = |dlz: u32, dividend: u32| {
            divas.write(CTRLA, Width::Byte, dlz, &mut ctx);
            divas.write(DIVIDEND, Width::Word, dividend, &mut ctx);
            divas.write(DIVISOR, Width::Word, 3, &mut ctx);
            assert_eq!(divas.read(STATUS, Width::Byte, &mut ctx), STATUS_BUSY);
            let before = ctx.now;
            divas.read(RESULT, Width::Word, &mut ctx);
            assert_eq!(divas.read(STATUS, Width::Byte, &mut ctx), 0);
            ctx.now - before
        };
        assert_eq!(cycles(0, 1), 2);
        assert_eq!(cycles(0, 0x1_0000), 9);
        assert_eq!(cycles(0, u32::MAX), 16);
        assert_eq!(cycles(CTRLA_DLZ, 1), 16);
    }

    #[test]
    fn a_narrow_operand_is_reported_and_ignored() {
        let (mut divas, mut ctx) = divas();
        divas.write(DIVISOR, Width::Half, 3, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::WrongWidth);
        assert_eq!(divas.read(STATUS, Width::Byte, &mut ctx), 0);
    }
}
