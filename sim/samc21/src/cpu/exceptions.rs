//! Entry to and return from exceptions, sleep and lockup (ARMv6-M ARM, B1.5 "Exception model").

use super::nvic::{HARD_FAULT, NMI, SVCALL, SYSTICK};
use super::scs::{SEVONPEND, SLEEPONEXIT};
use super::{Cpu, Fault, Sleep, XPSR_ALIGNED, XPSR_T, timing};
use crate::context::Context;
use crate::peripherals::Peripherals;
use crate::time::Cycles;
use crate::violation::Kind;

/// Returns to a handler, to a thread on the main stack, to a thread on the process stack.
const RETURN_HANDLER: u32 = 0xffff_fff1;
const RETURN_MAIN: u32 = 0xffff_fff9;
const RETURN_PROCESS: u32 = 0xffff_fffd;

/// Where a locked-up core appears to be.
const LOCKUP_PC: u32 = 0xffff_fffe;

impl Cpu {
    /// Between instructions: takes in what has happened outside, wakes up, takes the most urgent exception, and sets
    /// how long the loop may run undisturbed (at most to `until`).
    pub(crate) fn service(&mut self, until: Cycles, ctx: &mut Context, peripherals: &mut Peripherals) {
        self.systick.set_ticks(u64::from(ctx.clocks.cpu_ticks), ctx.now);
        self.take_in(ctx);
        if !self.thumb && self.sleep == Sleep::Awake {
            ctx.pc = self.pc;
            ctx.report(Kind::ArmState);
            self.hard_fault(ctx, peripherals);
        }
        if let Some(exception) = self.nvic.most_urgent() {
            let priority = self.nvic.priority(exception);
            if priority < self.nvic.execution_priority(self.primask) {
                if self.sleep != Sleep::LockedUp || exception == NMI {
                    self.sleep = Sleep::Awake;
                    self.enter(ctx, peripherals);
                }
            } else if self.sleep == Sleep::ForInterrupt && priority < self.nvic.active_priority() {
                // PRIMASK holds back the entry, not the wake-up.
                self.sleep = Sleep::Awake;
            }
        }
        if self.sleep == Sleep::ForEvent && std::mem::take(&mut self.event) {
            self.sleep = Sleep::Awake;
        }
        self.deadline = until.min(peripherals.next_event()).min(self.systick.next_event());
        if ctx.attention || ctx.wires.changed {
            self.deadline = Cycles(0);
        }
    }

    /// When the loop must be left next.
    pub(crate) fn deadline(&self) -> Cycles {
        self.deadline
    }

    /// Lines, SysTick and NMI into the NVIC.
    fn take_in(&mut self, ctx: &mut Context) {
        ctx.attention = false;
        if std::mem::take(&mut ctx.nmi) {
            self.nvic.pend(NMI);
        }
        self.sample_lines(ctx);
        self.catch_up_systick(ctx);
    }

    pub(super) fn sample_lines(&mut self, ctx: &Context) {
        let pended = self.nvic.sample(ctx.lines);
        self.event |= pended && self.scr & SEVONPEND != 0;
    }

    pub(super) fn catch_up_systick(&mut self, ctx: &Context) {
        if self.systick.advance(ctx.now) {
            self.event |= !self.nvic.is_pending(SYSTICK) && self.scr & SEVONPEND != 0;
            self.nvic.pend(SYSTICK);
        }
    }

    /// Takes the most urgent exception: there is one, and it preempts.
    ///
    /// Which one is decided after stacking, so one that arrives meanwhile and is more urgent goes first (late arrival).
    fn enter(&mut self, ctx: &mut Context, peripherals: &mut Peripherals) {
        let stacked = self.push_frame(ctx, peripherals);
        self.spend(timing::ENTRY - timing::ACCESS, ctx);
        if peripherals.next_event() <= ctx.now {
            peripherals.advance(ctx);
        }
        self.take_in(ctx);
        let exception = match (stacked, self.nvic.most_urgent()) {
            (Err(_), _) if self.nvic.active_priority() <= -1 => return self.lock_up(ctx),
            (Err(_), _) | (Ok(()), None) => HARD_FAULT,
            (Ok(()), Some(exception)) => exception,
        };
        let link = match (self.ipsr, self.uses_psp) {
            (0, false) => RETURN_MAIN,
            (0, true) => RETURN_PROCESS,
            _ => RETURN_HANDLER,
        };
        self.start_handler(exception, link, ctx, peripherals);
    }

    /// From stacked context to the first instruction of a handler (ARMv6-M ARM, B1.5.6 "ExceptionTaken"). The callers
    /// have spent all of its time but the access that reads the vector.
    fn start_handler(&mut self, exception: u8, link: u32, ctx: &mut Context, peripherals: &mut Peripherals) {
        self.exceptions += 1;
        self.r[14] = link;
        self.use_psp(false);
        self.nvic.activate(exception);
        self.ipsr = exception;
        self.event = true;
        let at = self.vtor.wrapping_add(4 * u32::from(exception));
        match self.load_word(at, ctx, peripherals) {
            Ok(vector) => {
                self.pc = vector & !1;
                self.thumb = vector & 1 != 0;
                if !self.thumb {
                    ctx.pc = self.pc;
                    ctx.report(Kind::ArmState);
                    self.hard_fault(ctx, peripherals);
                }
            }
            Err(_) => self.hard_fault(ctx, peripherals),
        }
    }

    /// Takes a HardFault at once, or locks up where that is impossible. `pc` is what it returns to.
    #[cold]
    pub(super) fn hard_fault(&mut self, ctx: &mut Context, peripherals: &mut Peripherals) {
        self.deadline = Cycles(0);
        if self.nvic.active_priority() <= -1 {
            return self.lock_up(ctx);
        }
        self.nvic.pend(HARD_FAULT);
        self.enter(ctx, peripherals);
    }

    #[cold]
    fn lock_up(&mut self, ctx: &mut Context) {
        ctx.pc = self.pc;
        ctx.report(Kind::Lockup);
        self.pc = LOCKUP_PC;
        self.thumb = true;
        self.sleep = Sleep::LockedUp;
    }

    /// SVC: pends SVCall, or escalates where it could not be taken.
    pub(super) fn call_supervisor(&mut self, pc: u32, ctx: &mut Context) -> Result<(), Fault> {
        if self.nvic.priority(SVCALL) >= self.nvic.execution_priority(self.primask) {
            return Err(self.refuse(Kind::Escalated, pc, ctx));
        }
        self.nvic.pend(SVCALL);
        self.deadline = Cycles(0);
        Ok(())
    }

    /// Stacks R0 to R3, R12, LR, return address and xPSR on the stack in use, aligned to 8 bytes.
    fn push_frame(&mut self, ctx: &mut Context, peripherals: &mut Peripherals) -> Result<(), Fault> {
        let realigned = self.r[13] & 4 != 0;
        let frame = self.r[13].wrapping_sub(32) & !7;
        self.r[13] = frame;
        let xpsr = self.xpsr() | if realigned { XPSR_ALIGNED } else { 0 };
        let [r0, r1, r2, r3] = [self.r[0], self.r[1], self.r[2], self.r[3]];
        let words = [r0, r1, r2, r3, self.r[12], self.r[14], self.pc, xpsr];
        let now = ctx.now;
        for (address, word) in (0..8).map(|i| frame.wrapping_add(4 * i)).zip(words) {
            self.store_word(address, word, ctx, peripherals)?;
        }
        // The entry's figure includes the stores.
        ctx.now = now;
        Ok(())
    }

    /// A branch to 0xf...._.... in a handler (ARMv6-M ARM, B1.5.8 "Exception return behavior").
    pub(super) fn exception_return(
        &mut self,
        link: u32,
        pc: u32,
        ctx: &mut Context,
        peripherals: &mut Peripherals,
    ) -> Result<(), Fault> {
        let returning = self.ipsr;
        let nested = self.nvic.others_active(returning);
        let wrong = match link {
            RETURN_HANDLER if !nested => Some("to a handler, but no other is active"),
            RETURN_MAIN | RETURN_PROCESS if nested => Some("to the thread, but a handler is active"),
            RETURN_HANDLER | RETURN_MAIN | RETURN_PROCESS => None,
            _ => Some("no such EXC_RETURN value"),
        };
        if let Some(why) = wrong.or((!self.nvic.is_active(returning)).then_some("of an exception not active")) {
            return Err(self.refuse(Kind::ExceptionReturn(why), pc, ctx));
        }
        self.nvic.deactivate(returning);
        self.event = true;
        self.deadline = Cycles(0);
        self.take_in(ctx);
        if let Some(next) = self.nvic.most_urgent()
            && self.nvic.priority(next) < self.nvic.execution_priority(self.primask)
        {
            // Tail-chaining: the frame stays where it is for the next handler.
            self.spend(timing::TAIL_CHAIN - timing::ACCESS, ctx);
            self.start_handler(next, link, ctx, peripherals);
            return Ok(());
        }
        self.spend(timing::RETURN, ctx);
        let stack_is_psp = link == RETURN_PROCESS;
        self.ipsr = 0;
        self.use_psp(stack_is_psp);
        self.pop_frame(link, pc, ctx, peripherals)?;
        if self.ipsr == 0 && self.scr & SLEEPONEXIT != 0 {
            self.sleep = Sleep::ForInterrupt;
        }
        Ok(())
    }

    fn pop_frame(&mut self, link: u32, pc: u32, ctx: &mut Context, peripherals: &mut Peripherals) -> Result<(), Fault> {
        let frame = self.r[13];
        let now = ctx.now;
        let mut words = [0; 8];
        for (address, word) in (0..8).map(|i| frame.wrapping_add(4 * i)).zip(&mut words) {
            *word = self.load_word(address, ctx, peripherals)?;
        }
        // The return's figure includes the loads.
        ctx.now = now;
        let [r0, r1, r2, r3, r12, r14, return_address, xpsr] = words;
        let to_handler = xpsr & 0x3f != 0;
        if to_handler != (link == RETURN_HANDLER) {
            return Err(self.refuse(Kind::ExceptionReturn("stacked mode differs from EXC_RETURN"), pc, ctx));
        }
        self.r[..4].copy_from_slice(&[r0, r1, r2, r3]);
        self.r[12] = r12;
        self.r[14] = r14;
        self.r[13] = frame.wrapping_add(32) | if xpsr & XPSR_ALIGNED != 0 { 4 } else { 0 };
        self.pc = return_address & !1;
        self.set_flags(xpsr);
        self.ipsr = (xpsr & 0x3f) as u8;
        self.thumb = xpsr & XPSR_T != 0;
        Ok(())
    }

    #[inline(always)]
    pub(super) fn spend(&self, cycles: u64, ctx: &mut Context) {
        ctx.now += cycles * u64::from(ctx.clocks.cpu_ticks);
    }
}
