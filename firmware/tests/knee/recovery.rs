//! A calm robot brings its legs back to rest.

use sarah_firmware::lpg::knee::Phase;
use sarah_firmware::lpg::rules::KNEE;
use sarah_protocol::bus::{GaitEvent, Side};

use crate::rig::{AIR, LOADED, PUSHED, QUIET, RATES, Rig, motion, names};

/// Cycles that begin from now on, and with which leg, while the robot stands quietly for `seconds`.
fn begun(rig: &mut Rig, seconds: u32) -> Vec<(GaitEvent, Side)> {
    rig.motion = QUIET();
    let mut begun = vec![];
    for _ in 0..seconds * 1_000_000 / rig.dt_us {
        let leg = rig.knee.swing() as usize;
        rig.load = [LOADED; 2];
        rig.load[leg] = if rig.position[leg] < -0.0075 { AIR } else { LOADED };
        let events = rig.tick().events;
        let starts = events.iter().filter(|event| matches!(event, GaitEvent::CycleStart | GaitEvent::Recovery));
        begun.extend(starts.map(|event| (*event, rig.knee.swing())));
    }
    begun
}

/// A recovery of each leg: a step turns both.
const BOTH: [(GaitEvent, Side); 2] = [(GaitEvent::Recovery, Side::Left), (GaitEvent::Recovery, Side::Right)];

fn by_leg(mut begun: Vec<(GaitEvent, Side)>) -> Vec<(GaitEvent, Side)> {
    begun.sort_by_key(|(_, side)| *side as usize);
    begun
}

#[test]
fn a_calm_robot_brings_both_legs_back_to_rest_once_after_however_many_steps() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        assert_eq!(begun(&mut rig, 3), []);
        rig.motion = PUSHED();
        rig.run(|r| r.knee.phase() == Phase::Retract);
        assert_eq!(by_leg(begun(&mut rig, 8)), BOTH, "at {dt} µs");
        for side in [Side::Left, Side::Right] {
            rig.motion = PUSHED();
            rig.run(|r| r.knee.phase() == Phase::Retract && r.knee.swing() == side);
        }
        rig.run(|r| r.knee.phase() == Phase::Idle);
        rig.tick(); // The foot lands.
        let steps = rig.knee.steps();
        assert_eq!(by_leg(begun(&mut rig, 8)), BOTH, "at {dt} µs");
        assert_eq!(rig.knee.steps(), steps, "a recovery is no step");
        assert!(rig.position.iter().all(|position| position.abs() < 0.01), "{:?} at {dt} µs", rig.position);
    }
}

#[test]
fn a_recovery_that_ends_in_steps_has_to_wait_longer_the_next_time() {
    let mut rig = Rig::new(1_000);
    rig.cycle();
    let waited = |rig: &mut Rig| {
        let waited = (0..20_000).find(|_| rig.tick().events.contains(&GaitEvent::Recovery)).expect("recovers");
        rig.run(|r| r.knee.phase() == Phase::Idle);
        waited
    };
    let mut last = waited(&mut rig);
    for _ in 0..6 {
        rig.cycle();
        let now = waited(&mut rig);
        let expected = (2 * last).min(KNEE.patience_us as usize / 1_000);
        assert!(now.abs_diff(expected) < 100, "{now} after {last}");
        last = now;
    }
    // A calm robot whose legs are at rest starts afresh.
    begun(&mut rig, 30);
    rig.cycle();
    assert!(waited(&mut rig).abs_diff(KNEE.calm_us as usize / 1_000) < 100);
}

#[test]
fn recovery_waits_until_the_robot_has_been_calm_long_enough() {
    let mut rig = Rig::new(1_000);
    rig.cycle();
    for _ in 0..5 {
        for _ in 0..KNEE.calm_us / 1_000 - 10 {
            assert!(rig.tick().events.is_empty());
        }
        rig.motion = motion(f64::from(KNEE.calm.to_f32()) * 1.5, [0.0; 2]);
        assert!(rig.tick().events.is_empty());
        rig.motion = QUIET();
    }
    assert_eq!(by_leg(begun(&mut rig, 4)), BOTH);
}

#[test]
fn a_short_leg_grows_where_it_stands_before_it_is_lifted() {
    for dt in RATES {
        let mut rig = Rig::new(dt);
        rig.cycle();
        let leg = rig.knee.swing() as usize;
        rig.position[leg] = -0.04;
        let events = rig.run(|r| r.knee.phase() != Phase::Idle);
        assert_eq!(names(&events), [GaitEvent::Recovery], "at {dt} µs");
        let calm_s = events[0].1;
        assert!((calm_s - f64::from(KNEE.straighten_us) * 1e-6).abs() < 0.05, "calm for {calm_s} s at {dt} µs");
        // It is not lifted, and takes the time that its speed gives.
        let events = rig.run(|r| r.knee.phase() == Phase::Idle);
        assert_eq!(names(&events), [GaitEvent::CycleEnd], "at {dt} µs");
        let expected_s = 0.04 / f64::from(KNEE.straighten.to_f32());
        assert!((events[0].1 - expected_s).abs() < 0.05, "grew for {} s at {dt} µs", events[0].1);
        assert_eq!(by_leg(begun(&mut rig, 4)), BOTH, "hips and abductors come home at {dt} µs");
        assert!(rig.position[leg].abs() < 0.01);
    }
}

#[test]
fn a_leg_that_lands_before_it_is_home_recovers_again_but_not_for_ever() {
    let mut rig = Rig::new(1_000);
    rig.cycle();
    let leg = rig.knee.swing() as usize;
    let mut recoveries = 0;
    for _ in 0..60_000 {
        // High ground: it lands 12 mm above rest, and what it grows then it loses again.
        rig.load[leg] = if rig.position[leg] < -0.012 { AIR } else { LOADED };
        let events = rig.tick().events;
        if rig.knee.swing() as usize == leg {
            recoveries += events.iter().filter(|event| **event == GaitEvent::Recovery).count();
        }
        if events.contains(&GaitEvent::CycleEnd) {
            rig.position[leg] = -0.012;
        }
    }
    assert_eq!(recoveries, usize::from(KNEE.recoveries));
}
