//! What every peripheral model shares: time, memory, interrupt lines, DMA requests, clocks, wires, findings.

use crate::clocks::Clocks;
use crate::dma_trigger::DmaTrigger;
use crate::irq::Irq;
use crate::nvm::{Nvm, ReadMode};
use crate::reset::Reset;
use crate::sram::Sram;
use crate::symbols::Symbols;
use crate::time::Cycles;
use crate::unit::Unit;
use crate::violation::{Access, Kind, Violation};
use crate::wires::Wires;

/// Findings kept per chip; later ones are only counted.
const VIOLATIONS_KEPT: usize = 1000;

/// The chip around a peripheral model. Handed to every call of a model.
#[derive(Clone, Debug, Default)]
pub struct Context {
    /// Now.
    pub now: Cycles,
    /// SRAM, for bus masters (CAN message RAM, DMA).
    pub sram: Sram,
    /// Flash, RWWEE and the auxiliary rows, for NVMCTRL.
    pub nvm: Nvm,
    /// Running clocks: set by the clock models, read by all.
    pub clocks: Clocks,
    /// The outside world.
    pub wires: Wires,
    /// Functions of the image, for findings.
    pub symbols: Symbols,
    pub(crate) lines: u32,
    /// Units that hold [`Irq::System`], by the bit of their number.
    system: u64,
    /// The CPU must look at lines, calendar and requests before its next instruction.
    pub(crate) attention: bool,
    pub(crate) nmi: bool,
    pub(crate) pc: u32,
    pub(crate) access: Option<Access>,
    pub(crate) unit: Option<Unit>,
    pub(crate) bus_error: bool,
    pub(crate) reset_request: Option<Reset>,
    pub(crate) stop_at_violation: bool,
    pub(crate) stop: bool,
    dma_triggers: u64,
    violations: Vec<Violation>,
    violation_count: u64,
}

impl Context {
    /// Sets the level of an interrupt line into the NVIC. Call it whenever INTFLAG or INTEN changes.
    #[inline]
    pub fn set_irq(&mut self, irq: Irq, asserted: bool) {
        let lines = if asserted { self.lines | irq.bit() } else { self.lines & !irq.bit() };
        self.attention |= lines != self.lines;
        self.lines = lines;
    }

    /// Sets `unit`'s share of the line that the clock, power and access controllers have in common.
    pub fn set_system_irq(&mut self, unit: Unit, asserted: bool) {
        let bit = 1 << unit as u32;
        self.system = if asserted { self.system | bit } else { self.system & !bit };
        self.set_irq(Irq::System, self.system != 0);
    }

    /// Pends the non-maskable interrupt.
    pub fn pend_nmi(&mut self) {
        self.nmi = true;
        self.attention = true;
    }

    /// Raises a DMA request; it stays until the DMA controller takes it.
    pub fn trigger_dma(&mut self, trigger: DmaTrigger) {
        self.dma_triggers |= trigger.bit();
    }

    /// Withdraws a DMA request whose reason is gone.
    pub fn withdraw_dma(&mut self, trigger: DmaTrigger) {
        self.dma_triggers &= !trigger.bit();
    }

    /// The DMA controller has taken these requests. Whoever still has a reason raises its request anew when served.
    pub(crate) fn take_dma_triggers(&mut self, taken: u64) {
        self.dma_triggers &= !taken;
    }

    /// Pending DMA requests, by the bit of their number.
    pub fn dma_triggers(&self) -> u64 {
        self.dma_triggers
    }

    /// Holds the bus for `ticks` of 48 MHz: [`Self::now`] moves on at once, and the CPU resumes then.
    #[inline]
    pub fn stall(&mut self, ticks: u64) {
        self.now += ticks;
    }

    /// Ends the access in progress with a bus error: the CPU takes a HardFault.
    pub fn fail_access(&mut self) {
        self.bus_error = true;
    }

    /// Asks for a reset at the end of the current instruction.
    pub fn request_reset(&mut self, cause: Reset) {
        self.reset_request = Some(cause);
        self.attention = true;
    }

    /// What a reset undoes here: lines, requests, clocks, flash timing, the chip's side of the wires.
    pub(crate) fn reset(&mut self, cause: Reset) {
        if cause.loses_sram() {
            self.sram.lose();
        }
        self.nvm.set_timing(0, ReadMode::NoMissPenalty);
        self.nvm.hold_rwwee(Cycles(0));
        self.clocks = Clocks::default();
        self.wires.release();
        (self.lines, self.system) = (0, 0);
        self.nmi = false;
        self.bus_error = false;
        self.reset_request = None;
        self.dma_triggers = 0;
    }

    /// The bus access in progress, `None` while a model acts by itself.
    pub fn access(&self) -> Option<Access> {
        self.access
    }

    /// Records that the firmware broke a rule in the access in progress, or, outside an access, now.
    #[cold]
    pub fn report(&mut self, kind: Kind) {
        self.stop |= self.stop_at_violation;
        self.attention |= self.stop;
        self.violation_count += 1;
        if self.violations.len() < VIOLATIONS_KEPT {
            self.violations.push(Violation {
                kind,
                access: self.access,
                unit: self.unit.map(Unit::name),
                pc: self.pc,
                symbol: self.symbols.describe(self.pc),
                at: self.now,
            });
        }
    }

    /// Findings so far, oldest first; at most the first thousand.
    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    /// Number of findings so far, those no longer kept included.
    pub fn violation_count(&self) -> u64 {
        self.violation_count
    }

    /// Removes and returns the findings.
    pub fn take_violations(&mut self) -> Vec<Violation> {
        self.violation_count = 0;
        std::mem::take(&mut self.violations)
    }
}
