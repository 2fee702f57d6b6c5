//! What instructions cost (Cortex-M0+ TRM, "Instruction set summary"; assumptions in `cpu::timing`).

mod support;

use samc21::nvm::ReadMode;
use samc21::{Chip, Cycles};
use support::thumb::*;

/// A chip with `code`, R1 pointing into SRAM and R2 at the I/O bus (DIVAS), R3 at the AHB side of DIVAS.
fn chip(code: &[u16]) -> Chip {
    let mut chip = Program::new(code).chip();
    set(&mut chip, &[(1, 0x2000_0100), (2, 0x6000_0200), (3, 0x4800_0000), (4, (MAIN + 2) | 1), (5, 0xe000_e100)]);
    chip
}

fn cost(code: &[u16]) -> u64 {
    let mut chip = chip(code);
    let before = chip.now();
    chip.step();
    assert_eq!(chip.violations(), []);
    chip.now() - before
}

#[test]
fn data_processing_takes_one_cycle() {
    // ADDS, LSLS by register, MULS, REV, UXTB, MOV high, SUB SP, NOP, CPSID, SEV
    for op in [0x1888, 0x4088, 0x4348, 0xba08, 0xb2c8, 0x4689, 0xb082, NOP, CPSID, SEV] {
        assert_eq!(cost(&[op]), 1, "{op:#x}");
    }
}

#[test]
fn a_branch_costs_a_cycle_more_if_taken() {
    assert_eq!(cost(&[0xd0fe]), 1); // BEQ: Z is clear
    assert_eq!(cost(&[0xd1fe]), 2); // BNE
    assert_eq!(cost(&[SPIN]), 2);
    assert_eq!(cost(&[bx(4)]), 2);
    assert_eq!(cost(&[0x47a0]), 2); // BLX R4
    assert_eq!(cost(&[0xf000, 0xf800]), 3); // BL
    assert_eq!(cost(&[0x46a7]), 2); // MOV PC, R4
    assert_eq!(cost(&[0x4487]), 2); // ADD PC, R0
}

#[test]
fn a_load_or_store_takes_two_cycles_and_one_on_the_io_bus() {
    assert_eq!(cost(&[ldr(0, 1, 0)]), 2);
    assert_eq!(cost(&[str(0, 1, 0)]), 2);
    assert_eq!(cost(&[0x4800]), 2); // LDR R0, [PC]
    assert_eq!(cost(&[ldr(0, 5, 0)]), 2); // NVIC
    assert_eq!(cost(&[ldr(0, 3, 0)]), 2); // DIVAS, AHB
    assert_eq!(cost(&[ldr(0, 2, 0)]), 1); // DIVAS, I/O bus
    assert_eq!(cost(&[str(0, 2, 8)]), 1);
}

#[test]
fn a_multiple_takes_one_cycle_and_one_per_register() {
    assert_eq!(cost(&[0xc9fd]), 8); // LDM R1!, {R0, R2-R7}
    assert_eq!(cost(&[0xc1fd]), 8); // STM
    assert_eq!(cost(&[0xb50f]), 6); // PUSH {R0-R3, LR}
    assert_eq!(cost(&[0xbc0f]), 5); // POP {R0-R3}
    let mut chip = chip(&[0xb410, 0xbd00]);
    chip.step();
    let before = chip.now();
    chip.step(); // POP {PC}
    assert_eq!((chip.now() - before, r(&chip, 15)), (4, MAIN + 2));
}

#[test]
fn system_instructions_take_three_cycles() {
    assert_eq!(cost(&[MRS, mrs(0, 16)]), 3);
    assert_eq!(cost(&[msr_from(0), msr(16)]), 3);
    assert_eq!(cost(&[0xf3bf, 0x8f4f]), 3);
}

#[test]
fn divas_holds_the_bus_until_its_result_is_there() {
    // Dividend 0xffff_ffff in R0 takes the longest: 16 cycles from the store on.
    let mut chip = chip(&[str(0, 2, 8), str(4, 2, 12), ldr(6, 2, 16), BKPT]);
    set(&mut chip, &[(0, u32::MAX), (4, 10)]);
    let before = chip.now();
    finish(&mut chip);
    assert_eq!(r(&chip, 6), u32::MAX / 10);
    assert_eq!(chip.now() - before, 1 + 16 + 1);
}

#[test]
fn straight_code_pays_the_wait_states_once_per_eight_bytes_and_a_loop_only_once() {
    let time = |wait_states, code: &[u16]| {
        let mut chip = chip(code);
        chip.nvm_mut().set_timing(wait_states, ReadMode::NoMissPenalty);
        finish(&mut chip);
        chip.now().0
    };
    let straight = [&[NOP; 15][..], &[BKPT]].concat();
    assert_eq!(time(2, &straight) - time(0, &straight), 4 * 2);
    // MOVS R0, #100; SUBS R0, #1; BNE; BKPT: one line.
    let looping = [movs(0, 100), 0x3801, 0xd1fd, BKPT];
    assert_eq!(time(2, &looping) - time(0, &looping), 2);
}

#[test]
fn a_slower_cpu_clock_takes_more_ticks_per_cycle() {
    let mut chip = chip(&[ldr(0, 1, 0), BKPT]);
    chip.context_mut().clocks.cpu_ticks = 12;
    chip.step();
    assert_eq!(chip.now(), Cycles(24));
}
