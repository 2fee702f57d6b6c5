//! System registers as firmware reads them, and the checks every peripheral access has in common.

mod support;

use samc21::{Chip, Irq, Kind};
use support::thumb::*;

/// Reads a word by an instruction of the chip's own.
fn read(chip: &mut Chip, address: u32) -> u32 {
    set(chip, &[(15, MAIN), (1, address)]);
    chip.step();
    r(chip, 0)
}

/// Writes a word by an instruction of the chip's own.
fn write(chip: &mut Chip, address: u32, value: u32) {
    set(chip, &[(15, MAIN + 2), (1, address), (0, value)]);
    chip.step();
}

fn chip() -> Chip {
    Program::new(&[ldr(0, 1, 0), str(0, 1, 0), BKPT]).handler(3, &[BKPT]).chip()
}

#[test]
fn the_core_identifies_itself() {
    assert_eq!(read(&mut chip(), 0xe000_ed00), 0x410c_c601);
}

#[test]
fn enable_and_pending_registers_set_and_clear_by_ones() {
    let mut chip = chip();
    for (set, clear) in [(0xe000_e100, 0xe000_e180), (0xe000_e200, 0xe000_e280)] {
        write(&mut chip, set, 0b1100);
        write(&mut chip, clear, 0b0100);
        assert_eq!((read(&mut chip, set), read(&mut chip, clear)), (0b1000, 0b1000));
        write(&mut chip, clear, u32::MAX);
    }
}

#[test]
fn a_pending_bit_of_an_asserted_line_cannot_be_cleared() {
    let mut chip = chip();
    chip.context_mut().set_irq(Irq::Eic, true);
    write(&mut chip, 0xe000_e280, 8);
    assert_eq!(read(&mut chip, 0xe000_e200), 8);
    chip.context_mut().set_irq(Irq::Eic, false);
    assert_eq!(read(&mut chip, 0xe000_e200), 8);
    write(&mut chip, 0xe000_e280, 8);
    assert_eq!(read(&mut chip, 0xe000_e200), 0);
}

#[test]
fn icsr_shows_what_is_pending() {
    let mut chip = chip();
    write(&mut chip, 0xe000_e100, 8);
    // PRIMASK keeps it pending.
    chip.nvm_mut().load(MAIN + 4, &CPSID.to_le_bytes());
    set(&mut chip, &[(15, MAIN + 4)]);
    chip.step();
    chip.context_mut().set_irq(Irq::Eic, true);
    assert_eq!(read(&mut chip, 0xe000_ed04), 1 << 22 | 19 << 12);
    write(&mut chip, 0xe000_ed04, 1 << 28);
    assert_eq!(read(&mut chip, 0xe000_ed04), 1 << 28 | 1 << 22 | 14 << 12);
    write(&mut chip, 0xe000_ed04, 1 << 27);
    assert_eq!(read(&mut chip, 0xe000_ed04) >> 28, 0);
}

#[test]
fn system_handler_priorities_have_two_bits_each() {
    let mut chip = chip();
    write(&mut chip, 0xe000_ed1c, u32::MAX);
    write(&mut chip, 0xe000_ed20, u32::MAX);
    assert_eq!(read(&mut chip, 0xe000_ed1c), 0xc000_0000);
    assert_eq!(read(&mut chip, 0xe000_ed20), 0xc0c0_0000);
}

#[test]
fn a_wrong_key_resets_nothing_and_is_reported() {
    let mut chip = chip();
    write(&mut chip, 0xe000_ed0c, 0x1234_0004);
    assert_eq!(chip.violations()[0].kind, Kind::WriteProtected);
    chip.step();
    assert_ne!(r(&chip, 15), MAIN);
}

#[test]
fn an_access_without_bus_clock_is_reported_and_reads_zero() {
    let mut chip = chip();
    write(&mut chip, 0x4800_0008, 7);
    assert_eq!(read(&mut chip, 0x4800_0008), 7);
    chip.context_mut().clocks.ahb &= !(1 << 12);
    assert_eq!(read(&mut chip, 0x4800_0008), 0);
    let violation = &chip.violations()[0];
    assert_eq!((violation.kind, violation.unit, violation.pc), (Kind::Unclocked, Some("DIVAS"), MAIN));
    assert_eq!(chip.cpu().exceptions(), 0);
}

#[test]
fn both_addresses_of_divas_are_one_unit() {
    let mut chip = chip();
    write(&mut chip, 0x4800_0008, 100);
    write(&mut chip, 0x6000_020c, 7);
    assert_eq!(read(&mut chip, 0x4800_0010), 14);
    assert_eq!(read(&mut chip, 0x6000_0214), 2);
}
