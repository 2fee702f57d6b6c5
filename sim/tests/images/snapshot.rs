//! The chips and their bus without the robot, as they were at one moment: to see what follows from many beginnings.

use samc21::machine::SLICE;
use samc21::wires::{Serial, UartByte};
use samc21::{CanBus, Chip, Cycles, Exchange, Machine};
use sarah_sim::emulated::{COORDINATOR, Emulated};

/// SERCOM of the host link.
pub const HOST_SERCOM: usize = 4;
/// A byte on the host link at 1 Mbaud.
const BYTE: u64 = 480;

/// The chips go on, the sensors say what they said last.
#[derive(Clone)]
pub struct Snapshot {
    machine: Machine,
    bus: Since,
}

/// A bus that has been simulated up to a moment.
#[derive(Clone)]
struct Since(Cycles, CanBus);

impl Exchange for Since {
    fn exchange(&mut self, now: Cycles, chips: &mut [Chip]) {
        if now > self.0 {
            self.1.exchange(now, chips);
        }
    }
}

impl Snapshot {
    /// As it is now.
    pub fn of(robot: &mut Emulated) -> Snapshot {
        let now = Cycles(robot.chips().iter().map(|chip| chip.now().0).min().unwrap_or_default() / SLICE * SLICE);
        let mut snapshot =
            Snapshot { machine: Machine::new(robot.chips().to_vec()), bus: Since(now, robot.can_mut().clone()) };
        snapshot.run_until(now);
        snapshot
    }

    /// When it is.
    pub fn now(&self) -> Cycles {
        self.machine.now()
    }

    /// The chips.
    pub fn chips(&self) -> &[Chip] {
        &self.machine.chips
    }

    /// Runs on.
    pub fn run_until(&mut self, until: Cycles) {
        if let Some((chip, stop)) = self.machine.run_until(until, &mut self.bus) {
            panic!("chip {chip}: {stop:?}, {:?}", self.machine.chips[chip].violations());
        }
    }

    /// Bytes from a host, the first of which begins at `from`; when the last ends.
    pub fn host_write(&mut self, from: Cycles, bytes: &[u8]) -> Cycles {
        write(&mut self.machine.chips[COORDINATOR], from, bytes)
    }
}

/// Bytes from a host to a chip, the first of which begins at `from`; when the last ends.
pub fn write(chip: &mut Chip, from: Cycles, bytes: &[u8]) -> Cycles {
    let mut at = from;
    if let Serial::Uart(uart) = &mut chip.wires_mut().serial[HOST_SERCOM] {
        for &byte in bytes {
            at += BYTE;
            uart.to_chip.push_back(UartByte { at, byte, framing_error: false });
        }
    }
    at
}

/// What a chip has sent to the host.
pub fn read(chip: &mut Chip) -> Vec<u8> {
    match &mut chip.wires_mut().serial[HOST_SERCOM] {
        Serial::Uart(uart) => uart.from_chip.drain(..).map(|byte| byte.byte).collect(),
        _ => vec![],
    }
}

/// Nothing is on the line any more.
pub fn hang_up(chip: &mut Chip) {
    chip.wires_mut().serial[HOST_SERCOM] = Serial::Uart(Default::default());
}
