//! The robot: `assets/sarah.xml` in rapier, driven joint by joint and read like a body with known truth.
//!
//! Ten joints, six of them driven ([`Joint`]), four of them the spring-loaded pads under the feet. Everything is SI,
//! in REP-103 axes (x forward, y left, z up). Drives and pushes take effect at the next [`Robot::step`]. What is above
//! it knows it as a [`Plant`], for which other simulators can stand in.
//!
//! Results are identical byte for byte from run to run and machine to machine; sensors with their errors are
//! [`crate::sensors`]' business, what an actuator makes of a command is [`crate::actuator`]'s.

mod config;
mod geometry;
mod joint;
mod model;

use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

pub use config::{Contacts, MAX_SUBSTEP_S, RobotConfig, RobotError, WeakActuator};
pub use geometry::Geometry;
pub use model::SARAH_MJCF;
pub(crate) use model::ground_turn;

use crate::plant::{Plant, PlantError};
use model::Model;

/// Trunk height, as a fraction of standing height, below which the robot has fallen (assumption).
pub const FALLEN_HEIGHT: f32 = 0.6;
/// Trunk lean from vertical above which the robot has fallen, rad (assumption).
pub const FALLEN_LEAN_RAD: f32 = 0.8;
/// Speeds of any body above which the solver, not the robot, is at fault: a free fall from 1 m ends at 4.4 m/s.
const EXPLODED_M_S: f32 = 30.0;
const EXPLODED_RAD_S: f32 = 300.0;

/// The driven joints, in the order of every six-element array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[repr(usize)]
pub enum Joint {
    /// Left hip's roll axis; positive moves the foot outward (+y).
    LeftAbductor,
    /// Left hip's pitch axis; positive swings the foot forward.
    LeftHip,
    /// Left knee, a linear actuator; positive extends the leg.
    LeftKnee,
    /// Right hip's roll axis; positive moves the foot inward (+y).
    RightAbductor,
    /// Right hip's pitch axis; positive swings the foot forward.
    RightHip,
    /// Right knee, a linear actuator; positive extends the leg.
    RightKnee,
}

impl Joint {
    /// All six, in index order.
    pub const ALL: [Self; 6] =
        [Self::LeftAbductor, Self::LeftHip, Self::LeftKnee, Self::RightAbductor, Self::RightHip, Self::RightKnee];

    /// Name of the joint and of its actuator in the MJCF file.
    pub const fn name(self) -> &'static str {
        ["l_abd", "l_hip", "l_knee", "r_abd", "r_hip", "r_knee"][self as usize]
    }

    /// Whether this is a linear actuator (m, N) rather than a rotary one (rad, N·m).
    pub const fn is_linear(self) -> bool {
        matches!(self, Self::LeftKnee | Self::RightKnee)
    }

    /// Whether this joint belongs to the left leg.
    pub const fn is_left(self) -> bool {
        (self as usize) < 3
    }
}

/// What a driven joint is told to do.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Drive {
    /// Locked where it is; needs no power.
    Brake,
    /// Brake released, speed held: m/s for knees, rad/s for the others. Clamped to the actuator's top speed.
    Velocity(f32),
}

impl Drive {
    /// This drive, or the brake if its speed is not finite.
    pub(crate) fn or_brake(self) -> Self {
        match self {
            Self::Velocity(speed) if !speed.is_finite() => Self::Brake,
            other => other,
        }
    }
}

/// Coordinate and speed of a joint: m and m/s for knees and pads, rad and rad/s for the others.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointState {
    /// Zero on straight legs.
    pub position: f32,
    /// Rate of change of `position`.
    pub velocity: f32,
}

/// Motion of the trunk's frame (0.12 m above the hips), in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrunkState {
    /// Position, m.
    pub position_m: [f32; 3],
    /// Unit quaternion x, y, z, w turning trunk axes into world axes.
    pub rotation_xyzw: [f32; 4],
    /// Velocity of the frame's origin, m/s.
    pub velocity_m_s: [f32; 3],
    /// Angular velocity in world axes, rad/s.
    pub angular_velocity_rad_s: [f32; 3],
}

/// What an ideal IMU at the file's `imu` site is carried through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuState {
    /// Velocity of the IMU in world axes, m/s.
    pub velocity_m_s: [f32; 3],
    /// Angular velocity in world axes, rad/s.
    pub angular_velocity_rad_s: [f32; 3],
    /// Unit quaternion x, y, z, w turning trunk axes into world axes.
    pub rotation_xyzw: [f32; 4],
}

/// Verdict on the robot's state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Health {
    /// On its feet, or in the air above them.
    Upright,
    /// Below [`FALLEN_HEIGHT`] or beyond [`FALLEN_LEAN_RAD`].
    Fallen {
        /// Height of the trunk's frame above the ground, m.
        height_m: f32,
        /// Angle between the trunk's z axis and the vertical, rad.
        lean_rad: f32,
    },
    /// A position or velocity is not a number: the simulation, not the robot, failed.
    NonFinite,
    /// A body is faster than the robot could make it: the simulation, not the robot, failed.
    Exploded {
        /// Fastest body, m/s.
        speed_m_s: f32,
        /// Fastest spinning body, rad/s.
        spin_rad_s: f32,
    },
}

/// A simulated robot on its ground.
pub struct Robot {
    model: Model,
    steps: u64,
    /// Force in world axes, N, and its point above the trunk's centre of mass, m.
    push: Option<(Vector, f32)>,
}

impl Robot {
    /// Builds the robot on straight legs, square to the ground and `drop_m` above it, brakes on.
    pub fn new(config: &RobotConfig) -> Result<Self, RobotError> {
        config.validate()?;
        let mut robot = Self { model: Model::load(config)?, steps: 0, push: None };
        for joint in Joint::ALL {
            robot.drive(joint, Drive::Brake);
        }
        Ok(robot)
    }

    /// Advances by `dt_s`.
    pub fn step(&mut self) {
        let trunk = &mut self.model.world.bodies[self.model.trunk];
        trunk.reset_forces(false);
        trunk.reset_torques(false);
        if let Some((force, height_m)) = self.push {
            let at = trunk.center_of_mass() + Vector::Z * height_m;
            trunk.add_force_at_point(force, at, false);
        }
        let Model { world, links, pads, .. } = &mut self.model;
        world.step();
        for link in links.iter_mut().chain(pads) {
            link.observe(world);
        }
        self.steps += 1;
    }

    /// Travel of each pad into its foot, m, 0 to 0.004, in the order of [`Plant::pad_loads_n`].
    pub fn pad_travel_m(&self) -> [f32; 4] {
        [0, 1, 2, 3].map(|pad| self.model.pads[pad].state().position)
    }

    /// Centre of mass of the whole robot, m.
    pub fn com_m(&self) -> [f32; 3] {
        let mut moment = Vector::ZERO;
        for body in self.bodies() {
            moment += body.center_of_mass() * body.mass();
        }
        (moment / self.mass_kg()).to_array()
    }

    /// Mass of the whole robot with its payload, kg.
    pub fn mass_kg(&self) -> f32 {
        self.bodies().map(RigidBody::mass).sum()
    }

    /// Angle between the trunk's z axis and the vertical, rad, 0 to π.
    pub fn lean_rad(&self) -> f32 {
        lean_rad(self.trunk().rotation_xyzw)
    }

    fn bodies(&self) -> impl Iterator<Item = &RigidBody> {
        self.model.bodies.iter().map(|handle| &self.model.world.bodies[*handle])
    }
}

impl Plant for Robot {
    fn drive(&mut self, joint: Joint, drive: Drive) {
        let Model { world, links, motors, .. } = &mut self.model;
        links[joint as usize].apply(world, drive.or_brake(), motors[joint as usize]);
    }

    fn driven(&self, joint: Joint) -> Drive {
        self.model.links[joint as usize].drive()
    }

    fn push(&mut self, force_n: [f32; 3], height_m: f32) {
        self.push = Some((Vector::from_array(force_n), height_m));
    }

    fn clear_push(&mut self) {
        self.push = None;
    }

    fn step(&mut self) -> Result<(), PlantError> {
        Robot::step(self);
        Ok(())
    }

    fn joint(&self, joint: Joint) -> JointState {
        self.model.links[joint as usize].state()
    }

    fn effort(&self, joint: Joint) -> f32 {
        self.model.links[joint as usize].effort(&self.model.world)
    }

    fn pad_loads_n(&self) -> [f32; 4] {
        let Model { world, ground, ground_normal, .. } = &self.model;
        self.model.pad_colliders.map(|pad| {
            let pair = world.narrow_phase.contact_pair(pad, *ground);
            pair.map_or(0.0, |pair| pair.total_impulse().dot(*ground_normal).abs() / world.integration_parameters.dt)
        })
    }

    fn trunk(&self) -> TrunkState {
        let body = &self.model.world.bodies[self.model.trunk];
        TrunkState {
            position_m: body.translation().to_array(),
            rotation_xyzw: body.rotation().to_array(),
            velocity_m_s: body.velocity_at_point(body.translation()).to_array(),
            angular_velocity_rad_s: body.angvel().to_array(),
        }
    }

    fn imu(&self) -> ImuState {
        let body = &self.model.world.bodies[self.model.trunk];
        ImuState {
            velocity_m_s: body.velocity_at_point(*body.position() * self.model.imu_m).to_array(),
            angular_velocity_rad_s: body.angvel().to_array(),
            rotation_xyzw: body.rotation().to_array(),
        }
    }

    fn health(&self) -> Health {
        let finite = |body: &RigidBody| {
            body.translation().is_finite()
                && body.rotation().is_finite()
                && body.linvel().is_finite()
                && body.angvel().is_finite()
        };
        // Rapier takes bodies with non-finite state out of the simulation and lists them.
        if !self.model.world.quarantine().is_empty() || !self.bodies().all(finite) {
            return Health::NonFinite;
        }
        let speed_m_s = self.bodies().map(|b| b.linvel().length()).fold(0.0, f32::max);
        let spin_rad_s = self.bodies().map(|b| b.angvel().length()).fold(0.0, f32::max);
        verdict(speed_m_s, spin_rad_s, [self.height_m(), self.standing_height_m()], self.lean_rad())
    }

    fn height_m(&self) -> f32 {
        let normal = self.model.ground_normal;
        self.model.world.bodies[self.model.trunk].translation().dot(normal) / normal.z
    }

    fn standing_height_m(&self) -> f32 {
        self.model.standing_height_m
    }

    fn gravity_m_s2(&self) -> f32 {
        -self.model.world.gravity.z
    }

    fn time_s(&self) -> f64 {
        self.steps as f64 * f64::from(self.dt_s())
    }

    fn dt_s(&self) -> f32 {
        self.model.world.integration_parameters.dt
    }
}

/// Angle between the z axis of a trunk turned like this and the vertical, rad, 0 to π.
pub(crate) fn lean_rad(rotation_xyzw: [f32; 4]) -> f32 {
    let up = Rotation::from_array(rotation_xyzw) * Vector::Z;
    // atan2 keeps its accuracy near zero, where acos loses it.
    up.x.hypot(up.y).atan2(up.z)
}

/// What a finite state amounts to: the fastest body, the fastest spinning one, the trunk's height now and standing, its
/// lean.
pub(crate) fn verdict(speed_m_s: f32, spin_rad_s: f32, [height_m, standing_m]: [f32; 2], lean_rad: f32) -> Health {
    if speed_m_s > EXPLODED_M_S || spin_rad_s > EXPLODED_RAD_S {
        return Health::Exploded { speed_m_s, spin_rad_s };
    }
    if height_m < FALLEN_HEIGHT * standing_m || lean_rad > FALLEN_LEAN_RAD {
        return Health::Fallen { height_m, lean_rad };
    }
    Health::Upright
}

#[cfg(test)]
mod tests;
