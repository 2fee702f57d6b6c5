//! `sarah record` and `sarah replay`.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use clap::Args;
use sarah_sim::robot::Health;
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::SilConfig;

use super::CliError;
use super::link::{LinkArgs, LinkName};
use crate::link::port::Target;
use crate::progress::Progress;
use crate::recording::live::{Going, Listening};
use crate::recording::parts::{Part, file_of};
use crate::recording::simulated::Simulation;
use crate::recording::{About, Parts, Recorder, RecordingError, replay};
use crate::run::utc_now;
use crate::stop;

/// Telemetry of a simulated robot, frames per second, unless asked otherwise.
const RATE_HZ: u16 = 100;
/// Between two lines on how a recording without an end goes, s.
const LINE_S: f64 = 10.0;
/// Length of a part, unless asked otherwise, min: about 0.7 GB at 100 frames per second.
const SPLIT_MIN: f64 = 60.0;

#[derive(Args, Debug)]
pub(super) struct RecordArgs {
    /// File to make; by default recordings/TIME.mcap.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// How long; by default the scenario's length, or with a robot on a port until Ctrl-C.
    #[arg(long, value_parser = seconds)]
    seconds: Option<f64>,
    /// With a robot on a port: begin another file every so many minutes, 0.05 to 10000; by default 60. Each is whole, and
    /// named after the time it begins.
    #[arg(long, value_name = "MINUTES", value_parser = minutes)]
    split: Option<f64>,
    /// Telemetry frames per second, 1 to 1000; 100 if simulated. Asking a robot on a port for it needs the claim, so
    /// without this the recording only listens.
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u16).range(1..=1000))]
    rate: Option<u16>,
    /// What happens to a simulated robot: paper, push-grid, stand, train, or the path of a TOML file.
    #[arg(long, default_value = "train")]
    scenario: String,
    /// Seed of pushes and sensor noise of a simulated robot.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Ticks of the pattern generators per second with --link sim, 100 to 10000.
    #[arg(long, default_value_t = 100)]
    lpg_rate: u32,
    #[command(flatten)]
    link: LinkArgs,
}

#[derive(Args, Debug)]
pub(super) struct ReplayArgs {
    /// A file that `sarah record` wrote.
    file: PathBuf,
}

/// Records as the arguments say.
pub(super) fn record(args: &RecordArgs) -> Result<(), CliError> {
    let stop = stop::when_asked().map_err(RecordingError::Signal)?;
    match args.link.serial() {
        Some(target) => listen(args, target, &stop),
        None if args.split.is_some() => Err(RecordingError::NotSplit.into()),
        None => simulate(args, &file_of(args.out.as_deref(), 1, &utc_now()), &stop),
    }
}

fn simulate(args: &RecordArgs, path: &Path, stop: &AtomicBool) -> Result<(), CliError> {
    let episode = Scenario::load(&args.scenario)?.episode(args.seed, 0);
    let images = args.link.images();
    let link = args.link.link.as_ref().unwrap_or(&LinkName::Sim).to_string();
    let simulation = Simulation {
        config: SilConfig { images, lpg_rate_hz: args.lpg_rate, ..SilConfig::default() },
        seconds: args.seconds.unwrap_or_else(|| f64::from(episode.duration_s)),
        rate_hz: args.rate.unwrap_or(RATE_HZ),
        episode,
    };
    let seed = args.seed.to_string();
    let about = About::default().with("link", link).with("scenario", &args.scenario).with("seed", seed);
    let mut recorder = Recorder::create(path, about)?;
    let progress = Progress::counting(simulation.seconds.ceil() as u64, "seconds");
    let ended = simulation.record(&mut recorder, stop, &mut |_| progress.episode(None));
    progress.finish();
    let ended = ended?;
    let messages = recorder.finish()?;
    let health = match ended.health {
        Health::Upright => "upright".into(),
        other => format!("{other:?}"),
    };
    println!("{}: {messages} messages over {:.1} s; the robot: {health}", path.display(), ended.seconds);
    Ok(())
}

fn listen(args: &RecordArgs, target: &Target, stop: &AtomicBool) -> Result<(), CliError> {
    let listening = Listening { target: target.clone(), rate_hz: args.rate, seconds: args.seconds };
    let link = listening.open()?;
    let port = link.health().port;
    let files = RefCell::new(vec![]);
    let about = About::now(link.now_us()).with("link", format!("serial:{port}"));
    let begin = |part: Part| begin_part(args.out.as_deref(), part, &about, &mut files.borrow_mut());
    let every_us = (args.split.unwrap_or(SPLIT_MIN) * 60e6) as u64;
    let mut parts = Parts::new(Some(every_us), link.now_us(), Box::new(begin))?;
    let bar = args.seconds.map(|seconds| Progress::counting(seconds.ceil() as u64, "seconds"));
    if bar.is_none() {
        eprintln!("recording {port}; Ctrl-C ends it");
    }
    let mut line_s = 0.0;
    let ended = listening.record(&link, &mut parts, stop, &mut |going| match &bar {
        Some(bar) => bar.episode(Some(words(&going))),
        None if going.seconds >= line_s => {
            line_s = going.seconds + LINE_S;
            eprintln!("{:6.0} s  {}", going.seconds, words(&going));
        }
        None => {}
    });
    if let Some(bar) = bar {
        bar.finish();
    }
    // What was heard before a failure is kept all the same.
    let messages = parts.finish();
    let files = files.into_inner();
    if ended.is_err() {
        eprintln!("kept, each readable by itself: {}", names(&files));
    }
    let (ended, messages) = (ended?, messages?);
    println!("{}: {messages} messages over {:.1} s, {}", names(&files), ended.seconds, words(&ended));
    Ok(())
}

/// Begins the file of a part, and notes its name.
fn begin_part(
    chosen: Option<&Path>,
    part: Part,
    about: &About,
    files: &mut Vec<PathBuf>,
) -> Result<Recorder, RecordingError> {
    let started = utc_now();
    let path = file_of(chosen, part.number, &started);
    let first = files.first().unwrap_or(&path).file_name().unwrap_or_default().to_string_lossy().into_owned();
    let about = About { begins_us: part.begins_us, ..about.clone() };
    let about = about.with("started", started).with("part", part.number.to_string()).with("first_part", first);
    let recorder = Recorder::create(&path, about)?;
    eprintln!("part {}: {}", part.number, path.display());
    files.push(path);
    Ok(recorder)
}

fn names(files: &[PathBuf]) -> String {
    match files {
        [] => String::new(),
        [one] => one.display().to_string(),
        [first, .., last] => format!("{} to {}, {} files", first.display(), last.display(), files.len()),
    }
}

fn words(going: &Going) -> String {
    let port = if going.up { "" } else { "; the port is gone" };
    format!("{} telemetry frames, {} lost{port}", going.frames, going.lost)
}

/// Replays as the arguments say.
pub(super) fn run_replay(args: &ReplayArgs) -> Result<(), CliError> {
    let began = Instant::now();
    let progress = Progress::counting(100, "percent");
    let mut shown = 0;
    let replayed = replay(&args.file, &mut |share| {
        let percent = (share * 100.0) as u64;
        (shown..percent).for_each(|_| progress.episode(None));
        shown = shown.max(percent);
    });
    progress.finish();
    print!("{}", replayed?);
    println!("replayed in {:.1} s", began.elapsed().as_secs_f64());
    Ok(())
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 1e6 => Ok(seconds),
        _ => Err("give seconds, above 0 and at most 1000000".into()),
    }
}

fn minutes(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(minutes) if (0.05..=10_000.0).contains(&minutes) => Ok(minutes),
        _ => Err("give minutes, from 0.05 to 10000".into()),
    }
}
