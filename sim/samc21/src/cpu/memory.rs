//! The CPU's side of the bus.

use super::{Cpu, Fault, Flow, timing};
use crate::context::Context;
use crate::nvm::Nvm;
use crate::peripherals::Peripherals;
use crate::sram::Sram;
use crate::time::Cycles;
use crate::unit::on_io_bus;
use crate::violation::{Access, Kind};
use crate::width::Width;

/// 4 KiB of system control registers: SysTick, NVIC, SCB, debug (ARMv6-M ARM, B3.1).
const SYSTEM_CONTROL: u32 = 0xe000_e000;

impl Cpu {
    /// A load by an instruction. Its address must be aligned (ARMv6-M ARM, A3.2).
    #[inline(always)]
    pub(super) fn load(
        &mut self,
        address: u32,
        width: Width,
        flow: &mut Flow,
        ctx: &mut Context,
        peripherals: &mut Peripherals,
    ) -> Result<u32, Fault> {
        if width.aligns(address) {
            if Sram::contains(address) {
                flow.spend(timing::ACCESS, ctx);
                return Ok(ctx.sram.read(address, width));
            }
            if let Some(value) = ctx.nvm.read_flash(address, width) {
                let waits = ctx.nvm.fetch(address);
                flow.spend(timing::ACCESS + waits, ctx);
                return Ok(value);
            }
        }
        flow.publish(self, ctx);
        let value = self.load_elsewhere(address, width, ctx, peripherals);
        flow.resume(self, ctx);
        value
    }

    /// A store by an instruction. Its address must be aligned (ARMv6-M ARM, A3.2).
    #[inline(always)]
    pub(super) fn store(
        &mut self,
        address: u32,
        width: Width,
        value: u32,
        flow: &mut Flow,
        ctx: &mut Context,
        peripherals: &mut Peripherals,
    ) -> Result<(), Fault> {
        if Sram::contains(address) && width.aligns(address) {
            flow.spend(timing::ACCESS, ctx);
            ctx.sram.write(address, width, value);
            return Ok(());
        }
        flow.publish(self, ctx);
        let done = self.store_elsewhere(address, width, value, ctx, peripherals);
        flow.resume(self, ctx);
        done
    }

    /// A word that an exception reads.
    pub(super) fn load_word(
        &mut self,
        address: u32,
        ctx: &mut Context,
        peripherals: &mut Peripherals,
    ) -> Result<u32, Fault> {
        let mut flow = Flow { pc: self.pc, now: ctx.now };
        let value = self.load(address, Width::Word, &mut flow, ctx, peripherals);
        flow.publish(self, ctx);
        value
    }

    /// A word that an exception writes.
    pub(super) fn store_word(
        &mut self,
        address: u32,
        value: u32,
        ctx: &mut Context,
        peripherals: &mut Peripherals,
    ) -> Result<(), Fault> {
        let mut flow = Flow { pc: self.pc, now: ctx.now };
        let done = self.store(address, Width::Word, value, &mut flow, ctx, peripherals);
        flow.publish(self, ctx);
        done
    }

    #[inline(never)]
    fn load_elsewhere(
        &mut self,
        address: u32,
        width: Width,
        ctx: &mut Context,
        peripherals: &mut Peripherals,
    ) -> Result<u32, Fault> {
        let ticks = u64::from(ctx.clocks.cpu_ticks);
        ctx.pc = self.pc.wrapping_sub(2);
        if !on_io_bus(address) {
            ctx.now += timing::ACCESS * ticks;
        }
        if width.aligns(address) && Nvm::contains(address) {
            ctx.now = ctx.now.max(ctx.nvm.readable_from(address));
            ctx.now += ctx.nvm.fetch_any(address) * ticks;
            return ctx.nvm.read(address, width).ok_or(Fault::Instruction);
        }
        if width.aligns(address) && address & !0xfff == SYSTEM_CONTROL {
            let access = Access { address, width, written: None };
            self.check_system_access(access, ctx)?;
            return Ok(self.read_system(access, ctx));
        }
        let value = peripherals.read(address, width, ctx);
        self.after_access(ctx)?;
        Ok(value)
    }

    #[inline(never)]
    fn store_elsewhere(
        &mut self,
        address: u32,
        width: Width,
        value: u32,
        ctx: &mut Context,
        peripherals: &mut Peripherals,
    ) -> Result<(), Fault> {
        ctx.pc = self.pc.wrapping_sub(2);
        if !on_io_bus(address) {
            ctx.now += timing::ACCESS * u64::from(ctx.clocks.cpu_ticks);
        }
        if width.aligns(address) && address & !0xfff == SYSTEM_CONTROL {
            let access = Access { address, width, written: Some(value) };
            self.check_system_access(access, ctx)?;
            self.write_system(access, value, ctx);
            self.deadline = Cycles(0);
            return Ok(());
        }
        if width.aligns(address) && Nvm::contains(address) {
            peripherals.store_nvm(address, width, value, ctx);
        } else {
            peripherals.write(address, width, value, ctx);
        }
        self.after_access(ctx)
    }

    /// A halfword of an instruction.
    pub(super) fn fetch_half(&self, address: u32, ctx: &mut Context) -> Result<u16, Fault> {
        let value = match Sram::contains(address) {
            true => Some(ctx.sram.read(address, Width::Half)),
            false => ctx.nvm.read(address, Width::Half),
        };
        value.map(|half| half as u16).ok_or_else(|| {
            ctx.access = Some(Access { address, width: Width::Half, written: None });
            let fault = self.refuse(Kind::Unmapped, self.pc, ctx);
            ctx.access = None;
            fault
        })
    }

    /// Only privileged code reaches the system control space.
    fn check_system_access(&self, access: Access, ctx: &mut Context) -> Result<(), Fault> {
        if self.is_privileged() {
            return Ok(());
        }
        ctx.access = Some(access);
        let fault = self.refuse(Kind::WriteProtected, ctx.pc, ctx);
        ctx.access = None;
        Err(fault)
    }

    fn after_access(&mut self, ctx: &mut Context) -> Result<(), Fault> {
        if ctx.attention || ctx.wires.changed {
            self.deadline = Cycles(0);
        }
        if std::mem::take(&mut ctx.bus_error) { Err(Fault::Instruction) } else { Ok(()) }
    }
}
