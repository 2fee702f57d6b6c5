//! Clocks as firmware sets them up, for tests that drive a chip from outside.

use samc21::{Chip, Cycles, Width};

const AHBMASK: u32 = 0x4000_0810;
const APBCMASK: u32 = 0x4000_081c;
const OSC48MDIV: u32 = 0x4000_1015;
const PCHCTRL: u32 = 0x4000_1c80;

/// Runs a chip at 48 MHz, with every bus clock on and generator 0 on `channels`.
pub fn start_clocks(chip: &mut Chip, channels: &[u32]) {
    // NVMCTRL: two wait states.
    chip.bus_write(0x4100_4004, Width::Word, 2 << 1);
    chip.bus_write(OSC48MDIV, Width::Byte, 0);
    chip.bus_write(AHBMASK, Width::Word, 0x1fff);
    chip.bus_write(APBCMASK, Width::Word, 0x00ff_fe7f);
    for channel in channels {
        chip.bus_write(PCHCTRL + 4 * channel, Width::Word, 1 << 6);
    }
    let now = chip.now();
    chip.run_until(Cycles(now.0 + 48_000));
}
