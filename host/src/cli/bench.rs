//! `sarah bench`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use sarah_firmware::default_params;
use sarah_sim::emulated::{Emulated, Images, NAMES};
use sarah_sim::line::Faults;
use sarah_sim::scenario::{Episode, Scenario};
use sarah_sim::sil::SilConfig;
use sarah_sim::world::{self, World};

use super::CliError;
use super::link::{IMAGES, LinkArgs};
use crate::bench::latency::{self, Times};
use crate::bench::wire::Wire;
use crate::bench::{BenchError, flood, soak};
use crate::progress::Progress;

/// Identifier of the halt on the bus.
const HALT: u32 = 0x010;

#[derive(Args, Debug)]
pub(super) struct BenchArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand, Debug)]
enum What {
    /// From a host's word to its effect: parameter sets and emergency stops, on the emulated chips.
    #[command(after_help = "Example:\n  sarah bench latency --tries 10000")]
    Latency {
        /// Tries of each.
        #[arg(long, default_value_t = 1_000)]
        tries: u32,
        /// Where the images lie.
        #[arg(long, default_value = IMAGES)]
        images: PathBuf,
        /// Seed of the sets.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Awake cycles and lateness of the control ticks, with and without a host that floods the link.
    #[command(after_help = "Example:\n  sarah bench flood --seconds 20")]
    Flood {
        /// Emulated seconds of each.
        #[arg(long, default_value_t = 20.0)]
        seconds: f64,
        /// Where the images lie.
        #[arg(long, default_value = IMAGES)]
        images: PathBuf,
        /// Seed of the sets.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// A bad line for a long time: lost, doubled and flipped bytes, a pulled cable, stops.
    #[command(after_help = "Examples:\n  sarah bench soak --minutes 30 --link emulated\n  \
        sarah bench soak --minutes 180 --link sim")]
    Soak {
        /// The robot's minutes.
        #[arg(long, default_value_t = 5.0)]
        minutes: f64,
        /// Share of the bytes, either way, that are lost; half as many are doubled, as many have a bit flipped.
        #[arg(long, default_value_t = 0.0005)]
        faults: f64,
        /// Seed of everything.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        #[command(flatten)]
        link: LinkArgs,
    },
}

/// Does what the arguments say.
pub(super) fn run(args: &BenchArgs) -> Result<(), CliError> {
    match &args.what {
        What::Latency { tries, images, seed } => latency_of(*tries, images, *seed)?,
        What::Flood { seconds, images, seed } => flooding(*seconds, images, *seed)?,
        What::Soak { minutes, faults, seed, link } => {
            if link.serial().is_some() {
                return Err(CliError::OnlySimulated("bench soak"));
            }
            soaking(*minutes, *faults, *seed, link)?;
        }
    }
    Ok(())
}

fn standing() -> Result<Episode, CliError> {
    Ok(Scenario::load("stand")?.episode(1, 0))
}

fn emulated(images: &std::path::Path) -> Result<Emulated, CliError> {
    let images = Images::load(images).map_err(BenchError::from)?;
    Ok(Emulated::new(&SilConfig::default(), &images, &standing()?).map_err(BenchError::from)?)
}

fn latency_of(tries: u32, images: &std::path::Path, seed: u64) -> Result<(), CliError> {
    let progress = Progress::counting(2 * u64::from(tries), "tries");
    let mut wire = Wire::new(emulated(images)?);
    wire.world.run_on();
    let sets = latency::parameters(&mut wire, tries, seed, &|| progress.episode(None))?;
    wire.world.can_mut().record(true);
    let halt = |world: &mut Emulated| {
        let log = world.can_mut().take_log();
        log.iter().find(|record| record.frame.id == HALT && record.error.is_none()).map(|record| record.end.0 / 48)
    };
    let (halts, answers) = latency::stops(&mut wire, tries, &|| progress.episode(None), halt)?;
    progress.finish();
    println!("| from the host's word | tries | p50 | p99 | max |\n|---|---:|---:|---:|---:|");
    row("to a set in force, acknowledged", &sets);
    row("emergency stop to the halt on the bus", &halts);
    row("emergency stop to its confirmation at the host", &answers);
    println!("none lost, none applied twice, none torn: each set was read back whole");
    Ok(())
}

fn row(what: &str, times: &Times) {
    let [p50, p99, max] = [0.5, 0.99, 1.0].map(|p| times.quantile(p));
    println!("| {what} | {} | {p50:.1} ms | {p99:.1} ms | {max:.1} ms |", times.count());
}

fn flooding(seconds: f64, images: &std::path::Path, seed: u64) -> Result<(), CliError> {
    println!(
        "| image | host | ticks | awake cycles per tick, mean | p99 | max | late by, p99 | max |\n\
         |---|---|---:|---:|---:|---:|---:|---:|"
    );
    let mut sets = 0;
    for (flooded, host) in [(false, "quiet"), (true, "floods")] {
        let (awake, changed) = flood::flood(emulated(images)?, seconds, flooded, seed)?;
        sets += changed;
        for (name, chip) in NAMES.iter().zip(awake) {
            println!(
                "| {name} | {host} | {} | {:.0} | {} | {} | {} | {} |",
                chip.ticks, chip.mean, chip.p99, chip.max, chip.late_p99, chip.late_max
            );
        }
    }
    println!("late: cycles that a tick began more than a period after the one before; {sets} sets were changed");
    Ok(())
}

fn soaking(minutes: f64, faults: f64, seed: u64, link: &LinkArgs) -> Result<(), CliError> {
    let config = SilConfig { images: link.images(), ..SilConfig::default() };
    let mut world = world::start(&config, default_params(), &standing()?).map_err(BenchError::from)?;
    world.run_on();
    let faults = Faults { lose: faults, double: faults / 2.0, flip: faults };
    let progress = Progress::counting(minutes.ceil() as u64, "minutes");
    let done = std::cell::Cell::new(0);
    let soaked = soak::soak(world, faults, minutes * 60.0, seed, &|now_s| {
        while done.get() < (now_s / 60.0) as u64 {
            done.set(done.get() + 1);
            progress.episode(None);
        }
    })?;
    progress.finish();
    let (robot_s, wall_s) = soaked.seconds;
    println!("{:.1} min of the robot in {:.1} min", robot_s / 60.0, wall_s / 60.0);
    println!("{} sets changed, each once and whole; {} emergency stops", soaked.sets, soaked.stops);
    println!(
        "the cable pulled {} times, {:.0} s altogether; {} bytes hit",
        soaked.pulled.0, soaked.pulled.1, soaked.hit
    );
    let stats = soaked.stats;
    println!(
        "{} frames sent: {} heard, {} missed; {} with a wrong check sum or length; {} requests repeated",
        soaked.sent, stats.frames, stats.lost, stats.frame_errors, stats.retries
    );
    println!(
        "wrap-arounds: {} of the sequence numbers, {} of the microsecond clock, {} of the generations",
        soaked.wraps.0, soaked.wraps.1, soaked.wraps.2
    );
    println!("resident memory: {} KiB after a tenth, {} KiB at the end", soaked.rss_kib.0, soaked.rss_kib.1);
    Ok(())
}
