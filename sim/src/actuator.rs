//! Between a command and the robot: what a real actuator makes of it.
//!
//! Speed and force limits are the robot's own (`ctrlrange`, `forcerange` of the MJCF file, scaled by
//! [`crate::robot::RobotConfig`]). Here are the delays of the brake, the slowest speed the drive can hold and the
//! difference between left and right. Position sensors, 5 mm on the linear ones, are [`crate::sensors`]' business.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::plant::Plant;
use crate::robot::{Drive, Joint};

/// Imperfections of the six actuators. The default has none: brakes act at the next physics step.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ActuatorConfig {
    /// Time from the brake command to a locked joint, s, 0 to 0.2; meanwhile the motor holds zero speed.
    pub brake_engage_s: f32,
    /// Time from a speed command to a released brake, s, 0 to 0.2.
    pub brake_release_s: f32,
    /// Commanded speeds below this do not overcome stiction, m/s or rad/s, 0 to 0.1.
    pub dead_band: f32,
    /// Left actuators run faster and right ones slower by this fraction, ±0.5.
    pub asymmetry: f32,
}

/// A field of [`ActuatorConfig`] is not finite or out of range.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("actuator.{field} = {value} is out of range; give a finite number from {min} to {max}")]
pub struct ActuatorError {
    /// Field name.
    pub field: &'static str,
    /// What was given.
    pub value: f32,
    /// Smallest accepted value.
    pub min: f32,
    /// Largest accepted value.
    pub max: f32,
}

impl ActuatorConfig {
    /// Checks every field against its documented range.
    pub fn validate(&self) -> Result<(), ActuatorError> {
        let fields = [
            ("brake_engage_s", self.brake_engage_s, 0.0, 0.2),
            ("brake_release_s", self.brake_release_s, 0.0, 0.2),
            ("dead_band", self.dead_band, 0.0, 0.1),
            ("asymmetry", self.asymmetry, -0.5, 0.5),
        ];
        for (field, value, min, max) in fields {
            if !(min..=max).contains(&value) {
                return Err(ActuatorError { field, value, min, max });
            }
        }
        Ok(())
    }
}

/// The six actuators, each with its command and the time since its brake was told to change.
#[derive(Debug, Clone)]
pub struct Actuators {
    config: ActuatorConfig,
    commands: [Drive; 6],
    /// Time the present kind of command (brake or move) has stood, s.
    held_s: [f32; 6],
}

impl Actuators {
    /// All brakes on, as after power-up.
    pub fn new(config: &ActuatorConfig) -> Result<Self, ActuatorError> {
        config.validate()?;
        Ok(Self { config: config.clone(), commands: [Drive::Brake; 6], held_s: [f32::INFINITY; 6] })
    }

    /// Commands `joint`; takes effect through [`Self::apply`]. A speed that is not finite brakes.
    pub fn command(&mut self, joint: Joint, drive: Drive) {
        let i = joint as usize;
        let drive = drive.or_brake();
        if (drive == Drive::Brake) != (self.commands[i] == Drive::Brake) {
            self.held_s[i] = 0.0;
        }
        self.commands[i] = drive;
    }

    /// Last command of each joint.
    pub fn commands(&self) -> [Drive; 6] {
        self.commands
    }

    /// Hands the robot what its actuators do in the coming step. Call once before every [`Plant::step`].
    pub fn apply(&mut self, robot: &mut dyn Plant) {
        for joint in Joint::ALL {
            robot.drive(joint, self.effective(joint));
            self.held_s[joint as usize] += robot.dt_s();
        }
    }

    fn effective(&self, joint: Joint) -> Drive {
        let i = joint as usize;
        // Half a microsecond of margin, so that summed steps reach a delay that is a multiple of them.
        let held_s = self.held_s[i] + 5e-7;
        match self.commands[i] {
            Drive::Brake if held_s < self.config.brake_engage_s => Drive::Velocity(0.0),
            Drive::Velocity(_) if held_s < self.config.brake_release_s => Drive::Brake,
            Drive::Velocity(speed) if speed.abs() < self.config.dead_band => Drive::Velocity(0.0),
            Drive::Velocity(speed) => {
                let side = if joint.is_left() { 1.0 } else { -1.0 };
                Drive::Velocity(speed * (1.0 + side * self.config.asymmetry))
            }
            Drive::Brake => Drive::Brake,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Robot, RobotConfig};

    fn pair(config: ActuatorConfig) -> (Actuators, Robot) {
        let robot = Robot::new(&RobotConfig { drop_m: 1.0, ..Default::default() }).unwrap();
        (Actuators::new(&config).unwrap(), robot)
    }

    #[test]
    fn the_default_passes_commands_through() {
        let (mut actuators, mut robot) = pair(ActuatorConfig::default());
        actuators.command(Joint::LeftHip, Drive::Velocity(1.5));
        actuators.apply(&mut robot);
        assert_eq!(robot.driven(Joint::LeftHip), Drive::Velocity(1.5));
        actuators.command(Joint::LeftHip, Drive::Brake);
        actuators.apply(&mut robot);
        assert_eq!(robot.driven(Joint::LeftHip), Drive::Brake);
    }

    #[test]
    fn a_brake_engages_after_its_delay_and_holds_still_meanwhile() {
        let (mut actuators, mut robot) = pair(ActuatorConfig { brake_engage_s: 0.01, ..Default::default() });
        actuators.command(Joint::LeftKnee, Drive::Velocity(0.5));
        actuators.apply(&mut robot);
        robot.step();
        actuators.command(Joint::LeftKnee, Drive::Brake);
        let mut released = 0;
        for _ in 0..20 {
            actuators.apply(&mut robot);
            robot.step();
            released += usize::from(robot.driven(Joint::LeftKnee) != Drive::Brake);
        }
        assert_eq!(released, 5, "0.01 s are five steps of 2 ms");
    }

    #[test]
    fn asymmetry_speeds_the_left_and_slows_the_right() {
        let (mut actuators, mut robot) = pair(ActuatorConfig { asymmetry: 0.1, ..Default::default() });
        actuators.command(Joint::LeftKnee, Drive::Velocity(0.5));
        actuators.command(Joint::RightKnee, Drive::Velocity(0.5));
        actuators.apply(&mut robot);
        assert_eq!(robot.driven(Joint::LeftKnee), Drive::Velocity(0.5 * 1.1));
        assert_eq!(robot.driven(Joint::RightKnee), Drive::Velocity(0.5 * 0.9));
    }

    #[test]
    fn nan_is_refused_in_the_config_and_brakes_as_a_command() {
        let error = Actuators::new(&ActuatorConfig { asymmetry: f32::NAN, ..Default::default() }).unwrap_err();
        assert!(error.to_string().contains("actuator.asymmetry"));
        let (mut actuators, _) = pair(ActuatorConfig::default());
        actuators.command(Joint::RightHip, Drive::Velocity(f32::NAN));
        assert_eq!(actuators.commands()[Joint::RightHip as usize], Drive::Brake);
    }
}
