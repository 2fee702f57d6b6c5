//! Interrupts as compiled code meets them: runs `programs/probe.rs`, and plays the outside for it.

mod support;

use samc21::{Chip, Cycles, Irq, Width};

const LINES: u32 = 0x2000_7000;
const SEEN: u32 = 0x2000_7004;
const LATER: u32 = 0x2000_7008;
const RESULTS: u32 = 0x2000_7010;
/// Ticks until lines asked for later are raised.
const DELAY: u64 = 5000;

fn word(chip: &Chip, address: u32) -> u32 {
    chip.peek(address, Width::Word).unwrap()
}

#[test]
fn the_interrupt_probe_finds_what_the_architecture_promises() {
    let mut chip = Chip::new(&support::build::build("probe", &[]));
    chip.context_mut().clocks.cpu_ticks = 1;
    let mut later = None;
    while word(&chip, RESULTS + 4 * 12) != 0x600d {
        assert!(chip.now() < Cycles(1_000_000), "stuck at pc {:#x}", chip.cpu().registers().r[15]);
        let until = chip.now() + 16;
        chip.run_until(until);
        assert_eq!(chip.violations(), []);
        match word(&chip, LATER) {
            0 => {}
            lines => {
                later = Some((chip.now() + DELAY, lines));
                chip.sram_mut().write(LATER, Width::Word, 0);
            }
        }
        if let Some((at, lines)) = later
            && chip.now() >= at
        {
            assert!(chip.cpu().is_asleep());
            chip.sram_mut().write(LINES, Width::Word, lines);
            later = None;
        }
        let lines = word(&chip, LINES);
        chip.context_mut().set_irq(Irq::Eic, lines & Irq::Eic.bit() != 0);
        chip.sram_mut().write(SEEN, Width::Word, lines);
    }
    let results: Vec<u32> = (0..12).map(|check| word(&chip, RESULTS + 4 * check)).collect();
    assert_eq!(results, [0, 1, 0, 1, 0, 1, 1, 0x243, 0x234, 7, 6, 5]);
}
