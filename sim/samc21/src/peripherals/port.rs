//! PORT: the pins (data sheet: "PORT – I/O Pin Controller"). Two groups, on bridge B and on the single-cycle I/O bus.
//!
//! A pin reads its level while its input buffer is on (PINCFG.INEN), else low. Events are registers only.

use super::Model;
use super::registers::{Map, Part, Register};
use crate::context::Context;
use crate::pins::Function;
use crate::violation::Kind;
use crate::width::Width;

/// From group to group.
const STRIDE: u32 = 0x80;
const GROUPS: usize = 2;

const DIR: u32 = 0x00;
const DIRCLR: u32 = 0x04;
const DIRSET: u32 = 0x08;
const DIRTGL: u32 = 0x0c;
const OUT: u32 = 0x10;
const OUTCLR: u32 = 0x14;
const OUTSET: u32 = 0x18;
const OUTTGL: u32 = 0x1c;
const IN: u32 = 0x20;
const CTRL: u32 = 0x24;
const WRCONFIG: u32 = 0x28;
const EVCTRL: u32 = 0x2c;
const PMUX: u32 = 0x30;
const PINCFG: u32 = 0x40;

const MAP: Map = Map(&[
    Register::new(OUTSET, Width::Word, !0),
    Register::new(OUTCLR, Width::Word, !0),
    Register::new(DIR, Width::Word, !0),
    Register::new(DIRCLR, Width::Word, !0),
    Register::new(DIRSET, Width::Word, !0),
    Register::new(DIRTGL, Width::Word, !0),
    Register::new(OUT, Width::Word, !0),
    Register::new(OUTTGL, Width::Word, !0),
    Register::read_only(IN, Width::Word),
    Register::new(CTRL, Width::Word, !0),
    Register::write_only(WRCONFIG, Width::Word, 0xdf47_ffff),
    Register::new(EVCTRL, Width::Word, !0),
    Register::new(PMUX, Width::Byte, 0xff).times(16),
    Register::new(PINCFG, Width::Byte, 0x47).times(32),
]);

const PMUXEN: u8 = 1 << 0;
const INEN: u8 = 1 << 1;
const PULLEN: u8 = 1 << 2;

/// Pins of the 64-pin package: PA00 to PA25, PA27, PA28, PA30, PA31; PB00 to PB17, PB22, PB23, PB30, PB31.
const BONDED: [u32; GROUPS] = [0xdbff_ffff, 0xc0c3_ffff];

/// One group's registers.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
struct Group {
    dir: u32,
    out: u32,
    ctrl: u32,
    evctrl: u32,
    pmux: [u8; 16],
    pincfg: [u8; 32],
}

/// Pin controller.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Port {
    groups: [Group; GROUPS],
}

impl Model for Port {
    fn read(&mut self, offset: u32, width: Width, ctx: &mut Context) -> u32 {
        let Some((group, index)) = self.group(offset, ctx) else { return 0 };
        MAP.read(offset % STRIDE, width, ctx).map_or(0, |part| {
            part.of(match part.register {
                DIR | DIRCLR | DIRSET | DIRTGL => group.dir,
                OUT | OUTCLR | OUTSET | OUTTGL => group.out,
                IN => ctx.wires.pins[index].seen() & group.with(INEN),
                CTRL => group.ctrl,
                EVCTRL => group.evctrl,
                PMUX => group.pmux[part.index].into(),
                _ => group.pincfg[part.index].into(),
            })
        })
    }

    fn write(&mut self, offset: u32, width: Width, value: u32, ctx: &mut Context) {
        let Some((group, index)) = self.group(offset, ctx) else { return };
        let Some(part) = MAP.write(offset % STRIDE, width, value, ctx) else { return };
        let ones = part.ones();
        match part.register {
            DIR => group.dir = part.onto(group.dir),
            DIRCLR => group.dir &= !ones,
            DIRSET => group.dir |= ones,
            DIRTGL => group.dir ^= ones,
            OUT => group.out = part.onto(group.out),
            OUTCLR => group.out &= !ones,
            OUTSET => group.out |= ones,
            OUTTGL => group.out ^= ones,
            CTRL => group.ctrl = part.onto(group.ctrl),
            WRCONFIG => group.configure(&part, width, ctx),
            EVCTRL => group.evctrl = part.onto(group.evctrl),
            PMUX => group.pmux[part.index] = ones as u8,
            _ => group.pincfg[part.index] = ones as u8,
        }
        if group.dir & !BONDED[index] != 0 {
            ctx.report(Kind::Misuse("an output that this package has no pin for"));
        }
        group.publish(index, matches!(part.register, WRCONFIG | PMUX | PINCFG), ctx);
    }
}

impl Port {
    fn group(&mut self, offset: u32, ctx: &mut Context) -> Option<(&mut Group, usize)> {
        let index = (offset / STRIDE) as usize;
        match self.groups.get_mut(index) {
            Some(group) => Some((group, index)),
            None => {
                ctx.report(Kind::NoRegister);
                None
            }
        }
    }
}

impl Group {
    /// Pins whose configuration has `bit`.
    fn with(&self, bit: u8) -> u32 {
        self.pincfg.iter().rev().fold(0, |mask, config| mask << 1 | u32::from(config & bit != 0))
    }

    /// Configures many pins with one word.
    fn configure(&mut self, part: &Part, width: Width, ctx: &mut Context) {
        if width != Width::Word {
            // The parts that are missing count as zero, so nothing at all would be selected.
            ctx.report(Kind::WrongWidth);
            return;
        }
        let word = part.ones();
        let first = if word >> 31 != 0 { 16 } else { 0 };
        for pin in (0..16).filter(|pin| word >> pin & 1 != 0).map(|pin| first + pin) {
            if word >> 28 & 1 != 0 {
                let (shift, mux) = (4 * (pin % 2), &mut self.pmux[pin / 2]);
                *mux = *mux & !(0xf << shift) | ((word >> 24 & 0xf) as u8) << shift;
            }
            if word >> 30 & 1 != 0 {
                self.pincfg[pin] = (word >> 16) as u8 & 0x47;
            }
        }
    }

    fn function(&self, pin: usize) -> Option<Function> {
        let mux = self.pmux[pin / 2] >> (4 * (pin % 2)) & 0xf;
        (self.pincfg[pin] & PMUXEN != 0).then_some(mux).and_then(|code| Function::from_code(code.into()))
    }

    /// Shows the outside what the pins do.
    fn publish(&self, index: usize, reconfigured: bool, ctx: &mut Context) {
        let before = ctx.wires.pins[index];
        let pins = &mut ctx.wires.pins[index];
        if reconfigured {
            pins.function = std::array::from_fn(|pin| self.function(pin));
            if (0..32).any(|pin| self.pincfg[pin] & PMUXEN != 0 && pins.function[pin].is_none()) {
                ctx.report(Kind::ReservedValue);
            }
        }
        let pins = &mut ctx.wires.pins[index];
        let peripheral = pins.function.iter().rev().fold(0, |mask, function| mask << 1 | u32::from(function.is_some()));
        (pins.output, pins.output_level) = (self.dir & !peripheral, self.out);
        (pins.pull, pins.pull_level) = (self.with(PULLEN) & !pins.output, self.out);
        ctx.wires.changed |= ctx.wires.pins[index] != before;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pins::{PA, PB};

    fn port() -> (Port, Context) {
        (Port::default(), Context::default())
    }

    #[test]
    fn set_clear_and_toggle_change_their_bits_alone() {
        let (mut port, mut ctx) = port();
        port.write(DIRSET, Width::Word, 0b1111, &mut ctx);
        port.write(OUTSET, Width::Word, 0b0110, &mut ctx);
        port.write(OUTCLR, Width::Word, 0b0010, &mut ctx);
        port.write(OUTTGL, Width::Word, 0b1100, &mut ctx);
        assert_eq!(port.read(OUT, Width::Word, &mut ctx), 0b1000);
        assert_eq!(ctx.wires.pins[PA].seen(), 0b1000);
    }

    #[test]
    fn after_reset_every_pin_floats() {
        let (_, ctx) = port();
        assert_eq!(ctx.wires.pins.map(|pins| pins.floating()), [!0, !0]);
    }

    #[test]
    fn a_pull_resistor_pulls_where_out_says_and_an_outside_one_is_stronger() {
        let (mut port, mut ctx) = port();
        ctx.wires.pins[PB].solder(3, false);
        port.write(STRIDE + OUTSET, Width::Word, 0b1100, &mut ctx);
        for pin in 2..4 {
            port.write(STRIDE + PINCFG + pin, Width::Byte, u32::from(INEN | PULLEN), &mut ctx);
        }
        assert_eq!(port.read(STRIDE + IN, Width::Word, &mut ctx), 0b0100);
    }

    #[test]
    fn an_input_reads_only_while_its_buffer_is_on() {
        let (mut port, mut ctx) = port();
        ctx.wires.pins[PA].drive(28, true);
        assert_eq!(port.read(IN, Width::Word, &mut ctx), 0);
        port.write(PINCFG + 28, Width::Byte, u32::from(INEN), &mut ctx);
        assert_eq!(port.read(IN, Width::Word, &mut ctx), 1 << 28);
    }

    #[test]
    fn a_pin_given_to_a_peripheral_is_no_longer_driven_by_port() {
        let (mut port, mut ctx) = port();
        port.write(DIRSET, Width::Word, 1 << 20, &mut ctx);
        port.write(PMUX + 10, Width::Byte, 5, &mut ctx);
        port.write(PINCFG + 20, Width::Byte, PMUXEN.into(), &mut ctx);
        assert_eq!((ctx.wires.pins[PA].output, ctx.wires.pins[PA].function[20]), (0, Some(Function::F)));
    }

    #[test]
    fn one_word_configures_many_pins() {
        let (mut port, mut ctx) = port();
        port.write(WRCONFIG, Width::Word, 1 << 31 | 1 << 30 | 6 << 24 | 1 << 28 | 1 << 16 | 0x300, &mut ctx);
        let pins = &ctx.wires.pins[PA];
        assert_eq!(
            [pins.function[24], pins.function[25], pins.function[26]],
            [Some(Function::G), Some(Function::G), None]
        );
        assert_eq!(port.read(PMUX + 12, Width::Byte, &mut ctx), 0x66);
    }

    #[test]
    fn a_reserved_function_or_missing_pin_is_reported() {
        let (mut port, mut ctx) = port();
        port.write(PMUX, Width::Byte, 0x0f, &mut ctx);
        port.write(PINCFG, Width::Byte, PMUXEN.into(), &mut ctx);
        port.write(DIRSET, Width::Word, 1 << 26, &mut ctx);
        assert_eq!(ctx.violations()[0].kind, Kind::ReservedValue);
        assert!(matches!(ctx.violations()[1].kind, Kind::Misuse(_)));
    }
}
