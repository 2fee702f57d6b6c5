//! Draws every figure from made-up data, to look at the drawing itself: `cargo run -p sarah --example figures_demo`.
//!
//! Nothing here is a result. The figures of a run are drawn by `sarah train` and `sarah report`.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sarah::figures::{self, BarRow, Curve, Figure, ParameterCurve, PolarSeries, Pose, Push, RewardSeries};
use sarah::metrics::{Trace, TraceSample};
use sarah::stats::Proportion;
use std::path::PathBuf;

const PUSH: Push = Push { at_s: 2.0, direction_deg: 20.0, impulse_n_s: 18.0 };

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "figures-demo".into()));
    std::fs::create_dir_all(&folder)?;
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let all: [(&str, Figure); 7] = [
        ("parameters", figures::parameters("Session 1: linear actuators (made up)", &parameters(&mut rng))),
        ("rewards", figures::rewards("Session 1: reward (made up)", "reward (gated)", &rewards(&mut rng))),
        ("trunk", figures::trunk("Trunk after a push (made up)", &trace(&mut rng), Some(PUSH))),
        ("imu", figures::imu("IMU after a push (made up)", &trace(&mut rng), Some(PUSH))),
        ("survival-polar", figures::survival_polar("Survival by direction, 24 N·s (made up)", &polar())),
        ("survival-bars", figures::survival_bars("Survival at 24 N·s (made up)", &bars())),
        ("filmstrip", figures::filmstrip("", &poses(), Some(PUSH))),
    ];
    for (name, figure) in all {
        figure.save(&folder, name)?;
    }
    println!("figures in {}", folder.display());
    Ok(())
}

fn learning(rng: &mut Pcg64Mcg, from: f64, to: f64, noise: f64) -> Curve {
    let episodes: Vec<f64> = (0..120).map(f64::from).collect();
    let runs = (0..5)
        .map(|_| {
            let speed = rng.random_range(20.0..45.0);
            let end = to + rng.random_range(-1.0..1.0) * noise * 0.8;
            let at = |episode: &f64| end + (from - end) * (-episode / speed).exp();
            episodes.iter().map(|episode| at(episode) + rng.random_range(-1.0..1.0) * noise).collect()
        })
        .collect();
    Curve { episodes, runs }
}

fn parameters(rng: &mut Pcg64Mcg) -> Vec<ParameterCurve> {
    [("P1", "kick speed", 0.5, 0.09), ("P2", "retract speed", 0.4, 0.84), ("P3", "extend speed", 0.5, 0.9)]
        .map(|(symbol, what, from, to)| ParameterCurve {
            symbol: symbol.into(),
            unit: "m/s".into(),
            what: what.into(),
            curve: learning(rng, from, to, 0.02),
        })
        .to_vec()
}

fn rewards(rng: &mut Pcg64Mcg) -> Vec<RewardSeries> {
    [("eNAF", 0.62), ("the paper's form", 0.38)]
        .map(|(label, to)| RewardSeries {
            label: label.into(),
            noisy: learning(rng, 0.3, to - 0.08, 0.10).smoothed(10),
            noise_free: learning(rng, 0.32, to, 0.06).smoothed(10),
        })
        .to_vec()
}

fn trace(rng: &mut Pcg64Mcg) -> Trace {
    let samples = (0..800)
        .map(|tick| {
            let t_s = tick as f32 * 0.01;
            let since = (t_s - PUSH.at_s).max(0.0);
            let (moving, decay) = (since > 0.0 && since < 2.2, (-since).exp());
            let wave = |frequency: f32| (since * frequency).sin() * decay * f32::from(u8::from(since > 0.0));
            let drop = (-(t_s - 0.14).max(0.0) * 9.0).exp();
            let step = (since * 2.9) as u32;
            let swing = moving && (since * 2.9).fract() < 0.45;
            let load = |foot: u32| if t_s < 0.14 || swing && step % 2 == foot { 0.0 } else { 80.0 };
            let noise = |rng: &mut Pcg64Mcg, size: f32| rng.random_range(-size..size);
            TraceSample {
                t_s,
                trunk_m: [
                    0.06 * (1.0 - decay) + 0.02 * wave(9.0),
                    0.018 * wave(6.0),
                    0.86 + 0.1 * drop - 0.008 * wave(18.0).abs(),
                ],
                accel_m_s2: [
                    4.0 * wave(17.0) + noise(rng, 0.15),
                    2.0 * wave(11.0) + noise(rng, 0.15),
                    9.81 + 12.0 * drop * (t_s * 60.0).sin() * f32::from(u8::from(t_s > 0.14))
                        + 3.0 * wave(23.0)
                        + noise(rng, 0.15),
                ],
                gyro_rad_s: [0.8 * wave(11.0) + noise(rng, 0.02), 1.4 * wave(9.0) + noise(rng, 0.02), 0.2 * wave(5.0)],
                factor: 0.04,
                phase: u8::from(swing),
                pads_n: [load(0), load(0), load(1), load(1)],
                joints: [0.0; 6],
            }
        })
        .collect();
    Trace { samples }
}

fn polar() -> Vec<PolarSeries> {
    let shape = |survival: fn(f64) -> f64| {
        (0..24).map(|i| (i as f32 * 15.0, survival(f64::from(i) * 15.0_f64).clamp(0.0, 1.0))).collect()
    };
    vec![
        PolarSeries {
            label: "trained".into(),
            points: shape(|deg| 1.0 - 0.2 * f64::from(u8::from((deg - 180.0).abs() < 20.0))),
        },
        PolarSeries {
            label: "default".into(),
            points: shape(|deg| 0.95 - 0.3 * f64::from(u8::from((deg - 180.0).abs() < 40.0))),
        },
        PolarSeries {
            label: "CMA-ES".into(),
            points: shape(|deg| 0.97 - 0.25 * (deg.to_radians().cos().min(0.0)).powi(2)),
        },
        PolarSeries {
            label: "braked".into(),
            points: shape(|deg| {
                0.35 + 0.5 * deg.to_radians().sin().powi(2) - 0.3 * f64::from(u8::from((deg - 180.0).abs() < 40.0))
            }),
        },
    ]
}

fn bars() -> Vec<BarRow> {
    [("trained", 93), ("default", 86), ("CMA-ES", 92), ("braked", 35)]
        .map(|(label, count)| BarRow { label: label.into(), survival: Proportion { count, of: 96 } })
        .to_vec()
}

fn poses() -> Vec<Pose> {
    // Lean, hip left, hip right, knee left, knee right, feet loaded left, right, forward.
    let frames = [
        (1.8, 0.00, 0.00, 0.00, 0.00, 0.00, true, true, 0.00),
        (2.0, 0.05, 0.00, 0.00, 0.00, 0.00, true, true, 0.00),
        (2.2, 0.16, 0.34, -0.05, -0.07, 0.0, false, true, 0.03),
        (2.4, 0.12, 0.30, -0.12, -0.02, 0.0, true, true, 0.07),
        (2.7, 0.07, 0.16, 0.10, -0.02, -0.06, true, false, 0.09),
        (3.2, 0.02, 0.05, 0.06, -0.01, -0.01, true, true, 0.09),
    ];
    frames
        .map(|(t_s, lean, hip_left, hip_right, knee_left, knee_right, left, right, x)| {
            let load = |loaded: bool| if loaded { 80.0 } else { 0.0 };
            Pose {
                t_s,
                trunk_m: [x, 0.0, 0.84 - 0.01 * lean],
                trunk_quat: [0.0, (lean / 2.0_f32).sin(), 0.0, (lean / 2.0_f32).cos()],
                joints: [0.03, -0.03, hip_left, hip_right, knee_left, knee_right],
                pads_n: [load(left), load(left), load(right), load(right)],
            }
        })
        .to_vec()
}
