//! The `sarah` command: arguments in, one clear line on error.

mod bench;
mod emulate;
mod flash;
mod monitor;
mod params;
mod record;
mod study;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::{Args, Parser, Subcommand, ValueEnum};
use sarah_firmware::default_params;
use sarah_sim::scenario::{Overrides, Scenario, ScenarioError};
use sarah_sim::sensors::SensorConfig;
use sarah_sim::sil::SilConfig;
use thiserror::Error;

use crate::bench::BenchError;
use crate::emulate::EmulateError;
use crate::evaluate::{Controller, EvaluateError, autonomy, run_many};
use crate::flash::FlashError;
use crate::link::port::Target;
use crate::metrics::Summary;
use crate::monitor::MonitorError;
use crate::params::assign::AssignError;
use crate::params::errand::RobotError;
use crate::progress::Progress;
use crate::recording::RecordingError;
use crate::report::{ControllerReport, Evaluation, headline};
use crate::run::{Layout, ParamFileError, RunError, load_param_set, read_text};
use crate::study::StudyError;
use crate::task::odometry::audit::{AuditSummary, ErrorM};
use crate::train::{self, ConfigError, Method, Operator, TrainConfig, TrainError};

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
        sarah train --quick             the same path with small numbers, about two minutes\n  \
        sarah train --seed 7 --out runs/seven\n  \
        sarah train --resume runs/seven  after it was cut off; ends bit-identical\n  \
        sarah train --print-config > my.toml && sarah train --config my.toml\n  \
        sarah train --link serial:/dev/ttyACM0   a robot, in real time; type a to arm it\n  \
        sarah train --link serial --arm          the only board plugged in; arms at once, and after falls\n  \
        sarah train --resume runs/robot-1 --link serial:/dev/ttyACM1")]
    Train(TrainArgs),
    /// Run a controller through a scenario and sum it up.
    #[command(after_help = "Examples:\n  sarah evaluate --scenario stand --episodes 3\n  \
        sarah evaluate --controller braked --scenario push-grid --impulse 24\n  \
        sarah evaluate --params runs/train-1/params.toml --scenario push-grid --impulse 18 --directions 24 \
        --repeats 4 --seed 7 --json")]
    Evaluate(EvaluateArgs),
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
        sarah record --link serial:/dev/ttyACM0 --out walk.mcap")]
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
        sarah study run tests/studies/ablation.toml --out runs/ablation   again, to go on after it was cut off\n  \
        sarah study run tests/studies/small.toml --print-config\n  \
        sarah study report runs/ablation")]
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

#[derive(Args, Debug)]
struct TrainArgs {
    /// Small numbers: shows that everything works, proves nothing.
    #[arg(long, conflicts_with_all = ["config", "resume"])]
    quick: bool,
    /// First seed.
    #[arg(long, conflicts_with = "resume")]
    seed: Option<u64>,
    /// Number of seeds.
    #[arg(long, conflicts_with = "resume")]
    seeds: Option<u64>,
    /// Episodes per session.
    #[arg(long, conflicts_with = "resume")]
    episodes: Option<u32>,
    /// Methods to train, ours first: enaf, enaf-paper, cma-es, random.
    #[arg(long, conflicts_with = "resume", value_delimiter = ',', value_parser = method)]
    methods: Option<Vec<Method>>,
    /// Configuration file; what it leaves out takes its default.
    #[arg(long, conflicts_with = "resume")]
    config: Option<PathBuf>,
    /// Run folder to make; by default runs/train-SEED (runs/quick-SEED).
    #[arg(long, conflicts_with = "resume")]
    out: Option<PathBuf>,
    /// Run folder to go on with.
    #[arg(long)]
    resume: Option<PathBuf>,
    /// Print the configuration and stop.
    #[arg(long, conflicts_with = "resume")]
    print_config: bool,
    /// On a robot: arm when it stands, and again whenever somebody has put it back on its feet after a fall. Without
    /// it, type a.
    #[arg(long)]
    arm: bool,
    /// On a robot: listen here, for instance 127.0.0.1:7755, for poses from whoever sees it from outside; see
    /// docs/odometry.md. Without it, odometry alone.
    #[arg(long, value_name = "ADDRESS:PORT")]
    pose: Option<String>,
    #[command(flatten)]
    link: LinkArgs,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum ControllerName {
    /// The set built into the firmware.
    Default,
    /// Brakes on, whatever happens.
    Braked,
}

#[derive(Args, Debug)]
struct EvaluateArgs {
    /// Parameter file (params.toml).
    #[arg(long, conflicts_with = "controller")]
    params: Option<PathBuf>,
    /// A controller that needs no file.
    #[arg(long, value_enum, default_value = "default")]
    controller: ControllerName,
    /// paper, push-grid, stand, train, or the path of a TOML file.
    #[arg(long, default_value = "push-grid")]
    scenario: String,
    /// Impulse of every push, N·s, instead of the scenario's own.
    #[arg(long)]
    impulse: Option<f32>,
    /// Directions of a push grid.
    #[arg(long)]
    directions: Option<u32>,
    /// Episodes per direction of a push grid.
    #[arg(long)]
    repeats: Option<u32>,
    /// Episodes of a scenario that is not a grid.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    episodes: u64,
    /// Seed of pushes and sensor noise.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Ticks of the pattern generators per second, 100 to 10000.
    #[arg(long, default_value_t = 100)]
    lpg_rate: u32,
    /// Switch all sensor errors off.
    #[arg(long)]
    perfect_sensors: bool,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    link: LinkArgs,
}

/// What balances.
#[derive(Clone, PartialEq, Eq, Debug)]
enum LinkName {
    /// The firmware library in the simulator.
    Sim,
    /// The flashed images on emulated chips.
    Emulated,
    /// A robot on a serial port.
    Serial(String),
}

impl FromStr for LinkName {
    type Err = String;

    fn from_str(text: &str) -> Result<LinkName, String> {
        match text {
            "sim" => Ok(LinkName::Sim),
            "emulated" => Ok(LinkName::Emulated),
            text if text.parse::<Target>().is_ok() => Ok(LinkName::Serial(text.into())),
            _ => {
                Err("give sim, emulated, serial:PATH (for instance serial:/dev/ttyACM0), or serial for the only board"
                    .into())
            }
        }
    }
}

#[derive(Args, Debug)]
struct LinkArgs {
    /// What balances: `sim`, the firmware's library, which it is if nothing is said; `emulated`, its images on emulated chips; `serial:PATH`, a robot,
    /// or `serial` for the only board that is plugged in.
    #[arg(long, value_name = "LINK")]
    link: Option<LinkName>,
    /// Where the images lie.
    #[arg(long, default_value = IMAGES)]
    images: PathBuf,
}

impl LinkArgs {
    fn images(&self) -> Option<PathBuf> {
        (self.link == Some(LinkName::Emulated)).then(|| self.images.clone())
    }

    fn serial(&self) -> Option<&str> {
        match &self.link {
            Some(LinkName::Serial(link)) => Some(link),
            _ => None,
        }
    }

    /// A simulated robot was asked for in so many words.
    fn simulated(&self) -> bool {
        matches!(self.link, Some(LinkName::Sim | LinkName::Emulated))
    }
}

/// Where `cargo firmware` puts the images.
const IMAGES: &str = "target/thumbv6m-none-eabi/firmware";

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
        Verb::Train(args) => train_verb(args),
        Verb::Evaluate(args) => evaluate_verb(&args),
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
            let report = train::outcome::read_report(&layout)?;
            train::outcome::write_report(&layout, &report)?;
            for evaluation in &report.evaluations {
                println!("{}", headline(evaluation));
            }
            println!("report: {}", layout.report().display());
            Ok(())
        }
    }
}

fn train_verb(args: TrainArgs) -> Result<(), CliError> {
    let serial = args.link.serial().map(String::from);
    let operator = Operator { arm: args.arm, link: serial.clone(), pose: args.pose.clone() };
    if let Some(folder) = args.resume {
        if args.link.simulated() {
            return Err(CliError::Ignored("--link sim and emulated", "with --resume, which goes on as the run began"));
        }
        train::resume(&folder, &operator)?;
        return Ok(());
    }
    let mut config = match &args.config {
        Some(path) => TrainConfig::parse(&path.display().to_string(), &read_text(path)?)?,
        None if args.quick => TrainConfig::quick(),
        None => TrainConfig::default(),
    };
    config.seed = args.seed.unwrap_or(config.seed);
    config.seeds = args.seeds.unwrap_or(config.seeds);
    config.episodes = args.episodes.unwrap_or(config.episodes);
    let methods_given = args.methods.is_some();
    config.methods = args.methods.unwrap_or(config.methods);
    config.robot.images = args.link.images().or(config.robot.images);
    if args.link.simulated() {
        config.link = None;
    }
    if let Some(link) = &serial {
        if args.seeds.is_some() || methods_given {
            return Err(CliError::Ignored("--seeds and --methods", "on a robot, which trains eNAF with one seed"));
        }
        config = config.on_a_robot(link);
    }
    if config.link.is_none() && (args.arm || args.pose.is_some()) {
        return Err(CliError::Ignored("--arm and --pose", "in simulation"));
    }
    config.validate()?;
    if args.print_config {
        print!("{}", config.to_toml()?);
        return Ok(());
    }
    let kind = match &config.link {
        Some(_) => "robot",
        None if args.quick => "quick",
        None => "train",
    };
    let name = format!("runs/{kind}-{}", config.seed);
    train::train(&config, args.out.as_deref().unwrap_or(Path::new(&name)), &operator)?;
    Ok(())
}

fn evaluate_verb(args: &EvaluateArgs) -> Result<(), CliError> {
    if args.link.serial().is_some() {
        return Err(CliError::OnlySimulated("evaluate"));
    }
    let (name, controller) = match (&args.params, args.controller) {
        (Some(path), _) => (path.display().to_string(), Controller::Constants(load_param_set(path)?.0)),
        (None, ControllerName::Default) => ("default".into(), Controller::Constants(default_params())),
        (None, ControllerName::Braked) => ("braked".into(), Controller::Braked),
    };
    let overrides = Overrides { impulse_n_s: args.impulse, directions: args.directions, repeats: args.repeats };
    let scenario = Scenario::load(&args.scenario)?.with(&overrides)?;
    let sensors = if args.perfect_sensors { SensorConfig::perfect() } else { SensorConfig::default() };
    let config = SilConfig { lpg_rate_hz: args.lpg_rate, sensors, images: args.link.images(), ..SilConfig::default() };
    let count = scenario.episodes().unwrap_or(args.episodes);
    let progress = Progress::new(count);
    let results = run_many(&controller, &config, &scenario, args.seed, count, &|| progress.episode(None));
    progress.finish();
    let results = results?;
    let mut summary = Summary::new(&name, &args.scenario, &results);
    summary.autonomy = autonomy(&config.energy, &results);
    let audited: Vec<_> = results.iter().filter_map(|result| result.odometry.clone()).collect();
    summary.odometry_error_m = Some(AuditSummary::new(&audited));
    if args.json {
        // A summary has only finite numbers, names and lists: it always serialises.
        println!("{}", serde_json::to_string(&summary).unwrap_or_default());
        return Ok(());
    }
    let mut report = ControllerReport::new(&name, &args.scenario, &results);
    report.summary = summary;
    let title = format!("{}, {count} episodes, seed {}", args.scenario, args.seed);
    println!("{}", headline(&Evaluation { title, controllers: vec![report] }));
    if let Some(ErrorM { median, p95 }) = AuditSummary::new(&audited).after_push_m {
        let cm = 100.0;
        println!("odometry, 3 s after a push: {:.1} cm off in the median, {:.1} cm at 95 %", median * cm, p95 * cm);
    }
    Ok(())
}

fn method(text: &str) -> Result<Method, String> {
    let all = [Method::Enaf, Method::EnafPaper, Method::CmaEs, Method::Random];
    all.into_iter()
        .find(|method| method.folder() == text)
        .ok_or_else(|| "give enaf, enaf-paper, cma-es or random".into())
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
