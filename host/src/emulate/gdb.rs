//! GDB on an emulated chip, by the `gdbstub` crate: registers, memory, breakpoints, steps.
//!
//! While the chip is halted, so is everything: the other chips, the bus, the robot. When GDB goes, the robot goes on.

use std::convert::Infallible;
use std::net::TcpListener;

use gdbstub::arch::{Arch, Registers};
use gdbstub::common::Signal;
use gdbstub::conn::ConnectionExt;
use gdbstub::stub::run_blocking::{BlockingEventLoop, Event, WaitForStopReasonError};
use gdbstub::stub::{DisconnectReason, GdbStub, SingleThreadStopReason};
use gdbstub::target::ext::base::BaseOps;
use gdbstub::target::ext::base::singlethread::{
    SingleThreadBase, SingleThreadResume, SingleThreadResumeOps, SingleThreadSingleStep, SingleThreadSingleStepOps,
};
use gdbstub::target::ext::breakpoints::{Breakpoints, BreakpointsOps, SwBreakpoint, SwBreakpointOps};
use gdbstub::target::{Target, TargetError, TargetResult};
use samc21::{Chip, Width};

use super::EmulateError;
use super::serve::{Server, serve};

/// Between two looks at what GDB says, µs of emulated time.
const LOOK_US: u64 = 1_000;

/// What GDB is told about the core: the registers of the M profile.
const DESCRIPTION: &str = r#"<?xml version="1.0"?><!DOCTYPE target SYSTEM "gdb-target.dtd"><target version="1.0"><architecture>armv6s-m</architecture><feature name="org.gnu.gdb.arm.m-profile"><reg name="r0" bitsize="32"/><reg name="r1" bitsize="32"/><reg name="r2" bitsize="32"/><reg name="r3" bitsize="32"/><reg name="r4" bitsize="32"/><reg name="r5" bitsize="32"/><reg name="r6" bitsize="32"/><reg name="r7" bitsize="32"/><reg name="r8" bitsize="32"/><reg name="r9" bitsize="32"/><reg name="r10" bitsize="32"/><reg name="r11" bitsize="32"/><reg name="r12" bitsize="32"/><reg name="sp" bitsize="32" type="data_ptr"/><reg name="lr" bitsize="32"/><reg name="pc" bitsize="32" type="code_ptr"/><reg name="xpsr" bitsize="32"/></feature></target>"#;

/// ARMv6-M.
pub enum Armv6m {}

/// R0 to R12, SP, LR, PC, xPSR.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoreRegisters([u32; 17]);

impl Arch for Armv6m {
    type Usize = u32;
    type Registers = CoreRegisters;
    type BreakpointKind = usize;
    type RegId = ();

    fn target_description_xml() -> Option<&'static str> {
        Some(DESCRIPTION)
    }
}

impl Registers for CoreRegisters {
    type ProgramCounter = u32;

    fn pc(&self) -> u32 {
        self.0[15]
    }

    fn gdb_serialize(&self, mut write_byte: impl FnMut(Option<u8>)) {
        self.0.iter().flat_map(|register| register.to_le_bytes()).for_each(|byte| write_byte(Some(byte)));
    }

    fn gdb_deserialize(&mut self, bytes: &[u8]) -> Result<(), ()> {
        let words =
            bytes.chunks_exact(4).map(|word| word.iter().rev().fold(0, |all, byte| all << 8 | u32::from(*byte)));
        if words.len() != self.0.len() {
            return Err(());
        }
        self.0.iter_mut().zip(words).for_each(|(register, word)| *register = word);
        Ok(())
    }
}

/// Waits for GDB on `port` of this machine and lets it control chip number `chip`; when it disconnects, the robot goes
/// on without it.
pub fn debug(server: Server, chip: usize, name: &str, port: u16) -> Result<(), EmulateError> {
    let refused = |source| EmulateError::Listen { port, source };
    let listener = TcpListener::bind(("127.0.0.1", port)).map_err(refused)?;
    println!("{name} waits for GDB: gdb-multiarch IMAGE -ex 'target remote :{port}'");
    let (stream, _) = listener.accept()?;
    stream.set_nodelay(true)?;
    let mut debugged = Debugged { server, chip, step: false, failed: None };
    let connection: Box<dyn ConnectionExt<Error = std::io::Error>> = Box::new(stream);
    let reason = GdbStub::new(connection).run_blocking::<Loop>(&mut debugged);
    let Debugged { mut server, failed, .. } = debugged;
    if let Some(error) = failed {
        return Err(error);
    }
    match reason {
        Ok(DisconnectReason::Kill) => return Ok(()),
        Ok(_) => {}
        Err(error) => return Err(EmulateError::Gdb(error.to_string())),
    }
    server.resume();
    serve(server)
}

/// A chip as GDB sees it.
struct Debugged {
    server: Server,
    chip: usize,
    /// GDB asked for one instruction.
    step: bool,
    /// What ended the emulation; GDB is told that the program has ended.
    failed: Option<EmulateError>,
}

impl Debugged {
    fn chip(&self) -> &Chip {
        &self.server.world().chips()[self.chip]
    }

    fn chip_mut(&mut self) -> &mut Chip {
        &mut self.server.world_mut().chips_mut()[self.chip]
    }

    /// Runs for a look; why GDB should be told something.
    fn turn(&mut self) -> Option<SingleThreadStopReason<u32>> {
        if self.step {
            self.chip_mut().step();
            return Some(SingleThreadStopReason::DoneStep);
        }
        match self.server.turn(LOOK_US) {
            Ok(Some(chip)) if chip == self.chip => Some(SingleThreadStopReason::SwBreak(())),
            Ok(_) if self.server.ended() => Some(SingleThreadStopReason::Exited(0)),
            Ok(_) => None,
            Err(error) => {
                self.failed = Some(error);
                Some(SingleThreadStopReason::Exited(1))
            }
        }
    }
}

struct Loop;

impl BlockingEventLoop for Loop {
    type Target = Debugged;
    type Connection = Box<dyn ConnectionExt<Error = std::io::Error>>;
    type StopReason = SingleThreadStopReason<u32>;

    fn wait_for_stop_reason(
        target: &mut Debugged,
        connection: &mut Self::Connection,
    ) -> Result<Event<Self::StopReason>, WaitForStopReasonError<Infallible, std::io::Error>> {
        target.server.resume();
        loop {
            if let Some(reason) = target.turn() {
                return Ok(Event::TargetStopped(reason));
            }
            if connection.peek().map_err(WaitForStopReasonError::Connection)?.is_some() {
                let byte = connection.read().map_err(WaitForStopReasonError::Connection)?;
                return Ok(Event::IncomingData(byte));
            }
        }
    }

    fn on_interrupt(_target: &mut Debugged) -> Result<Option<Self::StopReason>, Infallible> {
        Ok(Some(SingleThreadStopReason::Signal(Signal::SIGINT)))
    }
}

impl Target for Debugged {
    type Arch = Armv6m;
    type Error = Infallible;

    fn base_ops(&mut self) -> BaseOps<'_, Armv6m, Infallible> {
        BaseOps::SingleThread(self)
    }

    fn support_breakpoints(&mut self) -> Option<BreakpointsOps<'_, Self>> {
        Some(self)
    }
}

impl SingleThreadBase for Debugged {
    fn read_registers(&mut self, registers: &mut CoreRegisters) -> TargetResult<(), Self> {
        let now = self.chip().cpu().registers();
        registers.0[..16].copy_from_slice(&now.r);
        registers.0[16] = now.xpsr;
        Ok(())
    }

    fn write_registers(&mut self, registers: &CoreRegisters) -> TargetResult<(), Self> {
        let cpu = self.chip_mut().cpu_mut();
        let mut now = cpu.registers();
        now.r.copy_from_slice(&registers.0[..16]);
        now.xpsr = registers.0[16];
        cpu.set_registers(&now);
        Ok(())
    }

    fn read_addrs(&mut self, start: u32, data: &mut [u8]) -> TargetResult<usize, Self> {
        for (address, byte) in (start..).zip(data.iter_mut()) {
            *byte = self.chip().peek(address, Width::Byte).ok_or(TargetError::NonFatal)? as u8;
        }
        Ok(data.len())
    }

    fn write_addrs(&mut self, start: u32, data: &[u8]) -> TargetResult<(), Self> {
        if !(0x2000_0000..0x2000_8000).contains(&start) {
            // Flash is written by the firmware alone, and registers have effects.
            return Err(TargetError::NonFatal);
        }
        for (address, byte) in (start..).zip(data) {
            self.chip_mut().sram_mut().write(address, Width::Byte, u32::from(*byte));
        }
        Ok(())
    }

    fn support_resume(&mut self) -> Option<SingleThreadResumeOps<'_, Self>> {
        Some(self)
    }
}

impl SingleThreadResume for Debugged {
    fn resume(&mut self, _signal: Option<Signal>) -> Result<(), Infallible> {
        self.step = false;
        Ok(())
    }

    fn support_single_step(&mut self) -> Option<SingleThreadSingleStepOps<'_, Self>> {
        Some(self)
    }
}

impl SingleThreadSingleStep for Debugged {
    fn step(&mut self, _signal: Option<Signal>) -> Result<(), Infallible> {
        self.step = true;
        Ok(())
    }
}

impl Breakpoints for Debugged {
    fn support_sw_breakpoint(&mut self) -> Option<SwBreakpointOps<'_, Self>> {
        Some(self)
    }
}

impl SwBreakpoint for Debugged {
    fn add_sw_breakpoint(&mut self, address: u32, _kind: usize) -> TargetResult<bool, Self> {
        self.chip_mut().watch(address, true);
        Ok(true)
    }

    fn remove_sw_breakpoint(&mut self, address: u32, _kind: usize) -> TargetResult<bool, Self> {
        self.chip_mut().watch(address, false);
        Ok(true)
    }
}
