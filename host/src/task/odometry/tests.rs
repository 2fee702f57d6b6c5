use proptest::prelude::*;
use sarah_protocol::fixed::Q16;
use sarah_sim::robot::Health;
use sarah_sim::scenario::{Overrides, Scenario};
use sarah_sim::sil::SilConfig;

use super::audit::{Audit, AuditSummary, Audited, FALL_WITHIN_S};
use super::*;
use crate::link::sim::SimRobot;
use crate::task::judge::Judge;
use crate::task::reward::RewardForm;

fn odometry() -> Odometry {
    Odometry::new(Geometry::load().unwrap())
}

/// A robot that stands still on both feet, at this time.
fn standing(time_us: u32) -> Telemetry {
    Telemetry { time_us, accel: [0, 0, 2048], loads: [800; 4], ..Telemetry::default() }
}

fn away_m(estimate: &Estimate) -> f32 {
    let [x, y, _] = estimate.pose.position_m;
    x.hypot(y)
}

/// A simulated episode with all sensor errors on, pushed 24 to the circle; frames may get lost. Rewards of every second
/// by the truth and by odometry come with it.
fn episode(impulse_n_s: f32, index: u64, arrives: impl Fn(usize) -> bool) -> (Audited, Vec<[f32; 2]>) {
    let overrides =
        Overrides { impulse_n_s: Some(impulse_n_s), directions: Some(24), repeats: Some(4), ..Overrides::default() };
    let episode = Scenario::load("push-grid").unwrap().with(&overrides).unwrap().episode(3, index);
    let mut robot = SimRobot::start(&SilConfig::default(), &episode).unwrap();
    robot.ready_at(episode.settle_s).unwrap();
    let (mut odometry, mut audit, mut frames, mut slices) = (odometry(), Audit::default(), 0, 0);
    let mut judges = [robot.now_s(); 2].map(Judge::new);
    let (mut rewards, mut fell, mut ends_s) = (vec![], false, episode.duration_s);
    while robot.now_s() < ends_s - 1e-3 {
        let slice = robot.advance().unwrap();
        for frame in &slice.telemetry {
            frames += 1;
            if arrives(frames) {
                odometry.saw(frame);
            }
        }
        let (now_s, fallen) = (robot.now_s(), slice.health != Health::Upright);
        let poses = [robot.pose(), odometry.estimate().pose];
        if slice.pushed {
            audit.pushed(now_s);
        }
        audit.saw(now_s, &poses[0], fallen, &odometry.estimate());
        for (judge, pose) in judges.iter_mut().zip(poses) {
            judge.saw(now_s, pose, &slice.telemetry);
        }
        if fallen && !fell {
            (fell, ends_s) = (true, now_s + FALL_WITHIN_S + 0.1);
        }
        slices += 1;
        if !fallen && slices % 100 == 0 {
            rewards.push(judges.each_mut().map(|judge| judge.decide(now_s).reward(RewardForm::Gated)));
        }
    }
    (audit.finish(), rewards)
}

#[test]
fn a_robot_that_stands_stays_where_it_is_while_the_clock_wraps() {
    let mut odometry = odometry();
    for n in 0..1000_u32 {
        let estimate = odometry.saw(&standing((n * 10_000).wrapping_sub(5_000_000)));
        assert!(away_m(&estimate) < 1e-3 && estimate.upright && estimate.standing, "{estimate:?}");
        assert!((estimate.pose.position_m[2] - 0.84).abs() < 1e-3);
    }
}

#[test]
fn after_a_push_the_trunk_is_known_to_the_centimetre() {
    let all: Vec<Audited> = (0..24).step_by(3).map(|index| episode(18.0, index, |_| true).0).collect();
    let summary = AuditSummary::new(&all);
    let error = summary.after_push_m.unwrap();
    assert!(error.median < 0.01 && error.p95 < 0.03, "{summary:?}");
    assert!(summary.at_end_m.unwrap().p95 < 0.03, "{summary:?}");
}

#[test]
fn the_reward_is_that_of_the_truth() {
    for index in [1, 8, 14, 19] {
        for [truth, odometry] in episode(18.0, index, |_| true).1 {
            assert!((truth - odometry).abs() < 0.03, "{index}: {truth} {odometry}");
        }
    }
}

#[test]
fn one_frame_in_ten_may_get_lost() {
    let all: Vec<Audited> = (0..24).step_by(4).map(|index| episode(18.0, index, |n| n % 10 != 0).0).collect();
    assert!(AuditSummary::new(&all).after_push_m.unwrap().p95 < 0.06, "{all:?}");
}

#[test]
fn falls_are_told_in_time_and_only_falls() {
    // More than it can take, in every direction; and what it always takes.
    let all: Vec<Audited> = (0..24).step_by(4).map(|index| episode(45.0, index, |_| true).0).collect();
    let summary = AuditSummary::new(&all);
    assert_eq!((summary.falls_missed, summary.false_falls), (0, 0), "{all:?}");
    assert!(summary.falls_told >= 4, "{all:?}");
    assert!(!episode(12.0, 2, |_| true).0.false_fall);
}

#[test]
fn a_reset_begins_at_the_origin_and_forgets_a_fall() {
    let mut odometry = odometry();
    let lying = |n: u32| Telemetry { lean: [Q16::lit(1.1), Q16::ZERO], accel: [2048, 0, 0], ..standing(n * 10_000) };
    for n in 0..30 {
        odometry.saw(&lying(n));
    }
    assert!(odometry.estimate().fell);
    odometry.reset();
    let estimate = odometry.saw(&standing(1_000_000));
    assert!(!estimate.fell && estimate.upright && away_m(&estimate) == 0.0, "{estimate:?}");
}

#[test]
fn a_fallen_robot_that_somebody_sets_on_its_feet_is_followed_again() {
    let scenario = |name: &str| Scenario::load(name).unwrap();
    let pushed = scenario("push-grid").with(&Overrides { impulse_n_s: Some(60.0), ..Overrides::default() }).unwrap();
    let mut robot = SimRobot::start(&SilConfig::default(), &pushed.episode(3, 2)).unwrap();
    robot.world_mut().run_on();
    let mut odometry = odometry();
    let follow = |robot: &mut SimRobot, odometry: &mut Odometry, until_s: f32| {
        while robot.now_s() < until_s {
            robot.advance().unwrap().telemetry.iter().for_each(|frame| _ = odometry.saw(frame));
        }
    };
    follow(&mut robot, &mut odometry, 5.0);
    assert!(odometry.estimate().fell);
    robot.world_mut().body_mut().stand_up(&scenario("stand").episode(3, 0)).unwrap();
    follow(&mut robot, &mut odometry, 15.0);
    let estimate = odometry.estimate();
    assert!(estimate.fell && estimate.upright && estimate.pose.rotation_rad_s < 0.04, "{estimate:?}");
    odometry.reset();
    follow(&mut robot, &mut odometry, 20.0);
    let estimate = odometry.estimate();
    assert!(!estimate.fell && estimate.lean_rad < 0.02 && away_m(&estimate) < 0.02, "{estimate:?}");
}

#[test]
fn a_long_silence_moves_nothing() {
    let mut odometry = odometry();
    odometry.saw(&standing(0));
    let moved = Telemetry { joints: [Q16::lit(0.1); 6], ..standing(2_000_000) };
    assert!(away_m(&odometry.saw(&moved)) < 1e-3);
}

#[test]
fn a_robot_that_is_carried_stays_where_it_was_picked_up() {
    let mut odometry = odometry();
    for n in 0..1000_u32 {
        let stands = standing(n * 10_000);
        // A third of a g towards somewhere for nine seconds.
        let carried = Telemetry { accel: [700, 700, 2048], loads: [0; 4], ..stands };
        odometry.saw(if n < 100 { &stands } else { &carried });
    }
    assert!(away_m(&odometry.estimate()) < 2.0, "{:?}", odometry.estimate());
}

prop_compose! {
    fn any_frame()(
        time_us: u32, accel: [i16; 3], gyro: [i16; 3], loads: [u16; 4],
        joints: [i32; 6], lean: [i32; 2], phase: u8, usual: bool,
    ) -> Telemetry {
        let time_us = if usual { time_us % 300_000 } else { time_us };
        let (joints, lean) = (joints.map(Q16), lean.map(Q16));
        Telemetry { time_us, accel, gyro, loads, joints, lean, phases: [phase; 3], ..Telemetry::default() }
    }
}

proptest! {
    #[test]
    fn any_frames_leave_a_finite_and_bounded_estimate(
        frames in proptest::collection::vec(any_frame(), 1..300), steps in any::<bool>(),
    ) {
        let mut odometry = odometry();
        let mut time_us = 0_u32;
        for frame in frames {
            // As they come, or as a clock that runs forward has them.
            time_us = time_us.wrapping_add(frame.time_us);
            let estimate = odometry.saw(&Telemetry { time_us: if steps { time_us } else { frame.time_us }, ..frame });
            let Pose { position_m, rotation_rad_s, .. } = estimate.pose;
            prop_assert!(position_m.iter().all(|metres| metres.abs() <= FAR_M), "{:?}", estimate);
            prop_assert!(rotation_rad_s.is_finite() && rotation_rad_s < 200.0);
            prop_assert!(estimate.velocity_m_s.iter().all(|speed| speed.is_finite()));
            prop_assert!(estimate.yaw_rad.is_finite() && estimate.lean_rad.is_finite());
        }
    }
}
