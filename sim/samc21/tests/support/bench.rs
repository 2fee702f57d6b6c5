//! A chip on the bench: asleep, driven from outside through its bus, with clocks and pins as firmware sets them up.

use samc21::pins::Function;
use samc21::{Chip, Image, Width};

const AHBMASK: u32 = 0x4000_0810;
const APBCMASK: u32 = 0x4000_081c;
const OSC48MDIV: u32 = 0x4000_1015;
const PCHCTRL: u32 = 0x4000_1c80;
const PORT: u32 = 0x4100_0000;

/// A chip at 48 MHz, with every bus clock on and generator 0 on `channels`.
pub fn chip(channels: &[u32]) -> Chip {
    // Stack, reset vector, WFI, branch to it.
    let code = [0x00, 0x80, 0x00, 0x20, 0x09, 0, 0, 0, 0x30, 0xbf, 0xfd, 0xe7];
    let mut chip = Chip::new(&Image::from_binary(&code));
    chip.bus_write(0x4100_4004, Width::Word, 2 << 1);
    chip.bus_write(OSC48MDIV, Width::Byte, 0);
    chip.bus_write(AHBMASK, Width::Word, 0x1fff);
    chip.bus_write(APBCMASK, Width::Word, 0x00ff_fe7f);
    for channel in channels {
        chip.bus_write(PCHCTRL + 4 * channel, Width::Word, 1 << 6);
    }
    run(&mut chip, 1000);
    chip.context_mut().take_violations();
    chip
}

/// Lets a chip run, µs.
pub fn run(chip: &mut Chip, micros: u64) {
    let now = chip.now();
    chip.run_until(now + 48 * micros);
}

/// Switches a pin to a peripheral.
pub fn connect(chip: &mut Chip, group: u32, pin: u32, function: Function) {
    let base = PORT + 0x80 * group;
    let shift = 4 * (pin % 2);
    let old = chip.bus_read(base + 0x30 + pin / 2, Width::Byte);
    let new = old & !(15 << shift) | (function as u32) << shift;
    chip.bus_write(base + 0x30 + pin / 2, Width::Byte, new);
    chip.bus_write(base + 0x40 + pin, Width::Byte, 1);
}
