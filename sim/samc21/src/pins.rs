//! Pins: who drives them, what they show, and which peripheral has them (data sheet: "I/O Multiplexing and
//! Considerations", "PORT – I/O Pin Controller").

use crate::wires::{Pwm, Wires};

/// Index of group PA.
pub const PA: usize = 0;
/// Index of group PB.
pub const PB: usize = 1;

/// A peripheral function of a pin (PORT.PMUX).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Function {
    /// External interrupts.
    A,
    /// Analogue.
    B,
    /// SERCOM.
    C,
    /// SERCOM, alternative.
    D,
    /// TC, TCC.
    E,
    /// TCC.
    F,
    /// Communication.
    G,
    /// Clocks, comparators.
    H,
    /// Configurable logic.
    I,
}

impl Function {
    /// From its code in PMUX; `None` if reserved.
    pub const fn from_code(code: u32) -> Option<Function> {
        use Function::*;
        const ALL: [Function; 9] = [A, B, C, D, E, F, G, H, I];
        if (code as usize) < ALL.len() { Some(ALL[code as usize]) } else { None }
    }
}

/// One group of 32 port pins, PA or PB.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Pins {
    /// Pins that the outside drives.
    pub driven: u32,
    /// The level the outside drives onto them.
    pub level: u32,
    /// Pins with a resistor on the board.
    pub resistor: u32,
    /// The level it pulls to.
    pub resistor_level: u32,
    /// Pins that the chip drives (PORT.DIR).
    pub output: u32,
    /// The level the chip drives onto them.
    pub output_level: u32,
    /// Pins with the chip's own, weaker pull resistor (PINCFG.PULLEN).
    pub pull: u32,
    /// The level it pulls to.
    pub pull_level: u32,
    /// Function of each pin that belongs to a peripheral (PINCFG.PMUXEN).
    pub function: [Option<Function>; 32],
}

impl Pins {
    /// The level on the wire: of those who drive or pull it, the strongest decides. A floating pin reads low.
    pub const fn seen(&self) -> u32 {
        let pulled = self.resistor & self.resistor_level | !self.resistor & self.pull & self.pull_level;
        let outside = self.driven & self.level | !self.driven & pulled;
        self.output & self.output_level | !self.output & outside
    }

    /// Pins that nothing drives or pulls. What a peripheral drives is not looked at.
    pub const fn floating(&self) -> u32 {
        !(self.output | self.driven | self.resistor | self.pull)
    }

    /// Drives pin `pin` from outside.
    pub fn drive(&mut self, pin: u8, high: bool) {
        self.driven |= 1 << pin;
        self.level = self.level & !(1 << pin) | u32::from(high) << pin;
    }

    /// Solders a resistor to pin `pin` that pulls it up or down.
    pub fn solder(&mut self, pin: u8, up: bool) {
        self.resistor |= 1 << pin;
        self.resistor_level = self.resistor_level & !(1 << pin) | u32::from(up) << pin;
    }

    /// The chip lets go, as in reset.
    pub(crate) fn release(&mut self) {
        (self.output, self.output_level, self.pull, self.pull_level) = (0, 0, 0, 0);
        self.function = [None; 32];
    }
}

/// A waveform output of a TCC on a pin.
struct Waveform {
    group: usize,
    pin: u8,
    function: Function,
    tcc: usize,
    output: usize,
}

const fn w(group: usize, pin: u8, function: Function, tcc: usize, output: usize) -> Waveform {
    Waveform { group, pin, function, tcc, output }
}

/// Where the waveform outputs of TCC0 to TCC2 can come out.
#[rustfmt::skip]
const WAVEFORMS: &[Waveform] = &[
    w(PA, 0, Function::E, 2, 0),
    w(PA, 1, Function::E, 2, 1),
    w(PA, 4, Function::E, 0, 0),
    w(PA, 5, Function::E, 0, 1),
    w(PA, 6, Function::E, 1, 0),
    w(PA, 7, Function::E, 1, 1),
    w(PA, 8, Function::E, 0, 0),
    w(PA, 8, Function::F, 1, 2),
    w(PA, 9, Function::E, 0, 1),
    w(PA, 9, Function::F, 1, 3),
    w(PA, 10, Function::E, 1, 0),
    w(PA, 10, Function::F, 0, 2),
    w(PA, 11, Function::E, 1, 1),
    w(PA, 11, Function::F, 0, 3),
    w(PA, 12, Function::E, 2, 0),
    w(PA, 12, Function::F, 0, 6),
    w(PA, 13, Function::E, 2, 1),
    w(PA, 13, Function::F, 0, 7),
    w(PA, 14, Function::F, 0, 4),
    w(PA, 15, Function::F, 0, 5),
    w(PA, 16, Function::E, 2, 0),
    w(PA, 16, Function::F, 0, 6),
    w(PA, 17, Function::E, 2, 1),
    w(PA, 17, Function::F, 0, 7),
    w(PA, 18, Function::F, 0, 2),
    w(PA, 19, Function::F, 0, 3),
    w(PA, 20, Function::F, 0, 6),
    w(PA, 21, Function::F, 0, 7),
    w(PA, 22, Function::F, 0, 4),
    w(PA, 23, Function::F, 0, 5),
    w(PA, 24, Function::F, 1, 2),
    w(PA, 25, Function::F, 1, 3),
    w(PA, 30, Function::E, 1, 0),
    w(PA, 31, Function::E, 1, 1),
    w(PB, 10, Function::F, 0, 4),
    w(PB, 11, Function::F, 0, 5),
    w(PB, 12, Function::F, 0, 6),
    w(PB, 13, Function::F, 0, 7),
    w(PB, 16, Function::F, 0, 4),
    w(PB, 17, Function::F, 0, 5),
    w(PB, 30, Function::E, 0, 0),
    w(PB, 30, Function::F, 1, 2),
    w(PB, 31, Function::E, 0, 1),
    w(PB, 31, Function::F, 1, 3),
];

impl Wires {
    /// Share of the time that a pin is high: 0 or 1, or the duty cycle of the TCC that has it; `None` if it floats.
    pub fn share_high(&self, group: usize, pin: u8) -> Option<f32> {
        let pins = self.pins.get(group)?;
        let pwm = pins.function.get(usize::from(pin)).copied().flatten().and_then(|f| self.waveform(group, pin, f));
        if let Some(pwm) = pwm.filter(|pwm| pwm.driven) {
            return Some(pwm.duty);
        }
        let floats = pins.floating() >> pin & 1 != 0;
        (!floats).then_some(if pins.seen() >> pin & 1 != 0 { 1.0 } else { 0.0 })
    }

    fn waveform(&self, group: usize, pin: u8, function: Function) -> Option<Pwm> {
        let here = |w: &&Waveform| (w.group, w.pin, w.function) == (group, pin, function);
        WAVEFORMS.iter().find(here).map(|w| self.pwm[w.tcc][w.output])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strongest_driver_decides() {
        let mut pins = Pins { pull: 0b1111, pull_level: 0b1111, ..Pins::default() };
        pins.solder(1, false);
        pins.drive(2, false);
        pins.output = 0b1000;
        assert_eq!(pins.seen() & 0b1111, 0b0001);
        assert_eq!(pins.floating() & 0b11111, 0b10000);
    }

    #[test]
    fn a_timers_pin_shows_its_duty_cycle_and_a_floating_one_nothing() {
        let mut wires = Wires::default();
        assert_eq!(wires.share_high(PB, 30), None);
        wires.pwm[0][0] = Pwm { duty: 0.25, period: 2400, driven: true, faulted: false };
        assert_eq!(wires.share_high(PB, 30), None);
        wires.pins[PB].function[30] = Some(Function::E);
        assert_eq!(wires.share_high(PB, 30), Some(0.25));
    }

    #[test]
    fn a_brake_pin_in_reset_shows_the_boards_resistor() {
        let mut wires = Wires::default();
        wires.pins[PA].solder(20, false);
        assert_eq!(wires.share_high(PA, 20), Some(0.0));
    }
}
