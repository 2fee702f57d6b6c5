//! The robot on its own: no host, stored parameters, every clock rate and bus it may meet.

use sarah_firmware::default_params;
use sarah_protocol::bus::Mode;
use sarah_sim::robot::Health;
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::{Sil, SilConfig};
use sarah_tests::{Bench, drift_m, episode, knee, push, unattended};

/// Forward, more than the robot survives on its brakes alone (19 N·s).
const BEYOND_BRAKES_N_S: f32 = 20.0;

/// Runs `seconds` without a host; the verdict, the steps, and how far the trunk went after it had settled, m.
fn alone(config: &SilConfig, pushes: &[sarah_sim::scenario::Push], seconds: u64) -> (Health, u32, f32) {
    let mut bench = Bench::alone(config, &episode(11, pushes));
    bench.run_until_ms(500);
    let from = bench.sil.robot().trunk().position_m;
    bench.run_until_ms(seconds * 1000);
    assert_eq!(bench.mode(), Mode::Armed);
    (bench.health, bench.steps(), drift_m(&bench.sil, from))
}

#[test]
fn without_a_host_it_stands_still_untouched() {
    let (health, steps, drift_m) = alone(&unattended(), &[], 5);
    assert_eq!((health, steps), (Health::Upright, 0));
    assert!(drift_m < 0.01, "{drift_m} m");
}

#[test]
fn without_a_host_it_survives_a_forward_push_of_18_n_s() {
    let (health, steps, _) = alone(&unattended(), &[push(1.5, 18.0, 0.0)], 7);
    assert_eq!(health, Health::Upright);
    assert!(steps > 0);
}

#[test]
fn without_arming_it_never_moves_a_joint() {
    let mut bench = Bench::alone(&SilConfig::default(), &episode(1, &[push(1.0, 12.0, 0.0)]));
    for _ in 0..3000 {
        bench.step();
        assert!(bench.braked());
    }
    assert_eq!(bench.mode(), Mode::Braked);
}

/// Untouched, then pushed.
fn stands_and_survives_at(lpg_rate_hz: u32, seconds: u64) {
    let config = SilConfig { lpg_rate_hz, ..unattended() };
    let (health, steps, drift_m) = alone(&config, &[], seconds);
    assert_eq!((health, steps), (Health::Upright, 0));
    assert!(drift_m < 0.01, "{drift_m} m");
    let (health, steps, _) = alone(&config, &[push(1.0, BEYOND_BRAKES_N_S, 0.0)], seconds);
    assert_eq!(health, Health::Upright);
    assert!(steps > 0);
}

#[test]
fn at_100_hz_it_stands_and_survives_a_push() {
    stands_and_survives_at(100, 6);
}

#[test]
fn at_1_khz_it_stands_and_survives_a_push() {
    stands_and_survives_at(1_000, 5);
}

#[test]
fn at_10_khz_it_stands_and_survives_a_push() {
    stands_and_survives_at(10_000, 3);
}

#[test]
fn it_survives_a_push_with_any_bus_latency_up_to_5_ms() {
    for bus_latency_us in [0, 1_000, 2_000, 3_000, 4_000, 5_000] {
        let config = SilConfig { bus_latency_us, ..unattended() };
        let (health, steps, _) = alone(&config, &[push(1.0, BEYOND_BRAKES_N_S, 0.0)], 5);
        assert_eq!(health, Health::Upright, "latency {bus_latency_us} µs");
        assert!(steps > 0, "latency {bus_latency_us} µs");
    }
}

#[test]
fn the_stand_scenario_takes_no_step_with_all_sensor_errors_on() {
    let scenario = Scenario::load("stand").expect("embedded");
    for seed in 0..3 {
        let episode = scenario.episode(seed, 0);
        let mut sil = Sil::new(&unattended(), default_params(), default_params(), &episode).expect("valid");
        let health = sil.run_until((episode.duration_s * 1e6) as u64).expect("rapier goes on");
        assert_eq!((health, knee(&sil).lpg().steps()), (Health::Upright, 0), "seed {seed}");
        assert_eq!(sil.coordinator().mode(), Mode::Armed);
    }
}

#[test]
fn a_fall_is_reported_as_fallen() {
    let mut bench = Bench::alone(&unattended(), &episode(1, &[push(1.0, 80.0, 90.0)]));
    bench.run_until_ms(10_000);
    assert!(matches!(bench.health, Health::Fallen { .. }), "{:?}", bench.health);
}
