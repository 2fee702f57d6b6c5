//! Pads that tell late.

use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::knee::Phase;
use sarah_firmware::lpg::rules::KNEE;
use sarah_protocol::bus::GaitEvent;

use crate::rig::{AIR, LOADED, PUSHED, QUIET, RATES, Rig, motion, names};

/// A cycle at the beginning of its retraction, falling forward.
fn pulled_up(dt_us: u32) -> Rig {
    let mut rig = Rig::new(dt_us);
    rig.motion = PUSHED();
    rig.run(|r| r.knee.phase() == Phase::Retract);
    rig.motion = motion(1.0, [0.3, 0.0]);
    rig
}

/// Ticks for `us`.
fn pass(rig: &mut Rig, us: u32) -> Vec<GaitEvent> {
    (0..us / rig.dt_us).flat_map(|_| rig.tick().events).collect()
}

#[test]
fn a_foot_that_is_pulled_up_has_lifted_though_its_pads_say_nothing_yet() {
    for dt in RATES {
        let mut rig = pulled_up(dt);
        let lift = -f64::from(KNEE.lift.to_f32());
        loop {
            let at = rig.position[0];
            let lifted = rig.tick().events.contains(&GaitEvent::LiftOff);
            assert_eq!(lifted, at <= lift, "{at} m");
            if lifted {
                break;
            }
        }
    }
}

#[test]
fn pads_that_never_tell_of_lift_off_end_the_cycle_at_rest_height_and_count_no_step() {
    for dt in RATES {
        let mut rig = pulled_up(dt);
        let events = rig.run(|r| r.knee.phase() == Phase::Idle);
        assert_eq!(names(&events), [GaitEvent::LiftOff, GaitEvent::Touchdown, GaitEvent::CycleEnd]);
        assert!(rig.position[0].abs() < 0.01, "{}", rig.position[0]);
        let most = 2.0 * f64::from(KNEE.step.1.to_f32()) / 0.3 + f64::from(KNEE.wait_us) * 1e-6;
        assert!(events[2].1 < most, "{} s", events[2].1);
        rig.motion = QUIET();
        pass(&mut rig, 100_000);
        assert_eq!(rig.knee.steps(), 0);
    }
}

#[test]
fn an_extension_ends_where_its_sensor_sees_the_leg_beyond_its_goal() {
    let mut rig = pulled_up(1_000);
    rig.load[0] = AIR;
    rig.run(|r| r.knee.phase() == Phase::Extend);
    rig.motion = QUIET();
    // It hangs where it was when the cycle began, and was extended from there.
    rig.sensed = Some([0.014, 0.0]);
    assert!(!rig.tick().timed_out);
    rig.sensed = Some([0.016, 0.0]);
    let out = rig.tick();
    assert!(out.timed_out && rig.knee.phase() == Phase::Idle);
    assert_eq!(out.drive, [Drive::Brake; 2]);
}

#[test]
fn pads_that_still_tell_of_the_ground_are_no_touchdown() {
    for dt in RATES {
        let mut rig = pulled_up(dt);
        assert_eq!(pass(&mut rig, 60_000), [GaitEvent::LiftOff]);
        rig.load[0] = AIR;
        assert_eq!(pass(&mut rig, 20_000), []);
        rig.load[0] = LOADED;
        assert_eq!(pass(&mut rig, 10_000)[..1], [GaitEvent::Touchdown]);
        assert_eq!(rig.knee.steps(), 1);
    }
}

#[test]
fn a_foot_is_taken_to_be_down_near_rest_height_if_its_pads_told_late_of_lift_off() {
    for (late_us, expected) in
        [(20_000, None), (60_000, Some(GaitEvent::Touchdown)), (90_000, Some(GaitEvent::Touchdown))]
    {
        let mut rig = pulled_up(1_000);
        pass(&mut rig, late_us);
        rig.load[0] = AIR;
        rig.run(|r| r.knee.phase() == Phase::Extend);
        let mut told = None;
        while rig.position[0] < 0.0 {
            let at = rig.position[0];
            let events = rig.tick().events;
            assert!(events.is_empty() || at >= -f64::from(KNEE.near.to_f32()), "{at} m");
            told = told.or(events.first().copied());
        }
        assert_eq!(told, expected, "{late_us} µs");
        assert_eq!(rig.knee.steps(), u32::from(expected.is_some()));
    }
}

#[test]
fn a_leg_reaches_beyond_rest_when_the_pads_had_as_long_for_touchdown_as_they_took_for_lift_off() {
    for late_us in [20_000, 60_000, 90_000] {
        let mut rig = pulled_up(1_000);
        pass(&mut rig, late_us);
        rig.load[0] = AIR;
        rig.run(|r| r.position[0] >= 0.0);
        let waited = (0..400_u32).find(|_| rig.tick().drive[0] != Drive::Brake).expect("reaches");
        assert!(waited.abs_diff(late_us / 1_000) < 3, "{waited} ms");
        rig.run(|r| r.knee.phase() == Phase::Idle);
        assert!((rig.position[0] - f64::from(KNEE.reach.to_f32())).abs() < 0.01);
    }
}

#[test]
fn a_foot_that_lands_meanwhile_ends_the_reach() {
    let mut rig = pulled_up(1_000);
    pass(&mut rig, 40_000);
    rig.load[0] = AIR;
    rig.run(|r| r.position[0] >= 0.0);
    pass(&mut rig, 30_000);
    rig.load[0] = LOADED;
    let events = rig.run(|r| r.knee.phase() == Phase::Idle);
    assert_eq!(names(&events), [GaitEvent::Touchdown, GaitEvent::CycleEnd]);
    assert!(rig.position[0].abs() < 0.002, "{}", rig.position[0]);
}

#[test]
fn a_leg_does_not_reach_for_the_ground_once_the_imu_is_silent() {
    let mut rig = pulled_up(1_000);
    pass(&mut rig, 20_000);
    rig.load[0] = AIR;
    rig.may_start = false;
    let events = rig.run(|r| r.knee.phase() == Phase::Idle);
    assert_eq!(names(&events), [GaitEvent::LiftOff, GaitEvent::CycleEnd]);
    assert!(rig.position[0].abs() < 0.01, "{}", rig.position[0]);
}

#[test]
fn a_leg_that_grows_where_it_stands_has_lifted_when_its_pads_say_so_however_late_they_were_before() {
    let mut rig = pulled_up(1_000);
    pass(&mut rig, 90_000);
    rig.load[0] = AIR;
    rig.motion = QUIET();
    rig.run(|r| r.knee.phase() == Phase::Idle);
    rig.load[0] = LOADED;
    rig.position[0] = -0.04;
    rig.run(|r| r.knee.phase() == Phase::Extend);
    rig.run(|r| r.position[0] > -0.01);
    rig.load[0] = AIR;
    assert_eq!(pass(&mut rig, 10_000), [GaitEvent::LiftOff]);
}
