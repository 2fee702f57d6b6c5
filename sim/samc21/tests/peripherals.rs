//! Peripherals that act on the whole chip: watchdog and resets, flash and power.

mod support;

use samc21::pins::PA;
use samc21::{Chip, Cycles, Reset, Width};
use support::thumb::{Program, SPIN};

const RCAUSE: u32 = 0x4000_0c00;
const WDT_CTRLA: u32 = 0x4000_2000;
const WDT_CONFIG: u32 = 0x4000_2001;
const NVMCTRL_CTRLA: u32 = 0x4100_4000;
const NVMCTRL_ADDR: u32 = 0x4100_401c;
const PORT_DIRSET: u32 = 0x6000_0008;
const PORT_OUTSET: u32 = 0x6000_0018;
const RWWEE: u32 = 0x0040_0000;

#[test]
fn a_watchdog_not_cleared_resets_the_chip_and_rstc_says_so() {
    let mut chip = spinning();
    assert_eq!(chip.bus_read(RCAUSE, Width::Byte), 0x01);
    chip.bus_write(WDT_CONFIG, Width::Byte, 3);
    chip.bus_write(WDT_CTRLA, Width::Byte, 1 << 1);
    chip.run_until(Cycles::from_millis(60));
    assert_eq!(chip.bus_read(RCAUSE, Width::Byte), 0x01);
    chip.run_until(Cycles::from_millis(80));
    assert_eq!(chip.bus_read(RCAUSE, Width::Byte), 0x20);
    assert_eq!(chip.bus_read(WDT_CTRLA, Width::Byte), 0);
    assert_eq!(chip.violations(), []);
}

#[test]
fn a_brake_pin_falls_to_the_boards_resistor_when_the_chip_is_reset() {
    let mut chip = spinning();
    chip.wires_mut().pins[PA].solder(20, false);
    chip.bus_write(PORT_OUTSET, Width::Word, 1 << 20);
    chip.bus_write(PORT_DIRSET, Width::Word, 1 << 20);
    assert_eq!(chip.wires().share_high(PA, 20), Some(1.0));
    chip.reset(Reset::External);
    assert_eq!(chip.wires().share_high(PA, 20), Some(0.0));
}

#[test]
fn power_cut_while_a_page_is_written_leaves_it_torn_for_the_next_boot() {
    let mut chip = spinning();
    for at in (0..64).step_by(4) {
        chip.bus_write(RWWEE + at, Width::Word, 0);
    }
    chip.bus_write(NVMCTRL_ADDR, Width::Word, RWWEE / 2);
    chip.bus_write(NVMCTRL_CTRLA, Width::Half, 0xa51c);
    let start = chip.now();
    chip.run_until(Cycles(start.0 + Cycles::from_micros(1250).0));
    chip.reset(Reset::PowerOn);
    let page: Vec<u8> = chip.nvm().rwwee()[..64].to_vec();
    assert!(page[..32].iter().all(|byte| *byte == 0) && page[33..].iter().all(|byte| *byte == 0xff));
}

fn spinning() -> Chip {
    Program::new(&[SPIN]).chip()
}
