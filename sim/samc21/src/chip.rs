//! One microcontroller: core, peripherals and what lies between, run against the clock.

use crate::context::Context;
use crate::cpu::{Cpu, Unobserved};
use crate::image::Image;
use crate::nvm::Nvm;
use crate::peripherals::Peripherals;
use crate::profile::Profile;
use crate::reset::Reset;
use crate::sram::Sram;
use crate::time::Cycles;
use crate::violation::Violation;
use crate::width::Width;
use crate::wires::Wires;

/// Why a run ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Stop {
    /// The time asked for has come.
    Time,
    /// A violation was reported, and stopping at the first one was asked for.
    Violation,
    /// A watched address ([`Chip::watch`]), which the next run passes; or BKPT, and halting at it was asked for. PC is
    /// there.
    Breakpoint,
}

/// An ATSAMC21J18A. A clone is a snapshot: it continues exactly as the original does.
#[derive(Clone, Debug)]
pub struct Chip {
    cpu: Cpu,
    peripherals: Peripherals,
    context: Context,
    asleep: u64,
    profile: Option<Box<Profile>>,
}

impl Chip {
    /// A chip with `image` flashed, just powered on.
    pub fn new(image: &Image) -> Self {
        let mut chip = Chip {
            cpu: Cpu::new(),
            peripherals: Peripherals::default(),
            context: Context::default(),
            asleep: 0,
            profile: None,
        };
        chip.flash(image);
        chip.reset(Reset::PowerOn);
        chip
    }

    /// Writes an image into non-volatile memory, as a debugger does. Everything it does not cover stays.
    pub fn flash(&mut self, image: &Image) {
        for (address, bytes) in &image.segments {
            self.context.nvm.load(*address, bytes);
        }
        self.context.symbols = image.symbols.clone();
    }

    /// Resets the chip now. Non-volatile memory, the wires' outer side and the counters of this emulator stay.
    pub fn reset(&mut self, cause: Reset) {
        self.context.reset(cause);
        self.peripherals.reset(cause, &mut self.context);
        self.context.wires.changed = true;
        self.cpu.reset(&self.context);
    }

    /// Runs until `until`. The last instruction may end a few cycles later.
    pub fn run_until(&mut self, until: Cycles) -> Stop {
        if self.sleeps_until(until) {
            self.asleep += until.since(self.context.now);
            self.context.now = self.context.now.max(until);
            return Stop::Time;
        }
        while self.context.now < until {
            if let Some(stop) = self.turn(until) {
                return stop;
            }
        }
        Stop::Time
    }

    /// Whether the chip sleeps and nothing can wake it before `until`.
    #[inline]
    fn sleeps_until(&self, until: Cycles) -> bool {
        let context = &self.context;
        self.cpu.sleeps_until(until)
            && self.peripherals.next_event() >= until
            && !(context.attention || context.stop || context.wires.changed || context.reset_request.is_some())
    }

    /// Executes one instruction, or sleeps until the next event.
    pub fn step(&mut self) -> Stop {
        let (instructions, now) = (self.cpu.instructions(), self.context.now);
        while self.cpu.instructions() == instructions {
            if let Some(stop) = self.turn(self.context.now + 1) {
                return stop;
            }
            if self.cpu.is_asleep() && self.context.now != now {
                break;
            }
        }
        Stop::Time
    }

    /// What is due, then instructions or sleep up to the next thing due.
    fn turn(&mut self, until: Cycles) -> Option<Stop> {
        if std::mem::take(&mut self.context.stop) {
            return Some(Stop::Violation);
        }
        if let Some(cause) = self.context.reset_request.take() {
            self.reset(cause);
        }
        if std::mem::take(&mut self.context.wires.changed) {
            self.peripherals.notice(&mut self.context);
        }
        if self.peripherals.next_event() <= self.context.now {
            self.peripherals.advance(&mut self.context);
            // A watchdog that expires resets before the next instruction.
            if self.context.reset_request.is_some() {
                return None;
            }
        }
        self.cpu.service(until, &mut self.context, &mut self.peripherals);
        if self.cpu.is_asleep() {
            let wake = self.cpu.deadline();
            let ticks = wake.since(self.context.now);
            self.asleep += ticks;
            self.context.now += ticks;
            return None;
        }
        let (context, peripherals) = (&mut self.context, &mut self.peripherals);
        let halted = match &mut self.profile {
            None => self.cpu.run(context, peripherals, &mut Unobserved),
            Some(profile) => self.cpu.run(context, peripherals, profile.as_mut()),
        };
        halted.then_some(Stop::Breakpoint)
    }

    /// Now.
    pub fn now(&self) -> Cycles {
        self.context.now
    }

    /// Ticks of 48 MHz since power-on spent in WFI, WFE or lockup.
    pub fn asleep(&self) -> u64 {
        self.asleep
    }

    /// Ticks of 48 MHz since power-on spent executing.
    pub fn awake(&self) -> u64 {
        self.context.now.0 - self.asleep
    }

    /// The processor core.
    pub fn cpu(&self) -> &Cpu {
        &self.cpu
    }

    /// The processor core, for a debugger.
    pub fn cpu_mut(&mut self) -> &mut Cpu {
        &mut self.cpu
    }

    /// The peripheral models.
    pub fn peripherals(&self) -> &Peripherals {
        &self.peripherals
    }

    /// Wires to the outside.
    pub fn wires(&self) -> &Wires {
        &self.context.wires
    }

    /// Wires to the outside, to change. The models look at them again before the next instruction.
    pub fn wires_mut(&mut self) -> &mut Wires {
        self.context.wires.changed = true;
        &mut self.context.wires
    }

    /// Non-volatile memory.
    pub fn nvm(&self) -> &Nvm {
        &self.context.nvm
    }

    /// Non-volatile memory, to change as a debugger does.
    pub fn nvm_mut(&mut self) -> &mut Nvm {
        &mut self.context.nvm
    }

    /// SRAM.
    pub fn sram(&self) -> &Sram {
        &self.context.sram
    }

    /// SRAM, to change as a debugger does.
    pub fn sram_mut(&mut self) -> &mut Sram {
        &mut self.context.sram
    }

    /// What the peripheral models share: lines, clocks, findings.
    pub fn context(&self) -> &Context {
        &self.context
    }

    /// What the peripheral models share, to change from a test or a model's outside.
    pub fn context_mut(&mut self) -> &mut Context {
        &mut self.context
    }

    /// Reads memory without side effects: SRAM and non-volatile memory only.
    pub fn peek(&self, address: u32, width: Width) -> Option<u32> {
        match Sram::contains(address) {
            true => Some(self.context.sram.read(address, width)),
            false => self.context.nvm.read(address, width),
        }
    }

    /// Changes memory without side effects: SRAM and non-volatile memory only.
    pub fn poke(&mut self, address: u32, data: &[u8]) {
        match Sram::contains(address) {
            true => {
                for (address, byte) in (address..).zip(data) {
                    self.context.sram.write(address, Width::Byte, u32::from(*byte));
                }
            }
            false => self.context.nvm.load(address, data),
        }
    }

    /// Reads through the bus, side effects included, as a debugger does.
    pub fn bus_read(&mut self, address: u32, width: Width) -> u32 {
        let value = match self.peek(address, width) {
            Some(value) => value,
            None => self.peripherals.read(address, width, &mut self.context),
        };
        self.context.bus_error = false;
        value
    }

    /// Writes to SRAM, the flash's page buffer or a peripheral through the bus, as a debugger does.
    pub fn bus_write(&mut self, address: u32, width: Width, value: u32) {
        match Sram::contains(address) {
            true => self.context.sram.write(address, width, value),
            false if Nvm::contains(address) => self.peripherals.store_nvm(address, width, value, &mut self.context),
            false => self.peripherals.write(address, width, value, &mut self.context),
        }
        self.context.bus_error = false;
    }

    /// Findings about the firmware so far.
    pub fn violations(&self) -> &[Violation] {
        self.context.violations()
    }

    /// Whether runs end at the first violation.
    pub fn stop_at_violation(&mut self, stop: bool) {
        self.context.stop_at_violation = stop;
    }

    /// Starts attributing awake time to functions, or stops and returns what was found.
    pub fn set_profiling(&mut self, on: bool) -> Option<Profile> {
        let profile = on.then(|| Box::new(Profile::new(self.context.symbols.clone())));
        std::mem::replace(&mut self.profile, profile).map(|profile| *profile)
    }

    /// Stops before the instruction at `pc`, in flash or SRAM, or no longer; costs nothing elsewhere. What the chip reads
    /// there is unchanged, and so is its timing; what it writes there is watched too.
    pub fn watch(&mut self, pc: u32, on: bool) {
        self.context.nvm.code.watch(pc, on);
        self.context.sram.code.watch(pc, on);
    }

    /// Awake time by function so far, while profiling.
    pub fn profile(&self) -> Option<&Profile> {
        self.profile.as_deref()
    }
}
