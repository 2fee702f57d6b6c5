//! Which pins can carry which signal, and whether one does (data sheet: "I/O Multiplexing and Considerations").
//!
//! A peripheral whose pin was never switched to it works by itself and reaches nobody, so models ask.

use crate::pins::{Function, PA, PB};
use crate::wires::Wires;

/// A signal of a peripheral at a pin.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Signal {
    /// A pad of a SERCOM.
    Pad {
        /// Which SERCOM.
        sercom: usize,
        /// Which pad.
        pad: u32,
    },
    /// An analogue input.
    Analogue {
        /// ADC0 or ADC1.
        adc: usize,
        /// Which input.
        input: u32,
    },
    /// Transmit (0) or receive (1) of a CAN controller.
    Can {
        /// CAN0 or CAN1.
        controller: usize,
        /// Which signal.
        signal: u32,
    },
}

impl Signal {
    /// Whether a pin is switched to this signal.
    pub(super) fn is_connected(self, wires: &Wires) -> bool {
        let (table, unit, signal) = match self {
            Signal::Pad { sercom, pad } => (PADS, sercom, pad),
            Signal::Analogue { adc, input } => (INPUTS, adc, input),
            Signal::Can { controller, signal } => (CAN, controller, signal),
        };
        let wanted = |place: &&Place| usize::from(place.unit) == unit && u32::from(place.signal) == signal;
        table.iter().filter(wanted).any(|place| wires.pins[place.group].function[place.pin] == Some(place.function))
    }
}

struct Place {
    unit: u8,
    signal: u8,
    group: usize,
    pin: usize,
    function: Function,
}

const fn p(unit: u8, signal: u8, group: usize, pin: usize, function: Function) -> Place {
    Place { unit, signal, group, pin, function }
}

#[rustfmt::skip]
const PADS: &[Place] = &[
    p(0, 0, PA, 4, Function::D),
    p(0, 0, PA, 8, Function::C),
    p(0, 1, PA, 5, Function::D),
    p(0, 1, PA, 9, Function::C),
    p(0, 2, PA, 6, Function::D),
    p(0, 2, PA, 10, Function::C),
    p(0, 3, PA, 7, Function::D),
    p(0, 3, PA, 11, Function::C),
    p(1, 0, PA, 0, Function::D),
    p(1, 0, PA, 16, Function::C),
    p(1, 1, PA, 1, Function::D),
    p(1, 1, PA, 17, Function::C),
    p(1, 2, PA, 18, Function::C),
    p(1, 2, PA, 30, Function::D),
    p(1, 3, PA, 19, Function::C),
    p(1, 3, PA, 31, Function::D),
    p(2, 0, PA, 8, Function::D),
    p(2, 0, PA, 12, Function::C),
    p(2, 1, PA, 9, Function::D),
    p(2, 1, PA, 13, Function::C),
    p(2, 2, PA, 10, Function::D),
    p(2, 2, PA, 14, Function::C),
    p(2, 3, PA, 11, Function::D),
    p(2, 3, PA, 15, Function::C),
    p(3, 0, PA, 16, Function::D),
    p(3, 0, PA, 22, Function::C),
    p(3, 1, PA, 17, Function::D),
    p(3, 1, PA, 23, Function::C),
    p(3, 2, PA, 18, Function::D),
    p(3, 2, PA, 20, Function::D),
    p(3, 2, PA, 24, Function::C),
    p(3, 3, PA, 19, Function::D),
    p(3, 3, PA, 21, Function::D),
    p(3, 3, PA, 25, Function::C),
    p(4, 0, PA, 12, Function::D),
    p(4, 0, PB, 8, Function::D),
    p(4, 0, PB, 12, Function::C),
    p(4, 1, PA, 13, Function::D),
    p(4, 1, PB, 9, Function::D),
    p(4, 1, PB, 13, Function::C),
    p(4, 2, PA, 14, Function::D),
    p(4, 2, PB, 10, Function::D),
    p(4, 2, PB, 14, Function::C),
    p(4, 3, PA, 15, Function::D),
    p(4, 3, PB, 11, Function::D),
    p(4, 3, PB, 15, Function::C),
    p(5, 0, PA, 22, Function::D),
    p(5, 0, PB, 2, Function::D),
    p(5, 0, PB, 16, Function::C),
    p(5, 0, PB, 30, Function::D),
    p(5, 1, PA, 23, Function::D),
    p(5, 1, PB, 3, Function::D),
    p(5, 1, PB, 17, Function::C),
    p(5, 1, PB, 31, Function::D),
    p(5, 2, PA, 20, Function::C),
    p(5, 2, PA, 24, Function::D),
    p(5, 2, PB, 0, Function::D),
    p(5, 2, PB, 22, Function::D),
    p(5, 3, PA, 21, Function::C),
    p(5, 3, PA, 25, Function::D),
    p(5, 3, PB, 1, Function::D),
    p(5, 3, PB, 23, Function::D),
];

#[rustfmt::skip]
const INPUTS: &[Place] = &[
    p(0, 0, PA, 2, Function::B),
    p(0, 1, PA, 3, Function::B),
    p(0, 2, PB, 8, Function::B),
    p(0, 3, PB, 9, Function::B),
    p(0, 4, PA, 4, Function::B),
    p(0, 5, PA, 5, Function::B),
    p(0, 6, PA, 6, Function::B),
    p(0, 7, PA, 7, Function::B),
    p(0, 8, PA, 8, Function::B),
    p(0, 9, PA, 9, Function::B),
    p(0, 10, PA, 10, Function::B),
    p(0, 11, PA, 11, Function::B),
    p(1, 0, PB, 0, Function::B),
    p(1, 1, PB, 1, Function::B),
    p(1, 2, PB, 2, Function::B),
    p(1, 3, PB, 3, Function::B),
    p(1, 4, PB, 8, Function::B),
    p(1, 5, PB, 9, Function::B),
    p(1, 6, PB, 4, Function::B),
    p(1, 7, PB, 5, Function::B),
    p(1, 8, PB, 6, Function::B),
    p(1, 9, PB, 7, Function::B),
    p(1, 10, PA, 8, Function::B),
    p(1, 11, PA, 9, Function::B),
];

#[rustfmt::skip]
const CAN: &[Place] = &[
    p(0, 0, PA, 24, Function::G),
    p(0, 0, PB, 22, Function::G),
    p(0, 1, PA, 25, Function::G),
    p(0, 1, PB, 23, Function::G),
    p(1, 0, PB, 10, Function::G),
    p(1, 0, PB, 14, Function::G),
    p(1, 1, PB, 11, Function::G),
    p(1, 1, PB, 15, Function::G),
];
