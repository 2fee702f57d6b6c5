//! `sarah emulate`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use sarah_sim::emulated::NAMES;
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::SilConfig;

use super::CliError;
use super::link::IMAGES;
use crate::emulate::serve::{Server, Service, serve};
use crate::emulate::{self, Setup, Shown, gdb};
use crate::flash::Node;

/// What chips are compared with.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Reference {
    /// The library, tick by tick beside the chips.
    Sil,
}

#[derive(Args, Debug)]
pub(super) struct EmulateArgs {
    /// Where the images lie.
    #[arg(long, default_value = IMAGES)]
    images: PathBuf,
    /// paper, push-grid, stand, train, or the path of a TOML file.
    #[arg(long, default_value = "train")]
    scenario: String,
    /// Seed of pushes and sensor noise.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Emulated time; without it the scenario's, or with a host link until Ctrl-C.
    #[arg(long, value_parser = seconds)]
    seconds: Option<f64>,
    /// As fast as it can instead of in real time.
    #[arg(long)]
    fast: bool,
    /// Compare every tick of the nodes with the library, bit by bit, and say where they differ first.
    #[arg(long, value_enum)]
    compare: Option<Reference>,
    /// Print awake cycles per tick, and the functions they go to.
    #[arg(long)]
    cycles: bool,
    /// Keep the coordinator's non-volatile memory in this file: ending and starting again is a power cycle.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["compare", "cycles"])]
    memory: Option<PathBuf>,
    /// Print what the chips log, in words (needs `defmt-print`).
    #[arg(long, conflicts_with_all = ["compare", "cycles"])]
    logs: bool,
    /// Wait for GDB on this TCP port of this machine, and let it control --chip.
    #[arg(long, value_name = "PORT", conflicts_with_all = ["compare", "cycles"])]
    gdb: Option<u16>,
    /// The chip that GDB controls.
    #[arg(long, value_enum, default_value = "knee")]
    chip: Node,
}

/// Does what the arguments say.
pub(super) fn run(args: &EmulateArgs) -> Result<(), CliError> {
    let scenario = Scenario::load(&args.scenario)?;
    let alone = args.compare.is_some() || args.cycles;
    let whole = if alone { f64::from(scenario.duration_s) } else { f64::MAX };
    let config = SilConfig::default();
    let (images, seconds) = (args.images.clone(), args.seconds.unwrap_or(whole));
    let setup = Setup { images, config, scenario, seed: args.seed, seconds };
    if alone {
        let shown = emulate::unattended(&setup, args.compare.is_some(), args.cycles)?;
        print!("{}", words(&shown));
    } else {
        let service = Service { fast: args.fast, logs: args.logs, memory: args.memory.clone() };
        let server = Server::start(&setup, &service)?;
        let chip = NAMES.iter().position(|name| *name == args.chip.name()).unwrap_or_default();
        match args.gdb {
            Some(port) => gdb::debug(server, chip, args.chip.name(), port)?,
            None => serve(server)?,
        }
    }
    Ok(())
}

fn words(shown: &Shown) -> String {
    use std::fmt::Write;
    let mut text = String::new();
    // Writing into a string cannot fail.
    if let Some(compared) = &shown.compared {
        let _ = writeln!(
            text,
            "identical: {} ticks, {} actuator commands and {} frames compared over {:.1} s",
            compared.ticks, compared.commands, compared.frames, shown.seconds
        );
    }
    if let Some(awake) = &shown.awake {
        let _ =
            writeln!(text, "| image | ticks | awake cycles per tick, mean | p99 | max |\n|---|---:|---:|---:|---:|");
        for (name, chip) in NAMES.iter().zip(awake) {
            let _ = writeln!(text, "| {name} | {} | {:.0} | {} | {} |", chip.ticks, chip.mean, chip.p99, chip.max);
        }
    }
    for (name, functions) in NAMES.iter().zip(&shown.functions) {
        let total: u64 = functions.iter().map(|(_, cycles)| cycles).sum();
        let _ = writeln!(text, "\n{name}, awake cycles by function:");
        for (function, cycles) in functions.iter().take(12) {
            let _ = writeln!(text, "{:6.1} %  {function}", 100.0 * *cycles as f64 / total.max(1) as f64);
        }
    }
    let pace = shown.seconds / shown.wall_s.max(1e-9);
    let _ = writeln!(
        text,
        "{:.1} s emulated in {:.1} s, {pace:.1} x real time; the robot fell {} times",
        shown.seconds, shown.wall_s, shown.falls
    );
    text
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 1e6 => Ok(seconds),
        _ => Err("give seconds, above 0 and at most 1000000".into()),
    }
}
