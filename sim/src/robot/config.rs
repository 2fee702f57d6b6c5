//! What may differ between one simulated robot and the next: time step, drop, payload, friction, slope, actuators.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Joint;

/// Longest solver sub-step, in seconds, at which the braked robot keeps its topple impulses (measured: at 1 ms the
/// joints soften and it falls a third earlier).
pub const MAX_SUBSTEP_S: f32 = 0.0005;

/// How rapier solves contacts. The firmware's parameters were found with [`Contacts::Fast`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Contacts {
    /// Rapier's own way: one friction for each pad as a whole, contacts from 20 mm before they touch, one iteration.
    #[default]
    Fast,
    /// Closer to Coulomb's law, and to MuJoCo: friction at each corner, contacts from 2 mm on, four iterations.
    Exact,
}

/// Variations of the robot described by `assets/sarah.xml`. The default is that robot, unchanged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RobotConfig {
    /// Physics step, s. The clock of everything measured in steps.
    pub dt_s: f32,
    /// Solver iterations a step; `dt_s / solver_iterations` must not exceed [`MAX_SUBSTEP_S`].
    pub solver_iterations: usize,
    /// How contacts are solved.
    pub contacts: Contacts,
    /// Height of the soles above the ground at the start, m, 0 to 1. The paper drops the robot from 0.10 m.
    pub drop_m: f32,
    /// Point mass fixed at the trunk's centre of mass, kg, 0 to 40.
    pub payload_kg: f32,
    /// Displacement of the trunk's centre of mass (x, y, z), m, each within ±0.15.
    pub com_shift_m: [f32; 3],
    /// Factor on every mass and inertia of the robot, 0.3 to 3.
    pub mass_scale: f32,
    /// Coulomb friction between the feet and the ground, 0.05 to 2; `None` keeps the file's.
    pub friction: Option<f32>,
    /// Slope of the ground about y, rad, within ±0.3; positive falls away towards x (the robot looks downhill).
    pub slope_pitch_rad: f32,
    /// Slope of the ground about x, rad, within ±0.3; positive rises towards y (the left is uphill).
    pub slope_roll_rad: f32,
    /// Factor on the actuators' top speeds, 0.1 to 2: a sagging or a fresh battery.
    pub actuator_speed_scale: f32,
    /// Factor on the actuators' force limits, 0.1 to 2.
    pub actuator_force_scale: f32,
    /// One actuator that does less than the others.
    pub weak_actuator: Option<WeakActuator>,
}

/// An actuator that is worn, or its supply bad; on top of what holds for all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeakActuator {
    /// Which: `left-knee`, `right-hip` and so on.
    pub joint: Joint,
    /// Factor on its top speed, 0.1 to 1.
    #[serde(default = "whole")]
    pub speed_scale: f32,
    /// Factor on its force limit, 0.1 to 1.
    #[serde(default = "whole")]
    pub force_scale: f32,
}

fn whole() -> f32 {
    1.0
}

impl Default for RobotConfig {
    fn default() -> Self {
        Self {
            dt_s: 0.002,
            solver_iterations: 4,
            contacts: Contacts::default(),
            drop_m: 0.0,
            payload_kg: 0.0,
            com_shift_m: [0.0; 3],
            mass_scale: 1.0,
            friction: None,
            slope_pitch_rad: 0.0,
            slope_roll_rad: 0.0,
            actuator_speed_scale: 1.0,
            actuator_force_scale: 1.0,
            weak_actuator: None,
        }
    }
}

/// Why a robot could not be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RobotError {
    /// A field of [`RobotConfig`] is not finite or out of range.
    #[error("robot.{field} = {value} is out of range; give a finite number from {min} to {max}")]
    OutOfRange {
        /// Field name.
        field: &'static str,
        /// What was given.
        value: f32,
        /// Smallest accepted value.
        min: f32,
        /// Largest accepted value.
        max: f32,
    },
    /// The solver would be too soft to hold the robot up.
    #[error(
        "robot.dt_s / robot.solver_iterations = {substep_s} s is too coarse; lower dt_s or raise solver_iterations \
         until it is at most {MAX_SUBSTEP_S} s"
    )]
    Substep {
        /// The sub-step asked for, s.
        substep_s: f32,
    },
    /// The embedded MJCF file does not parse.
    #[error("assets/sarah.xml does not parse: {0}; compare it with the MJCF reference")]
    Parse(String),
    /// The MJCF file lacks something the simulator drives or measures.
    #[error("assets/sarah.xml has no {kind} named \"{name}\"; add it or restore its name")]
    Missing {
        /// `joint`, `body`, `geom`, `site` or `actuator`.
        kind: &'static str,
        /// The missing name.
        name: String,
    },
    /// An element lacks an attribute the simulator reads.
    #[error("assets/sarah.xml: \"{name}\" needs the attribute {attribute}")]
    Attribute {
        /// Element name.
        name: String,
        /// Attribute to add.
        attribute: &'static str,
    },
}

/// `Ok` if `value` is finite and within the range, else a named error.
fn within(field: &'static str, value: f32, min: f32, max: f32) -> Result<(), RobotError> {
    // `contains` is false for NaN, so one test covers both.
    if (min..=max).contains(&value) { Ok(()) } else { Err(RobotError::OutOfRange { field, value, min, max }) }
}

impl RobotConfig {
    /// Checks every field against its documented range.
    pub fn validate(&self) -> Result<(), RobotError> {
        within("dt_s", self.dt_s, 1e-4, 0.01)?;
        within("solver_iterations", self.solver_iterations as f32, 1.0, 64.0)?;
        within("drop_m", self.drop_m, 0.0, 1.0)?;
        within("payload_kg", self.payload_kg, 0.0, 40.0)?;
        for shift_m in self.com_shift_m {
            within("com_shift_m", shift_m, -0.15, 0.15)?;
        }
        within("mass_scale", self.mass_scale, 0.3, 3.0)?;
        if let Some(friction) = self.friction {
            within("friction", friction, 0.05, 2.0)?;
        }
        within("slope_pitch_rad", self.slope_pitch_rad, -0.3, 0.3)?;
        within("slope_roll_rad", self.slope_roll_rad, -0.3, 0.3)?;
        within("actuator_speed_scale", self.actuator_speed_scale, 0.1, 2.0)?;
        within("actuator_force_scale", self.actuator_force_scale, 0.1, 2.0)?;
        if let Some(weak) = self.weak_actuator {
            within("weak_actuator.speed_scale", weak.speed_scale, 0.1, 1.0)?;
            within("weak_actuator.force_scale", weak.force_scale, 0.1, 1.0)?;
        }
        let substep_s = self.dt_s / self.solver_iterations as f32;
        // A relative margin for the rounding of the division.
        if substep_s > MAX_SUBSTEP_S * 1.001 {
            return Err(RobotError::Substep { substep_s });
        }
        Ok(())
    }

    /// Factors on top speed and force limit of the actuator of `joint`.
    pub(crate) fn actuator_scales(&self, joint: Joint) -> (f32, f32) {
        let all = (self.actuator_speed_scale, self.actuator_force_scale);
        match self.weak_actuator {
            Some(weak) if weak.joint == joint => (all.0 * weak.speed_scale, all.1 * weak.force_scale),
            _ => all,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_valid() {
        assert_eq!(RobotConfig::default().validate(), Ok(()));
    }

    #[test]
    fn nan_and_out_of_range_are_refused_by_name() {
        let nan = RobotConfig { payload_kg: f32::NAN, ..Default::default() };
        assert!(nan.validate().unwrap_err().to_string().contains("robot.payload_kg"));
        let negative = RobotConfig { drop_m: -0.1, ..Default::default() };
        assert!(negative.validate().unwrap_err().to_string().contains("robot.drop_m"));
    }

    #[test]
    fn a_weak_actuator_is_named_by_its_joint_and_must_be_weaker() {
        let config: RobotConfig = toml::from_str("weak_actuator = { joint = 'left-knee', force_scale = 0.8 }").unwrap();
        let weak = WeakActuator { joint: Joint::LeftKnee, speed_scale: 1.0, force_scale: 0.8 };
        assert_eq!((config.weak_actuator, config.validate()), (Some(weak), Ok(())));
        let strong = WeakActuator { speed_scale: 1.2, ..weak };
        let strong = RobotConfig { weak_actuator: Some(strong), ..Default::default() };
        assert!(strong.validate().unwrap_err().to_string().contains("robot.weak_actuator.speed_scale = 1.2"));
        let nobody = toml::from_str::<RobotConfig>("weak_actuator.joint = 'left-toe'").unwrap_err();
        assert!(nobody.to_string().contains("left-knee"), "{nobody}");
    }

    #[test]
    fn only_the_weak_actuator_is_weaker_and_on_top_of_what_holds_for_all() {
        let weak = WeakActuator { joint: Joint::RightHip, speed_scale: 0.5, force_scale: 0.25 };
        let config = RobotConfig { actuator_speed_scale: 0.5, weak_actuator: Some(weak), ..Default::default() };
        for joint in Joint::ALL {
            let expected = if joint == Joint::RightHip { (0.25, 0.25) } else { (0.5, 1.0) };
            assert_eq!(config.actuator_scales(joint), expected, "{joint:?}");
        }
    }

    #[test]
    fn a_coarse_substep_is_refused() {
        let coarse = RobotConfig { solver_iterations: 2, ..Default::default() };
        assert!(matches!(coarse.validate(), Err(RobotError::Substep { .. })));
    }

    #[test]
    fn unknown_keys_are_refused() {
        let error = toml::from_str::<RobotConfig>("mass_sclae = 1.1").unwrap_err();
        assert!(error.to_string().contains("mass_sclae"));
    }
}
