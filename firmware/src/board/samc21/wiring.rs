//! What is connected where: pins of the node boards and of the coordinator, and what each node image is.
//!
//! The three node boards are wired alike; only the knee's has pads. Pins are those of the SAM C21 Xplained Pro's
//! extension headers; two uses of one pin do not compile, and tests compare every pin function with `facts.toml` and
//! this table with `docs/wiring.md`.

use sarah_protocol::bus::{Message, NodeId};
use sarah_protocol::fixed::Q16;
use sarah_protocol::params::ParamSet;

use super::pins::{Function, Pin, pa, pb};
use crate::calibration::{self, ADC_MAX, Calibration};
use crate::node::{self, NodeConfig};

/// One connection.
#[derive(Clone, Copy, Debug)]
pub struct Wire {
    /// What it is for.
    pub role: &'static str,
    /// The pin.
    pub pin: Pin,
    /// What drives or reads it.
    pub function: Function,
    /// The peripheral's signal, as the data sheet names it; empty for a plain input or output.
    pub signal: &'static str,
    /// Header and pin of the board.
    pub header: &'static str,
}

const fn wire(role: &'static str, pin: Pin, function: Function, signal: &'static str, header: &'static str) -> Wire {
    Wire { role, pin, function, signal, header }
}

/// An input of ADC0.
#[derive(Clone, Copy, Debug)]
pub struct Analogue {
    /// Number of the converter's input.
    pub input: u8,
    /// The pin.
    pub pin: Pin,
    /// Always analogue.
    pub function: Function,
}

/// Analogue inputs: two positions, four pads.
pub const INPUTS: usize = 6;
const POSITION_LEFT: Wire = wire("position, left", pb(8), Function::B, "ADC0_AIN2", "EXT1 4");
const POSITION_RIGHT: Wire = wire("position, right", pb(9), Function::B, "ADC0_AIN3", "EXT1 3");
const PAD_LEFT_HEEL: Wire = wire("pad, left heel (knee only)", pa(8), Function::B, "ADC0_AIN8", "EXT2 3");
const PAD_LEFT_TOE: Wire = wire("pad, left toe (knee only)", pa(9), Function::B, "ADC0_AIN9", "EXT2 4");
const PAD_RIGHT_HEEL: Wire = wire("pad, right heel (knee only)", pa(10), Function::B, "ADC0_AIN10", "EXT2 5");
const PAD_RIGHT_TOE: Wire = wire("pad, right toe (knee only)", pa(11), Function::B, "ADC0_AIN11", "EXT2 6");

const fn analogue(wire: Wire, input: u8) -> Analogue {
    Analogue { input, pin: wire.pin, function: wire.function }
}

/// In the order of the scan, which is that of the converter's inputs: left and right position, then the pads as in
/// [`calibration::Counts`].
pub const ANALOGUE: [Analogue; INPUTS] = [
    analogue(POSITION_LEFT, 2),
    analogue(POSITION_RIGHT, 3),
    analogue(PAD_LEFT_HEEL, 8),
    analogue(PAD_LEFT_TOE, 9),
    analogue(PAD_RIGHT_HEEL, 10),
    analogue(PAD_RIGHT_TOE, 11),
];

/// Motor pulses \[left, right\]: compare channels 0 and 1 of TCC0.
pub const PWM: [Wire; 2] = [
    wire("motor pulses, left", pb(30), Function::E, "TCC0_WO0", "EXT2 7"),
    wire("motor pulses, right", pb(31), Function::E, "TCC0_WO1", "EXT2 8"),
];
/// Brake coils \[left, right\], high releases: compare channels 2 and 3 of TCC0.
pub const BRAKE: [Wire; 2] = [
    wire("brake coil, left (high releases)", pa(20), Function::F, "TCC0_WO6", "EXT1 5"),
    wire("brake coil, right (high releases)", pa(21), Function::F, "TCC0_WO7", "EXT1 6"),
];
/// Direction \[left, right\], high towards larger positions.
pub const DIRECTION: [Wire; 2] = [
    wire("direction, left (high: larger position)", pb(16), Function::Output, "", "EXT2 9"),
    wire("direction, right (high: larger position)", pb(17), Function::Output, "", "EXT2 10"),
];
/// CAN transmit and receive, to the transceiver on the board.
pub const CAN: [Wire; 2] = [
    wire("CAN transmit", pa(24), Function::G, "CAN0_TX", "CAN"),
    wire("CAN receive", pa(25), Function::G, "CAN0_RX", "CAN"),
];
/// The board's LED, low lights it.
pub const LED: Wire = wire("LED (low lights)", pa(15), Function::Output, "", "on board");
/// The watch crystal; its pins are the oscillator's once it runs.
pub const CRYSTAL: [Pin; 2] = [pa(0), pa(1)];
/// Serial wire debug; left alone.
pub const DEBUG: [Pin; 2] = [pa(30), pa(31)];

/// Everything wired on a node board.
pub const NODE: [Wire; 15] = [
    POSITION_LEFT,
    POSITION_RIGHT,
    PAD_LEFT_HEEL,
    PAD_LEFT_TOE,
    PAD_RIGHT_HEEL,
    PAD_RIGHT_TOE,
    PWM[0],
    PWM[1],
    BRAKE[0],
    BRAKE[1],
    DIRECTION[0],
    DIRECTION[1],
    CAN[0],
    CAN[1],
    LED,
];

/// Host link: the debugger's virtual serial port, SERCOM4 pads 2 and 3.
pub const HOST_TX: Wire = wire("host link, transmit", pb(10), Function::D, "SERCOM4_PAD2", "debug USB");
/// See [`HOST_TX`].
pub const HOST_RX: Wire = wire("host link, receive", pb(11), Function::D, "SERCOM4_PAD3", "debug USB");
/// IMU on SPI, SERCOM1: data to the chip.
pub const IMU_MISO: Wire = wire("IMU, SPI MISO", pa(16), Function::C, "SERCOM1_PAD0", "EXT1 17");
/// IMU: chip select, low selects; driven by software.
pub const IMU_SELECT: Wire = wire("IMU, select (low)", pa(17), Function::Output, "", "EXT1 15");
/// IMU: data to the sensor.
pub const IMU_MOSI: Wire = wire("IMU, SPI MOSI", pa(18), Function::C, "SERCOM1_PAD2", "EXT1 16");
/// IMU: clock.
pub const IMU_SCK: Wire = wire("IMU, SPI clock", pa(19), Function::C, "SERCOM1_PAD3", "EXT1 18");
/// IMU: data ready.
pub const IMU_READY: Wire = wire("IMU, data ready", pb(14), Function::A, "EIC_EXTINT14", "EXT1 9");

/// Everything wired on the coordinator's board.
pub const COORDINATOR: [Wire; 10] =
    [HOST_TX, HOST_RX, IMU_MISO, IMU_SELECT, IMU_MOSI, IMU_SCK, IMU_READY, CAN[0], CAN[1], LED];

const fn no_pin_twice(wires: &[Wire]) -> bool {
    let mut i = 0;
    while i < wires.len() {
        let pin = wires[i].pin;
        let mut j = i + 1;
        while j < wires.len() {
            if pin.is(wires[j].pin) {
                return false;
            }
            j += 1;
        }
        if pin.is(CRYSTAL[0]) || pin.is(CRYSTAL[1]) || pin.is(DEBUG[0]) || pin.is(DEBUG[1]) {
            return false;
        }
        i += 1;
    }
    true
}

const _: () = assert!(no_pin_twice(&NODE) && no_pin_twice(&COORDINATOR));

/// What one node image is.
#[derive(Clone, Copy, Debug)]
pub struct NodeBoard {
    /// Which node.
    pub id: NodeId,
    /// Its joints, left and right.
    pub joints: &'static str,
    /// Counts and units.
    pub calibration: Calibration,
    /// Joints brake before they pass ± this, m or rad.
    pub end_stop: Q16,
    /// Positions beyond ± this cannot be.
    pub plausible: Q16,
    /// Pads are connected.
    pub pads: bool,
}

impl NodeBoard {
    const fn new(id: NodeId, joints: &'static str, calibration: Calibration, range: (Q16, Q16)) -> NodeBoard {
        let (end_stop, plausible) = range;
        let mut i = 0;
        while i < 2 {
            // A broken wire reads full scale, and that must be recognised as impossible.
            let (low, high) = (calibration.position[i].value(0), calibration.position[i].value(ADC_MAX));
            assert!(low.0 < -plausible.0 && high.0 > plausible.0);
            i += 1;
        }
        assert!(0 < end_stop.0 && end_stop.0 < plausible.0);
        NodeBoard { id, joints, calibration, end_stop, plausible, pads: matches!(id, NodeId::Knee) }
    }

    /// What the node is born with.
    pub fn config(&self, default: ParamSet, boot_nonce: u16) -> NodeConfig {
        NodeConfig { default, boot_nonce, end_stop: self.end_stop, plausible: self.plausible }
    }
}

/// The image `knee`.
pub const KNEE: NodeBoard =
    NodeBoard::new(NodeId::Knee, "linear actuators of the legs", calibration::KNEE, node::knee::STROKE);
/// The image `hip`.
pub const HIP: NodeBoard = NodeBoard::new(NodeId::Hip, "hip flexion", calibration::HIP, node::swing::HIP_SWING);
/// The image `abductor`.
pub const ABDUCTOR: NodeBoard =
    NodeBoard::new(NodeId::Abductor, "hip abduction", calibration::ABDUCTOR, node::swing::ABDUCTOR_SWING);

/// Identifiers a node takes from the bus: everything but answers and states.
pub const NODE_ACCEPTS: &[(u16, u16)] = &[(0x010, 0x05f)];
/// Identifiers the coordinator takes: the knee's flags, answers, states.
pub const COORDINATOR_ACCEPTS: &[(u16, u16)] = &[(0x020, 0x020), (0x060, 0x06f), (0x100, 0x10f)];

/// Whether a board with these filters hears a message.
pub fn accepts(filters: &[(u16, u16)], message: &Message) -> bool {
    let id = message.encode().id;
    filters.iter().any(|(low, high)| (*low..=*high).contains(&id))
}

#[cfg(test)]
mod tests {
    use super::super::pins::Group;
    use super::super::regs::facts;
    use super::*;
    use sarah_protocol::bus::{Gait, GaitEvent, HaltReason, Motion, Side, Stage, Staged, Status};

    fn name(pin: Pin) -> String {
        let group = if pin.group == Group::A { 'A' } else { 'B' };
        format!("P{group}{:02}", pin.number)
    }

    #[test]
    fn every_pin_can_carry_its_signal() {
        for wire in NODE.iter().chain(&COORDINATOR).filter(|wire| !wire.signal.is_empty()) {
            let function = (b'A' + wire.function as u8) as char;
            let pins = facts::pins(wire.signal);
            assert!(pins.contains(&(name(wire.pin).as_str(), function)), "{wire:?}: {pins:?}");
        }
    }

    #[test]
    fn the_scan_reads_its_inputs_in_their_order() {
        for (pair, wire) in ANALOGUE.windows(2).zip(&NODE) {
            assert!(pair[0].input < pair[1].input);
            assert_eq!(wire.signal, format!("ADC0_AIN{}", pair[0].input));
        }
        assert_eq!(NODE[INPUTS - 1].signal, format!("ADC0_AIN{}", ANALOGUE[INPUTS - 1].input));
    }

    #[test]
    fn the_document_has_this_table() {
        let document = include_str!("../../../../docs/wiring.md");
        for wire in NODE.iter().chain(&COORDINATOR) {
            let signal = if wire.signal.is_empty() { "–" } else { wire.signal };
            let row = format!("| {} | {} | {} | {} |", wire.role, wire.header, name(wire.pin), signal);
            assert!(document.contains(&row), "docs/wiring.md lacks\n{row}");
        }
    }

    #[test]
    fn everyone_hears_what_is_meant_for_them() {
        let gait = Gait { event: GaitEvent::Beat, swing: Side::Left, cycle: 0, generation: 0 };
        let stage = Stage { generation: 1, params: *crate::default_params().values() };
        let for_nodes = [
            Message::Halt(HaltReason::Disarmed),
            Message::Gait(gait),
            Message::Motion(Motion::default()),
            Message::Activate(1),
            Message::Stage(stage),
        ];
        assert!(for_nodes.iter().all(|message| accepts(NODE_ACCEPTS, message)));
        let status = Status {
            position: [Q16::ZERO; 2],
            loads: [0; 4],
            phase: 0,
            factor: Q16::ZERO,
            steps: 0,
            cycle: 0,
            applied: 0,
            staged: None,
            limits: 0,
            boot_nonce: 0,
        };
        for node in NodeId::ALL {
            let answers = [
                Message::Staged(node, Staged { generation: 1, result: Ok(()) }),
                Message::Status(node, status),
                Message::Gait(gait),
            ];
            assert!(answers.iter().all(|message| accepts(COORDINATOR_ACCEPTS, message)));
            assert!(!accepts(NODE_ACCEPTS, &answers[0]) && !accepts(NODE_ACCEPTS, &answers[1]));
        }
        assert!(!accepts(COORDINATOR_ACCEPTS, &for_nodes[2]));
    }
}
