//! The `sarah` command: arguments in, one clear line on error.

use std::path::{Path, PathBuf};

use clap::{Args, Parser, Subcommand, ValueEnum};
use sarah_firmware::default_params;
use sarah_sim::emulated::NAMES;
use sarah_sim::scenario::{Overrides, Scenario, ScenarioError};
use sarah_sim::sensors::SensorConfig;
use sarah_sim::sil::SilConfig;
use thiserror::Error;

use crate::bake::bake;
use crate::emulate::serve::{Server, serve};
use crate::emulate::{self, EmulateError, Setup, Shown, gdb};
use crate::evaluate::{Controller, EvaluateError, autonomy, run_many};
use crate::flash::{self, BOARDS_FILE, Boards, FlashError, Job, Node, Tool};
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
    Flash(FlashArgs),
    /// Run the flashed images on four emulated chips with the simulated robot; build them with `cargo firmware`.
    #[command(
        after_help = "Examples:\n  sarah emulate                                prints the path of the host link, in real time\n  \
        sarah emulate --compare sil --seconds 30 --seed 3\n  \
        sarah emulate --cycles --seconds 60 --scenario stand"
    )]
    Emulate(EmulateArgs),
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

/// What chips are compared with.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Reference {
    /// The library, tick by tick beside the chips.
    Sil,
}

#[derive(Args, Debug)]
struct EmulateArgs {
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

#[derive(Args, Debug)]
#[command(group(clap::ArgGroup::new("what").required(true).args(["node", "all", "elf"])))]
struct FlashArgs {
    /// Which image.
    #[arg(long, value_enum)]
    node: Option<Node>,
    /// All four images, each onto its board.
    #[arg(long, conflicts_with_all = ["probe", "run"])]
    all: bool,
    /// This very file.
    #[arg(long)]
    elf: Option<PathBuf>,
    /// Serial number of the board's probe; without it the board map's, or the only board plugged in.
    #[arg(long)]
    probe: Option<String>,
    /// Board map: which probe is which node's.
    #[arg(long, default_value = BOARDS_FILE)]
    boards: PathBuf,
    /// Where the images lie.
    #[arg(long, default_value = IMAGES)]
    images: PathBuf,
    /// What flashes.
    #[arg(long, value_enum, default_value = "openocd")]
    tool: Tool,
    /// Show the image's logs afterwards, until Ctrl-C.
    #[arg(long)]
    run: bool,
    /// Only print the command.
    #[arg(long)]
    dry_run: bool,
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
        Verb::Flash(args) => flash_verb(&args),
        Verb::Emulate(args) => emulate_verb(&args),
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

fn emulate_verb(args: &EmulateArgs) -> Result<(), CliError> {
    let scenario = Scenario::load(&args.scenario)?;
    let episode = scenario.episode(args.seed, 0);
    let alone = args.compare.is_some() || args.cycles;
    let whole = if alone { f64::from(episode.duration_s) } else { f64::MAX };
    let config = SilConfig::default();
    let setup = Setup { images: args.images.clone(), config, episode, seconds: args.seconds.unwrap_or(whole) };
    if alone {
        let shown = emulate::unattended(&setup, args.compare.is_some(), args.cycles)?;
        print!("{}", words(&shown));
    } else {
        let server = Server::start(&setup, args.fast, args.logs)?;
        let chip = NAMES.iter().position(|name| *name == args.chip.name()).unwrap_or_default();
        let health = match args.gdb {
            Some(port) => gdb::debug(server, chip, args.chip.name(), port)?,
            None => serve(server)?,
        };
        println!("the robot: {health:?}");
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
        "{:.1} s emulated in {:.1} s, {pace:.1} x real time; the robot: {:?}",
        shown.seconds, shown.wall_s, shown.health
    );
    text
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 1e6 => Ok(seconds),
        _ => Err("give seconds, above 0 and at most 1000000".into()),
    }
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

fn flash_verb(args: &FlashArgs) -> Result<(), CliError> {
    let nodes = if args.all { Node::ALL.to_vec() } else { args.node.into_iter().collect() };
    let map = if args.all || args.boards.exists() { Some(Boards::load(&args.boards)?) } else { None };
    let mut jobs = vec![];
    for node in &nodes {
        let mapped = map.as_ref().map(|map| map.probe(*node, &args.boards).map(str::to_owned));
        let probe = match args.probe.clone() {
            Some(probe) => Some(probe),
            None => mapped.transpose()?,
        };
        jobs.push((node.name().to_owned(), Job { elf: args.images.join(node.name()), probe }));
    }
    if let Some(elf) = &args.elf {
        let name = elf.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // `cargo run` gives a path and no node: the image is named after its node.
        let node = Node::ALL.into_iter().find(|node| node.name() == name);
        let mapped = map.as_ref().zip(node).and_then(|(map, node)| map.probe(node, &args.boards).ok());
        let probe = args.probe.clone().or(mapped.map(str::to_owned));
        jobs.push((name, Job { elf: elf.clone(), probe }));
    }
    // All are looked at before the first is written.
    let attached = flash::attached();
    let jobs: Vec<_> =
        jobs.into_iter().map(|(name, job)| Ok((name, job.checked(&attached)?))).collect::<Result<_, FlashError>>()?;
    for (name, job) in jobs {
        if args.dry_run {
            let command = if args.run { args.tool.run(&job, 9090) } else { args.tool.flash(&job) };
            println!("{}", flash::typed(&command));
        } else if args.run {
            job.run(args.tool)?;
        } else {
            job.flash(args.tool)?;
            println!("{name}: written and verified");
        }
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
