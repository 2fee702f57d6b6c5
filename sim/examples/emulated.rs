//! How fast the flashed images run, and where their cycles go: `cargo firmware`, then
//! `cargo run --release -p sarah-sim --example emulated -- target/thumbv6m-none-eabi/firmware [--seconds N] [--profile]`.
//!
//! Four chips, bus, host link and robot, armed and pushed. Prints emulated seconds per second of one core, awake cycles
//! per tick of each chip, and a digest of everything that crossed the wires and of every chip's cycles: equal digests are
//! equal runs. `--profile` adds cycles per tick by function, and is slower.

use std::error::Error;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
use std::time::Instant;

use sarah_protocol::bus::{Mode, NodeId};
use sarah_protocol::session::{HostSession, News};
use sarah_sim::awake::Summary;
use sarah_sim::emulated::{Emulated, Images, NAMES};
use sarah_sim::robot::Health;
use sarah_sim::scenario::{Episode, Push};
use sarah_sim::sil::SilConfig;
use sarah_sim::world::World;

/// Between two exchanges with the host, µs.
const STEP_US: u64 = 1_000;
/// Functions listed per chip.
const LISTED: usize = 25;

fn main() -> Result<(), Box<dyn Error>> {
    let (mut folder, mut seconds, mut profile) = (None, 6.0, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--seconds" => seconds = arguments.next().ok_or("--seconds needs a number")?.parse()?,
            "--profile" => profile = true,
            _ => folder = Some(argument),
        }
    }
    let folder =
        folder.ok_or("which folder has the images? `cargo firmware` says target/thumbv6m-none-eabi/firmware")?;
    let push =
        |at_s, impulse_n_s, direction_deg| Push { at_s, impulse_n_s, direction_deg, duration_s: 0.1, height_m: 0.0 };
    let episode = Episode {
        index: 0,
        seed: 5,
        duration_s: 3600.0,
        settle_s: 0.5,
        drop_m: 0.005,
        pushes: vec![push(1.5, 15.0, 0.0), push(4.0, 12.0, 180.0)],
        direction: None,
    };
    let mut robot = Emulated::new(&SilConfig::default(), &Images::load(Path::new(&folder))?, &episode)?;
    robot.can_mut().record(true);
    robot.measure()?;
    if profile {
        robot.chips_mut().iter_mut().for_each(|chip| drop(chip.set_profiling(true)));
    }

    let clock = Instant::now();
    let (health, digest) = run(&mut robot, (seconds * 1e6) as u64)?;
    let simulated_s = robot.now_us() as f64 * 1e-6;
    let awake = robot.awake().ok_or("not measured")?;
    let instructions: u64 = robot.chips().iter().map(|chip| chip.cpu().instructions()).sum();
    let cpu_s = cpu_s(&clock);
    println!("{health:?} at {simulated_s:.3} s, digest {digest:016x}");
    println!(
        "{:.2} sim-s per CPU-s, {:.1} million instructions per sim-s",
        simulated_s / cpu_s,
        instructions as f64 * 1e-6 / simulated_s
    );
    println!("| image | ticks | mean | p99 | max | late p99 | late max |\n|---|---:|---:|---:|---:|---:|---:|");
    for (name, awake) in NAMES.iter().zip(&awake) {
        let Summary { ticks, mean, p99, max, late_p99, late_max } = awake;
        println!("| {name} | {ticks} | {mean:.0} | {p99} | {max} | {late_p99} | {late_max} |");
    }
    for ((name, chip), awake) in NAMES.iter().zip(robot.chips()).zip(&awake) {
        if let Some(profile) = chip.profile() {
            println!("\n{name}, awake cycles per tick by function:");
            for (function, cycles) in profile.functions().into_iter().take(LISTED) {
                println!("{:9.1} {function}", cycles as f64 / awake.ticks as f64);
            }
        }
    }
    Ok(())
}

/// Arms and runs to `until_us` or the robot's end; a digest of what happened.
fn run(robot: &mut Emulated, until_us: u64) -> Result<(Health, u64), Box<dyn Error>> {
    let mut digest = DefaultHasher::new();
    let mut session = HostSession::new(7);
    let (mut health, mut armed, mut wait_ms) = (Health::Upright, false, 0);
    while health == Health::Upright && robot.now_us() < until_us {
        if !armed && wait_ms == 0 {
            // Refused until everything is ready.
            let _ = session.arm();
            wait_ms = 50;
        }
        wait_ms -= u32::from(wait_ms > 0);
        while let Some(bytes) = session.poll(robot.now_us()) {
            robot.host_write(&bytes);
        }
        health = robot.run_until(robot.now_us() + STEP_US)?;
        let bytes = robot.host_read();
        session.on_bytes(robot.now_us(), &bytes, &mut |news| {
            if let News::Telemetry(telemetry) = news {
                armed = telemetry.mode == Mode::Armed;
            }
        });
        bytes.hash(&mut digest);
        for record in robot.can_mut().take_log() {
            (record.start, record.end, record.sender, record.frame.id, record.frame.data).hash(&mut digest);
        }
        format!("{:?}", NodeId::ALL.map(|id| robot.commands(id))).hash(&mut digest);
        for chip in robot.chips() {
            (chip.now(), chip.awake(), chip.cpu().instructions(), chip.cpu().exceptions()).hash(&mut digest);
        }
    }
    Ok((health, digest.finish()))
}

/// Seconds this thread has spent on a core, or wall-clock seconds where the system does not say.
fn cpu_s(start: &Instant) -> f64 {
    let on_core_ns = std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|stat| stat.split_whitespace().next()?.parse::<f64>().ok());
    on_core_ns.map_or_else(|| start.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}
