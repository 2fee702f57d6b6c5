//! What depends on where the robot falls.

use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::knee::Phase;
use sarah_firmware::lpg::rules::KNEE;
use sarah_protocol::bus::{GaitEvent, Motion, Side};
use sarah_protocol::fixed::Q16;

use crate::rig::{AIR, HELD, LOADED, PUSHED, RATES, Rig, motion, names};

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

#[test]
fn a_robot_that_tips_over_the_outer_edge_of_one_foot_hops_on_it() {
    for (lean, load, leg) in [(0.3, [LOADED, AIR], Side::Left), (-0.3, [AIR, LOADED], Side::Right)] {
        for dt in RATES {
            let mut rig = Rig::new(dt);
            rig.load = load;
            rig.motion = motion(1.0, [0.0, lean / 2.0]);
            assert!(rig.tick().events.is_empty(), "the foot holds it");
            rig.motion = motion(1.0, [0.0, lean]);
            rig.run(|r| r.knee.phase() == Phase::Retract);
            assert_eq!(rig.knee.swing(), leg, "{lean:?} at {dt} µs");
            assert_eq!(rig.knee.phase(), Phase::Retract);
        }
    }
}

#[test]
fn a_foot_that_has_just_landed_stands_though_a_sagittal_fall_lifts_it_again() {
    for (lean, other_steps) in [([0.3, 0.0], true), ([0.0, 0.3], false)] {
        for dt in RATES {
            let mut rig = Rig::new(dt);
            rig.motion = motion(1.0, lean);
            rig.run(|r| r.knee.phase() == Phase::Retract);
            let first = rig.knee.swing();
            rig.load[first as usize] = AIR;
            rig.run(|r| r.knee.phase() == Phase::Extend);
            rig.load = [LOADED; 2];
            rig.run(|r| r.knee.phase() == Phase::Idle);
            rig.load[first as usize] = AIR;
            // In a chain it would step itself.
            rig.run(|r| r.knee.phase() != Phase::Idle);
            assert_eq!(rig.knee.swing() == first.other(), other_steps, "{lean:?} at {dt} µs");
        }
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
