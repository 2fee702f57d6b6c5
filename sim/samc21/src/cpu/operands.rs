//! Registers, flags and special registers, as instructions use them.

use super::{Cpu, Flow, timing};

impl Cpu {
    #[inline(always)]
    pub(super) fn reg(&self, register: u8) -> u32 {
        self.r[usize::from(register & 15)]
    }

    #[inline(always)]
    pub(super) fn set(&mut self, register: u8, value: u32) {
        self.r[usize::from(register & 15)] = value;
    }

    /// A register, or the PC as an operand: two instructions on.
    #[inline(always)]
    pub(super) fn reg_or_pc(&self, register: u8, pc: u32) -> u32 {
        if register == 15 { pc.wrapping_add(4) } else { self.reg(register) }
    }

    /// Writes a register that may be SP, whose low bits are zero, or PC, which branches; returns the cost.
    #[inline(always)]
    pub(super) fn set_special(&mut self, register: u8, value: u32, flow: &mut Flow) -> u64 {
        match register {
            13 => self.r[13] = value & !3,
            15 => {
                flow.pc = value & !1;
                return timing::BRANCH;
            }
            _ => self.set(register, value),
        }
        timing::SIMPLE
    }

    /// Address of a register-offset access.
    #[inline(always)]
    pub(super) fn sum(&self, n: u8, m: u8) -> u32 {
        self.reg(n).wrapping_add(self.reg(m))
    }

    /// Address of an immediate-offset access.
    #[inline(always)]
    pub(super) fn at(&self, n: u8, offset: u32) -> u32 {
        self.reg(n).wrapping_add(offset)
    }

    /// Sets N and Z for a result.
    #[inline(always)]
    pub(super) fn judge(&mut self, result: u32) {
        self.nz = i64::from(result as i32) as u64;
    }

    #[inline(always)]
    pub(super) fn set_nz(&mut self, d: u8, value: u32) {
        self.judge(value);
        self.set(d, value);
    }

    /// Sets all flags for an addition, and returns the sum.
    #[inline(always)]
    pub(super) fn add_flags(&mut self, a: u32, b: u32) -> u32 {
        let (sum, carry) = a.overflowing_add(b);
        self.c = u32::from(carry);
        self.v = (a ^ sum) & (b ^ sum);
        self.judge(sum);
        sum
    }

    #[inline(always)]
    pub(super) fn add(&mut self, d: u8, a: u32, b: u32) {
        let sum = self.add_flags(a, b);
        self.set(d, sum);
    }

    /// Carry is the absence of a borrow.
    #[inline(always)]
    pub(super) fn compare(&mut self, a: u32, b: u32) {
        let difference = a.wrapping_sub(b);
        self.c = u32::from(a >= b);
        self.v = (a ^ b) & (a ^ difference);
        self.judge(difference);
    }

    #[inline(always)]
    pub(super) fn subtract(&mut self, d: u8, a: u32, b: u32) {
        self.compare(a, b);
        self.set(d, a.wrapping_sub(b));
    }

    #[inline(always)]
    pub(super) fn add_with_carry(&mut self, d: u8, a: u32, b: u32) {
        let wide = u64::from(a) + u64::from(b) + u64::from(self.c);
        let sum = wide as u32;
        self.c = (wide >> 32) as u32;
        self.v = (a ^ sum) & (b ^ sum);
        self.set_nz(d, sum);
    }

    /// N.
    #[inline(always)]
    pub(super) fn negative(&self) -> bool {
        self.nz >> 63 != 0
    }

    /// Z.
    #[inline(always)]
    pub(super) fn zero(&self) -> bool {
        self.nz as u32 == 0
    }

    /// C.
    #[inline(always)]
    pub(super) fn carry(&self) -> bool {
        self.c != 0
    }

    /// V.
    #[inline(always)]
    pub(super) fn overflow(&self) -> bool {
        self.v >> 31 != 0
    }

    /// N differs from V: the first operand of a comparison was less, as signed numbers.
    #[inline(always)]
    pub(super) fn less(&self) -> bool {
        self.negative() != self.overflow()
    }

    /// MRS (ARMv6-M ARM, B4.2). Unprivileged code reads zero, but for the flags.
    pub(super) fn read_special(&self, special: u8) -> u32 {
        let stack = |psp: bool| if psp == self.uses_psp { self.r[13] } else { self.other_sp };
        match special {
            0..=7 => {
                let flags = if special & 4 == 0 { self.xpsr() & 0xf000_0000 } else { 0 };
                let exception = if special & 1 != 0 && self.is_privileged() { u32::from(self.ipsr) } else { 0 };
                flags | exception
            }
            20 => u32::from(self.uses_psp) << 1 | u32::from(self.unprivileged),
            _ if !self.is_privileged() => 0,
            8 => stack(false),
            9 => stack(true),
            16 => u32::from(self.primask),
            _ => 0,
        }
    }

    /// MSR (ARMv6-M ARM, B4.2). Unprivileged code can write only the flags.
    pub(super) fn write_special(&mut self, special: u8, value: u32) {
        match special {
            0..=3 => self.set_flags(value),
            _ if !self.is_privileged() => {}
            8 | 9 if (special == 9) == self.uses_psp => self.r[13] = value & !3,
            8 | 9 => self.other_sp = value & !3,
            16 => self.primask = value & 1 != 0,
            20 => {
                self.unprivileged = value & 1 != 0;
                if self.ipsr == 0 {
                    self.use_psp(value & 2 != 0);
                }
            }
            _ => {}
        }
    }
}
