//! What each instruction does (ARMv6-M ARM, A6.7 "Alphabetical list of ARMv6-M Thumb instructions").

use super::decode::{Op, Shift};
use super::{Cpu, Fault, Flow, Sleep, timing};
use crate::context::Context;
use crate::peripherals::Peripherals;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width::{Byte, Half, Word};

impl Cpu {
    /// Executes one instruction at `pc`, and spends its time.
    #[inline(always)]
    pub(super) fn execute(
        &mut self,
        op: Op,
        pc: u32,
        flow: &mut Flow,
        ctx: &mut Context,
        bus: &mut Peripherals,
    ) -> Result<(), Fault> {
        flow.pc = pc.wrapping_add(2);
        let mut cost = timing::SIMPLE;
        match op {
            Op::Moves { d, m } => self.set_nz(d, self.reg(m)),
            Op::LslImm { d, m, shift } => {
                let value = self.reg(m);
                self.c = value >> (32 - shift) & 1;
                self.set_nz(d, value << shift);
            }
            Op::LsrImm { d, m, shift } => {
                let value = u64::from(self.reg(m)) << 1 >> shift;
                self.c = (value & 1) as u32;
                self.set_nz(d, (value >> 1) as u32);
            }
            Op::AsrImm { d, m, shift } => {
                let value = i64::from(self.reg(m) as i32) << 1 >> shift;
                self.c = (value & 1) as u32;
                self.set_nz(d, (value >> 1) as u32);
            }
            Op::AddReg { d, n, m } => self.add(d, self.reg(n), self.reg(m)),
            Op::SubReg { d, n, m } => self.subtract(d, self.reg(n), self.reg(m)),
            Op::AddImm { d, n, imm } => self.add(d, self.reg(n), imm),
            Op::SubImm { d, n, imm } => self.subtract(d, self.reg(n), imm),
            Op::MovImm { d, imm } => self.set_nz(d, imm),
            Op::CmpImm { n, imm } => self.compare(self.reg(n), imm),
            Op::And { d, m } => self.set_nz(d, self.reg(d) & self.reg(m)),
            Op::Eor { d, m } => self.set_nz(d, self.reg(d) ^ self.reg(m)),
            Op::ShiftReg { shift, d, m } => self.shift_by_register(shift, d, m),
            Op::Adc { d, m } => self.add_with_carry(d, self.reg(d), self.reg(m)),
            Op::Sbc { d, m } => self.add_with_carry(d, self.reg(d), !self.reg(m)),
            Op::Tst { n, m } => self.judge(self.reg(n) & self.reg(m)),
            Op::Rsb { d, n } => self.subtract(d, 0, self.reg(n)),
            Op::CmpReg { n, m } => self.compare(self.reg(n), self.reg(m)),
            Op::Cmn { n, m } => {
                self.add_flags(self.reg(n), self.reg(m));
            }
            Op::Orr { d, m } => self.set_nz(d, self.reg(d) | self.reg(m)),
            Op::Mul { d, m } => self.set_nz(d, self.reg(d).wrapping_mul(self.reg(m))),
            Op::Bic { d, m } => self.set_nz(d, self.reg(d) & !self.reg(m)),
            Op::Mvn { d, m } => self.set_nz(d, !self.reg(m)),
            Op::AddHigh { d, m } => self.set(d, self.reg(d).wrapping_add(self.reg(m))),
            Op::MovHigh { d, m } => self.set(d, self.reg(m)),
            Op::AddSpecial { d, m } => {
                let value = self.reg_or_pc(d, pc).wrapping_add(self.reg_or_pc(m, pc));
                cost = self.set_special(d, value, flow);
            }
            Op::MovSpecial { d, m } => cost = self.set_special(d, self.reg_or_pc(m, pc), flow),
            Op::Bx { m } => {
                cost = timing::BRANCH;
                self.interwork(self.reg_or_pc(m, pc), pc, flow, ctx, bus)?;
            }
            Op::Blx { m } => {
                cost = timing::BRANCH;
                let target = self.reg(m);
                self.r[14] = pc.wrapping_add(2) | 1;
                self.jump(target, flow, ctx)?;
            }
            Op::LdrLiteral { t, address } => {
                let value = self.load(address, Word, flow, ctx, bus)?;
                self.set(t, value);
            }
            Op::StrReg { t, n, m } => self.store(self.sum(n, m), Word, self.reg(t), flow, ctx, bus)?,
            Op::StrhReg { t, n, m } => self.store(self.sum(n, m), Half, self.reg(t), flow, ctx, bus)?,
            Op::StrbReg { t, n, m } => self.store(self.sum(n, m), Byte, self.reg(t), flow, ctx, bus)?,
            Op::LdrReg { t, n, m } => {
                let value = self.load(self.sum(n, m), Word, flow, ctx, bus)?;
                self.set(t, value);
            }
            Op::LdrhReg { t, n, m } => {
                let value = self.load(self.sum(n, m), Half, flow, ctx, bus)?;
                self.set(t, value);
            }
            Op::LdrbReg { t, n, m } => {
                let value = self.load(self.sum(n, m), Byte, flow, ctx, bus)?;
                self.set(t, value);
            }
            Op::LdrsbReg { t, n, m } => {
                let value = self.load(self.sum(n, m), Byte, flow, ctx, bus)?;
                self.set(t, value as i8 as u32);
            }
            Op::LdrshReg { t, n, m } => {
                let value = self.load(self.sum(n, m), Half, flow, ctx, bus)?;
                self.set(t, value as i16 as u32);
            }
            Op::StrImm { t, n, offset } => self.store(self.at(n, offset), Word, self.reg(t), flow, ctx, bus)?,
            Op::StrhImm { t, n, offset } => self.store(self.at(n, offset), Half, self.reg(t), flow, ctx, bus)?,
            Op::StrbImm { t, n, offset } => self.store(self.at(n, offset), Byte, self.reg(t), flow, ctx, bus)?,
            Op::LdrImm { t, n, offset } => {
                let value = self.load(self.at(n, offset), Word, flow, ctx, bus)?;
                self.set(t, value);
            }
            Op::LdrhImm { t, n, offset } => {
                let value = self.load(self.at(n, offset), Half, flow, ctx, bus)?;
                self.set(t, value);
            }
            Op::LdrbImm { t, n, offset } => {
                let value = self.load(self.at(n, offset), Byte, flow, ctx, bus)?;
                self.set(t, value);
            }
            Op::Adr { d, address } => self.set(d, address),
            Op::AddSp { d, offset } => self.set(d, self.r[13].wrapping_add(offset)),
            Op::Sxth { d, m } => self.set(d, self.reg(m) as i16 as u32),
            Op::Sxtb { d, m } => self.set(d, self.reg(m) as i8 as u32),
            Op::Uxth { d, m } => self.set(d, self.reg(m) & 0xffff),
            Op::Uxtb { d, m } => self.set(d, self.reg(m) & 0xff),
            Op::Rev { d, m } => self.set(d, self.reg(m).swap_bytes()),
            Op::Rev16 { d, m } => self.set(d, self.reg(m).swap_bytes().rotate_left(16)),
            Op::Revsh { d, m } => self.set(d, (self.reg(m) as u16).swap_bytes() as i16 as u32),
            Op::Push { list } => {
                let bottom = self.r[13].wrapping_sub(4 * list.count_ones());
                self.store_list(bottom, list, flow, ctx, bus)?;
                self.r[13] = bottom;
            }
            Op::Pop { list } => self.r[13] = self.load_list(self.r[13], list, flow, ctx, bus)?,
            Op::PopPc { list } => {
                cost = timing::POP_PC;
                let top = self.load_list(self.r[13], list, flow, ctx, bus)?;
                let target = self.load(top, Word, flow, ctx, bus)?;
                self.r[13] = top.wrapping_add(4);
                self.interwork(target, pc, flow, ctx, bus)?;
            }
            Op::Stm { n, list } => {
                let end = self.store_list(self.reg(n), list, flow, ctx, bus)?;
                self.set(n, end);
            }
            Op::Ldm { n, list } => {
                let end = self.load_list(self.reg(n), list, flow, ctx, bus)?;
                if list >> n & 1 == 0 {
                    self.set(n, end);
                }
            }
            Op::BranchEq { target } => cost = flow.branch(self.zero(), target),
            Op::BranchNe { target } => cost = flow.branch(!self.zero(), target),
            Op::BranchCs { target } => cost = flow.branch(self.carry(), target),
            Op::BranchCc { target } => cost = flow.branch(!self.carry(), target),
            Op::BranchMi { target } => cost = flow.branch(self.negative(), target),
            Op::BranchPl { target } => cost = flow.branch(!self.negative(), target),
            Op::BranchVs { target } => cost = flow.branch(self.overflow(), target),
            Op::BranchVc { target } => cost = flow.branch(!self.overflow(), target),
            Op::BranchHi { target } => cost = flow.branch(self.carry() && !self.zero(), target),
            Op::BranchLs { target } => cost = flow.branch(!self.carry() || self.zero(), target),
            Op::BranchGe { target } => cost = flow.branch(!self.less(), target),
            Op::BranchLt { target } => cost = flow.branch(self.less(), target),
            Op::BranchGt { target } => cost = flow.branch(!self.zero() && !self.less(), target),
            Op::BranchLe { target } => cost = flow.branch(self.zero() || self.less(), target),
            Op::Branch { target } => cost = flow.branch(true, target),
            Op::BranchLink { target } => {
                cost = timing::BRANCH_LINK;
                self.r[14] = pc.wrapping_add(4) | 1;
                flow.pc = target;
            }
            Op::Nop => {}
            Op::Unknown => {
                flow.pc = pc;
                flow.publish(self, ctx);
                let done = self.execute_unknown(ctx, bus);
                flow.resume(self, ctx);
                return done;
            }
            Op::Cps { .. }
            | Op::Bkpt
            | Op::Svc
            | Op::Wfe
            | Op::Wfi
            | Op::Sev
            | Op::Msr { .. }
            | Op::Mrs { .. }
            | Op::Barrier
            | Op::Undefined => {
                flow.publish(self, ctx);
                let spent = self.execute_system(op, pc, ctx);
                flow.resume(self, ctx);
                cost = spent?;
            }
        }
        flow.spend(cost, ctx);
        Ok(())
    }

    /// Finds out what the instruction is, and executes it.
    #[cold]
    #[inline(never)]
    fn execute_unknown(&mut self, ctx: &mut Context, bus: &mut Peripherals) -> Result<(), Fault> {
        let pc = self.pc;
        let op = self.find(pc, ctx)?;
        let mut flow = Flow { pc, now: ctx.now };
        let done = self.execute(op, pc, &mut flow, ctx, bus);
        flow.publish(self, ctx);
        done
    }

    /// The instructions that are rare or end the loop; returns the cost.
    #[inline(never)]
    fn execute_system(&mut self, op: Op, pc: u32, ctx: &mut Context) -> Result<u64, Fault> {
        match op {
            Op::Cps { disable } => {
                if self.is_privileged() {
                    self.primask = disable;
                    self.deadline = Cycles(0);
                }
                Ok(timing::SIMPLE)
            }
            Op::Bkpt if self.halts_at_bkpt => Err(Fault::Halt),
            Op::Bkpt => Err(self.refuse(Kind::Escalated, pc, ctx)),
            Op::Svc => {
                self.call_supervisor(pc, ctx)?;
                Ok(timing::SIMPLE)
            }
            Op::Wfe => {
                if !std::mem::take(&mut self.event) {
                    self.sleep = Sleep::ForEvent;
                    self.deadline = Cycles(0);
                }
                Ok(timing::SLEEP)
            }
            Op::Wfi => {
                self.sleep = Sleep::ForInterrupt;
                self.deadline = Cycles(0);
                Ok(timing::SLEEP)
            }
            Op::Sev => {
                self.event = true;
                Ok(timing::SIMPLE)
            }
            Op::Msr { n, special } => {
                self.pc = pc.wrapping_add(4);
                self.write_special(special, self.reg(n));
                self.deadline = Cycles(0);
                Ok(timing::SYSTEM)
            }
            Op::Mrs { d, special } => {
                self.pc = pc.wrapping_add(4);
                self.set(d, self.read_special(special));
                Ok(timing::SYSTEM)
            }
            Op::Barrier => {
                self.pc = pc.wrapping_add(4);
                Ok(timing::SYSTEM)
            }
            _ => Err(self.refuse(Kind::Undefined, pc, ctx)),
        }
    }

    /// A branch that may return from an exception: BX, POP.
    #[inline(always)]
    fn interwork(
        &mut self,
        target: u32,
        pc: u32,
        flow: &mut Flow,
        ctx: &mut Context,
        bus: &mut Peripherals,
    ) -> Result<(), Fault> {
        if target >> 28 == 0xf && self.ipsr != 0 {
            flow.publish(self, ctx);
            let returned = self.exception_return(target, pc, ctx, bus);
            flow.resume(self, ctx);
            return returned;
        }
        self.jump(target, flow, ctx)
    }

    /// A branch to an address with the Thumb bit.
    #[inline(always)]
    fn jump(&mut self, target: u32, flow: &mut Flow, ctx: &mut Context) -> Result<(), Fault> {
        flow.pc = target & !1;
        if target & 1 == 0 {
            flow.publish(self, ctx);
            self.thumb = false;
            self.refuse(Kind::ArmState, target, ctx);
            return Err(Fault::Target);
        }
        Ok(())
    }

    #[inline(always)]
    fn load_list(
        &mut self,
        from: u32,
        list: u16,
        flow: &mut Flow,
        ctx: &mut Context,
        bus: &mut Peripherals,
    ) -> Result<u32, Fault> {
        let mut address = from;
        let mut left = list;
        while left != 0 {
            let register = left.trailing_zeros() as u8;
            left &= left - 1;
            let value = self.load(address, Word, flow, ctx, bus)?;
            self.set(register, value);
            address = address.wrapping_add(4);
        }
        Ok(address)
    }

    #[inline(always)]
    fn store_list(
        &mut self,
        from: u32,
        list: u16,
        flow: &mut Flow,
        ctx: &mut Context,
        bus: &mut Peripherals,
    ) -> Result<u32, Fault> {
        let mut address = from;
        let mut left = list;
        while left != 0 {
            let register = left.trailing_zeros() as u8;
            left &= left - 1;
            self.store(address, Word, self.reg(register), flow, ctx, bus)?;
            address = address.wrapping_add(4);
        }
        Ok(address)
    }

    #[inline(always)]
    fn shift_by_register(&mut self, shift: Shift, d: u8, m: u8) {
        let value = self.reg(d);
        let by = self.reg(m) & 0xff;
        if by == 0 {
            return self.set_nz(d, value);
        }
        // One bit wider than the register on the side the bits leave, to keep the last one for the carry.
        let (result, carry) = match shift {
            Shift::Left => {
                let wide = u64::from(value).checked_shl(by).unwrap_or(0);
                (wide as u32, (wide >> 32) as u32)
            }
            Shift::Right => {
                let wide = (u64::from(value) << 1).checked_shr(by).unwrap_or(0);
                ((wide >> 1) as u32, wide as u32)
            }
            Shift::Arithmetic => {
                let wide = i64::from(value as i32) << 1 >> by.min(33);
                ((wide >> 1) as u32, wide as u32)
            }
            Shift::Rotate => {
                let rotated = value.rotate_right(by & 31);
                (rotated, rotated >> 31)
            }
        };
        self.c = carry & 1;
        self.set_nz(d, result);
    }
}
