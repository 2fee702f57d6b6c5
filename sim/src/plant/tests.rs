use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::thread;
use std::time::{Duration, Instant};

use sarah_protocol::frame::{self, Deframer, Header};

use super::external::model_crc;
use super::process::Process;
use super::wire::encode;
use super::*;
use crate::robot::{Geometry, Robot, RobotConfig, WeakActuator};
use crate::scenario::Scenario;
use crate::sil::{Sil, SilConfig, SilError};

const PATIENCE: Patience = Patience { setup: Duration::from_millis(300), step: Duration::from_millis(300) };

/// The other end of the line, for plants in this process.
struct Far(UnixStream);

impl Far {
    /// The next message with its number; `None` once nobody asks any more.
    fn hear(&mut self) -> Option<(u16, ToPlant)> {
        let mut deframer: Deframer = Deframer::new();
        let mut byte = [0];
        loop {
            self.0.read_exact(&mut byte).ok()?;
            if let Some(packet) = deframer.push(byte[0]) {
                let packet = packet.unwrap();
                assert_eq!((packet.header.version, packet.header.session), (VERSION, 0));
                return Some((packet.header.sequence, postcard::from_bytes(packet.body).unwrap()));
            }
        }
    }

    fn say(&mut self, number: u16, reply: &FromPlant) {
        self.bytes(&encode(number, reply).unwrap());
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.0.write_all(bytes).unwrap();
    }

    /// Puts up the robot of rapier's that was asked for.
    fn put_up(&mut self) -> (Robot, RobotConfig) {
        let (number, message) = self.hear().unwrap();
        let ToPlant::Setup(setup) = message else { panic!("{message:?}") };
        let weak = Joint::ALL.into_iter().find(|joint| setup.speed_scales[*joint as usize] != 1.0);
        let config = RobotConfig {
            weak_actuator: weak.map(|joint| WeakActuator {
                joint,
                speed_scale: setup.speed_scales[joint as usize],
                force_scale: setup.force_scales[joint as usize],
            }),
            dt_s: setup.dt_s,
            drop_m: setup.drop_m,
            payload_kg: setup.payload_kg,
            friction: Some(setup.friction).filter(|friction| friction.is_finite()),
            ..RobotConfig::default()
        };
        let robot = Robot::new(&config).unwrap();
        let model = setup.model;
        self.say(number, &FromPlant::Ready { model, snapshot: snapshot(&robot), name: "rapier".try_into().unwrap() });
        (robot, config)
    }

    /// Simulates until nobody asks any more, or for so many steps.
    fn simulate(&mut self, steps: usize) {
        let (mut robot, _) = self.put_up();
        for _ in 0..steps {
            let Some((number, ToPlant::Step(step))) = self.hear() else { return };
            robot.push(step.force_n, step.height_m);
            for (i, joint) in Joint::ALL.into_iter().enumerate() {
                let released = step.released >> i & 1 == 1;
                robot.drive(joint, if released { Drive::Velocity(step.speeds[i]) } else { Drive::Brake });
            }
            robot.step();
            self.say(number, &FromPlant::Done(snapshot(&robot)));
        }
    }
}

fn snapshot(robot: &dyn Plant) -> Snapshot {
    let TrunkState { position_m, rotation_xyzw, velocity_m_s, angular_velocity_rad_s } = robot.trunk();
    Snapshot {
        position_m,
        rotation_xyzw,
        velocity_m_s,
        angular_velocity_rad_s,
        joints: Joint::ALL.map(|joint| robot.joint(joint).position),
        joint_speeds: Joint::ALL.map(|joint| robot.joint(joint).velocity),
        efforts: Joint::ALL.map(|joint| robot.effort(joint)),
        pads_n: robot.pad_loads_n(),
    }
}

/// A robot simulated by `plant` in another thread.
fn with(config: &RobotConfig, plant: impl FnOnce(Far) + Send + 'static) -> Result<External, PlantError> {
    let (near, far) = UnixStream::pair().unwrap();
    thread::spawn(|| plant(Far(far)));
    External::over(Process::over(near, "fake"), PATIENCE, Geometry::load().unwrap(), config)
}

/// What such a plant is refused with at the start.
fn refused(plant: impl FnOnce(Far) + Send + 'static) -> PlantError {
    with(&RobotConfig::default(), plant).err().unwrap()
}

#[test]
fn rapier_behind_the_wire_is_rapier() {
    let weak = WeakActuator { joint: Joint::RightHip, speed_scale: 0.5, force_scale: 0.75 };
    let config = RobotConfig {
        drop_m: 0.02,
        payload_kg: 3.0,
        friction: Some(0.7),
        weak_actuator: Some(weak),
        ..RobotConfig::default()
    };
    let mut here = Robot::new(&config).unwrap();
    let mut there = with(&config, |mut far| far.simulate(usize::MAX)).unwrap();
    assert_eq!((there.name(), there.standing_height_m()), ("rapier", here.standing_height_m()));
    assert_eq!(there.gravity_m_s2(), here.gravity_m_s2());
    for step in 0..600 {
        let both: [&mut dyn Plant; 2] = [&mut here, &mut there];
        for robot in both {
            match step {
                300 => robot.push([150.0, 60.0, 0.0], 0.1),
                350 => robot.clear_push(),
                360 => robot.drive(Joint::RightKnee, Drive::Velocity(-0.8)),
                380 => robot.drive(Joint::RightHip, Drive::Velocity(4.0)),
                420 => robot.drive(Joint::RightKnee, Drive::Brake),
                430 => robot.drive(Joint::LeftHip, Drive::Velocity(f32::NAN)),
                _ => {}
            }
            robot.step().unwrap();
        }
        assert_eq!(snapshot(&here), snapshot(&there), "step {step}");
        assert_eq!(here.health(), there.health());
        assert_eq!((here.time_s(), here.height_m()), (there.time_s(), there.height_m()));
        let [a, b] = [here.imu().velocity_m_s, there.imu().velocity_m_s];
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5), "{a:?} {b:?}");
    }
    assert_eq!(there.driven(Joint::LeftHip), Drive::Brake);
}

#[test]
fn the_words_are_as_documented_byte_by_byte() {
    let setup = Setup {
        model: [1, 2, 3, 4],
        dt_s: 1.0,
        drop_m: 2.0,
        payload_kg: 3.0,
        com_shift_m: [4.0, 5.0, 6.0],
        mass_scale: 7.0,
        friction: 8.0,
        slope_rad: [9.0, 10.0],
        speed_scales: [11.0, 12.0, 13.0, 14.0, 15.0, 16.0],
        force_scales: [17.0, 18.0, 19.0, 20.0, 21.0, 22.0],
    };
    let floats = |range: std::ops::RangeInclusive<u8>| range.flat_map(|n| f32::from(n).to_le_bytes());
    let body: Vec<u8> = [0, 1, 2, 3, 4].into_iter().chain(floats(1..=22)).collect();
    let framed = |body: &[u8]| frame::encode(Header { version: 1, session: 0, sequence: 9 }, body).unwrap();
    assert_eq!(encode(9, &ToPlant::Setup(setup)), Some(framed(&body)));

    let step =
        Step { released: 0b101, speeds: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], force_n: [7.0, 8.0, 9.0], height_m: 10.0 };
    let body: Vec<u8> = [1, 0b101].into_iter().chain(floats(1..=10)).collect();
    assert_eq!(encode(9, &ToPlant::Step(step)), Some(framed(&body)));

    let mut values = 1..;
    let mut next = || values.next().map_or(0.0, |n: u8| f32::from(n));
    let snapshot = Snapshot {
        position_m: [(); 3].map(|()| next()),
        rotation_xyzw: [(); 4].map(|()| next()),
        velocity_m_s: [(); 3].map(|()| next()),
        angular_velocity_rad_s: [(); 3].map(|()| next()),
        joints: [(); 6].map(|()| next()),
        joint_speeds: [(); 6].map(|()| next()),
        efforts: [(); 6].map(|()| next()),
        pads_n: [(); 4].map(|()| next()),
    };
    let ready = FromPlant::Ready { model: [1, 2, 3, 4], snapshot, name: "me".try_into().unwrap() };
    let body: Vec<u8> = [0, 1, 2, 3, 4].into_iter().chain(floats(1..=35)).chain(*b"\x02me").collect();
    assert_eq!(encode(9, &ready), Some(framed(&body)));
    let body: Vec<u8> = [1].into_iter().chain(floats(1..=35)).collect();
    assert_eq!(encode(9, &FromPlant::Done(snapshot)), Some(framed(&body)));
    let refused = FromPlant::Refused { setting: "dt_s".try_into().unwrap(), why: "no".try_into().unwrap() };
    assert_eq!(encode(9, &refused), Some(framed(b"\x02\x04dt_s\x02no")));
}

#[test]
fn another_version_is_named_before_anything_else() {
    let error = refused(|mut far| {
        let (number, _) = far.hear().unwrap();
        far.bytes(&frame::encode(Header { version: 7, session: 0, sequence: number }, b"whatever").unwrap());
    });
    assert_eq!(error, PlantError::Version { command: "fake".into(), theirs: 7 });
    assert!(error.to_string().contains("version 7 of the plant's words, this program 1"), "{error}");
}

#[test]
fn another_robot_is_named() {
    let error = refused(|mut far| {
        let (number, _) = far.hear().unwrap();
        let snapshot = snapshot(&Robot::new(&RobotConfig::default()).unwrap());
        far.say(number, &FromPlant::Ready { model: [0; 4], snapshot, name: "old".try_into().unwrap() });
    });
    assert_eq!(error, PlantError::Model { command: "fake".into(), theirs: 0, ours: model_crc() });
}

#[test]
fn a_setting_that_cannot_be_simulated_is_refused_by_name() {
    let error = refused(|mut far| {
        let (number, _) = far.hear().unwrap();
        let (setting, why) = ("slope_pitch_rad".try_into().unwrap(), "the ground is flat; give 0".try_into().unwrap());
        far.say(number, &FromPlant::Refused { setting, why });
    });
    assert_eq!(error.to_string(), "the plant `fake` cannot do robot.slope_pitch_rad: the ground is flat; give 0");
}

#[test]
fn a_plant_that_dies_is_told_with_the_step_and_asked_no_more() {
    let mut robot = with(&RobotConfig::default(), |mut far| far.simulate(3)).unwrap();
    for _ in 0..3 {
        robot.step().unwrap();
    }
    let error = robot.step().unwrap_err();
    assert!(matches!(&error, PlantError::Ended { doing, .. } if doing.contains("step 4, at 0.006 s")), "{error}");
    assert!(matches!(robot.step(), Err(PlantError::Ended { .. })));
}

#[test]
fn a_silent_plant_is_given_up_in_bounded_time() {
    for babbles in [false, true] {
        let began = Instant::now();
        let mut robot = with(&RobotConfig::default(), move |mut far| {
            far.put_up();
            // Bytes that never become a frame are no answer.
            while far.0.write_all(if babbles { b"well " } else { b"" }).is_ok() && began.elapsed().as_secs() < 5 {
                thread::sleep(Duration::from_millis(10));
            }
        })
        .unwrap();
        let error = robot.step().unwrap_err();
        assert!(matches!(error, PlantError::Silent { .. }), "{error}");
        assert!(began.elapsed() < Duration::from_secs(3));
    }
}

#[test]
fn what_is_no_reply_is_told_as_what_it_is() {
    type Reply = fn(u16) -> Vec<u8>;
    let cases: [(&str, Reply); 5] = [
        ("bytes that are no frame", |_| b"loading model...\n\0".to_vec()),
        ("CRC-32 mismatch", |number| {
            let mut bytes = encode(number, &FromPlant::Done(snapshot(&Robot::new(&RobotConfig::default()).unwrap())));
            bytes.as_mut().unwrap()[20] ^= 1;
            bytes.unwrap().to_vec()
        }),
        ("a reply to message 2", |number| {
            encode(number + 1, &ToPlant::Step(Step { released: 0, speeds: [0.0; 6], force_n: [0.0; 3], height_m: 0.0 }))
                .unwrap()
                .to_vec()
        }),
        ("a body of 2 bytes", |number| {
            frame::encode(Header { version: VERSION, session: 0, sequence: number }, &[1, 2]).unwrap().to_vec()
        }),
        ("the reply to a step", |number| {
            let snapshot = snapshot(&Robot::new(&RobotConfig::default()).unwrap());
            encode(number, &FromPlant::Done(snapshot)).unwrap().to_vec()
        }),
    ];
    for (told, reply) in cases {
        let error = refused(move |mut far| {
            let (number, _) = far.hear().unwrap();
            far.bytes(&reply(number));
        });
        assert!(matches!(error, PlantError::Malformed { .. }) && error.to_string().contains(told), "{error}");
    }
}

#[test]
fn a_state_that_is_not_finite_is_the_simulators_fault() {
    let mut robot = with(&RobotConfig::default(), |mut far| {
        let (robot, _) = far.put_up();
        let (number, _) = far.hear().unwrap();
        let joint_speeds = [f32::INFINITY; 6];
        far.say(number, &FromPlant::Done(Snapshot { joint_speeds, ..snapshot(&robot) }));
    })
    .unwrap();
    assert_eq!(robot.health(), Health::Upright);
    robot.step().unwrap();
    assert_eq!(robot.health(), Health::NonFinite);
}

#[test]
fn a_program_that_is_no_plant_is_told_with_what_to_do() {
    let start = |command: &str| match External::start(command, &RobotConfig::default()) {
        Err(SilError::Plant(error)) => error,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("{command} is no plant"),
    };
    for command in ["", "no-such-program --here"] {
        let error = start(command);
        assert!(matches!(error, PlantError::Spawn { .. }) && error.to_string().contains("plant.py"), "{error}");
    }
    let error = start("false");
    assert!(matches!(&error, PlantError::Ended { why, .. } if why.contains("exit status: 1")), "{error}");
    // It says what it hears.
    let error = start("cat");
    assert!(matches!(error, PlantError::Malformed { .. }), "{error}");
}

#[test]
fn a_process_whose_episode_is_over_serves_the_next_one() {
    let first = Process::start("sleep 61").unwrap();
    let id = first.id();
    first.rest();
    let again = Process::start("sleep 61").unwrap();
    assert_eq!(again.id(), id);
    // The one that was idle is taken, another is started.
    assert_ne!(Process::start("sleep 61").unwrap().id(), id);
}

#[test]
fn an_episode_without_its_plant_does_not_begin() {
    let config = SilConfig { plant: Some("true".into()), ..SilConfig::default() };
    let (default, episode) = (sarah_firmware::default_params(), Scenario::load("stand").unwrap().episode(1, 0));
    let error = Sil::new(&config, default, default, &episode).err().unwrap();
    assert!(error.to_string().starts_with("the plant `true` ended"), "{error}");
}
