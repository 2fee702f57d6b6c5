//! The robot as its controllers' wires end in it: actuators, sensors, energy, and the pushes of an episode.
//!
//! Whoever computes the control, a library call or an emulated chip, drives this with pin commands and reads counts.

use sarah_firmware::calibration::{self, Calibration, Command, Counts};
use sarah_protocol::bus::NodeId;

use crate::actuator::Actuators;
use crate::energy::EnergyMeter;
use crate::plant::{External, Plant, PlantError};
use crate::robot::{Drive, Health, Joint, Robot, RobotConfig};
use crate::scenario::Episode;
use crate::sensors::{ImuCounts, Sensors};
use crate::sil::{SilConfig, SilError};

/// A robot in an episode.
pub struct Body {
    config: SilConfig,
    robot: Box<dyn Plant>,
    actuators: Actuators,
    sensors: Sensors,
    meter: EnergyMeter,
    episode: Episode,
    step_us: u64,
    next_us: u64,
    /// When the episode began.
    began_us: u64,
    /// When the robot was put where it is.
    placed_us: u64,
}

impl Body {
    /// The robot at the start of `episode`, everything braked.
    pub fn new(config: &SilConfig, episode: &Episode) -> Result<Body, SilError> {
        config.energy.validate()?;
        let (robot, sensors) = place(config, episode)?;
        Ok(Body {
            actuators: Actuators::new(&config.actuators)?,
            meter: EnergyMeter::new(&config.energy),
            episode: episode.clone(),
            step_us: u64::from((robot.dt_s() * 1e6).round() as u32),
            next_us: 0,
            began_us: 0,
            placed_us: 0,
            robot,
            sensors,
            config: config.clone(),
        })
    }

    /// Another episode begins with the next step; the robot goes on as it is.
    pub fn begin(&mut self, episode: &Episode) {
        self.episode = episode.clone();
        self.began_us = self.next_us;
    }

    /// Another episode begins with the next step: somebody has put the robot back on its feet, legs straight, as at the
    /// start. Its controllers know nothing of it but what their sensors say.
    pub fn stand_up(&mut self, episode: &Episode) -> Result<(), SilError> {
        (self.robot, self.sensors) = place(&self.config, episode)?;
        self.placed_us = self.next_us;
        self.begin(episode);
        Ok(())
    }

    /// When the next step begins, µs since power-up.
    pub fn next_us(&self) -> u64 {
        self.next_us
    }

    /// The step that begins at [`Body::next_us`], with the actuators commanded like this; what it leads to is observed
    /// when it ends, at the next one. Only a plant in another process can fail to take it.
    pub fn step(&mut self, command: impl Fn(NodeId) -> [Command; 2]) -> Result<Health, PlantError> {
        if self.next_us > self.placed_us {
            self.sensors.observe(&*self.robot);
            self.meter.observe(&*self.robot);
        }
        let now_s = seconds(self.next_us - self.began_us);
        let acting = self.episode.pushes.iter().map(|push| (push.force_n(now_s), push.height_m));
        match acting.into_iter().find(|(force, _)| *force != [0.0; 3]) {
            Some((force, height_m)) => self.robot.push(force, height_m),
            None => self.robot.clear_push(),
        }
        for id in NodeId::ALL {
            for (joint, pins) in joints_of(id).into_iter().zip(command(id)) {
                let drive = calibration_of(id).speed(pins).map_or(Drive::Brake, Drive::Velocity);
                self.actuators.command(joint, drive);
            }
        }
        self.actuators.apply(&mut *self.robot);
        self.robot.step()?;
        self.next_us += self.step_us;
        Ok(self.robot.health())
    }

    /// What a node's converter reads at `now_us`.
    pub fn counts(&self, id: NodeId, now_us: u64) -> Counts {
        let now_s = seconds(now_us.saturating_sub(self.placed_us));
        let joints = self.sensors.joints(now_s);
        let load = if id == NodeId::Knee { self.sensors.pads_n(now_s) } else { [0.0; 4] };
        calibration_of(id).counts(joints_of(id).map(|joint| joints[joint as usize]), load)
    }

    /// What the IMU's registers hold at `now_us`.
    pub fn imu(&self, now_us: u64) -> ImuCounts {
        self.sensors.imu(seconds(now_us.saturating_sub(self.placed_us)))
    }

    /// The truth, for rewards, figures and verdicts; no controller sees it.
    pub fn robot(&self) -> &dyn Plant {
        &*self.robot
    }

    /// What the robot has drawn so far.
    pub fn meter(&self) -> &EnergyMeter {
        &self.meter
    }

    /// What happens to the robot in this episode.
    pub fn episode(&self) -> &Episode {
        &self.episode
    }
}

/// A robot at the start of an episode, and its sensors, which have seen it once.
fn place(config: &SilConfig, episode: &Episode) -> Result<(Box<dyn Plant>, Sensors), SilError> {
    let robot = RobotConfig { drop_m: episode.drop_m, ..config.robot.clone() };
    let robot: Box<dyn Plant> = match &config.plant {
        None => Box::new(Robot::new(&robot)?),
        Some(command) => Box::new(External::start(command, &robot)?),
    };
    let mut sensors = Sensors::new(&config.sensors, episode.seed)?;
    sensors.observe(&*robot);
    Ok((robot, sensors))
}

fn seconds(now_us: u64) -> f64 {
    now_us as f64 * 1e-6
}

/// The joints of a node, left and right.
pub fn joints_of(id: NodeId) -> [Joint; 2] {
    match id {
        NodeId::Knee => [Joint::LeftKnee, Joint::RightKnee],
        NodeId::Hip => [Joint::LeftHip, Joint::RightHip],
        NodeId::Abductor => [Joint::LeftAbductor, Joint::RightAbductor],
    }
}

/// What a node's converter and pulse widths mean.
pub fn calibration_of(id: NodeId) -> &'static Calibration {
    match id {
        NodeId::Knee => &calibration::KNEE,
        NodeId::Hip => &calibration::HIP,
        NodeId::Abductor => &calibration::ABDUCTOR,
    }
}
