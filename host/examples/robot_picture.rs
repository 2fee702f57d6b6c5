//! Draws one push as the README shows it, from the simulation: `cargo run --release -p sarah --example robot_picture`.

use std::path::PathBuf;

use sarah::evaluate::{Controller, Recording, Watch, run_episode};
use sarah::figures::{Pose, Push, filmstrip};
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::SilConfig;

/// Of 24: backward and to the left, where most fall at 27 N·s.
const DIRECTION: u64 = 10;
/// Instants, s after the push.
const SHOWN_S: [f32; 7] = [0.0, 0.2, 0.35, 0.55, 0.75, 1.0, 3.5];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "runs/robot-picture".into()));
    std::fs::create_dir_all(&folder)?;
    let episode = Scenario::load("push-grid")?.episode(1, DIRECTION);
    let pushed = episode.pushes[0];
    let controller = Controller::Constants(sarah_firmware::default_params());
    let mut recording = Recording::default();
    let result = run_episode(&controller, &SilConfig::default(), &episode, Watch::Recording(&mut recording))?;
    let nearest = |after_s: f32| {
        let away = |pose: &&Pose| (pose.t_s - pushed.at_s - after_s).abs();
        recording.poses.iter().min_by(|a, b| away(a).total_cmp(&away(b))).cloned()
    };
    let poses: Vec<Pose> = SHOWN_S.into_iter().filter_map(nearest).collect();
    let push = Push { at_s: pushed.at_s, direction_deg: pushed.direction_deg, impulse_n_s: pushed.impulse_n_s };
    filmstrip("", &poses, Some(push)).save(&folder, "robot")?;
    println!(
        "{} N·s at {}°: {:?}, {} steps; in {}",
        push.impulse_n_s,
        push.direction_deg,
        result.outcome,
        result.steps,
        folder.display()
    );
    Ok(())
}
