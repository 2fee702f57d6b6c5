//! The same path with the nodes that are flashed.

use sarah_protocol::bus::limits;

use super::*;
use crate::node::{Node, NodeConfig, NodeKind, Sensors, by_id};

struct Robot {
    coordinator: Coordinator,
    nodes: Vec<(NodeId, NodeKind)>,
    bus: BusOutbox,
    host: HostOutbox,
    now: u32,
    /// What the IMU says; `None`: nothing.
    imu: Option<ImuSample>,
}

const REST: ImuSample = ImuSample { accel: [0, 0, 2048], gyro: [0; 3] };

impl Robot {
    fn run(&mut self, millis: u32) {
        for _ in 0..millis {
            self.now = self.now.wrapping_add(1_000);
            if let Some(sample) = self.imu {
                self.coordinator.on_imu(self.now, &sample, &mut self.bus);
            }
            self.coordinator.tick(self.now, &mut self.bus, &mut self.host);
            let mut frames = vec![];
            while let Some(frame) = self.bus.pop() {
                frames.push((None, frame));
            }
            let sensors = Sensors { position: [Q16::ZERO; 2], load: [Q16::lit(80.0); 4] };
            for (id, node) in &mut self.nodes {
                frames.extend(node.tick(1_000, &sensors).messages.iter().map(|m| (Some(*id), m.encode())));
            }
            while let Some((from, frame)) = frames.pop() {
                let message = Message::decode(&frame).expect("ours");
                if from.is_some() {
                    self.coordinator.on_bus(self.now, &frame, &mut self.bus, &mut self.host);
                }
                for (id, node) in self.nodes.iter_mut().filter(|(id, _)| Some(*id) != from) {
                    frames.extend(node.on_message(&message).map(|answer| (Some(*id), answer.encode())));
                }
            }
        }
    }
}

fn robot(config: Config) -> Robot {
    let node = |id| {
        let end_stop = Q16::lit(0.6);
        NodeConfig { default: config.default, boot_nonce: id as u16, end_stop, plausible: Q16::lit(1.0) }
    };
    Robot {
        coordinator: Coordinator::new(config),
        nodes: NodeId::ALL.map(|id| (id, by_id(id, node(id)))).to_vec(),
        bus: BusOutbox::new(),
        host: HostOutbox::new(),
        now: u32::MAX - 300_000,
        imu: Some(REST),
    }
}

#[test]
fn real_nodes_take_the_stored_set_at_boot_and_arm() {
    let mut robot = robot(Config { arm_at_boot: true, stored: other_set(0.1), ..config() });
    robot.run(1_000);
    assert_eq!(robot.coordinator.applied(), (1, &other_set(0.1)));
    assert_eq!(robot.coordinator.mode(), Mode::Armed);
    robot.run(100);
    for limits in robot.coordinator.telemetry().limits {
        assert_eq!(limits & (limits::BRAKED | limits::HALTED | limits::COORDINATOR_LOST), 0);
    }
}

#[test]
fn real_nodes_halt_and_are_released_by_the_next_arming() {
    let mut robot = robot(Config { arm_at_boot: true, ..config() });
    robot.run(1_000);
    let mut sequence = 0;
    let mut send = |robot: &mut Robot, message: ToRobot| {
        sequence += 1;
        let bytes = message.encode(1, sequence).expect("fits");
        robot.coordinator.on_host_bytes(robot.now, &bytes, &mut robot.bus, &mut robot.host);
    };
    send(&mut robot, ToRobot::EStop);
    robot.run(300);
    assert!(robot.coordinator.telemetry().limits.iter().all(|l| l & limits::BRAKED != 0));
    for command in [Command::Claim, Command::ClearEStop, Command::Arm { boot_nonce: NONCE }] {
        send(&mut robot, ToRobot::Command(command));
    }
    robot.run(100);
    assert_eq!(robot.coordinator.mode(), Mode::Armed);
    assert!(robot.coordinator.telemetry().limits.iter().all(|l| l & (limits::BRAKED | limits::HALTED) == 0));
}

#[test]
fn a_step_under_way_is_finished_when_the_imu_falls_silent() {
    let mut robot = robot(Config { arm_at_boot: true, ..config() });
    robot.run(1_000);
    // About 0.6 rad/s of roll: Factor passes its threshold and a cycle starts.
    robot.imu = Some(ImuSample { gyro: [560, 0, 0], ..REST });
    robot.run(60);
    let cycling = |robot: &Robot| robot.coordinator.telemetry().phases[0] != 0;
    assert!(cycling(&robot));
    robot.imu = None;
    robot.run(55);
    assert_eq!(robot.coordinator.mode(), Mode::Braked);
    assert!(cycling(&robot), "the loss is known, the leg is still being set down");
    assert!(robot.coordinator.telemetry().limits[0] & limits::HALTED == 0);
    robot.run(1_300);
    assert!(!cycling(&robot));
    assert!(robot.coordinator.telemetry().limits.iter().all(|l| l & limits::HALTED != 0));
}
