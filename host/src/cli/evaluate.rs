//! `sarah evaluate`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use sarah_firmware::default_params;
use sarah_sim::scenario::{Overrides, Scenario};
use sarah_sim::sensors::SensorConfig;
use sarah_sim::sil::SilConfig;

use super::CliError;
use super::link::LinkArgs;
use crate::evaluate::{Controller, EvaluateError, Watch, autonomy, parallel, run_episode};
use crate::metrics::Summary;
use crate::progress::Progress;
use crate::report::{ControllerReport, Evaluation, headline};
use crate::run::load_param_set;
use crate::task::odometry::audit::{AuditSummary, Audited, ErrorM};

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(super) enum ControllerName {
    /// The set built into the firmware.
    Default,
    /// Brakes on, whatever happens.
    Braked,
}

#[derive(Args, Debug)]
pub(super) struct EvaluateArgs {
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
    /// Length of every push, s, 0.002 to 10; the impulse stays, so a longer push is a weaker force.
    #[arg(long, value_name = "SECONDS")]
    push_duration: Option<f32>,
    /// Where every push acts, m above the trunk's centre of mass (below it, if negative), within ±0.5.
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    push_height: Option<f32>,
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
    /// Simulate the robot's body with this program instead of rapier, such as "python3 sim/mujoco/plant.py"; see
    /// docs/sim-to-sim.md.
    #[arg(long, value_name = "COMMAND")]
    plant: Option<String>,
    #[command(flatten)]
    link: LinkArgs,
}

/// Does what the arguments say.
pub(super) fn run(args: &EvaluateArgs) -> Result<(), CliError> {
    if args.link.serial().is_some() {
        return Err(CliError::OnlySimulated("evaluate"));
    }
    let (name, controller) = match (&args.params, args.controller) {
        (Some(path), _) => (path.display().to_string(), Controller::Constants(load_param_set(path)?.0)),
        (None, ControllerName::Default) => ("default".into(), Controller::Constants(default_params())),
        (None, ControllerName::Braked) => ("braked".into(), Controller::Braked),
    };
    let overrides = Overrides {
        impulse_n_s: args.impulse,
        duration_s: args.push_duration,
        height_m: args.push_height,
        directions: args.directions,
        repeats: args.repeats,
    };
    let scenario = Scenario::load(&args.scenario)?.with(&overrides)?;
    let sensors = if args.perfect_sensors { SensorConfig::perfect() } else { SensorConfig::default() };
    let config = SilConfig {
        lpg_rate_hz: args.lpg_rate,
        sensors,
        images: args.link.images(),
        plant: args.plant.clone(),
        ..SilConfig::default()
    };
    let count = scenario.episodes().unwrap_or(args.episodes);
    let progress = Progress::new(count);
    let audited = parallel(count as usize, |index| {
        let mut audited = Audited::default();
        let episode = scenario.episode(args.seed, index as u64);
        let result = run_episode(&controller, &config, &episode, Watch::Odometry(&mut audited))?;
        progress.episode(None);
        Ok::<_, EvaluateError>((result, audited))
    });
    progress.finish();
    let (results, audited): (Vec<_>, Vec<_>) = audited.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
    let odometry = AuditSummary::new(&audited);
    let mut summary = Summary::new(&name, &args.scenario, &results);
    summary.autonomy = autonomy(&config.energy, &results);
    summary.odometry_error_m = Some(odometry);
    if args.json {
        // A summary has only finite numbers, names and lists: it always serialises.
        println!("{}", serde_json::to_string(&summary).unwrap_or_default());
        return Ok(());
    }
    let mut report = ControllerReport::new(&name, &args.scenario, &results);
    report.summary = summary;
    let title = format!("{}, {count} episodes, seed {}", args.scenario, args.seed);
    println!("{}", headline(&Evaluation { title, controllers: vec![report] }));
    if let Some(ErrorM { median, p95 }) = odometry.after_push_m {
        let cm = 100.0;
        println!("odometry, 3 s after a push: {:.1} cm off in the median, {:.1} cm at 95 %", median * cm, p95 * cm);
    }
    Ok(())
}
