//! Every transition (paper, Fig. 3), by name, at 100 Hz, 1 kHz and 10 kHz.

use proptest::prelude::*;
use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::factor::PlainDivider;
use sarah_firmware::lpg::fall::Fall;
use sarah_firmware::lpg::knee::{Knee, KneeInputs, KneeOutputs, Phase};
use sarah_firmware::lpg::rules::KNEE;
use sarah_protocol::bus::{GaitEvent, Motion, Side};
use sarah_protocol::fixed::Q16;

use crate::rig::{AIR, HELD, LOADED, PUSHED, QUIET, RATES, Rig, motion, names, params};

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
        let mut knee = Knee::idle();
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
                sensed: position.map(Q16),
                fall: &Fall::of(&PlainDivider, &motion),
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
