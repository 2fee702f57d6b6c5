//! Every transition of LPG1 (paper, Fig. 3), by name, at 100 Hz, 1 kHz and 10 kHz.

use proptest::prelude::*;
use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::factor::PlainDivider;
use sarah_firmware::lpg::fall::Fall;
use sarah_firmware::lpg::knee::{Knee, KneeInputs, KneeOutputs, KneeParams, Phase};
use sarah_firmware::lpg::rules::KNEE;
use sarah_protocol::bus::{GaitEvent, Motion, Side};
use sarah_protocol::fixed::Q16;

const RATES: [u32; 3] = [10_000, 1_000, 100];
const LOADED: Q16 = Q16::lit(150.0);
const AIR: Q16 = Q16::ZERO;

fn params() -> KneeParams {
    KneeParams { kick: Q16::lit(0.09), retract: Q16::lit(0.8), extend: Q16::lit(0.9) }
}

/// The trunk turns at `rotation` and leans `[sagittal, lateral]`.
fn motion(rotation: f64, lean: [f64; 2]) -> Motion {
    Motion { acceleration: Q16::lit(9.81), rotation: Q16::lit(rotation), lean: lean.map(Q16::lit), ..Motion::default() }
}

const PUSHED: fn() -> Motion = || motion(1.0, [0.0, 0.15]);
/// Factor is high, and the feet hold the robot.
const HELD: fn() -> Motion = || motion(1.0, [0.0, 0.02]);
const QUIET: fn() -> Motion = || motion(0.0, [0.0, 0.0]);

/// LPG1 with ideal actuators; feet unload when shorter than −5 mm.
struct Rig {
    knee: Knee,
    dt_us: u32,
    position: [f64; 2],
    load: [Q16; 2],
    motion: Motion,
    may_start: bool,
}

impl Rig {
    fn new(dt_us: u32) -> Rig {
        Rig { knee: Knee::new(KNEE), dt_us, position: [0.0; 2], load: [LOADED; 2], motion: QUIET(), may_start: true }
    }

    fn tick(&mut self) -> KneeOutputs {
        let inputs = KneeInputs {
            dt_us: self.dt_us,
            load: self.load,
            position: self.position.map(Q16::lit),
            fall: &Fall::of(&PlainDivider, &KNEE, &self.motion),
            may_start: self.may_start,
        };
        let out = self.knee.tick(&inputs, &params());
        for (position, drive) in self.position.iter_mut().zip(out.drive) {
            if let Drive::Velocity(v) = drive {
                *position += v.to_f32() as f64 * self.dt_us as f64 * 1e-6;
            }
        }
        out
    }

    /// Ticks until `stop` or two seconds; all events on the way, with the time of each in seconds.
    fn run(&mut self, stop: impl Fn(&Rig) -> bool) -> Vec<(GaitEvent, f64)> {
        let mut events = vec![];
        for tick in 0..2_000_000 / self.dt_us {
            let seconds = tick as f64 * self.dt_us as f64 * 1e-6;
            events.extend(self.tick().events.iter().map(|e| (*e, seconds)));
            if stop(self) {
                break;
            }
        }
        events
    }
}

fn names(events: &[(GaitEvent, f64)]) -> Vec<GaitEvent> {
    events.iter().map(|e| e.0).collect()
}

#[test]
fn idle_stays_braked_while_factor_is_below_the_threshold() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        for _ in 0..100 {
            assert_eq!(rig.tick(), KneeOutputs::default());
        }
    }
}

#[test]
fn idle_starts_when_both_feet_are_loaded_and_factor_exceeds_the_threshold() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        rig.motion = PUSHED();
        assert_eq!(rig.tick().events.as_slice(), [GaitEvent::CycleStart]);
        assert_eq!(rig.knee.phase(), Phase::Kick);
    }
}

#[test]
fn idle_does_not_start_while_a_foot_is_in_the_air_and_the_fall_is_slow() {
    let mut rig = Rig::new(1_000);
    rig.motion = motion(1.0, [0.0, 0.01]);
    rig.load = [LOADED, AIR];
    assert!(rig.run(|_| false).is_empty());
}

#[test]
fn idle_does_not_start_without_permission() {
    let mut rig = Rig::new(1_000);
    rig.motion = PUSHED();
    rig.may_start = false;
    assert!(rig.run(|_| false).is_empty());
}

#[test]
fn one_loaded_foot_and_a_fast_fall_chain_a_step_of_the_unloaded_leg() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        rig.motion = motion(1.0, [0.2, 0.0]);
        rig.load = [LOADED, AIR];
        assert_eq!(rig.tick().events.first(), Some(&GaitEvent::CycleStart));
        assert_eq!(rig.knee.swing(), Side::Right);
    }
}

#[test]
fn the_first_leg_is_on_the_side_of_the_fall() {
    for (lateral, side) in [(0.15, Side::Left), (-0.15, Side::Right)] {
        let mut rig = Rig::new(1_000);
        rig.motion = motion(1.0, [0.0, lateral]);
        rig.tick();
        assert_eq!(rig.knee.swing(), side);
    }
}

#[test]
fn legs_alternate_while_cycles_follow_each_other() {
    let mut rig = Rig::new(1_000);
    rig.motion = PUSHED();
    let mut sides = vec![];
    for _ in 0..4 {
        rig.run(|r| r.knee.phase() == Phase::Kick);
        sides.push(rig.knee.swing());
        rig.run(|r| r.knee.phase() == Phase::Idle);
    }
    assert_eq!(sides, [Side::Left, Side::Right, Side::Left, Side::Right]);
}

#[test]
fn kick_extends_only_the_swing_leg_and_ends_at_its_time() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        rig.motion = PUSHED();
        let out = rig.tick();
        assert_eq!(out.drive, [Drive::Velocity(params().kick), Drive::Brake]);
        let mut ticks = 1;
        while rig.knee.phase() == Phase::Kick {
            rig.tick();
            ticks += 1;
        }
        // 0.09 m/s cannot reach the kick height within the limit, so the time ends it, to the nearest tick.
        let seconds = (ticks - 1) as f64 * dt as f64 * 1e-6;
        let limit = f64::from(KNEE.kick_us) * 1e-6;
        assert!((seconds - limit).abs() <= 0.5e-6 * dt as f64 + 1e-9, "{seconds} at {dt} µs");
    }
}

#[test]
fn retract_lifts_the_foot_to_the_step_height_then_extends() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        rig.motion = PUSHED();
        rig.run(|r| r.knee.phase() == Phase::Retract);
        let mut depth = 0.0f64;
        while rig.knee.phase() == Phase::Retract {
            depth = depth.max(-rig.position[0]);
            rig.tick();
        }
        // Factor is about 1 here, so the step is the longest; a tick at 0.8 m/s is the sampling error.
        let longest = f64::from(KNEE.step.1.to_f32());
        assert!((longest - 1e-4..longest + 0.9 * dt as f64 * 1e-6 + 1e-4).contains(&depth), "{depth} at {dt} µs");
    }
}

#[test]
fn unloading_raises_lift_off_and_loading_raises_touchdown_once_each() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        rig.motion = PUSHED();
        let mut events = rig.run(|r| r.knee.phase() == Phase::Retract);
        rig.motion = HELD(); // touchdown does not brake at once
        rig.load = [AIR, LOADED];
        events.extend(rig.run(|r| r.knee.phase() == Phase::Extend && r.position[0] > -0.03));
        rig.load = [LOADED, LOADED];
        rig.motion = QUIET();
        events.extend(rig.run(|r| r.knee.phase() == Phase::Idle));
        assert_eq!(
            names(&events),
            [GaitEvent::CycleStart, GaitEvent::LiftOff, GaitEvent::Touchdown, GaitEvent::CycleEnd]
        );
        assert_eq!(rig.knee.steps(), 1);
    }
}

#[test]
fn touchdown_while_still_falling_brakes_the_leg_at_once() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        rig.motion = motion(1.0, [0.3, 0.0]);
        rig.run(|r| r.knee.phase() == Phase::Retract);
        rig.load[rig.knee.swing() as usize] = AIR;
        rig.run(|r| r.knee.phase() == Phase::Extend);
        rig.load = [LOADED; 2];
        let out = rig.tick();
        assert_eq!(out.drive, [Drive::Brake; 2]);
        assert_eq!(out.events.as_slice(), [GaitEvent::Touchdown, GaitEvent::CycleEnd]);
        assert_eq!(rig.knee.steps(), 1);
    }
}

#[test]
fn touchdown_of_a_slow_fall_finishes_the_extension_slowly() {
    let mut rig = Rig::new(1_000);
    rig.motion = PUSHED();
    rig.run(|r| r.knee.phase() == Phase::Retract);
    rig.motion = HELD();
    let leg = rig.knee.swing() as usize;
    rig.load[leg] = AIR;
    rig.run(|r| r.knee.phase() == Phase::Extend);
    rig.load = [LOADED; 2];
    assert_eq!(rig.tick().drive[leg], Drive::Velocity(KNEE.touchdown_speed));
}

#[test]
fn extend_ends_at_the_rest_position() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        rig.motion = PUSHED();
        rig.run(|r| r.knee.phase() == Phase::Extend);
        rig.motion = QUIET();
        rig.run(|r| r.knee.phase() == Phase::Idle);
        assert!(rig.position[0].abs() < 0.01, "{}", rig.position[0]);
        assert_eq!(rig.position[1], 0.0);
    }
}

#[test]
fn a_foot_that_lands_after_its_leg_came_to_rest_still_counts_as_one_step() {
    let mut rig = Rig::new(1_000);
    rig.motion = PUSHED();
    rig.run(|r| r.knee.phase() == Phase::Retract);
    rig.load = [AIR, LOADED];
    rig.motion = QUIET();
    rig.run(|r| r.knee.phase() == Phase::Idle);
    assert_eq!(rig.knee.steps(), 0);
    rig.load = [LOADED; 2];
    assert_eq!(rig.tick().events.as_slice(), [GaitEvent::Touchdown]);
    assert_eq!(rig.knee.steps(), 1);
    rig.tick();
    assert_eq!(rig.knee.steps(), 1);
}

#[test]
fn a_push_that_the_feet_hold_starts_nothing() {
    let mut rig = Rig::new(1_000);
    rig.motion = HELD();
    assert!(rig.run(|_| false).is_empty());
}

#[test]
fn a_push_starts_a_step_while_it_still_acts() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        // Nothing leans yet and the rate alone is too low, but it rises.
        let pushed = Motion { rate: [Q16::lit(0.35), Q16::ZERO], slow_rate: [Q16::lit(0.2), Q16::ZERO], ..HELD() };
        rig.motion = Motion { slow_rate: pushed.rate, ..pushed };
        assert!(rig.tick().events.is_empty());
        rig.motion = pushed;
        assert_eq!(rig.tick().events.as_slice(), [GaitEvent::CycleStart]);
    }
}

#[test]
fn a_foot_that_alone_carries_is_lifted_only_by_a_robot_that_falls() {
    for (after_the_kick, then) in [(motion(1.0, [0.0, 0.3]), Phase::Retract), (HELD(), Phase::Idle)] {
        let mut rig = Rig::new(1_000);
        rig.motion = PUSHED();
        rig.tick();
        rig.load[rig.knee.swing().other() as usize] = AIR;
        rig.motion = after_the_kick;
        let events = rig.run(|r| r.knee.phase() != Phase::Kick);
        assert_eq!(rig.knee.phase(), then);
        assert_eq!(names(&events).contains(&GaitEvent::CycleEnd), then == Phase::Idle);
    }
}

#[test]
fn a_chained_step_goes_to_the_side_of_the_fall_or_answers_a_sagittal_one() {
    for (lean, starts) in [([0.0, 0.15], true), ([0.0, -0.15], false), ([0.15, -0.05], true), ([-0.15, -0.05], true)] {
        let mut rig = Rig::new(1_000);
        rig.load = [AIR, LOADED];
        rig.motion = motion(1.0, lean);
        assert_eq!(!rig.tick().events.is_empty(), starts, "{lean:?}");
    }
}

/// A rig whose swing foot has left the ground and is on its way down.
fn extending(dt_us: u32) -> (Rig, usize) {
    let mut rig = Rig::new(dt_us);
    rig.motion = PUSHED();
    rig.run(|r| r.knee.phase() == Phase::Retract);
    let leg = rig.knee.swing() as usize;
    rig.load[leg] = AIR;
    rig.run(|r| r.knee.phase() == Phase::Extend);
    (rig, leg)
}

#[test]
fn a_falling_robot_reaches_for_the_ground_beyond_rest() {
    for dt in RATES {
        let (mut rig, leg) = extending(dt);
        let events = rig.run(|r| r.knee.phase() == Phase::Idle);
        let reach = f64::from(KNEE.reach.to_f32());
        assert!((rig.position[leg] - reach).abs() < 0.01, "{} at {dt} µs", rig.position[leg]);
        assert_eq!(names(&events), [GaitEvent::CycleEnd]);
    }
}

#[test]
fn a_leg_longer_than_at_rest_stops_as_soon_as_the_ground_is_found() {
    let (mut rig, leg) = extending(1_000);
    rig.run(|r| r.position[leg] > 0.01);
    rig.load[leg] = LOADED;
    rig.motion = HELD();
    assert_eq!(rig.tick().drive, [Drive::Brake; 2]);
    assert_eq!(rig.knee.phase(), Phase::Idle);
}

/// Cycles that begin from now on, and with which leg, while the robot stands quietly for `seconds`.
fn begun(rig: &mut Rig, seconds: u32) -> Vec<(GaitEvent, Side)> {
    rig.motion = QUIET();
    let mut begun = vec![];
    for _ in 0..seconds * 1_000_000 / rig.dt_us {
        let leg = rig.knee.swing() as usize;
        rig.load = [LOADED; 2];
        rig.load[leg] = if rig.position[leg] < -0.01 { AIR } else { LOADED };
        let events = rig.tick().events;
        let starts = events.iter().filter(|event| matches!(event, GaitEvent::CycleStart | GaitEvent::Recovery));
        begun.extend(starts.map(|event| (*event, rig.knee.swing())));
    }
    begun
}

#[test]
fn a_calm_robot_brings_each_leg_that_stepped_back_to_rest_once() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        assert_eq!(begun(&mut rig, 3), []);
        rig.motion = PUSHED();
        rig.run(|r| r.knee.phase() == Phase::Retract);
        assert_eq!(begun(&mut rig, 5), [(GaitEvent::Recovery, Side::Left)], "at {dt} µs");
        for side in [Side::Left, Side::Right] {
            rig.motion = PUSHED();
            rig.run(|r| r.knee.phase() == Phase::Retract && r.knee.swing() == side);
        }
        rig.run(|r| r.knee.phase() == Phase::Idle);
        let steps = rig.knee.steps();
        let mut recovered = begun(&mut rig, 8);
        assert_eq!(rig.knee.steps(), steps, "a recovery is no step");
        recovered.sort_by_key(|(_, side)| *side as usize);
        assert_eq!(recovered, [(GaitEvent::Recovery, Side::Left), (GaitEvent::Recovery, Side::Right)], "at {dt} µs");
        assert!(rig.position.iter().all(|position| position.abs() < 0.01), "{:?} at {dt} µs", rig.position);
    }
}

#[test]
fn a_recovery_that_ends_in_steps_has_to_wait_longer_the_next_time() {
    let mut rig = Rig::new(1_000);
    rig.motion = PUSHED();
    rig.run(|r| r.knee.phase() == Phase::Retract);
    rig.motion = QUIET();
    rig.run(|r| r.knee.phase() == Phase::Idle);
    let waited = |rig: &mut Rig| {
        let waited = (0..20_000).find(|_| rig.tick().events.contains(&GaitEvent::Recovery)).expect("recovers");
        rig.run(|r| r.knee.phase() == Phase::Idle);
        waited
    };
    let mut last = waited(&mut rig);
    for _ in 0..6 {
        rig.motion = PUSHED();
        rig.run(|r| r.knee.phase() == Phase::Retract);
        rig.motion = QUIET();
        rig.run(|r| r.knee.phase() == Phase::Idle);
        let now = waited(&mut rig);
        let expected = (2 * last).min(KNEE.patience_us as usize / 1_000);
        assert!(now.abs_diff(expected) < 100, "{now} after {last}");
        last = now;
    }
    // A calm robot whose legs are at rest starts afresh.
    begun(&mut rig, 30);
    rig.motion = PUSHED();
    rig.run(|r| r.knee.phase() == Phase::Retract);
    rig.motion = QUIET();
    rig.run(|r| r.knee.phase() == Phase::Idle);
    assert!(waited(&mut rig).abs_diff(KNEE.calm_us as usize / 1_000) < 100);
}

#[test]
fn recovery_waits_until_the_robot_has_been_calm_long_enough() {
    let mut rig = Rig::new(1_000);
    rig.motion = PUSHED();
    rig.run(|r| r.knee.phase() == Phase::Retract);
    rig.motion = QUIET();
    rig.run(|r| r.knee.phase() == Phase::Idle);
    for _ in 0..5 {
        for _ in 0..KNEE.calm_us / 1_000 - 10 {
            assert!(rig.tick().events.is_empty());
        }
        rig.motion = motion(f64::from(KNEE.calm.to_f32()) * 1.5, [0.0; 2]);
        assert!(rig.tick().events.is_empty());
        rig.motion = QUIET();
    }
    assert_eq!(begun(&mut rig, 2), [(GaitEvent::Recovery, Side::Left)]);
}

#[test]
fn a_bouncing_foot_counts_one_step_per_cycle() {
    let mut rig = Rig::new(1_000);
    rig.motion = PUSHED();
    rig.run(|r| r.knee.phase() == Phase::Retract);
    rig.motion = HELD();
    let leg = rig.knee.swing() as usize;
    rig.load[leg] = AIR;
    rig.run(|r| r.knee.phase() == Phase::Extend);
    for load in [LOADED, AIR, LOADED, AIR, LOADED] {
        rig.load[leg] = load;
        rig.tick();
    }
    assert_eq!(rig.knee.steps(), 1);
}

#[test]
fn a_jammed_leg_runs_into_the_time_out_of_each_stroke() {
    let mut rig = Rig::new(1_000);
    rig.motion = PUSHED();
    rig.run(|r| r.knee.phase() == Phase::Retract);
    let mut timed_out = 0;
    for _ in 0..1_100 {
        rig.position = [-0.03; 2];
        rig.motion = QUIET();
        timed_out += rig.tick().timed_out as u32;
        if rig.knee.phase() == Phase::Idle {
            break;
        }
    }
    assert_eq!((timed_out, rig.knee.phase()), (2, Phase::Idle));
}

#[test]
fn a_whole_cycle_takes_the_same_time_at_every_tick_rate() {
    let duration = |dt| {
        let mut rig = Rig::new(dt);
        rig.motion = PUSHED();
        let mut events = rig.run(|r| r.knee.phase() == Phase::Retract);
        rig.motion = QUIET();
        events.extend(rig.run(|r| r.knee.phase() == Phase::Idle));
        events.last().map(|e| e.1)
    };
    let fine = duration(100).expect("the cycle ends");
    for dt in RATES {
        let coarse = duration(dt).expect("the cycle ends");
        assert!((coarse - fine).abs() < 3e-6 * dt as f64 + 1e-3, "{coarse} against {fine} s at {dt} µs");
    }
}

proptest! {
    /// Whatever the sensors say, one leg at most moves, never faster than its parameters allow, and every cycle ends.
    #[test]
    fn any_inputs_keep_outputs_within_limits(
        ticks in prop::collection::vec(any::<([i32; 2], [i32; 2], i32, i32, [i32; 4], bool)>(), 1..400),
        dt_us in prop::sample::select(&RATES[..]),
    ) {
        let mut knee = Knee::new(KNEE);
        let fastest = params().extend.max(params().retract).max(params().kick);
        for (load, position, acceleration, rotation, lean, may_start) in ticks {
            let motion = Motion {
                acceleration: Q16(acceleration),
                rotation: Q16(rotation),
                rate: [Q16(lean[0]), Q16(lean[1])],
                lean: [Q16(lean[2]), Q16(lean[3])],
                ..Motion::default()
            };
            let inputs = KneeInputs {
                dt_us,
                load: load.map(Q16),
                position: position.map(Q16),
                fall: &Fall::of(&PlainDivider, &KNEE, &motion),
                may_start,
            };
            let before = (knee.cycle(), knee.steps());
            let out = knee.tick(&inputs, &params());
            let moving: Vec<_> = out.drive.iter().filter_map(|d| match d {
                Drive::Velocity(v) => Some(*v),
                Drive::Brake => None,
            }).collect();
            prop_assert!(moving.len() <= 1);
            prop_assert!(moving.iter().all(|v| v.abs() <= fastest));
            prop_assert!(knee.steps().wrapping_sub(before.1) <= 1);
            if knee.phase() == Phase::Idle {
                prop_assert!(moving.is_empty());
            }
        }
    }

    /// From any state, quiet inputs bring LPG1 back to rest within its time-outs.
    #[test]
    fn every_cycle_ends_within_its_time_outs(stuck in -0.1f64..0.1, dt_us in prop::sample::select(&RATES[..])) {
        let mut rig = Rig::new(dt_us);
        rig.motion = PUSHED();
        rig.tick();
        rig.motion = QUIET();
        for _ in 0..1_100_000 / dt_us {
            rig.position = [stuck; 2];
            rig.tick();
        }
        prop_assert_eq!(rig.knee.phase(), Phase::Idle);
    }
}
