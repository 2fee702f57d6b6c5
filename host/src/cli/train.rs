//! `sarah train`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::CliError;
use super::link::LinkArgs;
use crate::run::read_text;
use crate::train::{self, Method, Operator, TrainConfig};

#[derive(Args, Debug)]
pub(super) struct TrainArgs {
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
    /// Methods to train, ours first: enaf, enaf-paper, cma-es, random. One more, external, is a program of yours: see tests/studies.
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

/// Does what the arguments say.
pub(super) fn run(args: TrainArgs) -> Result<(), CliError> {
    let serial = args.link.serial().cloned();
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
    if args.link.simulated() {
        config.link = None;
        config.robot.images = args.link.images();
    }
    if let Some(link) = serial {
        if args.seeds.is_some() || methods_given {
            return Err(CliError::Ignored("--seeds and --methods", "on a robot, which trains eNAF with one seed"));
        }
        config = config.on_a_robot(link);
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

fn method(text: &str) -> Result<Method, String> {
    let all = [Method::Enaf, Method::EnafPaper, Method::CmaEs, Method::Random];
    all.into_iter()
        .find(|method| method.folder() == text)
        .ok_or_else(|| "give enaf, enaf-paper, cma-es or random".into())
}
