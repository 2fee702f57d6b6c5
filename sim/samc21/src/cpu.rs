//! The Cortex-M0+: registers, and the loop that fetches and executes.

pub(crate) mod decode;
mod exceptions;
mod execute;
mod memory;
mod nvic;
mod operands;
mod scs;
mod systick;
pub mod timing;

use crate::context::Context;
use crate::peripherals::Peripherals;
use crate::time::Cycles;
use crate::violation::Kind;
use crate::width::Width;

use decode::Op;
use nvic::Nvic;
use systick::SysTick;

/// Bit of xPSR that says the stack was realigned on exception entry.
const XPSR_ALIGNED: u32 = 1 << 9;
/// Thumb state, in EPSR.
const XPSR_T: u32 = 1 << 24;

/// Whether the core executes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Sleep {
    Awake,
    /// Until an exception that PRIMASK alone may hold back.
    ForInterrupt,
    /// Until the event register is set.
    ForEvent,
    /// Lockup: until reset or NMI.
    LockedUp,
}

/// Why an instruction did not complete. Whatever there was to report has been reported.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Fault {
    /// A HardFault that returns to the instruction.
    Instruction,
    /// A HardFault before the instruction that `pc` points at already.
    Target,
    /// BKPT while breakpoints halt, or a watched address.
    Halt,
}

/// What changes with every instruction. While the loop runs it is here and nowhere else, so that the compiler can keep it
/// in registers; [`Cpu`] and [`Context`] have it whenever anything but the loop looks.
#[derive(Clone, Copy)]
struct Flow {
    /// The next instruction.
    pc: u32,
    now: Cycles,
}

impl Flow {
    /// To where everybody else looks.
    #[inline(always)]
    fn publish(self, cpu: &mut Cpu, ctx: &mut Context) {
        (cpu.pc, ctx.now) = (self.pc, self.now);
    }

    /// Back from there.
    #[inline(always)]
    fn resume(&mut self, cpu: &Cpu, ctx: &Context) {
        (self.pc, self.now) = (cpu.pc, ctx.now);
    }

    /// Goes on at `target` if `taken`; the cost.
    #[inline(always)]
    fn branch(&mut self, taken: bool, target: u32) -> u64 {
        if !taken {
            return timing::SIMPLE;
        }
        self.pc = target;
        timing::BRANCH
    }

    #[inline(always)]
    fn spend(&mut self, cycles: u64, ctx: &Context) {
        self.now += cycles * u64::from(ctx.clocks.cpu_ticks);
    }
}

/// Attribution of time to instructions, chosen when the loop is compiled so that it costs nothing when unused.
pub(crate) trait Observer {
    /// The instruction at `pc` took `ticks` of 48 MHz.
    fn executed(&mut self, pc: u32, ticks: u64);
}

/// Observes nothing.
pub(crate) struct Unobserved;

impl Observer for Unobserved {
    #[inline(always)]
    fn executed(&mut self, _pc: u32, _ticks: u64) {}
}

/// Registers as a debugger shows them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Registers {
    /// R0 to R12, SP, LR, PC (the next instruction to execute).
    pub r: [u32; 16],
    /// APSR, IPSR and EPSR together.
    pub xpsr: u32,
    /// Main stack pointer.
    pub msp: u32,
    /// Process stack pointer.
    pub psp: u32,
    /// Interrupts held back.
    pub primask: bool,
    /// CONTROL: nPRIV and SPSEL.
    pub control: u32,
}

/// The processor core with its interrupt controller and system timer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Cpu {
    /// R0 to R14; SP is the one in use. The last element is unused, PC is `pc`.
    r: [u32; 16],
    pc: u32,
    /// The last result, with its sign: N is bit 63, Z is set when the low word is zero.
    nz: u64,
    /// 0 or 1.
    c: u32,
    /// V is bit 31.
    v: u32,
    thumb: bool,
    /// The stack pointer not in use.
    other_sp: u32,
    uses_psp: bool,
    unprivileged: bool,
    primask: bool,
    /// Exception number of the code that runs, 0 in Thread mode.
    ipsr: u8,
    event: bool,
    sleep: Sleep,
    vtor: u32,
    scr: u32,
    nvic: Nvic,
    systick: SysTick,
    /// The loop leaves for [`Cpu::service`] at this time.
    deadline: Cycles,
    halts_at_bkpt: bool,
    /// The watched instruction that is executed next time instead of halting.
    passing: Option<u32>,
    instructions: u64,
    exceptions: u64,
}

impl Cpu {
    /// A core that has not come out of reset.
    pub(crate) fn new() -> Self {
        Cpu {
            r: [0; 16],
            pc: 0,
            nz: 1,
            c: 0,
            v: 0,
            thumb: true,
            other_sp: 0,
            uses_psp: false,
            unprivileged: false,
            primask: false,
            ipsr: 0,
            event: false,
            sleep: Sleep::Awake,
            vtor: 0,
            scr: 0,
            nvic: Nvic::default(),
            systick: SysTick::default(),
            deadline: Cycles(0),
            halts_at_bkpt: false,
            passing: None,
            instructions: 0,
            exceptions: 0,
        }
    }

    /// Takes the reset exception: MSP and PC from the vector table at 0 (ARMv6-M ARM, B1.5.5).
    pub(crate) fn reset(&mut self, ctx: &Context) {
        let vector = |address| ctx.nvm.read(address, Width::Word).unwrap_or(0);
        let entry = vector(4);
        *self = Cpu {
            halts_at_bkpt: self.halts_at_bkpt,
            instructions: self.instructions,
            exceptions: self.exceptions,
            ..Cpu::new()
        };
        self.r[13] = vector(0) & !3;
        self.r[14] = u32::MAX;
        self.pc = entry & !1;
        self.thumb = entry & 1 != 0;
    }

    /// Instructions executed since power-on.
    pub fn instructions(&self) -> u64 {
        self.instructions
    }

    /// Exceptions taken since power-on.
    pub fn exceptions(&self) -> u64 {
        self.exceptions
    }

    /// Whether the core waits in WFI or WFE, or is locked up.
    pub fn is_asleep(&self) -> bool {
        self.sleep != Sleep::Awake
    }

    /// Whether the core sleeps and does not wake by itself before `until`.
    #[inline]
    pub(crate) fn sleeps_until(&self, until: Cycles) -> bool {
        self.is_asleep() && self.deadline.0 != 0 && self.systick.next_event() >= until
    }

    /// Whether a fault inside HardFault or NMI has stopped the core.
    pub fn is_locked_up(&self) -> bool {
        self.sleep == Sleep::LockedUp
    }

    /// Whether BKPT halts, as with a debugger attached, or faults.
    pub fn set_halts_at_bkpt(&mut self, halts: bool) {
        self.halts_at_bkpt = halts;
    }

    /// Registers as a debugger shows them.
    pub fn registers(&self) -> Registers {
        let mut r = self.r;
        r[15] = self.pc;
        let (msp, psp) = match self.uses_psp {
            true => (self.other_sp, self.r[13]),
            false => (self.r[13], self.other_sp),
        };
        let control = u32::from(self.uses_psp) << 1 | u32::from(self.unprivileged);
        Registers { r, xpsr: self.xpsr(), msp, psp, primask: self.primask, control }
    }

    /// Sets R0 to R12, SP, LR, PC and the flags of xPSR; everything else of `registers` is ignored.
    pub fn set_registers(&mut self, registers: &Registers) {
        self.r = registers.r;
        self.r[13] &= !3;
        self.pc = registers.r[15] & !1;
        self.set_flags(registers.xpsr);
    }

    /// Executes until the deadline; `true` when BKPT halted it.
    #[inline(never)]
    pub(crate) fn run<O: Observer>(
        &mut self,
        ctx: &mut Context,
        peripherals: &mut Peripherals,
        observer: &mut O,
    ) -> bool {
        let mut flow = Flow { pc: self.pc, now: ctx.now };
        let mut executed = 0;
        let halted = loop {
            let (pc, before) = (flow.pc, flow.now);
            if before >= self.deadline {
                break false;
            }
            let op = match ctx.nvm.code.at(pc) {
                Some(&op) => {
                    flow.now += ctx.nvm.fetch(pc) * u64::from(ctx.clocks.cpu_ticks);
                    op
                }
                None => *ctx.sram.code.at(pc).unwrap_or(&Op::Unknown),
            };
            if let Err(fault) = self.execute(op, pc, &mut flow, ctx, peripherals) {
                flow.publish(self, ctx);
                let halts = self.stopped_by(fault, pc, ctx, peripherals);
                flow.resume(self, ctx);
                if halts {
                    break true;
                }
            }
            executed += 1;
            observer.executed(pc, flow.now - before);
        };
        flow.publish(self, ctx);
        self.instructions += executed;
        halted
    }

    /// What the instruction at `pc` is that was not decoded yet or is watched.
    fn find(&mut self, pc: u32, ctx: &mut Context) -> Result<Op, Fault> {
        let watched = ctx.nvm.code.is_watched(pc) || ctx.sram.code.is_watched(pc);
        if watched && self.passing.take() != Some(pc) {
            return Err(Fault::Halt);
        }
        let first = self.fetch_half(pc, ctx)?;
        let second = if decode::is_wide(first) { self.fetch_half(pc.wrapping_add(2), ctx)? } else { 0 };
        let op = decode::decode(pc, first, second);
        ctx.nvm.code.keep(pc, op);
        ctx.sram.code.keep(pc, op);
        Ok(op)
    }

    /// Ends an instruction that faulted; `true` if execution halts instead.
    #[cold]
    fn stopped_by(&mut self, fault: Fault, pc: u32, ctx: &mut Context, peripherals: &mut Peripherals) -> bool {
        if fault != Fault::Target {
            self.pc = pc;
        }
        if fault == Fault::Halt {
            self.passing = Some(pc);
            return true;
        }
        self.hard_fault(ctx, peripherals);
        false
    }

    /// A fault that is not about a bus access.
    #[cold]
    fn refuse(&self, kind: Kind, pc: u32, ctx: &mut Context) -> Fault {
        ctx.pc = pc;
        ctx.report(kind);
        Fault::Instruction
    }

    fn xpsr(&self) -> u32 {
        let flags = u32::from(self.negative()) << 31 | u32::from(self.zero()) << 30 | self.c << 29 | self.v >> 31 << 28;
        flags | if self.thumb { XPSR_T } else { 0 } | u32::from(self.ipsr)
    }

    fn set_flags(&mut self, xpsr: u32) {
        self.nz = u64::from(xpsr >> 31) << 63 | u64::from(!xpsr & 1 << 30);
        self.c = xpsr >> 29 & 1;
        self.v = xpsr << 3;
    }

    fn is_privileged(&self) -> bool {
        !self.unprivileged || self.ipsr != 0
    }

    /// Puts the other stack pointer into use.
    fn use_psp(&mut self, psp: bool) {
        if psp != self.uses_psp {
            std::mem::swap(&mut self.r[13], &mut self.other_sp);
            self.uses_psp = psp;
        }
    }
}
