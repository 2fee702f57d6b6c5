use super::*;

fn steps(robot: &mut Robot, seconds: f32) {
    for _ in 0..(seconds / robot.dt_s()).round() as usize {
        robot.step();
    }
}

fn standing() -> Robot {
    let mut robot = Robot::new(&RobotConfig { drop_m: 0.005, ..Default::default() }).unwrap();
    steps(&mut robot, 0.5);
    robot
}

/// Whether the braked robot is still up 4 s after a 0.1 s push at the trunk's centre of mass.
fn survives_braked(direction_deg: f32, impulse_n_s: f32) -> bool {
    let mut robot = Robot::new(&RobotConfig { drop_m: 0.1, ..Default::default() }).unwrap();
    steps(&mut robot, 1.0);
    let (sin, cos) = direction_deg.to_radians().sin_cos();
    robot.push([impulse_n_s * cos / 0.1, impulse_n_s * sin / 0.1, 0.0], 0.0);
    steps(&mut robot, 0.1);
    robot.clear_push();
    for _ in 0..40 {
        steps(&mut robot, 0.1);
        if robot.health() != Health::Upright {
            return false;
        }
    }
    true
}

#[test]
fn braked_robot_topples_at_the_reference_impulses() {
    for (name, direction_deg, reference_n_s) in
        [("forward", 0.0, 19.0), ("left", 90.0, 23.0), ("backward", 180.0, 17.0)]
    {
        assert!(survives_braked(direction_deg, reference_n_s - 1.5), "{name} falls too early");
        assert!(!survives_braked(direction_deg, reference_n_s + 1.5), "{name} stands too long");
    }
}

#[test]
fn mass_is_the_sum_of_the_file_and_follows_payload_and_scale() {
    let plain = Robot::new(&RobotConfig::default()).unwrap();
    assert!((plain.mass_kg() - 32.0).abs() < 0.01, "{}", plain.mass_kg());
    let loaded = RobotConfig { payload_kg: 5.0, mass_scale: 1.1, ..Default::default() };
    assert!((Robot::new(&loaded).unwrap().mass_kg() - (35.2 + 5.0)).abs() < 0.01);
}

#[test]
fn pads_carry_the_weight_at_rest() {
    let robot = standing();
    let total_n: f32 = robot.pad_loads_n().iter().sum();
    let weight_n = robot.mass_kg() * robot.gravity_m_s2();
    assert!((total_n - weight_n).abs() < 0.02 * weight_n, "{total_n} N of {weight_n} N");
    // 50 kN/m under the mean load of a pad.
    let travel_m: f32 = robot.pad_travel_m().iter().sum();
    assert!((travel_m - weight_n / 50_000.0).abs() < 0.0005, "{travel_m} m");
}

#[test]
fn brakes_do_not_creep_under_load() {
    let mut robot = Robot::new(&RobotConfig { drop_m: 0.005, payload_kg: 15.0, ..Default::default() }).unwrap();
    // Landing deflects the brakes elastically; creep is what comes after.
    steps(&mut robot, 0.5);
    let before = Joint::ALL.map(|joint| robot.joint(joint).position);
    steps(&mut robot, 2.0);
    for joint in Joint::ALL {
        let moved = (robot.joint(joint).position - before[joint as usize]).abs();
        assert!(moved < 0.0005, "{joint:?} moved {moved}");
    }
}

#[test]
fn brake_holds_where_it_was_applied() {
    let mut robot = standing();
    robot.drive(Joint::LeftKnee, Drive::Velocity(-0.3));
    robot.drive(Joint::LeftHip, Drive::Velocity(2.0));
    steps(&mut robot, 0.1);
    let at = [robot.joint(Joint::LeftKnee).position, robot.joint(Joint::LeftHip).position];
    robot.drive(Joint::LeftKnee, Drive::Brake);
    robot.drive(Joint::LeftHip, Drive::Brake);
    assert_eq!(at, [robot.joint(Joint::LeftKnee).position, robot.joint(Joint::LeftHip).position]);
    steps(&mut robot, 0.1);
    assert!((robot.joint(Joint::LeftKnee).position - at[0]).abs() < 0.001);
    assert!((robot.joint(Joint::LeftHip).position - at[1]).abs() < 0.005);
}

#[test]
fn slow_knee_command_lifts_the_robot_instead_of_stalling() {
    let mut robot = standing();
    for knee in [Joint::LeftKnee, Joint::RightKnee] {
        robot.drive(knee, Drive::Velocity(0.09));
    }
    steps(&mut robot, 0.5);
    let moved_m = robot.joint(Joint::LeftKnee).position;
    assert!((moved_m - 0.045).abs() < 0.005, "{moved_m} m of 0.045");
    // Each leg lifts half of what is above its rod; the motor's effort must say so.
    let effort_n = robot.effort(Joint::LeftKnee) + robot.effort(Joint::RightKnee);
    assert!((effort_n - 28.0 * 9.8).abs() < 30.0, "{effort_n} N");
}

#[test]
fn force_and_speed_limits_come_from_the_file() {
    let mut robot = Robot::new(&RobotConfig { drop_m: 1.0, ..Default::default() }).unwrap();
    robot.drive(Joint::LeftHip, Drive::Velocity(50.0));
    steps(&mut robot, 0.06);
    let speed = robot.joint(Joint::LeftHip).velocity;
    assert!((speed - 5.0).abs() < 0.3, "{speed} rad/s");
    assert!(robot.effort(Joint::LeftHip).abs() <= 200.1);
}

#[test]
fn joints_stop_at_their_range() {
    let mut robot = Robot::new(&RobotConfig { drop_m: 1.0, ..Default::default() }).unwrap();
    robot.drive(Joint::RightKnee, Drive::Velocity(-0.9));
    steps(&mut robot, 0.3);
    let position_m = robot.joint(Joint::RightKnee).position;
    assert!((position_m + 0.12).abs() < 0.003, "{position_m} m");
}

#[test]
fn positive_angles_move_the_feet_forward_and_left() {
    let mut robot = Robot::new(&RobotConfig { drop_m: 1.0, ..Default::default() }).unwrap();
    let before = robot.com_m();
    for joint in [Joint::LeftHip, Joint::RightHip, Joint::LeftAbductor, Joint::RightAbductor] {
        robot.drive(joint, Drive::Velocity(2.0));
    }
    steps(&mut robot, 0.1);
    // In free fall the trunk recoils: legs going forward pitch it forward (+y), legs going left roll it left (-x).
    let [x, y, ..] = robot.trunk().rotation_xyzw;
    assert!(y > 0.05 && x < -0.05, "{x} {y}");
    assert!((robot.com_m()[0] - before[0]).abs() < 0.002);
}

#[test]
fn two_runs_are_identical_byte_for_byte_even_on_other_threads() {
    fn run() -> Vec<u8> {
        let mut robot = Robot::new(&RobotConfig { drop_m: 0.1, ..Default::default() }).unwrap();
        let mut bytes = Vec::new();
        for step in 0..1000 {
            match step {
                300 => robot.push([150.0, 60.0, 0.0], 0.0),
                350 => robot.clear_push(),
                360 => robot.drive(Joint::RightKnee, Drive::Velocity(-0.8)),
                380 => robot.drive(Joint::RightHip, Drive::Velocity(4.0)),
                420 => robot.drive(Joint::RightKnee, Drive::Brake),
                _ => {}
            }
            robot.step();
            let trunk = robot.trunk();
            for value in trunk.position_m.iter().chain(&trunk.rotation_xyzw).chain(&robot.pad_loads_n()) {
                bytes.extend(value.to_le_bytes());
            }
        }
        bytes
    }
    let (here, there) = (run(), std::thread::spawn(run).join().unwrap());
    assert!(here == there);
}

#[test]
fn a_fallen_robot_is_reported() {
    let mut robot = standing();
    assert_eq!(robot.health(), Health::Upright);
    robot.push([500.0, 0.0, 0.0], 0.0);
    steps(&mut robot, 0.1);
    robot.clear_push();
    steps(&mut robot, 1.5);
    assert!(matches!(robot.health(), Health::Fallen { .. }), "{:?}", robot.health());
}

#[test]
fn a_non_finite_state_is_its_own_verdict() {
    let mut robot = standing();
    robot.push([f32::NAN, 0.0, 0.0], 0.0);
    robot.step();
    assert_eq!(robot.health(), Health::NonFinite);
}

#[test]
fn a_blow_up_is_its_own_verdict() {
    let mut robot = standing();
    robot.push([1e7, 0.0, 0.0], 0.0);
    robot.step();
    assert!(matches!(robot.health(), Health::Exploded { .. }), "{:?}", robot.health());
}

#[test]
fn the_robot_is_set_down_on_a_slope_with_its_soles_flat() {
    let slope = RobotConfig { slope_pitch_rad: -0.05, slope_roll_rad: 0.03, drop_m: 0.005, ..Default::default() };
    let mut robot = Robot::new(&slope).unwrap();
    let leaning_rad = (0.05f32.cos() * 0.03f32.cos()).acos();
    assert!((robot.lean_rad() - leaning_rad).abs() < 1e-3, "{}", robot.lean_rad());
    for _ in 0..15 {
        steps(&mut robot, 0.1);
        assert!((robot.lean_rad() - leaning_rad).abs() < 0.01, "{}", robot.lean_rad());
    }
    assert!(robot.pad_loads_n().iter().all(|&load| load > 15.0), "{:?}", robot.pad_loads_n());
}

#[test]
fn a_speed_that_is_not_finite_brakes() {
    let mut robot = standing();
    robot.drive(Joint::LeftHip, Drive::Velocity(f32::NAN));
    assert_eq!(robot.driven(Joint::LeftHip), Drive::Brake);
}

#[test]
fn the_measures_place_the_soles_where_the_simulator_has_them() {
    let geometry = Geometry::load().unwrap();
    let mut robot = Robot::new(&RobotConfig { drop_m: 1.0, ..Default::default() }).unwrap();
    assert_eq!(geometry.standing_m, robot.standing_height_m());
    for (joint, speed) in Joint::ALL.into_iter().zip([1.5, -2.0, -0.5, -1.0, 3.0, 0.6]) {
        robot.drive(joint, Drive::Velocity(speed));
    }
    steps(&mut robot, 0.15);
    let soles_m = geometry.soles_m(Joint::ALL.map(|joint| robot.joint(joint).position));
    let Model { world, pads, pad_colliders, trunk, .. } = &robot.model;
    for ((pad, collider), sole) in pads.iter().zip(pad_colliders).zip(soles_m) {
        let body = world.impulse_joints.get(pad.handle).unwrap().body2();
        let half = world.colliders[*collider].shape().as_cuboid().unwrap().half_extents;
        let up = Vector::new(0.0, 0.0, -half.z);
        let at = world.bodies[*trunk].position().inverse() * (*world.bodies[body].position() * up);
        let middle = sole.into_iter().map(Vector::from_array).sum::<Vector>() / 4.0;
        // The pad's spring gives a little as the leg swings.
        assert!((at - middle).length() < 0.002, "{at} {middle}");
    }
}
