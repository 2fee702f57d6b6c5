//! Boots firmware images: `cargo run --release -p samc21 --example boot -- <ELF> [<ELF> …] [--millis N]`.
//!
//! Each image runs alone on a chip with nobody on its bus, inputs at mid-scale and the board's resistors. Prints what
//! it does per control tick, where its time goes, and every violation.

use std::time::Instant;

use samc21::pins::{PA, PB};
use samc21::{Chip, Cycles, Image};

/// Supply of the board, V.
const SUPPLY: f32 = 3.3;
/// Control tick of the nodes, 48 MHz ticks.
const TICK: u64 = 4800;
/// Pins that the board pulls down: pulses and brakes of TCC0.
const PULLED_DOWN: [(usize, u8); 4] = [(PA, 20), (PA, 21), (PB, 30), (PB, 31)];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut millis, mut paths) = (1000, vec![]);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--millis" => millis = arguments.next().ok_or("--millis needs a number")?.parse()?,
            _ => paths.push(argument),
        }
    }
    for path in paths {
        println!("── {path}");
        run(&Image::from_elf(&std::fs::read(&path)?)?, millis);
    }
    Ok(())
}

fn run(image: &Image, millis: u64) {
    let mut chip = Chip::new(image);
    let wires = chip.wires_mut();
    wires.supply = SUPPLY;
    wires.analog = [[SUPPLY / 2.0; 12]; 2];
    for (group, pin) in PULLED_DOWN {
        wires.pins[group].solder(pin, false);
    }
    let start = Instant::now();
    // Awake time per tick.
    let (mut ticks, mut last_awake) = (vec![], 0);
    for n in 1..=millis * 10 {
        chip.run_until(Cycles(n * TICK));
        if n == millis * 5 {
            chip.set_profiling(true);
        }
        ticks.push(chip.awake() - last_awake);
        last_awake = chip.awake();
        if chip.cpu().is_locked_up() {
            println!("locked up");
            break;
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    let registers = chip.cpu().registers();
    let place = image.symbols.describe(registers.r[15]).unwrap_or_default();
    println!(
        "after {:.1} ms: {:#010x} {place}{}, CPU {} Hz, {} instructions, {} exceptions, {:.1} × real time",
        chip.now().as_secs_f64() * 1e3,
        registers.r[15],
        if chip.cpu().is_asleep() { " (asleep)" } else { "" },
        chip.context().clocks.cpu().0,
        chip.cpu().instructions(),
        chip.cpu().exceptions(),
        chip.now().as_secs_f64() / seconds
    );
    // The last half: past the start.
    let mut late = ticks.split_off(ticks.len() / 2);
    late.sort_unstable();
    if let (Some(last), false) = (late.last(), late.is_empty()) {
        let mean = late.iter().sum::<u64>() as f64 / late.len() as f64;
        let p99 = late[late.len() * 99 / 100];
        println!("awake cycles per 100 µs: mean {mean:.0}, median {}, p99 {p99}, max {last}", late[late.len() / 2]);
    }
    let brakes = PULLED_DOWN.map(|(group, pin)| chip.wires().share_high(group, pin));
    println!("PA20, PA21, PB30, PB31 are high for {brakes:?}");
    if let Some(profile) = chip.profile() {
        let functions = profile.functions();
        println!("where they go:");
        for (name, cycles) in functions.into_iter().take(15) {
            println!("  {:6.0} {name}", cycles as f64 / (millis * 5) as f64);
        }
    }
    println!("{} violations", chip.context().violation_count());
    for violation in chip.violations().iter().take(30) {
        println!("  {violation}");
    }
}
