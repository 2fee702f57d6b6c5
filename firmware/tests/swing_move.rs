//! Every transition of LPG2 and LPG3 (paper, Fig. 2), by name.

use proptest::prelude::*;
use sarah_firmware::lpg::Drive;
use sarah_firmware::lpg::rules::{ABDUCTOR, HIP, SwingRules};
use sarah_firmware::lpg::swing::{Phase, Sway, Swing, SwingParams};
use sarah_protocol::bus::{GaitEvent, Motion, Side};
use sarah_protocol::fixed::Q16;

fn params() -> SwingParams {
    SwingParams {
        dead_band: Q16::lit(0.4),
        lean_weight: Q16::lit(5.0),
        quadratic: Q16::lit(0.1),
        linear: Q16::lit(0.2),
        speed: Q16::lit(5.0),
    }
}

/// Falling so that x = `sagittal` and `lateral` rad/s.
fn falling(sagittal: f64, lateral: f64) -> Motion {
    Motion { slow_rate: [Q16::lit(sagittal), Q16::lit(lateral)], ..Motion::default() }
}

fn lifted(rules: SwingRules, leg: Side, motion: &Motion) -> Swing {
    let (mut swing, sway) = (Swing::new(rules), Sway::of(&rules, motion));
    swing.on_gait(GaitEvent::CycleStart, leg, &sway, &params());
    swing.on_gait(GaitEvent::LiftOff, leg, &sway, &params());
    swing
}

fn target(rules: SwingRules, leg: Side, motion: &Motion) -> f32 {
    lifted(rules, leg, motion).target().expect("decided at lift-off").to_f32()
}

#[test]
fn nothing_moves_before_lift_off() {
    let mut swing = Swing::new(HIP);
    swing.on_gait(GaitEvent::CycleStart, Side::Left, &Sway::of(&HIP, &falling(1.0, 0.0)), &params());
    assert_eq!(swing.phase(), Phase::Ready);
    assert_eq!(swing.tick(1_000, [Q16::ZERO; 2], &params()).0, [Drive::Brake; 2]);
}

#[test]
fn lift_off_moves_the_swing_leg_to_its_target_and_the_other_the_opposite_way() {
    for leg in Side::BOTH {
        let mut swing = lifted(HIP, leg, &falling(1.0, 0.0));
        let (drive, _) = swing.tick(1_000, [Q16::ZERO; 2], &params());
        assert_eq!(drive[leg as usize], Drive::Velocity(params().speed));
        assert_eq!(drive[leg.other() as usize], Drive::Velocity(-HIP.scissor_speed));
    }
}

#[test]
fn the_other_leg_turns_by_a_fraction_of_what_the_swing_leg_has_to_go() {
    for rules in [HIP, ABDUCTOR] {
        let mut swing = lifted(rules, Side::Left, &falling(1.0, 1.0));
        let target = swing.target().expect("decided").to_f32();
        let (dt_us, mut legs) = (1_000, [0.1, 0.2]);
        while swing.phase() == Phase::Moving {
            let (drive, late) = swing.tick(dt_us, legs.map(Q16::from_f32), &params());
            assert!(!late);
            for (leg, drive) in legs.iter_mut().zip(drive) {
                if let Drive::Velocity(speed) = drive {
                    *leg += speed.to_f32() * dt_us as f32 * 1e-6;
                }
            }
        }
        assert!((legs[0] - target).abs() < 0.003);
        assert!((legs[1] - (0.2 - rules.scissor.to_f32() * (target - 0.1))).abs() < 0.001);
    }
}

#[test]
fn a_recovery_brings_the_leg_back_to_rest_whatever_the_fall() {
    for rules in [HIP, ABDUCTOR] {
        let sway = Sway::of(&rules, &falling(1.0, 1.0));
        let mut swing = Swing::new(rules);
        swing.on_gait(GaitEvent::Recovery, Side::Left, &sway, &params());
        assert_eq!(swing.tick(1_000, [Q16::lit(0.2); 2], &params()).0, [Drive::Brake; 2]);
        swing.on_gait(GaitEvent::LiftOff, Side::Left, &sway, &params());
        assert_eq!(swing.target(), Some(Q16::ZERO));
        let (drive, _) = swing.tick(1_000, [Q16::lit(0.2); 2], &params());
        assert_eq!(drive, [Drive::Velocity(-params().speed), Drive::Brake]);
    }
}

#[test]
fn the_target_is_the_quadratic_of_the_fall() {
    let x = 1.5f32;
    let expected = 0.1 * x * x + 0.2 * x + HIP.constant.to_f32();
    assert!((target(HIP, Side::Left, &falling(1.5, 0.0)) - expected).abs() < 1e-4);
    assert!((target(HIP, Side::Left, &falling(-1.5, 0.0)) + expected).abs() < 1e-4);
}

#[test]
fn lean_weighs_in_by_its_coefficient() {
    let leaning = Motion { lean: [Q16::lit(0.2), Q16::ZERO], ..Motion::default() };
    let x = 5.0 * 0.2f32;
    let expected = 0.1 * x * x + 0.2 * x + HIP.constant.to_f32();
    assert!((target(HIP, Side::Left, &leaning) - expected).abs() < 1e-3);
}

#[test]
fn inside_the_dead_band_the_leg_returns_to_rest() {
    assert_eq!(target(HIP, Side::Left, &falling(0.39, 0.0)), 0.0);
    let mut swing = lifted(HIP, Side::Left, &falling(0.39, 0.0));
    let (drive, _) = swing.tick(1_000, [Q16::lit(0.3), Q16::ZERO], &params());
    assert_eq!(drive[0], Drive::Velocity(-params().speed));
}

#[test]
fn an_abductor_moves_outward_with_the_fall_and_a_little_against_it() {
    let x = 1.0f32;
    let with = 0.1 * x * x + 0.2 * x + ABDUCTOR.constant.to_f32();
    let against = ABDUCTOR.opposite.to_f32();
    assert!((target(ABDUCTOR, Side::Left, &falling(0.0, 1.0)) - with).abs() < 1e-4);
    assert!((target(ABDUCTOR, Side::Right, &falling(0.0, -1.0)) + with).abs() < 1e-4);
    assert!((target(ABDUCTOR, Side::Left, &falling(0.0, -1.0)) - against).abs() < 1e-4);
    assert!((target(ABDUCTOR, Side::Right, &falling(0.0, 1.0)) + against).abs() < 1e-4);
}

#[test]
fn the_decision_is_made_once_per_cycle() {
    let mut swing = lifted(HIP, Side::Left, &falling(1.0, 0.0));
    let decided = swing.target();
    swing.on_gait(GaitEvent::Touchdown, Side::Left, &Sway::of(&HIP, &falling(3.0, 0.0)), &params());
    swing.on_gait(GaitEvent::LiftOff, Side::Left, &Sway::of(&HIP, &falling(3.0, 0.0)), &params());
    assert_eq!(swing.target(), decided);
    assert_eq!(swing.phase(), Phase::Moving);
}

#[test]
fn each_leg_brakes_on_target() {
    let mut swing = lifted(HIP, Side::Left, &falling(1.0, 0.0));
    let goal = swing.target().expect("decided");
    let opens = Drive::Velocity(-HIP.scissor_speed);
    assert_eq!(swing.tick(1_000, [Q16::ZERO; 2], &params()).0, [Drive::Velocity(params().speed), opens]);
    assert_eq!(swing.tick(1_000, [goal, Q16::ZERO], &params()).0, [Drive::Brake, opens]);
    assert_eq!(swing.tick(1_000, [goal, -HIP.scissor.times(goal)], &params()).0, [Drive::Brake; 2]);
    assert_eq!(swing.phase(), Phase::Held);
}

#[test]
fn touchdown_brakes_and_cycle_end_brakes() {
    for event in [GaitEvent::Touchdown, GaitEvent::CycleEnd] {
        let mut swing = lifted(HIP, Side::Left, &falling(1.0, 0.0));
        swing.on_gait(event, Side::Left, &Sway::of(&HIP, &falling(1.0, 0.0)), &params());
        assert_eq!(swing.tick(1_000, [Q16::ZERO; 2], &params()).0, [Drive::Brake; 2]);
    }
}

#[test]
fn a_jammed_joint_gives_up_after_its_time_out() {
    let mut swing = lifted(HIP, Side::Left, &falling(1.0, 0.0));
    let ticks = (0..1_000).take_while(|_| !swing.tick(1_000, [Q16::ZERO; 2], &params()).1).count();
    assert_eq!(ticks as u32, HIP.move_us / 1_000);
    assert_eq!(swing.tick(1_000, [Q16::ZERO; 2], &params()).0, [Drive::Brake; 2]);
}

proptest! {
    #[test]
    fn any_flags_and_inputs_keep_targets_in_reach_and_speed_within_limits(
        events in prop::collection::vec((0u8..6, any::<bool>(), any::<[i32; 4]>(), any::<[i32; 2]>()), 1..200),
        lateral in any::<bool>(),
    ) {
        let rules = if lateral { ABDUCTOR } else { HIP };
        let mut swing = Swing::new(rules);
        for (event, left, fall, position) in events {
            let event = [GaitEvent::CycleStart, GaitEvent::LiftOff, GaitEvent::Touchdown, GaitEvent::CycleEnd,
                GaitEvent::Boundary, GaitEvent::Beat][event as usize];
            let motion = Motion {
                slow_rate: [Q16(fall[0]), Q16(fall[1])],
                lean: [Q16(fall[2]), Q16(fall[3])],
                ..Motion::default()
            };
            swing.on_gait(event, if left { Side::Left } else { Side::Right }, &Sway::of(&rules, &motion), &params());
            let (drive, _) = swing.tick(1_000, position.map(Q16), &params());
            if let Some(target) = swing.target() {
                prop_assert!(target.abs() <= rules.reach);
            }
            let moving = drive.iter().filter(|d| **d != Drive::Brake).count();
            prop_assert!(swing.phase() == Phase::Moving || moving == 0);
            for d in drive {
                if let Drive::Velocity(v) = d {
                    prop_assert!([params().speed, rules.scissor_speed].contains(&v.abs()));
                }
            }
        }
    }
}
