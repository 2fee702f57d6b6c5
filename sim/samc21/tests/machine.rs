//! Chips against the clock: sleep, snapshots, several at once, images.

mod support;

use samc21::machine::SLICE;
use samc21::{Chip, Cycles, Exchange, Image, ImageError, Irq, Machine, Stop, Width};
use support::build::build;
use support::thumb::*;

/// Counts EIC interrupts in R7 and sleeps in between.
fn counter() -> Chip {
    let mut program = Program::new(&[movs(0, 8), str(0, 5, 0), WFI, 0xe7fd]);
    let mut chip = program.handler(19, &[adds(7, 1), BX_LR]).chip();
    set(&mut chip, &[(5, 0xe000_e100)]);
    chip
}

/// What a run must repeat: registers, time, instructions and all of SRAM.
fn state(chip: &Chip) -> (samc21::cpu::Registers, Cycles, u64, Vec<u8>) {
    (chip.cpu().registers(), chip.now(), chip.cpu().instructions(), chip.sram().bytes().to_vec())
}

#[test]
fn a_sleeping_chip_skips_to_the_end_and_counts_the_time_apart() {
    let mut chip = counter();
    chip.run_until(Cycles::from_millis(3_600_000));
    assert!(chip.cpu().instructions() < 10);
    assert_eq!(chip.now(), Cycles::from_millis(3_600_000));
    assert!(chip.awake() < 20);
    assert_eq!(chip.awake() + chip.asleep(), chip.now().0);
}

#[test]
fn a_snapshot_continues_as_the_original_does() {
    let mut chip = Chip::new(&build("factor", &[]));
    chip.run_until(Cycles(100_003));
    let mut snapshot = chip.clone();
    chip.run_until(Cycles(300_000));
    snapshot.run_until(Cycles(300_000));
    assert_eq!(state(&chip), state(&snapshot));
}

#[test]
fn a_watched_address_halts_before_it_and_nothing_else_changes() {
    let program = Program::new(&[adds(0, 1), adds(1, 1), 0xe7fc]);
    let (mut plain, mut watched) = (program.chip(), program.chip());
    watched.watch(MAIN + 2, true);
    for round in 1..=5 {
        assert_eq!(watched.run_until(Cycles(1_000)), Stop::Breakpoint);
        let registers = watched.cpu().registers();
        assert_eq!((registers.r[15], registers.r[0], registers.r[1]), (MAIN + 2, round, round - 1));
    }
    watched.watch(MAIN + 2, false);
    assert_eq!(watched.run_until(Cycles(1_000)), Stop::Time);
    plain.run_until(Cycles(1_000));
    assert_eq!(state(&plain), state(&watched));
}

#[test]
fn a_run_does_not_depend_on_how_it_is_cut() {
    let image = build("factor", &["--cfg=soft_division"]);
    let (mut whole, mut cut) = (Chip::new(&image), Chip::new(&image));
    whole.run_until(Cycles(200_000));
    for until in (0..=200_000).step_by(777) {
        cut.run_until(Cycles(until));
    }
    cut.run_until(Cycles(200_000));
    assert_eq!(state(&whole), state(&cut));
}

#[test]
fn profiling_changes_nothing_and_accounts_for_every_awake_tick() {
    let image = build("factor", &[]);
    let (mut plain, mut profiled) = (Chip::new(&image), Chip::new(&image));
    profiled.set_profiling(true);
    plain.run_until(Cycles(200_000));
    profiled.run_until(Cycles(200_000));
    assert_eq!(state(&plain), state(&profiled));
    let profile = profiled.set_profiling(false).unwrap();
    assert_eq!(profile.functions().iter().map(|(_, ticks)| ticks).sum::<u64>(), profiled.awake());
    assert!(profile.functions().iter().any(|(name, ticks)| *name == "factor" && *ticks > 10_000));
}

#[test]
fn division_by_divas_and_by_software_give_the_same_factors() {
    let (mut divas, mut soft) =
        (Chip::new(&build("factor", &[])), Chip::new(&build("factor", &["--cfg=soft_division"])));
    let at_round = |chip: &mut Chip, round| {
        while chip.peek(0x2000_0000, Width::Word) != Some(round) || chip.peek(0x2000_0004, Width::Word) == Some(0) {
            chip.step();
        }
        // The sum is stored right after the round.
        for _ in 0..4 {
            chip.step();
        }
        chip.peek(0x2000_0004, Width::Word)
    };
    assert_eq!(at_round(&mut divas, 500), at_round(&mut soft, 500));
}

/// Raises EIC on the other chip for one slice, each time a chip's R7 has changed.
struct Ping([u32; 2]);

impl Exchange for Ping {
    fn exchange(&mut self, _now: Cycles, chips: &mut [Chip]) {
        let counts = [r(&chips[0], 7), r(&chips[1], 7)];
        for (from, to) in [(0, 1), (1, 0)] {
            chips[to].context_mut().set_irq(Irq::Eic, counts[from] != self.0[from]);
        }
        self.0 = counts;
    }
}

#[test]
fn chips_meet_only_between_slices_and_repeat_exactly() {
    let play = || {
        let mut machine = Machine::new(vec![counter(), counter()]);
        let mut ping = Ping([1, 0]);
        assert_eq!(machine.run_until(Cycles(100 * SLICE), &mut ping), None);
        assert_eq!(machine.now(), Cycles(100 * SLICE));
        machine.chips.iter().map(state).collect::<Vec<_>>()
    };
    let states = play();
    assert!(states[0].0.r[7] > 10 && states[1].0.r[7] > 10, "{} {}", states[0].0.r[7], states[1].0.r[7]);
    assert_eq!(states, play());
}

#[test]
fn symbols_name_the_place_of_a_violation() {
    let mut image = build("factor", &[]);
    let factor = image.symbols.address("factor").unwrap();
    image.segments.push((factor + 4, vec![0x00, 0xde]));
    let mut chip = Chip::new(&image);
    chip.stop_at_violation(true);
    chip.run_until(Cycles(1_000_000));
    assert_eq!(chip.violations()[0].symbol.as_deref(), Some("factor+0x4"));
}

#[test]
fn what_is_not_a_firmware_image_is_refused() {
    assert!(matches!(Image::from_elf(b"not an ELF"), Err(ImageError::Malformed(_))));
    let own = std::fs::read(std::env::current_exe().unwrap()).unwrap();
    assert!(matches!(Image::from_elf(&own), Err(ImageError::Malformed(_) | ImageError::Machine(_))));
}
