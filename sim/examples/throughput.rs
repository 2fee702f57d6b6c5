//! Measures what the physics costs and where the braked robot topples.
//!
//! `cargo run -p sarah-sim --example throughput` prints simulated seconds per second of one core, standing and
//! pushed, and the topple impulse in eight directions (bisection to 0.25 N·s).

use std::time::Instant;

use sarah_sim::plant::Plant;
use sarah_sim::robot::{Health, Robot, RobotConfig, RobotError};

/// Seconds this thread has spent on a core, or wall-clock seconds where the system does not say.
fn cpu_s(start: &Instant) -> f64 {
    let on_core_ns = std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|stat| stat.split_whitespace().next()?.parse::<f64>().ok());
    on_core_ns.map_or_else(|| start.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

fn run(robot: &mut Robot, seconds: f32) -> bool {
    for _ in 0..(seconds / robot.dt_s()).round() as usize {
        robot.step();
    }
    robot.health() == Health::Upright
}

fn survives(direction_deg: f32, impulse_n_s: f32, simulated_s: &mut f64) -> Result<bool, RobotError> {
    let mut robot = Robot::new(&RobotConfig { drop_m: 0.1, ..Default::default() })?;
    run(&mut robot, 1.0);
    let (sin, cos) = direction_deg.to_radians().sin_cos();
    robot.push([impulse_n_s * cos / 0.1, impulse_n_s * sin / 0.1, 0.0], 0.0);
    run(&mut robot, 0.1);
    robot.clear_push();
    let up = (0..40).all(|_| run(&mut robot, 0.1));
    *simulated_s += robot.time_s();
    Ok(up)
}

fn main() -> Result<(), RobotError> {
    let clock = Instant::now();
    let start = cpu_s(&clock);
    for _ in 0..500 {
        Robot::new(&RobotConfig::default())?;
    }
    println!("building a robot: {:.2} ms", (cpu_s(&clock) - start) * 2.0);

    let mut robot = Robot::new(&RobotConfig { drop_m: 0.1, ..Default::default() })?;
    let start = cpu_s(&clock);
    run(&mut robot, 30.0);
    println!("standing: {:.0} sim-s per CPU-s", robot.time_s() / (cpu_s(&clock) - start));

    let start = cpu_s(&clock);
    let mut simulated_s = 0.0;
    for direction in 0..8 {
        let direction_deg = 45.0 * direction as f32;
        let (mut stands, mut falls) = (4.0f32, 40.0f32);
        while falls - stands > 0.25 {
            let middle = 0.5 * (stands + falls);
            if survives(direction_deg, middle, &mut simulated_s)? { stands = middle } else { falls = middle }
        }
        println!("topples at {direction_deg:>3} deg: {:.1} N s", 0.5 * (stands + falls));
    }
    println!("braked pushes: {:.0} sim-s per CPU-s", simulated_s / (cpu_s(&clock) - start));
    Ok(())
}
