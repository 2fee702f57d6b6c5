//! The `sarah` command: arguments in, one clear line on error.

mod bench;
mod emulate;
mod evaluate;
mod flash;
mod link;
mod monitor;
mod params;
mod record;
mod study;
mod train;

use std::path::PathBuf;

use clap::{Parser, Subcommand};
use sarah_sim::scenario::ScenarioError;
use thiserror::Error;

use crate::bench::BenchError;
use crate::emulate::EmulateError;
use crate::evaluate::EvaluateError;
use crate::flash::FlashError;
use crate::monitor::MonitorError;
use crate::params::assign::AssignError;
use crate::params::errand::RobotError;
use crate::recording::RecordingError;
use crate::report::headline;
use crate::run::{Layout, ParamFileError, RunError};
use crate::study::StudyError;
use crate::train::{ConfigError, TrainError, outcome};

/// Trains, evaluates and reports the balance of a biped that steps by local pattern generators.
#[derive(Parser, Debug)]
#[command(name = "sarah", version, about, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand, Debug)]
enum Verb {
    /// Train the three sessions in simulation, compare, and write a report.
    #[command(after_help = "Examples:\n  sarah train                     everything, into runs/train-1\n  \
        sarah train --quick             the same path with small numbers, about a minute\n  \
        sarah train --seed 7 --out runs/seven\n  \
        sarah train --resume runs/seven  after it was cut off; ends bit-identical\n  \
        sarah train --print-config > my.toml && sarah train --config my.toml\n  \
        sarah train --link serial:/dev/ttyACM0   a robot, in real time; type a to arm it\n  \
        sarah train --link serial --arm          the only board plugged in; arms at once, and after falls\n  \
        sarah train --resume runs/robot-1 --link serial:/dev/ttyACM1")]
    Train(train::TrainArgs),
    /// Run a controller through a scenario and sum it up.
    #[command(after_help = "Examples:\n  sarah evaluate --scenario stand --episodes 3\n  \
        sarah evaluate --controller braked --scenario push-grid --impulse 24\n  \
        sarah evaluate --params runs/train-1/params.toml --scenario push-grid --impulse 18 --directions 24 \
        --repeats 4 --seed 7 --json\n  \
        sarah evaluate --impulse 24 --push-duration 0.3 --push-height 0.2   a long push at the chest\n  \
        sarah evaluate --plant sim/mujoco/plant.py --scenario push-grid   MuJoCo instead of rapier")]
    Evaluate(evaluate::EvaluateArgs),
    /// Show, compare and change parameter sets: of files, of runs, of a robot, of the firmware.
    #[command(after_help = "Examples:\n  sarah params show runs/train-1\n  \
        sarah params set --from runs/train-1 --link serial\n  \
        sarah params commit --link serial\n  \
        sarah params bake runs/train-1")]
    Params {
        #[command(subcommand)]
        verb: params::ParamsVerb,
    },
    /// Watch a robot in the terminal, arm it, stop it.
    #[command(after_help = "Examples:\n  sarah monitor --link serial:/dev/ttyACM0\n  \
        sarah monitor --link serial --observe          claims nothing\n  \
        sarah monitor --link serial:/dev/pts/3 > log   a line a second")]
    Monitor(monitor::MonitorArgs),
    /// Record a robot, simulated or real, for Foxglove, Rerun and replay.
    #[command(after_help = "Examples:\n  sarah record --link sim --scenario train --seed 3\n  \
        sarah record --link emulated --seconds 5\n  \
        sarah record --link serial:/dev/ttyACM0 --out walk.mcap\n  \
        sarah record --link serial --split 10        a new file every ten minutes")]
    Record(record::RecordArgs),
    /// Run a recording's inputs through this build's control code, and say where it first differs.
    #[command(after_help = "Example:\n  sarah replay walk.mcap")]
    Replay(record::ReplayArgs),
    /// Write an image onto a board, verify it, and let it run.
    #[command(after_help = "Examples:\n  sarah flash --node knee                      the only board plugged in\n  \
        sarah flash --node knee --probe ATML2130021800000001\n  \
        sarah flash --all --boards boards.toml       all four, each by its probe\n  \
        sarah flash --node knee --run                and show its logs\n  \
        sarah flash --node knee --dry-run            only print the command")]
    Flash(flash::FlashArgs),
    /// Run the flashed images on four emulated chips with the simulated robot; build them with `cargo firmware`.
    #[command(
        after_help = "Examples:\n  sarah emulate                                prints the path of the host link, in real time\n  \
        sarah emulate --compare sil --seconds 30 --seed 3\n  \
        sarah emulate --cycles --seconds 60 --scenario stand\n  \
        sarah emulate --gdb 3333 --chip hip          waits for GDB"
    )]
    Emulate(emulate::EmulateArgs),
    /// Measure the link: latencies, a bad line for a long time, a host that floods it.
    #[command(after_help = "Examples:\n  sarah bench latency --tries 10000\n  \
        sarah bench flood --seconds 20\n  \
        sarah bench soak --minutes 30 --link emulated")]
    Bench(bench::BenchArgs),
    /// Ask many questions at once: a file of arms, seeds and conditions, answered with tables and figures.
    #[command(after_help = "Examples:\n  sarah study run tests/studies/push-map.toml\n  \
        sarah study run tests/studies/sessions.toml --out runs/sessions   again, to go on after it was cut off\n  \
        sarah study run tests/studies/check/small.toml --print-config\n  \
        sarah study report runs/sessions")]
    Study {
        #[command(subcommand)]
        verb: study::StudyVerb,
    },
    /// Draw figures and write report.md again from a run's data, and print its tables.
    #[command(after_help = "Example:\n  sarah report runs/train-1")]
    Report {
        /// The run folder.
        run: PathBuf,
    },
}

/// Why a command failed; one line each.
#[derive(Debug, Error)]
pub enum CliError {
    /// Training.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// Evaluating.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// What would have no effect.
    #[error("{0} mean nothing {1}: leave them out")]
    Ignored(&'static str, &'static str),
    /// Common pushes on a robot.
    #[error("{0} compares controllers on common pushes, which only a simulator gives: --link sim or emulated")]
    OnlySimulated(&'static str),
    /// A scenario.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A parameter file.
    #[error(transparent)]
    Params(#[from] ParamFileError),
    /// A file of a run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Flashing.
    #[error(transparent)]
    Flash(#[from] FlashError),
    /// A robot's parameters.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// Parameters to set.
    #[error(transparent)]
    Assign(#[from] AssignError),
    /// The dashboard.
    #[error(transparent)]
    Monitor(#[from] MonitorError),
    /// A recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Measuring.
    #[error(transparent)]
    Bench(#[from] BenchError),
    /// Emulating.
    #[error(transparent)]
    Emulate(#[from] EmulateError),
    /// A study.
    #[error(transparent)]
    Study(#[from] StudyError),
}

/// Does what the command line says.
pub fn main() -> Result<(), CliError> {
    match Cli::parse().verb {
        Verb::Train(args) => train::run(args),
        Verb::Evaluate(args) => evaluate::run(&args),
        Verb::Params { verb } => params::run(&verb),
        Verb::Monitor(args) => monitor::run(&args),
        Verb::Record(args) => record::record(&args),
        Verb::Replay(args) => record::run_replay(&args),
        Verb::Flash(args) => flash::run(&args),
        Verb::Emulate(args) => emulate::run(&args),
        Verb::Bench(args) => bench::run(&args),
        Verb::Study { verb } => Ok(study::run(&verb)?),
        Verb::Report { run } => {
            let layout = Layout::new(run);
            layout.read_info()?;
            if !layout.evaluation().exists() {
                return Err(RunError::Unfinished(layout.root().to_path_buf()).into());
            }
            let report = outcome::read_report(&layout)?;
            outcome::write_report(&layout, &report)?;
            for evaluation in &report.evaluations {
                println!("{}", headline(evaluation));
            }
            println!("report: {}", layout.report().display());
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    /// Words up to an explanation (set off by spaces) or a redirection.
    fn words(example: &str) -> impl Iterator<Item = &str> {
        let end = example.find("  ").into_iter().chain(example.find('>')).min().unwrap_or(example.len());
        example[..end].split_whitespace()
    }

    #[test]
    fn every_verb_has_examples_and_every_example_parses() {
        for verb in Cli::command().get_subcommands() {
            let help = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.starts_with("Example"), "{} has no examples", verb.get_name());
            let examples: Vec<&str> = help.lines().skip(1).flat_map(|line| line.split(" && ")).collect();
            assert!(!examples.is_empty());
            for example in examples.iter().map(|example| example.trim()) {
                let parsed = Cli::try_parse_from(words(example));
                assert!(parsed.is_ok(), "{example}: {}", parsed.expect_err("refused"));
                assert!(example.starts_with(&format!("sarah {}", verb.get_name())), "{example}");
            }
        }
    }
}
