use proptest::prelude::*;

use super::plain::Plain;
use super::*;

const G: f64 = 9.80665;

/// Rotation body → world as a matrix, integrated finely in f64.
#[derive(Clone, Copy)]
struct Truth {
    up: [f64; 3],
}

fn omega(t: f64, seed: u32) -> [f64; 3] {
    let s = f64::from(seed);
    let wave =
        |amplitude: f64, hertz: f64, phase: f64| amplitude * hertz * (core::f64::consts::TAU * hertz * t + phase).cos();
    [
        wave(1.2, 0.7 + 0.05 * s, s) + wave(0.3, 2.9, 2.0 * s),
        wave(1.0, 0.9 + 0.03 * s, 3.0 * s) + wave(0.2, 3.7, s),
        wave(0.8, 0.4, s),
    ]
}

impl Truth {
    /// d(up)/dt = up × ω, by Runge-Kutta.
    fn step(&mut self, t: f64, dt: f64, seed: u32) {
        let rate = |u: [f64; 3], w: [f64; 3]| {
            [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]]
        };
        let at = |u: [f64; 3], k: [f64; 3], h: f64| [u[0] + k[0] * h, u[1] + k[1] * h, u[2] + k[2] * h];
        let (w0, w1, w2) = (omega(t, seed), omega(t + dt / 2.0, seed), omega(t + dt, seed));
        let k1 = rate(self.up, w0);
        let k2 = rate(at(self.up, k1, dt / 2.0), w1);
        let k3 = rate(at(self.up, k2, dt / 2.0), w1);
        let k4 = rate(at(self.up, k3, dt), w2);
        for i in 0..3 {
            self.up[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
}

fn counts(v: f64, per_unit: f64) -> i16 {
    (v * per_unit).round() as i16
}

fn sample(up: [f64; 3], w: [f64; 3]) -> ImuSample {
    let per_radian = 16.4 * 180.0 / core::f64::consts::PI;
    ImuSample { accel: up.map(|u| counts(u, 2048.0)), gyro: w.map(|w| counts(w, per_radian)) }
}

/// Angle between the filter's up and the truth, rad.
fn error(filter: &Attitude, truth: &Truth) -> f64 {
    let up = filter.up().map(|axis| f64::from(axis) / f64::from(1 << 30));
    let distance: f64 = (0..3).map(|i| (up[i] - truth.up[i]).powi(2)).sum();
    distance.sqrt()
}

fn run(period_us: u32, seed: u32, seconds: f64) -> (Attitude, Truth, f64, Motion) {
    let mut truth = Truth { up: [0.0, 0.0, 1.0] };
    let mut filter = Attitude::new();
    let mut motion = filter.update(period_us, &sample(truth.up, omega(0.0, seed)));
    let dt = f64::from(period_us) * 1e-6;
    let mut worst = 0f64;
    let steps = (seconds / dt).round() as u32;
    for n in 0..steps {
        let t = f64::from(n) * dt;
        for fine in 0..10 {
            truth.step(t + f64::from(fine) * dt / 10.0, dt / 10.0, seed);
        }
        motion = filter.update(period_us, &sample(truth.up, omega(t + dt, seed)));
        worst = worst.max(error(&filter, &truth));
    }
    (filter, truth, worst, motion)
}

#[test]
fn follows_random_motion_within_two_milliradians_at_1_khz() {
    for seed in 0..20 {
        let (_, _, worst, _) = run(1_000, seed, 10.0);
        assert!(worst < 2e-3, "seed {seed}: {worst}");
    }
}

#[test]
fn follows_random_motion_within_two_milliradians_at_100_hz() {
    for seed in 0..20 {
        let (_, _, worst, _) = run(10_000, seed, 10.0);
        assert!(worst < 2e-3, "seed {seed}: {worst}");
    }
}

#[test]
fn rates_from_100_hz_to_1_khz_agree() {
    for seed in 0..10 {
        let reference = run(1_000, seed, 2.0).3;
        for period_us in [2_000, 5_000, 10_000] {
            let motion = run(period_us, seed, 2.0).3;
            for axis in 0..2 {
                let lean = (motion.lean[axis] - reference.lean[axis]).to_f32();
                let slow = (motion.slow_rate[axis] - reference.slow_rate[axis]).to_f32();
                assert!(lean.abs() < 2e-3, "lean {lean} at {period_us} µs");
                // The low-pass is exact for a rate held since the sample before: half a period of the signal's slope.
                assert!(slow.abs() < 0.12, "slow rate {slow} at {period_us} µs");
            }
        }
    }
}

#[test]
fn at_rest_it_reads_gravity_and_nothing_else() {
    let mut filter = Attitude::new();
    let rest = ImuSample { accel: [0, 0, 2048], gyro: [0; 3] };
    let motion = (0..1000).map(|_| filter.update(1_000, &rest)).last().expect("1000 samples");
    assert!((f64::from(motion.acceleration.to_f32()) - G).abs() < 1e-4);
    assert_eq!(motion.rotation, Q16::ZERO);
    assert_eq!((motion.rate, motion.slow_rate, motion.lean), ([Q16::ZERO; 2], [Q16::ZERO; 2], [Q16::ZERO; 2]));
}

#[test]
fn magnitudes_and_rates_have_their_units_and_signs() {
    let mut filter = Attitude::new();
    // Turning forward (about +y) at 100 °/s and to the left (about −x) at 50 °/s, pulled at 2 g sideways.
    let moved = ImuSample { accel: [0, 4096, 0], gyro: [-820, 1640, 0] };
    let motion = filter.update(1_000, &moved);
    assert!((motion.rate[0].to_f32() - 1.745_33).abs() < 1e-4);
    assert!((motion.rate[1].to_f32() - 0.872_66).abs() < 1e-4);
    assert!((motion.rotation.to_f32() - 1.951_34).abs() < 1e-4);
    assert!((f64::from(motion.acceleration.to_f32()) - 2.0 * G).abs() < 1e-4);
}

#[test]
fn leaning_forward_and_left_are_positive() {
    for (up, axis) in [([-0.2, 0.0, 0.98], 0), ([0.0, -0.2, 0.98], 1)] {
        let mut filter = Attitude::new();
        let still = sample(up, [0.0; 3]);
        let motion = (0..2000).map(|_| filter.update(1_000, &still)).last().expect("samples");
        assert!((motion.lean[axis].to_f32() - 0.2013).abs() < 2e-3, "{:?}", motion.lean);
        assert_eq!(motion.lean[1 - axis], Q16::ZERO);
    }
}

#[test]
fn a_tilted_start_is_known_within_the_first_third_of_a_second() {
    let mut filter = Attitude::new();
    let still = sample([-0.2, 0.1, 0.9747], [0.0; 3]);
    let mut motion = Motion::default();
    for _ in 0..30 {
        assert!(!filter.settled());
        motion = filter.update(10_000, &still);
    }
    assert!(filter.settled());
    assert!((motion.lean[0].to_f32() - 0.2014).abs() < 2e-3, "{:?}", motion.lean);
}

#[test]
fn the_gate_closes_outside_two_metres_per_second_squared() {
    let mut filter = Attitude::new();
    for _ in 0..400 {
        filter.update(1_000, &ImuSample { accel: [0, 0, 2048], gyro: [0; 3] });
    }
    let before = filter.up();
    for accel in [[2048, 0, 2048], [0, 0, 1600], [0, 1600, 0]] {
        filter.update(1_000, &ImuSample { accel, gyro: [0; 3] });
        assert_eq!(filter.up(), before, "{accel:?}");
    }
    filter.update(1_000, &ImuSample { accel: [500, 0, 2048], gyro: [0; 3] });
    assert_ne!(filter.up(), before);
}

/// A robot that turns steadily by its gyro's bias, as far as the gyro can tell, and stands still.
fn biased(bias_counts: i16) -> ImuSample {
    ImuSample { accel: [0, 0, 2048], gyro: [bias_counts, -bias_counts, bias_counts] }
}

#[test]
fn a_bias_is_learned_at_rest_and_neither_rate_nor_lean_shows_it() {
    for (counts, period_us) in [(10, 1_000), (-10, 1_000), (40, 10_000)] {
        let mut filter = Attitude::new();
        let mut motion = Motion::default();
        for _ in 0..3_000_000 / period_us {
            motion = filter.update(period_us, &biased(counts));
        }
        assert!(motion.rotation <= Q16::lit(0.002), "{counts}: {:?}", motion.rotation);
        // A second in which nothing tells gravity from a push: what is left of the bias is all that turns up.
        for _ in 0..1_000_000 / period_us {
            motion = filter.update(period_us, &ImuSample { accel: [0; 3], ..biased(counts) });
        }
        for lean in motion.lean {
            assert!(lean.abs() < Q16::lit(0.002), "{counts}: {:?}", motion.lean);
        }
    }
}

#[test]
fn a_growing_bias_is_followed_to_the_parts_tolerance_and_no_further() {
    // A count every 0.1 s is 0.01 rad/s²; 320 counts are 0.34 rad/s.
    let mut filter = Attitude::new();
    let motion = (0..3200_i16).map(|sample| filter.update(10_000, &biased(sample / 10))).last();
    assert!(motion.is_some_and(|motion| motion.rotation < Q16::lit(0.03)), "{motion:?}");
    for counts in (320..400).flat_map(|counts| [counts; 50]) {
        filter.update(10_000, &biased(counts));
    }
    assert_eq!(filter.bias(), [329, -329, 329]);
}

#[test]
fn a_bias_that_grew_while_the_robot_moved_is_learned_when_it_rests() {
    let mut filter = Attitude::new();
    // 0.15 rad/s, twice what counts as rest.
    let motion = (0..3000).map(|_| filter.update(1_000, &biased(80))).last().expect("samples");
    assert!(motion.rotation < Q16::lit(0.005), "{:?}", motion.rotation);
}

#[test]
fn a_robot_that_rocks_or_falls_learns_no_bias() {
    let mut filter = Attitude::new();
    for n in 0..5000 {
        // 0.2 rad/s at 1 Hz.
        let gyro = 187.0 * (f64::from(n) * 1e-3 * core::f64::consts::TAU).sin();
        filter.update(1_000, &ImuSample { accel: [0, 0, 2048], gyro: [0, gyro as i16, 0] });
        assert!(filter.bias().iter().all(|bias| bias.abs() < 10), "{:?}", filter.bias());
    }
    let mut filter = Attitude::new();
    for n in 0..1000 {
        // From 0.02 to 0.6 rad/s, as a pendulum of 0.8 m falls.
        let gyro = 19.0 * (3.5 * f64::from(n) * 1e-3).exp();
        filter.update(1_000, &ImuSample { accel: [0, 0, 2048], gyro: [0, gyro as i16, 0] });
    }
    assert!(filter.bias()[1].abs() < 25, "{:?}", filter.bias());
}

#[test]
fn a_push_of_half_a_second_is_hardly_taken_for_a_lean() {
    let mut filter = Attitude::new();
    for _ in 0..1000 {
        filter.update(1_000, &biased(0));
    }
    // 1.5 m/s² forward for 0.5 s while the trunk turns too fast to be at rest, about the vertical.
    let pushed = ImuSample { accel: [313, 0, 2048], gyro: [0, 0, 200] };
    let motion = (0..500).map(|_| filter.update(1_000, &pushed)).last().expect("samples");
    assert!(motion.lean[0].abs() < Q16::lit(0.03), "{:?}", motion.lean);
}

#[test]
fn the_low_pass_gain_matches_the_exponential() {
    for dt_us in [0u32, 100, 1_000, 5_000, 10_000, MAX_STEP_US] {
        let exact = 1.0 - (-f64::from(dt_us) / 21_200.0).exp();
        let ours = f64::from(low_pass_gain(dt_us)) / f64::from(ONE);
        assert!((ours - exact).abs() < 2e-5, "{dt_us}: {ours} {exact}");
    }
}

fn samples() -> impl Strategy<Value = Vec<([i16; 3], [i16; 3], u32)>> {
    let wild = || proptest::array::uniform3(any::<i16>());
    // Nonsense, and what a robot feels.
    let calm = |spread: i16| proptest::array::uniform3(-spread..spread);
    let accel = prop_oneof![wild(), calm(2500), (calm(300)).prop_map(|[x, y, z]| [x, y, 2048 + z])];
    let gyro = prop_oneof![wild(), calm(3000)];
    let dt_us = prop_oneof![any::<u32>(), Just(1_000), 990_u32..1_010, 0_u32..30_000];
    proptest::collection::vec((accel, gyro, dt_us), 1..200)
}

/// Noise about a bias, for a third of a second and more, and then anything.
fn rest() -> impl Strategy<Value = Vec<([i16; 3], [i16; 3], u32)>> {
    let sample = |bias: i16| {
        let accel = proptest::array::uniform3(-20..20_i16).prop_map(|[x, y, z]| [x, y, 2048 + z]);
        let gyro = proptest::array::uniform3(bias - 15..bias + 15);
        (accel, gyro, 900_u32..1_100)
    };
    let quiet = (-50..50_i16).prop_flat_map(move |bias| proptest::collection::vec(sample(bias), 300..600));
    (quiet, samples()).prop_map(|(quiet, wild)| [quiet, wild].concat())
}

proptest! {
    #[test]
    fn quick_arithmetic_changes_no_bit(samples in prop_oneof![samples(), rest()]) {
        let (mut filter, mut plain) = (Attitude::new(), Plain::new());
        for (accel, gyro, dt_us) in samples {
            let sample = ImuSample { accel, gyro };
            prop_assert_eq!(filter.update(dt_us, &sample), plain.update(dt_us, &sample));
        }
    }

    #[test]
    fn any_samples_keep_up_a_vector_of_sane_length(samples in samples()) {
        let mut filter = Attitude::new();
        for (accel, gyro, dt_us) in samples {
            let motion = filter.update(dt_us, &ImuSample { accel, gyro });
            prop_assert!(motion.acceleration >= Q16::ZERO && motion.rotation >= Q16::ZERO);
            for lean in motion.lean {
                prop_assert!(lean.abs() <= Q16::lit(1.2));
            }
        }
    }
}
