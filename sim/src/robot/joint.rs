//! One driven joint: its coordinate, its brake, its motor.
//!
//! The brake is a true lock. A motor that holds zero speed creeps (35 mm in 2 s under the robot's weight), so braking
//! moves the joint's first frame to where the joint is and locks the last free axis; releasing undoes both.
//!
//! The motor is the file's: force = kv · (commanded speed − speed), limited. Solved in as few iterations as ours it
//! slips in proportion to its load, 0.04 m/s under half the robot's weight whatever the gain, so a slow command
//! stalls. An integral term on the speed removes the slip, as the speed loop of a geared actuator does.

use rapier3d::prelude::*;

use super::{Drive, JointState};

/// Kind of motion along a joint's x axis, which is where the MJCF loader puts the free axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Motion {
    /// Hinge, rad.
    Turn,
    /// Slide, m.
    Slide,
}

impl Motion {
    fn axis(self) -> JointAxis {
        match self {
            Self::Turn => JointAxis::AngX,
            Self::Slide => JointAxis::LinX,
        }
    }

    fn locked_while_free(self) -> JointAxesMask {
        match self {
            Self::Turn => JointAxesMask::LOCKED_REVOLUTE_AXES,
            Self::Slide => JointAxesMask::LOCKED_PRISMATIC_AXES,
        }
    }

    /// The displacement `q` along or about the joint's axis.
    fn pose(self, q: f32) -> Pose {
        match self {
            Self::Turn => Pose::from_rotation(Rotation::from_axis_angle(Vector::X, q)),
            Self::Slide => Pose::from_translation(Vector::new(q, 0.0, 0.0)),
        }
    }
}

/// What an actuator can do, from the file's `kv`, `ctrlrange` and `forcerange`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Motor {
    /// Force per speed error, N·s/m or N·m·s/rad.
    pub gain: f32,
    /// Top speed, m/s or rad/s.
    pub max_speed: f32,
    /// Force limit, N or N·m.
    pub max_force: f32,
}

/// Time constant of the integral term, s: slip is gone in a few steps, contact chatter is not followed.
const INTEGRAL_TIME_S: f32 = 0.010;
/// Bound of the integral term as a fraction of the top speed; more would be wind-up against a stop.
const INTEGRAL_LIMIT: f32 = 0.15;

/// A joint of the rapier world together with what locking needs to be undone.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub handle: ImpulseJointHandle,
    pub motion: Motion,
    /// Joint frames and limit axes as loaded, before any lock.
    free_frame1: Pose,
    limit_axes: JointAxesMask,
    parent: RigidBodyHandle,
    child: RigidBodyHandle,
    drive: Option<Drive>,
    servo: Servo,
    state: JointState,
}

/// Integral term of a released joint's speed loop.
#[derive(Debug, Clone, Copy)]
struct Servo {
    /// Commanded speed.
    speed: f32,
    /// Added to the command to cancel the slip.
    correction: f32,
    /// Bound of `correction`.
    limit: f32,
}

impl Link {
    /// Wraps a joint just loaded, free and undriven.
    pub(super) fn new(handle: ImpulseJointHandle, joint: &ImpulseJoint) -> Self {
        let motion =
            if joint.data.locked_axes == JointAxesMask::LOCKED_PRISMATIC_AXES { Motion::Slide } else { Motion::Turn };
        Self {
            handle,
            motion,
            free_frame1: joint.data.local_frame1,
            limit_axes: joint.data.limit_axes,
            parent: joint.body1(),
            child: joint.body2(),
            drive: None,
            servo: Servo { speed: 0.0, correction: 0.0, limit: 0.0 },
            state: JointState::default(),
        }
    }

    /// Coordinate and speed after the last [`Self::observe`], in the joint's own sign, locked or not.
    pub(super) fn state(&self) -> JointState {
        self.state
    }

    fn position(&self, world: &PhysicsWorld) -> f32 {
        let Some(joint) = world.impulse_joints.get(self.handle) else { return self.state.position };
        let frame1 = *world.bodies[self.parent].position() * self.free_frame1;
        let frame2 = *world.bodies[self.child].position() * joint.data.local_frame2;
        let relative = frame1.inverse() * frame2;
        match self.motion {
            Motion::Slide => relative.translation.x,
            Motion::Turn => relative.rotation.to_scaled_axis().x,
        }
    }

    /// Applies `drive` from the next step on.
    pub(super) fn apply(&mut self, world: &mut PhysicsWorld, drive: Drive, motor: Motor) {
        if self.drive == Some(drive) {
            return;
        }
        let position = self.position(world);
        let Some(joint) = world.impulse_joints.get_mut(self.handle, false) else { return };
        let (joint, axis) = (&mut joint.data, self.motion.axis());
        match drive {
            Drive::Brake => {
                joint.local_frame1 = self.free_frame1 * self.motion.pose(position);
                joint.locked_axes = JointAxesMask::LOCKED_FIXED_AXES;
                joint.limit_axes = JointAxesMask::empty();
                joint.motor_axes = JointAxesMask::empty();
                joint.motors[axis as usize].impulse = 0.0;
            }
            Drive::Velocity(speed) => {
                joint.local_frame1 = self.free_frame1;
                joint.locked_axes = self.motion.locked_while_free();
                joint.limit_axes = self.limit_axes;
                let speed = speed.clamp(-motor.max_speed, motor.max_speed);
                // A new command keeps the correction: the load it cancels has not changed.
                let correction =
                    if matches!(self.drive, Some(Drive::Velocity(_))) { self.servo.correction } else { 0.0 };
                self.servo = Servo { speed, correction, limit: INTEGRAL_LIMIT * motor.max_speed };
                joint.set_motor_model(axis, MotorModel::ForceBased);
                joint.set_motor(axis, 0.0, speed + correction, 0.0, motor.gain);
                joint.set_motor_max_force(axis, motor.max_force);
            }
        }
        self.drive = Some(drive);
    }

    /// Reads the joint after a step and, while released, closes its speed loop.
    pub(super) fn observe(&mut self, world: &mut PhysicsWorld) {
        let dt = world.integration_parameters.dt;
        let position = self.position(world);
        // What the joint travelled, not the solver's velocity: under load the two differ by the slip.
        let velocity = (position - self.state.position) / dt;
        self.state = JointState { position, velocity };
        if matches!(self.drive, Some(Drive::Velocity(_))) {
            let servo = &mut self.servo;
            let gain = dt / (dt + INTEGRAL_TIME_S);
            servo.correction += gain * (servo.speed - velocity);
            servo.correction = servo.correction.clamp(-servo.limit, servo.limit);
            if let Some(joint) = world.impulse_joints.get_mut(self.handle, false) {
                joint.data.motors[self.motion.axis() as usize].target_vel = servo.speed + servo.correction;
            }
        }
    }

    /// Force or torque of the motor over the last solver sub-step, in the joint's sign; zero while braked.
    pub(super) fn effort(&self, world: &PhysicsWorld) -> f32 {
        let axis = self.motion.axis() as usize;
        match (self.drive, world.impulse_joints.get(self.handle)) {
            (Some(Drive::Velocity(_)), Some(joint)) => {
                let p = &world.integration_parameters;
                // Rapier counts the impulse on the parent.
                -joint.data.motors[axis].impulse * p.num_solver_iterations as f32 / p.dt
            }
            _ => 0.0,
        }
    }

    /// Drive in force.
    pub(super) fn drive(&self) -> Drive {
        self.drive.unwrap_or(Drive::Brake)
    }
}
