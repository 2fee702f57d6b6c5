//! `sarah record` and `sarah replay`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
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
use crate::recording::simulated::Simulation;
use crate::recording::{About, Recorder, RecordingError, replay};
use crate::run::utc_now;

/// Telemetry of a simulated robot, frames per second, unless asked otherwise.
const RATE_HZ: u16 = 100;
/// Between two lines on how a recording without an end goes, s.
const LINE_S: f64 = 10.0;

#[derive(Args, Debug)]
pub(super) struct RecordArgs {
    /// File to make; by default recordings/TIME.mcap.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// How long; by default the scenario's length, or with a robot on a port until Ctrl-C.
    #[arg(long, value_parser = seconds)]
    seconds: Option<f64>,
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
    let path = args.out.clone().unwrap_or_else(|| {
        // Colons are not for file names everywhere.
        Path::new("recordings").join(format!("{}.mcap", utc_now().replace(':', "-")))
    });
    let stop = stop_at_ctrl_c()?;
    match args.link.serial() {
        Some(target) => listen(args, target, &path, &stop),
        None => simulate(args, &path, &stop),
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

fn listen(args: &RecordArgs, target: &Target, path: &Path, stop: &AtomicBool) -> Result<(), CliError> {
    let listening = Listening { target: target.clone(), rate_hz: args.rate, seconds: args.seconds };
    let link = listening.open()?;
    let about = About::now(link.now_us()).with("link", format!("serial:{}", link.health().port));
    let mut recorder = Recorder::create(path, about.with("started", utc_now()))?;
    let bar = args.seconds.map(|seconds| Progress::counting(seconds.ceil() as u64, "seconds"));
    if bar.is_none() {
        eprintln!("recording {} into {}; Ctrl-C ends it", link.health().port, path.display());
    }
    let mut line_s = 0.0;
    let ended = listening.record(&link, &mut recorder, stop, &mut |going| match &bar {
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
    let messages = recorder.finish();
    let (ended, messages) = (ended?, messages?);
    println!("{}: {messages} messages over {:.1} s, {}", path.display(), ended.seconds, words(&ended));
    Ok(())
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

/// Set when Ctrl-C is pressed: the recording is then ended as it should be.
fn stop_at_ctrl_c() -> Result<Arc<AtomicBool>, RecordingError> {
    let stop = Arc::new(AtomicBool::new(false));
    let heard = stop.clone();
    ctrlc::set_handler(move || heard.store(true, Ordering::Relaxed))
        .map_err(|error| RecordingError::Signal(error.to_string()))?;
    Ok(stop)
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 1e6 => Ok(seconds),
        _ => Err("give seconds, above 0 and at most 1000000".into()),
    }
}
