//! The `sarah` command: arguments in, one clear line on error.

mod emulate;
mod flash;

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};
use sarah_firmware::default_params;
use sarah_sim::scenario::{Overrides, Scenario, ScenarioError};
use sarah_sim::sensors::SensorConfig;
use sarah_sim::sil::SilConfig;
use thiserror::Error;

use crate::bake::bake;
use crate::emulate::EmulateError;
use crate::evaluate::{Controller, EvaluateError, autonomy, run_many};
use crate::flash::FlashError;
use crate::metrics::Summary;
use crate::progress::Progress;
use crate::report::{ControllerReport, Evaluation, headline};
use crate::run::{Layout, ParamFileError, RunError, load_param_set, read_text};
use crate::train::{self, ConfigError, Method, TrainConfig, TrainError};

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
        sarah train --print-config > my.toml && sarah train --config my.toml")]
    Train(TrainArgs),
    /// Run a controller through a scenario and sum it up.
    #[command(after_help = "Examples:\n  sarah evaluate --scenario stand --episodes 3\n  \
        sarah evaluate --controller braked --scenario push-grid --impulse 24\n  \
        sarah evaluate --params runs/train-1/params.toml --scenario push-grid --impulse 18 --directions 24 \
        --repeats 4 --seed 7 --json")]
    Evaluate(EvaluateArgs),
    /// Work with parameter sets.
    #[command(after_help = "Example:\n  sarah params bake runs/train-1")]
    Params {
        #[command(subcommand)]
        verb: ParamsVerb,
    },
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

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum LinkName {
    /// The firmware library in the simulator.
    Sim,
    /// The flashed images on emulated chips.
    Emulated,
}

#[derive(Args, Debug)]
struct LinkArgs {
    /// What balances: the firmware's library, or its images on emulated chips.
    #[arg(long, value_enum, default_value = "sim")]
    link: LinkName,
    /// Where the images lie.
    #[arg(long, default_value = IMAGES)]
    images: PathBuf,
}

impl LinkArgs {
    fn images(&self) -> Option<PathBuf> {
        (self.link == LinkName::Emulated).then(|| self.images.clone())
    }
}

/// Where `cargo firmware` puts the images.
const IMAGES: &str = "target/thumbv6m-none-eabi/firmware";

#[derive(Subcommand, Debug)]
enum ParamsVerb {
    /// Make a run's set the one the firmware is built with; takes effect with the next `cargo firmware`.
    #[command(after_help = "Examples:\n  sarah params bake runs/train-1\n  \
        sarah params bake my-params.toml --into default-params.toml")]
    Bake {
        /// A run folder, or a parameter file.
        from: PathBuf,
        /// The file the firmware is built from. Keeps its comments; [origin] is replaced.
        #[arg(long, default_value = "default-params.toml")]
        into: PathBuf,
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
    /// Emulating.
    #[error(transparent)]
    Emulate(#[from] EmulateError),
}

/// Does what the command line says.
pub fn main() -> Result<(), CliError> {
    match Cli::parse().verb {
        Verb::Train(args) => train_verb(args),
        Verb::Evaluate(args) => evaluate_verb(&args),
        Verb::Params { verb: ParamsVerb::Bake { from, into } } => bake_verb(&from, &into),
        Verb::Flash(args) => flash::run(&args),
        Verb::Emulate(args) => emulate::run(&args),
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
    if let Some(folder) = args.resume {
        train::resume(&folder)?;
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
    config.methods = args.methods.unwrap_or(config.methods);
    config.robot.images = args.link.images().or(config.robot.images);
    config.validate()?;
    if args.print_config {
        print!("{}", config.to_toml()?);
        return Ok(());
    }
    let name = format!("runs/{}-{}", if args.quick { "quick" } else { "train" }, config.seed);
    train::train(&config, args.out.as_deref().unwrap_or(Path::new(&name)))?;
    Ok(())
}

fn evaluate_verb(args: &EvaluateArgs) -> Result<(), CliError> {
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
    if args.json {
        // A summary has only finite numbers, names and lists: it always serialises.
        println!("{}", serde_json::to_string(&summary).unwrap_or_default());
        return Ok(());
    }
    let mut report = ControllerReport::new(&name, &args.scenario, &results);
    report.summary = summary;
    let title = format!("{}, {count} episodes, seed {}", args.scenario, args.seed);
    println!("{}", headline(&Evaluation { title, controllers: vec![report] }));
    Ok(())
}

fn bake_verb(from: &Path, into: &Path) -> Result<(), CliError> {
    let baked = bake(from, into)?;
    for (symbol, before, after) in &baked.changed {
        let before = before.map_or("new".into(), |before| before.to_string());
        println!("{symbol}: {before} -> {after}");
    }
    let count = baked.changed.len();
    println!("{}: {count} changed, from {}; `cargo firmware` builds it in", into.display(), baked.from.display());
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
