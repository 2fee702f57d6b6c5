use super::*;
use crate::robot::{Drive, Robot, RobotConfig};

fn standing() -> Robot {
    let mut robot = Robot::new(&RobotConfig { drop_m: 0.005, ..Default::default() }).unwrap();
    for _ in 0..250 {
        robot.step();
    }
    robot
}

#[test]
fn imu_at_rest_reads_one_g_with_errors_off() {
    let mut robot = standing();
    let mut sensors = Sensors::new(&SensorConfig::perfect(), 1).unwrap();
    for _ in 0..100 {
        robot.step();
        sensors.observe(&robot);
    }
    let imu = sensors.imu(robot.time_s());
    assert!((i32::from(imu.accel[2]) - 2048).abs() <= 4, "{imu:?}");
    assert!(imu.accel[0].abs() <= 12 && imu.accel[1].abs() <= 12, "{imu:?}");
    assert!(imu.gyro.iter().all(|w| w.abs() <= 5), "{imu:?}");
}

#[test]
fn imu_in_free_fall_reads_zero() {
    let mut robot = Robot::new(&RobotConfig { drop_m: 1.0, ..Default::default() }).unwrap();
    let mut sensors = Sensors::new(&SensorConfig::perfect(), 1).unwrap();
    for _ in 0..50 {
        robot.step();
        sensors.observe(&robot);
    }
    assert!(sensors.imu(robot.time_s()).accel.iter().all(|a| a.abs() <= 2));
}

#[test]
fn counts_saturate_instead_of_wrapping() {
    let counts = ImuCounts::from_si([1e6, -1e6, 16.5 * G0_M_S2], [100.0, -100.0, 0.0]);
    assert_eq!(counts.accel, [i16::MAX, i16::MIN, i16::MAX]);
    assert_eq!(counts.gyro, [i16::MAX, i16::MIN, 0]);
}

#[test]
fn counts_convert_back_within_half_a_count() {
    let counts = ImuCounts::from_si([1.0, -2.0, 9.81], [0.1, -0.2, 3.0]);
    for (back, given) in counts.accel_m_s2().iter().zip([1.0, -2.0, 9.81]) {
        assert!((back - given).abs() <= 0.5 * G0_M_S2 / 2048.0 + 1e-6);
    }
    for (back, given) in counts.gyro_rad_s().iter().zip([0.1f32, -0.2, 3.0]) {
        assert!((back - given).abs() <= 0.5f32.to_radians() / 16.4 + 1e-6);
    }
}

#[test]
fn delay_is_exact_at_any_query_rate() {
    let config = SensorConfig { joint_delay_s: 0.010, ..SensorConfig::perfect() };
    let mut robot = Robot::new(&RobotConfig { drop_m: 1.0, ..Default::default() }).unwrap();
    let mut sensors = Sensors::new(&config, 1).unwrap();
    sensors.observe(&robot);
    robot.drive(Joint::LeftKnee, Drive::Velocity(0.3));
    let mut truth = vec![robot.joint(Joint::LeftKnee).position];
    for step in 1..=60usize {
        robot.step();
        sensors.observe(&robot);
        truth.push(robot.joint(Joint::LeftKnee).position);
        // Twenty queries between this step and the next, as a 10 kHz node makes, and one as a slow one makes.
        for query in 0..20 {
            let now_s = robot.time_s() + f64::from(query) * 1e-4;
            let seen = sensors.joints(now_s)[Joint::LeftKnee as usize];
            assert_eq!(seen, truth[step.saturating_sub(5)], "step {step} query {query}");
        }
    }
}

#[test]
fn noise_does_not_depend_on_how_often_it_is_read() {
    let run = |reads: usize| {
        let mut robot = standing();
        let mut sensors = Sensors::new(&SensorConfig::default(), 7).unwrap();
        for _ in 0..50 {
            robot.step();
            sensors.observe(&robot);
            for _ in 0..reads {
                let _ = (sensors.imu(robot.time_s()), sensors.pads_n(robot.time_s()));
            }
        }
        (sensors.imu(robot.time_s()), sensors.pads_n(robot.time_s()))
    };
    assert_eq!(run(0), run(9));
}

#[test]
fn noise_has_the_configured_strength_and_bias_is_constant() {
    let config = SensorConfig { imu_delay_s: 0.0, ..Default::default() };
    let mut robot = standing();
    let mut sensors = Sensors::new(&config, 3).unwrap();
    let (mut accel, mut gyro) = (Vec::new(), Vec::new());
    for _ in 0..2000 {
        robot.step();
        sensors.observe(&robot);
        let imu = sensors.imu(robot.time_s());
        accel.push(imu.accel_m_s2()[0]);
        gyro.push(imu.gyro_rad_s()[0]);
    }
    let mean = |v: &[f32]| v.iter().sum::<f32>() / v.len() as f32;
    let rms = |v: &[f32]| (v.iter().map(|x| (x - mean(v)).powi(2)).sum::<f32>() / v.len() as f32).sqrt();
    assert!((rms(&accel) - 0.1).abs() < 0.02, "{}", rms(&accel));
    assert!((rms(&gyro) - 0.01).abs() < 0.002, "{}", rms(&gyro));
    assert!((mean(&gyro) - sensors.gyro_bias_rad_s[0]).abs() < 0.002);
}

#[test]
fn a_growing_bias_goes_on_in_the_direction_it_was_drawn_in() {
    let config = SensorConfig { gyro_bias_rad_s: 0.02, gyro_bias_growth_rad_s2: 0.01, ..SensorConfig::perfect() };
    let mut robot = standing();
    let began_s = robot.time_s() as f32;
    let mut sensors = Sensors::new(&config, 3).unwrap();
    let drawn = sensors.gyro_bias_rad_s;
    for step in 1..=1500 {
        robot.step();
        sensors.observe(&robot);
        if step % 500 == 0 {
            // 0.01 rad/s² on 0.02 rad/s: half as much again every second.
            let time_s = began_s + step as f32 * robot.dt_s();
            for (read, drawn) in sensors.imu(robot.time_s()).gyro_rad_s().iter().zip(drawn) {
                assert!((read - drawn * (1.0 + 0.5 * time_s)).abs() < 0.003, "{read} at {time_s} s, began as {drawn}");
            }
        }
    }
}

#[test]
fn growth_draws_nothing_more_so_that_noise_stays_what_it_was() {
    let grows = SensorConfig { gyro_bias_growth_rad_s2: 0.01, ..SensorConfig::default() };
    let loads = |config: &SensorConfig| {
        let mut robot = standing();
        let mut sensors = Sensors::new(config, 3).unwrap();
        robot.step();
        sensors.observe(&robot);
        (sensors.pads_n(robot.time_s()), sensors.imu(robot.time_s()).accel)
    };
    assert_eq!(loads(&SensorConfig::default()), loads(&grows));
}

#[test]
fn knees_are_read_in_steps_of_five_millimetres() {
    let mut robot = standing();
    let mut sensors = Sensors::new(&SensorConfig::default(), 1).unwrap();
    robot.drive(Joint::LeftKnee, Drive::Velocity(-0.2));
    for _ in 0..30 {
        robot.step();
        sensors.observe(&robot);
    }
    let (seen, truth) = (sensors.joints(robot.time_s())[2], robot.joint(Joint::LeftKnee).position);
    assert!(((seen / 0.005).round() * 0.005 - seen).abs() < 1e-6 && (seen - truth).abs() <= 0.0026, "{seen} {truth}");
}

#[test]
fn unknown_keys_nan_and_negative_values_are_refused() {
    assert!(toml::from_str::<SensorConfig>("gyro_nois = 1").unwrap_err().to_string().contains("gyro_nois"));
    for bad in [f32::NAN, -1.0] {
        let config = SensorConfig { pad_noise_n: bad, ..Default::default() };
        assert!(Sensors::new(&config, 1).unwrap_err().to_string().contains("sensors.pad_noise_n"));
        let config = SensorConfig { gyro_bias_growth_rad_s2: bad, ..Default::default() };
        assert!(Sensors::new(&config, 1).unwrap_err().to_string().contains("sensors.gyro_bias_growth_rad_s2"));
    }
}
