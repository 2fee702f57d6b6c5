//! Exceptions: who is taken when, and what is stacked (ARMv6-M ARM, B1.5).

mod support;

use samc21::Irq;
use samc21::sram::BASE;
use samc21::{Chip, Kind, Width};
use support::thumb::*;

const NVIC: u32 = 0xe000_e100;
const ICSR: u32 = 0xe000_ed04;
const EIC: u32 = 16 + 3;
const DMAC: u32 = 16 + 7;

/// Sets R5 and R6 to what the programs here use: NVIC registers and ICSR.
fn start(program: &Program) -> Chip {
    let mut chip = program.chip();
    set(&mut chip, &[(5, NVIC), (6, ICSR)]);
    chip
}

/// Enables interrupts: MOVS R0, #mask; STR R0, [R5].
const fn enable(mask: u16) -> [u16; 2] {
    [movs(0, mask), str(0, 5, 0)]
}

fn program(main: &[&[u16]]) -> Program {
    Program::new(&main.concat())
}

#[test]
fn a_line_pends_while_disabled_and_is_taken_when_enabled() {
    let mut program = program(&[&[NOP; 20], &enable(8), &[NOP, BKPT]]);
    let mut chip = start(program.handler(EIC, &note(1)));
    chip.context_mut().set_irq(Irq::Eic, true);
    run(&mut chip, 15);
    assert_eq!((r(&chip, 7), chip.cpu().exceptions()), (0, 0));
    chip.context_mut().set_irq(Irq::Eic, false);
    finish(&mut chip);
    assert_eq!(r(&chip, 7), 0x1);
}

#[test]
fn primask_holds_an_interrupt_back_and_lets_it_go() {
    let mut program = program(&[&[CPSID], &enable(8), &[NOP; 20], &[CPSIE, NOP, BKPT]]);
    let mut chip = start(program.handler(EIC, &note(1)));
    chip.context_mut().set_irq(Irq::Eic, true);
    run(&mut chip, 15);
    chip.context_mut().set_irq(Irq::Eic, false);
    assert_eq!(r(&chip, 7), 0);
    finish(&mut chip);
    assert_eq!(r(&chip, 7), 0x1);
}

#[test]
fn wfi_under_primask_wakes_without_entry() {
    let mut program = program(&[&[CPSID], &enable(8), &[WFI, movs(4, 7), BKPT]]);
    let mut chip = start(program.handler(EIC, &note(1)));
    run(&mut chip, 1000);
    assert!(chip.cpu().is_asleep());
    chip.context_mut().set_irq(Irq::Eic, true);
    finish(&mut chip);
    assert_eq!((r(&chip, 4), r(&chip, 7)), (7, 0));
}

#[test]
fn wfi_sleeps_through_a_disabled_interrupt() {
    let mut chip = start(&program(&[&[WFI, BKPT]]));
    chip.context_mut().set_irq(Irq::Eic, true);
    run(&mut chip, 1000);
    assert!(chip.cpu().is_asleep());
    assert!(chip.asleep() > 990);
}

#[test]
fn a_more_urgent_interrupt_preempts_a_handler() {
    let mut program = program(&[&enable(0x88), &[str(1, 5, 0), BKPT, movs(0, 8), str(0, 4, 0), NOP, BKPT]]);
    // EIC, at 0x80, pends DMAC, at 0x40, in the middle.
    let [shift, digit, back] = note(1);
    program.handler(EIC, &[shift, digit, movs(0, 0x80), str(0, 4, 0), NOP, lsls(7, 7, 4), adds(7, 3), back]);
    let mut chip = start(program.handler(DMAC, &note(2)));
    for (dmac, order) in [(0x40, 0x123), (0x80, 0x132), (0xc0, 0x132)] {
        let mut chip = {
            finish(&mut chip);
            chip.clone()
        };
        set(&mut chip, &[(4, NVIC + 0x100), (15, MAIN + 8), (7, 0)]);
        set_priority(&mut chip, 3, 0x80);
        set_priority(&mut chip, 7, dmac);
        finish(&mut chip);
        assert_eq!(r(&chip, 7), order, "DMAC at {dmac:#x}");
    }
}

/// Writes one byte of IPR by a store of the chip's own: pokes STR R2, [R3] and runs it.
fn set_priority(chip: &mut Chip, irq: u32, priority: u32) {
    let saved = chip.cpu().registers();
    let address = 0xe000_e400 + irq / 4 * 4;
    chip.sram_mut().write(BASE + 0x4000, Width::Half, u32::from(str(2, 3, 0)));
    set(chip, &[(15, BASE + 0x4000), (2, priority << (8 * (irq % 4))), (3, address)]);
    chip.step();
    chip.cpu_mut().set_registers(&saved);
}

#[test]
fn tail_chained_handlers_run_by_number_when_equally_urgent() {
    let mut program = program(&[&enable(0x88), &[movs(0, 0x88), str(0, 4, 0), NOP, BKPT]]);
    let mut chip = start(program.handler(EIC, &note(1)).handler(DMAC, &note(2)));
    set(&mut chip, &[(4, NVIC + 0x100)]);
    finish(&mut chip);
    assert_eq!(r(&chip, 7), 0x12);
    assert_eq!(r(&chip, 13), STACK);
}

#[test]
fn a_tail_chain_is_shorter_than_return_and_entry() {
    let time = |pended: u16| {
        let mut program = program(&[&enable(0x88), &[movs(0, pended), str(0, 4, 0), NOP, BKPT]]);
        let mut chip = start(program.handler(EIC, &note(1)).handler(DMAC, &note(2)));
        set(&mut chip, &[(4, NVIC + 0x100)]);
        finish(&mut chip);
        chip.now().0
    };
    let (none, one, two) = (time(0), time(0x08), time(0x88));
    let handler = 1 + 1 + 2;
    assert_eq!(one - none, 15 + handler + 11);
    assert_eq!(two - one, 6 + handler);
}

#[test]
fn an_interrupt_during_entry_goes_first_if_more_urgent() {
    let mut program = program(&[&enable(0x88), &[NOP, BKPT]]);
    let mut chip = start(program.handler(EIC, &note(1)).handler(DMAC, &note(2)).handler(15, &note(5)));
    set_priority(&mut chip, 3, 0xc0);
    // SysTick, at priority 0, fires in the fifteen cycles of EIC's entry.
    for (address, value) in [(0xe000_e014, 100), (0xe000_e018, 0), (0xe000_e010, 3)] {
        let saved = chip.cpu().registers();
        chip.sram_mut().write(BASE + 0x4000, Width::Half, u32::from(str(2, 3, 0)));
        set(&mut chip, &[(15, BASE + 0x4000), (2, value), (3, address)]);
        chip.step();
        chip.cpu_mut().set_registers(&saved);
    }
    let fires = chip.now() + 101;
    set(&mut chip, &[(15, MAIN)]);
    chip.nvm_mut().load(MAIN + 4, &[0xfe, 0xe7]);
    chip.run_until(samc21::Cycles(fires.0 - 8));
    chip.context_mut().set_irq(Irq::Eic, true);
    chip.step();
    chip.context_mut().set_irq(Irq::Eic, false);
    run(&mut chip, 60);
    assert_eq!(r(&chip, 7), 0x51);
}

#[test]
fn pendsv_waits_for_the_handler_that_pends_it() {
    let mut program = program(&[&enable(8), &[movs(0, 8), str(0, 4, 0), NOP, BKPT]]);
    program.handler(EIC, &[movs(0, 1), lsls(0, 0, 28), str(0, 6, 0), NOP, lsls(7, 7, 4), adds(7, 1), BX_LR]);
    let mut chip = start(program.handler(14, &note(2)));
    set(&mut chip, &[(4, NVIC + 0x100)]);
    finish(&mut chip);
    assert_eq!(r(&chip, 7), 0x12);
}

#[test]
fn svc_returns_to_the_instruction_after_it() {
    let mut program = program(&[&[SVC, adds(7, 1), BKPT]]);
    let mut chip = start(program.handler(11, &note(4)));
    finish(&mut chip);
    assert_eq!(r(&chip, 7), 5);
}

#[test]
fn svc_that_cannot_be_taken_is_a_hard_fault() {
    let mut program = program(&[&[CPSID, SVC, BKPT]]);
    let mut chip = start(program.handler(3, &[movs(7, 9), BKPT]));
    finish(&mut chip);
    assert_eq!(r(&chip, 7), 9);
    assert_eq!(chip.violations()[0].kind, Kind::Escalated);
    // It would return to the SVC itself.
    assert_eq!(chip.peek(r(&chip, 13) + 24, Width::Word), Some(MAIN + 2));
}

#[test]
fn entry_stacks_eight_words_on_eight_bytes_and_return_undoes_it() {
    for odd in [0, 4] {
        let mut program = program(&[&enable(8), &[movs(0, 8), str(0, 4, 0), NOP, BKPT]]);
        let mut chip = start(program.handler(EIC, &[BKPT, movs(0, 99), BX_LR]));
        let values = [(1, 11), (2, 12), (3, 13), (4, NVIC + 0x100), (12, 112), (13, STACK - odd), (14, 0x777)];
        set(&mut chip, &values);
        finish(&mut chip);
        let frame = r(&chip, 13);
        assert_eq!(frame, (STACK - odd - 32) & !7);
        assert_eq!(r(&chip, 14), 0xffff_fff9);
        let word = |i: u32| chip.peek(frame + 4 * i, Width::Word).unwrap();
        assert_eq!([word(0), word(1), word(2), word(3), word(4), word(5)], [8, 11, 12, 13, 112, 0x777]);
        assert_eq!(word(6), MAIN + 8);
        assert_eq!(word(7) >> 9 & 1 != 0, odd == 4);
        assert_eq!(word(7) >> 24 & 1, 1);
        let at = r(&chip, 15);
        set(&mut chip, &[(15, at + 2)]);
        finish(&mut chip);
        assert_eq!((r(&chip, 0), r(&chip, 13), r(&chip, 14)), (8, STACK - odd, 0x777));
    }
}

#[test]
fn the_thread_may_use_the_process_stack() {
    // MSR PSP, R1; MOVS R0, #2; MSR CONTROL, R0; ISB; pend; BKPT
    let main =
        [msr_from(1), msr(9), movs(0, 2), msr_from(0), msr(20), 0xf3bf, 0x8f6f, movs(0, 8), str(0, 4, 0), NOP, BKPT];
    let mut program = program(&[&enable(8), &main]);
    let mut chip = start(program.handler(EIC, &[BKPT, BX_LR]));
    set(&mut chip, &[(1, 0x2000_1000), (4, NVIC + 0x100)]);
    finish(&mut chip);
    let inside = chip.cpu().registers();
    assert_eq!((inside.r[14], inside.r[13], inside.psp), (0xffff_fffd, STACK, 0x2000_1000 - 32));
    set(&mut chip, &[(15, inside.r[15] + 2)]);
    finish(&mut chip);
    let after = chip.cpu().registers();
    assert_eq!((after.r[13], after.msp, after.control), (0x2000_1000, STACK, 2));
}

#[test]
fn a_level_that_stays_is_taken_again() {
    let mut program = program(&[&enable(8), &[SPIN]]);
    let mut chip = start(program.handler(EIC, &note(1)));
    chip.context_mut().set_irq(Irq::Eic, true);
    run(&mut chip, 1000);
    assert!(chip.cpu().exceptions() > 10);
    // From one handler to the next by tail-chaining: one instruction of the thread at most ran.
    chip.context_mut().set_irq(Irq::Eic, false);
    run(&mut chip, 100);
    let taken = chip.cpu().exceptions();
    run(&mut chip, 1000);
    assert_eq!(chip.cpu().exceptions(), taken);
}

#[test]
fn sev_lets_one_wfe_pass() {
    let mut chip = start(&program(&[&[SEV, WFE, movs(4, 1), WFE, movs(4, 2), BKPT]]));
    run(&mut chip, 100);
    assert_eq!(r(&chip, 4), 1);
    assert!(chip.cpu().is_asleep());
}

#[test]
fn wfe_wakes_after_a_handler_and_on_pending_if_asked_to() {
    let mut program = program(&[&[WFE, movs(4, 1), BKPT]]);
    let mut chip = start(&program);
    run(&mut chip, 100);
    chip.context_mut().set_irq(Irq::Eic, true);
    run(&mut chip, 100);
    assert!(chip.cpu().is_asleep(), "neither enabled nor SEVONPEND");
    program.at(MAIN, &[str(3, 2, 0), WFE, movs(4, 1), BKPT]);
    let mut chip = start(&program);
    set(&mut chip, &[(2, 0xe000_ed10), (3, 1 << 4)]);
    run(&mut chip, 100);
    assert!(chip.cpu().is_asleep());
    chip.context_mut().set_irq(Irq::Eic, true);
    finish(&mut chip);
    assert_eq!(r(&chip, 4), 1);
}

#[test]
fn a_handler_leaves_an_event_for_the_next_wfe() {
    let mut program = program(&[&enable(8), &[movs(0, 8), str(0, 4, 0), NOP, WFE, movs(4, 1), WFE, movs(4, 2), BKPT]]);
    let mut chip = start(program.handler(EIC, &note(1)));
    set(&mut chip, &[(4, NVIC + 0x100)]);
    run(&mut chip, 200);
    assert_eq!(r(&chip, 4), 1);
    assert!(chip.cpu().is_asleep());
}

#[test]
fn sleep_on_exit_sleeps_when_the_last_handler_returns() {
    let mut program = program(&[&enable(8), &[str(3, 2, 0), movs(0, 8), str(0, 4, 0), NOP, movs(7, 0x7f), BKPT]]);
    let mut chip = start(program.handler(EIC, &note(1)));
    set(&mut chip, &[(2, 0xe000_ed10), (3, 1 << 1), (4, NVIC + 0x100)]);
    run(&mut chip, 1000);
    assert!(chip.cpu().is_asleep());
    assert_eq!(r(&chip, 7), 1);
}

#[test]
fn systick_interrupts_at_its_period_and_wakes_the_core() {
    // Enables SysTick with a reload value of 999, then sleeps for ever.
    let main = [str(1, 2, 4), str(1, 2, 8), str(3, 2, 0), WFI, 0xe7fd];
    let mut program = program(&[&main]);
    let mut chip = start(program.handler(15, &[adds(7, 1), BX_LR]));
    set(&mut chip, &[(1, 999), (2, 0xe000_e010), (3, 7)]);
    run(&mut chip, 10_100);
    assert_eq!(r(&chip, 7), 10);
    assert!(chip.awake() < 10 * 40, "awake {}", chip.awake());
}

#[test]
fn a_vector_table_elsewhere_is_used() {
    let mut program = program(&[&[str(1, 2, 0)], &enable(8), &[NOP, NOP, BKPT]]);
    program.word(0x1000 + 4 * EIC, 0x1101).at(0x1100, &[movs(7, 0x55), BX_LR]);
    let mut chip = start(&program);
    set(&mut chip, &[(1, 0x1000), (2, 0xe000_ed08)]);
    chip.context_mut().set_irq(Irq::Eic, true);
    run(&mut chip, 40);
    assert_eq!(r(&chip, 7), 0x55);
}

#[test]
fn the_system_reset_request_starts_over() {
    let mut chip = start(&program(&[&[adds(7, 1), str(1, 2, 0), NOP, BKPT]]));
    set(&mut chip, &[(1, 0x05fa_0004), (2, 0xe000_ed0c), (7, 40)]);
    chip.step();
    chip.step();
    assert_eq!(r(&chip, 7), 41);
    chip.step();
    assert_eq!((r(&chip, 7), r(&chip, 15)), (1, MAIN + 2));
}
