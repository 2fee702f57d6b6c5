//! What ends in a HardFault, what a HardFault sees, and lockup (ARMv6-M ARM, B1.5.10 and B1.5.11).

mod support;

use samc21::{Chip, Kind, Stop, Width};
use support::thumb::*;

/// Runs `main` with R1 and R2 set; the HardFault handler stops. Returns the chip and the stacked return address.
fn fault(main: &[u16], r1: u32, r2: u32) -> (Chip, u32) {
    let mut chip = Program::new(main).handler(3, &[movs(7, 1), BKPT]).chip();
    set(&mut chip, &[(1, r1), (2, r2)]);
    finish(&mut chip);
    assert_eq!(r(&chip, 7), 1, "no HardFault");
    let stacked = chip.peek(r(&chip, 13) + 24, Width::Word).unwrap();
    (chip, stacked)
}

fn kind(chip: &Chip) -> Kind {
    chip.violations()[0].kind
}

#[test]
fn an_unaligned_access_faults_at_its_instruction() {
    for (instruction, address) in [
        (ldr(0, 1, 0), 0x2000_0002),
        (str(0, 1, 0), 0x2000_0001),
        (0x8808, 0x2000_0001), // LDRH R0, [R1]
        (0x8008, 0x2000_0003), // STRH R0, [R1]
        (0xc901, 0x2000_0002), // LDM R1!, {R0}
        (ldr(0, 1, 0), 0x102), // flash
        (ldr(0, 1, 0), 0xe000_ed02),
    ] {
        let (chip, stacked) = fault(&[NOP, instruction, BKPT], address, 0);
        assert_eq!((kind(&chip), stacked), (Kind::Unaligned, MAIN + 2), "{instruction:#x}");
        assert_eq!(chip.violations()[0].access.unwrap().address, address);
        assert_eq!(chip.violations()[0].pc, MAIN + 2);
    }
}

#[test]
fn an_address_without_memory_faults() {
    for address in [0x0004_0000, 0x2000_8000, 0x1fff_fffc, 0x4300_0000, 0x6000_0400, 0xe000_1000] {
        let (chip, stacked) = fault(&[ldr(0, 1, 0), BKPT], address, 0);
        assert_eq!((kind(&chip), stacked), (Kind::Unmapped, MAIN), "{address:#x}");
    }
}

#[test]
fn an_undefined_instruction_faults() {
    for undefined in [UDF, 0xb100, 0xba80, 0xe800, 0xf800, 0xbf01, 0xb6ff] {
        let (chip, stacked) = fault(&[undefined, 0x0000], 0, 0);
        assert_eq!((kind(&chip), stacked), (Kind::Undefined, MAIN), "{undefined:#x}");
    }
}

#[test]
fn erased_flash_faults() {
    let (chip, stacked) = fault(&[NOP], 0, 0);
    assert_eq!((kind(&chip), stacked), (Kind::Undefined, MAIN + 2));
}

#[test]
fn a_branch_without_the_thumb_bit_faults_at_its_target() {
    for branch in [&[bx(1)][..], &[0x4780 | 1 << 3], &[0xb402, 0xbd00]] {
        let (chip, stacked) = fault(branch, 0x300, 0);
        assert_eq!((kind(&chip), stacked), (Kind::ArmState, 0x300));
        let xpsr = chip.peek(r(&chip, 13) + 28, Width::Word).unwrap();
        assert_eq!(xpsr >> 24 & 1, 0, "T is stacked as it was");
    }
}

#[test]
fn a_branch_to_a_peripheral_or_nowhere_faults_there() {
    for target in [0x4000_0000, 0x2000_8000, 0x0010_0000] {
        let (chip, stacked) = fault(&[bx(1)], target | 1, 0);
        assert_eq!((kind(&chip), stacked), (Kind::Unmapped, target));
    }
}

#[test]
fn a_breakpoint_without_debugger_faults() {
    let mut chip = Program::new(&[BKPT]).handler(3, &[movs(7, 1), SPIN]).chip();
    chip.cpu_mut().set_halts_at_bkpt(false);
    run(&mut chip, 100);
    assert_eq!((kind(&chip), r(&chip, 7)), (Kind::Escalated, 1));
}

#[test]
fn a_wrong_exception_return_faults() {
    for link in [0xffff_fff1_u32, 0xffff_fff0, 0xf000_0001, 0xffff_fff5] {
        let mut program = Program::new(&[SVC, BKPT]);
        let mut chip = program.handler(11, &[bx(1)]).handler(3, &[movs(7, 1), BKPT]).chip();
        set(&mut chip, &[(1, link)]);
        finish(&mut chip);
        assert!(matches!(kind(&chip), Kind::ExceptionReturn(_)), "{link:#x}: {:?}", chip.violations());
        assert_eq!(r(&chip, 7), 1);
    }
}

#[test]
fn a_frame_that_returns_to_arm_state_faults() {
    // The handler clears the stacked xPSR.
    let mut program = Program::new(&[SVC, BKPT]);
    let mut chip = program.handler(11, &[movs(0, 0), 0x9007, BX_LR]).handler(3, &[movs(7, 1), BKPT]).chip();
    finish(&mut chip);
    assert_eq!((kind(&chip), r(&chip, 7)), (Kind::ArmState, 1));
}

#[test]
fn a_fault_inside_hard_fault_locks_the_core_up_until_reset() {
    let mut chip = Program::new(&[UDF]).handler(3, &[UDF]).chip();
    assert_eq!(run(&mut chip, 1000), Stop::Time);
    assert!(chip.cpu().is_locked_up());
    assert_eq!(chip.violations().last().unwrap().kind, Kind::Lockup);
    chip.reset(samc21::Reset::External);
    assert!(!chip.cpu().is_locked_up());
    assert_eq!(r(&chip, 15), MAIN);
}

#[test]
fn a_stack_outside_memory_ends_in_lockup() {
    let mut chip = Program::new(&[SVC]).handler(3, &[0xb401, BKPT]).chip();
    set(&mut chip, &[(13, 0x1000_0000)]);
    run(&mut chip, 1000);
    assert!(chip.cpu().is_locked_up());
}

#[test]
fn unprivileged_code_cannot_mask_interrupts_or_reach_system_registers() {
    // CONTROL.nPRIV from R0, CPSID, MRS R3 PRIMASK, LDR from the NVIC.
    let main = [movs(0, 1), msr_from(0), msr(20), CPSID, ldr(0, 1, 0), BKPT];
    let (chip, stacked) = fault(&main, 0xe000_e100, 0);
    assert!(!chip.cpu().registers().primask);
    assert_eq!((kind(&chip), stacked), (Kind::WriteProtected, MAIN + 8));
}

#[test]
fn a_peripheral_without_model_is_refused_and_named() {
    let (chip, _) = fault(&[ldr(0, 1, 0)], 0x4100_8000, 0);
    assert_eq!((kind(&chip), chip.violations()[0].unit), (Kind::Unmodelled, Some("MTB")));
    let text = chip.violations()[0].to_string();
    assert!(text.starts_with("peripheral not modelled, MTB, read32 0x41008000, pc 0x00000200"), "{text}");
}

#[test]
fn a_run_can_end_at_the_first_violation() {
    let mut chip = Program::new(&[NOP, UDF]).handler(3, &[SPIN]).chip();
    chip.stop_at_violation(true);
    assert_eq!(run(&mut chip, 1000), Stop::Violation);
    assert_eq!(chip.violations().len(), 1);
    assert_eq!(run(&mut chip, 1000), Stop::Time);
}
