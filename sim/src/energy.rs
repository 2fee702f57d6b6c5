//! What an episode costs the batteries, by consumer.
//!
//! The paper gives the packs (three 12 V 14 Ah in series for the actuators, one for the computers), that actuators
//! draw nothing while still and brakes hold without power, and two autonomies: 5 h mixed, 12 h standby. Efficiencies
//! and powers are ASSUMPTIONS, each a field of [`EnergyConfig`]; the autonomy they lead to is an estimate to be shown
//! beside the paper's, not a measurement of it.

use serde::{Deserialize, Serialize};

use crate::plant::Plant;
use crate::robot::{Drive, Joint};

/// Autonomy the paper reports for mixed activity, h.
pub const PAPER_MIXED_H: f64 = 5.0;
/// Autonomy the paper reports on standby, h.
pub const PAPER_STANDBY_H: f64 = 12.0;
/// Charge of one 12 V, 14 Ah battery, J (paper, §III.A).
pub const BATTERY_J: f64 = 12.0 * 14.0 * 3600.0;

/// Electrical constants of the robot. All but the number of batteries are assumptions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EnergyConfig {
    /// Mechanical over electrical power of a moving actuator, gearing included.
    pub efficiency: f64,
    /// Draw of a powered actuator's windings and driver besides its work, W each.
    pub winding_w: f64,
    /// Draw of a released brake's coil, W each.
    pub brake_coil_w: f64,
    /// Constant draw of computers, controllers and sensors on the 12 V battery, W.
    pub compute_w: f64,
    /// Share of a battery's charge that can be drawn, 0 to 1.
    pub usable_charge: f64,
}

impl Default for EnergyConfig {
    fn default() -> Self {
        Self { efficiency: 0.5, winding_w: 5.0, brake_coil_w: 8.0, compute_w: 11.0, usable_charge: 0.8 }
    }
}

/// An electrical constant that makes no sense.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("energy.{field} = {value} is out of range; give a number from {min} to {max}")]
pub struct EnergyError {
    field: &'static str,
    value: f64,
    min: f64,
    max: f64,
}

impl EnergyConfig {
    /// Checks every field.
    pub fn validate(&self) -> Result<(), EnergyError> {
        let ranges = [
            ("efficiency", self.efficiency, 0.01, 1.0),
            ("winding_w", self.winding_w, 0.0, 1000.0),
            ("brake_coil_w", self.brake_coil_w, 0.0, 1000.0),
            ("compute_w", self.compute_w, 0.01, 1000.0),
            ("usable_charge", self.usable_charge, 0.0, 1.0),
        ];
        // `contains` is false for NaN.
        match ranges.into_iter().find(|(_, value, min, max)| !(min..=max).contains(&value)) {
            Some((field, value, min, max)) => Err(EnergyError { field, value, min, max }),
            None => Ok(()),
        }
    }
}

/// Energy drawn, by consumer.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Energy {
    /// Time metered, s.
    pub duration_s: f64,
    /// Motors, from the 36 V pack, J.
    pub motors_j: f64,
    /// Brake coils, from the 36 V pack, J.
    pub brakes_j: f64,
    /// Computers, from the 12 V battery, J.
    pub compute_j: f64,
    /// Time actuators spent released, summed over the six, s.
    pub released_s: f64,
}

impl Energy {
    /// All consumers together, J.
    pub fn total_j(&self) -> f64 {
        self.motors_j + self.brakes_j + self.compute_j
    }
}

/// Hours each battery would last at the mean power metered; infinite where nothing was drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Autonomy {
    /// 36 V actuator pack, h.
    pub actuators_h: f64,
    /// 12 V compute battery, h.
    pub compute_h: f64,
}

impl Autonomy {
    /// The first battery to run out, h.
    pub fn robot_h(&self) -> f64 {
        self.actuators_h.min(self.compute_h)
    }
}

/// Integrates the robot's draw step by step.
#[derive(Debug, Clone)]
pub struct EnergyMeter {
    config: EnergyConfig,
    energy: Energy,
}

impl EnergyMeter {
    /// A meter at zero.
    pub fn new(config: &EnergyConfig) -> Self {
        Self { config: config.clone(), energy: Energy::default() }
    }

    /// Adds the step the robot has just made. Call once after every [`Plant::step`].
    pub fn observe(&mut self, robot: &dyn Plant) {
        let dt_s = f64::from(robot.dt_s());
        for joint in Joint::ALL {
            let work_w = f64::from(robot.effort(joint)) * f64::from(robot.joint(joint).velocity);
            self.observe_actuator(dt_s, robot.driven(joint), work_w);
        }
        self.energy.compute_j += self.config.compute_w * dt_s;
        self.energy.duration_s += dt_s;
    }

    /// `work_w` is force times speed. Braking work is not recovered: it costs like driving work.
    fn observe_actuator(&mut self, dt_s: f64, drive: Drive, work_w: f64) {
        if drive == Drive::Brake || !work_w.is_finite() {
            return;
        }
        self.energy.motors_j += (work_w.abs() / self.config.efficiency + self.config.winding_w) * dt_s;
        self.energy.brakes_j += self.config.brake_coil_w * dt_s;
        self.energy.released_s += dt_s;
    }

    /// Energy since construction.
    pub fn energy(&self) -> Energy {
        self.energy
    }

    /// How long full batteries would last if the metered mix went on.
    pub fn autonomy(&self) -> Autonomy {
        let hours = |batteries: f64, drawn_j: f64| {
            batteries * BATTERY_J * self.config.usable_charge * self.energy.duration_s / drawn_j / 3600.0
        };
        Autonomy {
            actuators_h: hours(3.0, self.energy.motors_j + self.energy.brakes_j),
            compute_h: hours(1.0, self.energy.compute_j),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Robot, RobotConfig};

    #[test]
    fn actuators_draw_nothing_while_braked() {
        let mut robot = Robot::new(&RobotConfig { drop_m: 0.05, ..Default::default() }).unwrap();
        let mut meter = EnergyMeter::new(&EnergyConfig::default());
        for _ in 0..500 {
            robot.step();
            meter.observe(&robot);
        }
        let energy = meter.energy();
        assert_eq!((energy.motors_j, energy.brakes_j), (0.0, 0.0));
        assert!((energy.compute_j - 11.0).abs() < 1e-3, "{energy:?}");
        assert_eq!(meter.autonomy().actuators_h, f64::INFINITY);
        assert!((meter.autonomy().robot_h() - 168.0 * 0.8 / 11.0).abs() < 0.01);
    }

    #[test]
    fn lifting_the_robot_costs_its_potential_energy_over_the_efficiency() {
        let mut robot = Robot::new(&RobotConfig { drop_m: 0.002, ..Default::default() }).unwrap();
        let config = EnergyConfig { winding_w: 0.0, ..Default::default() };
        let mut meter = EnergyMeter::new(&config);
        for _ in 0..250 {
            robot.step();
        }
        for knee in [Joint::LeftKnee, Joint::RightKnee] {
            robot.drive(knee, Drive::Velocity(0.2));
        }
        for _ in 0..200 {
            robot.step();
            meter.observe(&robot);
        }
        // 28 kg above the rods, 0.08 m, half of it lost.
        let expected_j = 28.0 * 9.80665 * 0.08 / 0.5;
        let energy = meter.energy();
        assert!((energy.motors_j / expected_j - 1.0).abs() < 0.1, "{} J of {expected_j}", energy.motors_j);
        assert!((energy.brakes_j - 2.0 * 8.0 * 0.4).abs() < 0.01);
    }
}
