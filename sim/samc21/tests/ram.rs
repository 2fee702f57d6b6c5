//! Code in SRAM: what it costs, and what happens when it is written.

mod support;

use samc21::nvm::ReadMode;
use samc21::{Chip, Stop, Width};
use support::thumb::*;

const RAM: u32 = 0x2000_1000;

/// A chip about to run `code` in SRAM, with `main` in flash.
fn chip(main: &[u16], code: &[u16]) -> Chip {
    let mut chip = Program::new(main).chip();
    put(&mut chip, RAM, code);
    set(&mut chip, &[(15, RAM)]);
    chip
}

fn put(chip: &mut Chip, address: u32, code: &[u16]) {
    let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
    chip.poke(address, &bytes);
}

#[test]
fn straight_code_in_sram_pays_no_wait_states() {
    for wait_states in [0, 2] {
        let mut chip = chip(&[], &[&[NOP; 40][..], &[BKPT]].concat());
        chip.nvm_mut().set_timing(wait_states, ReadMode::NoMissPenalty);
        finish(&mut chip);
        assert_eq!(chip.now().0, 40);
    }
}

#[test]
fn a_literal_beside_the_code_costs_one_access() {
    let mut chip = chip(&[], &[0x4800, BKPT, 0x1234, 0x5678]); // LDR R0, [PC]
    finish(&mut chip);
    assert_eq!((r(&chip, 0), chip.now().0), (0x5678_1234, 2));
}

#[test]
fn code_that_writes_over_itself_executes_what_it_wrote() {
    // A loop whose first instruction is ADDS R0, #1 until the third round makes it ADDS R0, #16: STRH R1, [R2].
    let code = [adds(0, 1), adds(3, 1), 0x2b03, 0xd1fb, 0x8011, 0x2b06, 0xd1f8, BKPT];
    let mut chip = chip(&[], &code);
    set(&mut chip, &[(1, adds(0, 16).into()), (2, RAM)]);
    for _ in 0..12 {
        chip.step();
    }
    assert_eq!(r(&chip, 0), 3);
    chip.step();
    chip.step();
    chip.step();
    chip.step();
    assert_eq!(r(&chip, 0), 19);
}

#[test]
fn a_debuggers_write_into_either_half_of_a_long_instruction_takes_effect() {
    // BL RAM+8, BKPT; at +8 and at +12: BX LR.
    let mut chip = chip(&[], &[0xf000, 0xf802, BKPT, NOP, movs(0, 1), BX_LR, movs(0, 2), BX_LR]);
    finish(&mut chip);
    assert_eq!(r(&chip, 0), 1);
    put(&mut chip, RAM + 2, &[0xf804]);
    set(&mut chip, &[(15, RAM)]);
    finish(&mut chip);
    assert_eq!(r(&chip, 0), 2);
}

#[test]
fn a_watched_function_in_sram_halts_although_it_is_copied_there_later() {
    let code = [adds(0, 1), BX_LR];
    let mut chip = chip(&[SPIN], &[NOP, NOP]);
    chip.watch(RAM + 0x100, true);
    for (index, half) in code.into_iter().enumerate() {
        chip.sram_mut().write(RAM + 0x100 + 2 * index as u32, Width::Half, half.into());
    }
    set(&mut chip, &[(15, RAM + 0x100), (14, MAIN | 1)]);
    let now = chip.now();
    assert_eq!((run(&mut chip, 100), chip.now()), (Stop::Breakpoint, now));
    assert_eq!((r(&chip, 15), r(&chip, 0)), (RAM + 0x100, 0));
    assert_eq!((run(&mut chip, 100), r(&chip, 0), r(&chip, 15)), (Stop::Time, 1, MAIN));
    chip.watch(RAM + 0x100, false);
    set(&mut chip, &[(15, RAM + 0x100), (14, MAIN | 1)]);
    assert_eq!((run(&mut chip, 100), r(&chip, 0)), (Stop::Time, 2));
}

#[test]
fn a_snapshot_has_its_own_code() {
    let mut original = chip(&[], &[movs(0, 1), BKPT]);
    finish(&mut original);
    let mut copy = original.clone();
    put(&mut copy, RAM, &[movs(0, 2)]);
    for (chip, expected) in [(&mut original, 1), (&mut copy, 2)] {
        set(chip, &[(15, RAM)]);
        finish(chip);
        assert_eq!(r(chip, 0), expected);
    }
}
