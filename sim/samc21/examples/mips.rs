//! How fast the core runs: `cargo run --release -p samc21 --example mips`.
//!
//! Emulates one chip that computes Factor without pause, with DIVAS and with division in software, at two flash wait
//! states, and prints millions of instructions and cycles per second of one thread: the best of five runs, and the
//! median.

#[path = "../tests/support/build.rs"]
mod build;

use std::time::Instant;

use samc21::nvm::ReadMode;
use samc21::{Chip, Cycles, Image};

/// Emulated time of one run.
const RUN: Cycles = Cycles::from_millis(2000);

fn main() {
    for (name, flags) in [("Factor, DIVAS", &[][..]), ("Factor, division in software", &["--cfg=soft_division"])] {
        let image = build::build("factor", flags);
        let mut runs: Vec<_> = (0..5).map(|_| run(&image)).collect();
        runs.sort_by(|a, b| b.0.total_cmp(&a.0));
        println!(
            "{name}: best {:.1} MIPS, median {:.1} MIPS, {:.1} Mcycle/s, {:.2} cycles per instruction",
            runs[0].0,
            runs[2].0,
            runs[0].1,
            runs[0].1 / runs[0].0
        );
    }
}

/// MIPS and millions of cycles per second.
fn run(image: &Image) -> (f64, f64) {
    let mut chip = Chip::new(image);
    chip.context_mut().clocks.cpu_ticks = 1;
    chip.nvm_mut().set_timing(2, ReadMode::NoMissPenalty);
    let start = Instant::now();
    chip.run_until(RUN);
    let seconds = start.elapsed().as_secs_f64();
    assert_eq!(chip.violations(), []);
    (chip.cpu().instructions() as f64 / seconds / 1e6, chip.now().0 as f64 / seconds / 1e6)
}
