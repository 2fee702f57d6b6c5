//! One driven joint: its coordinate, its brake, its motor.
//!
//! The brake is a true lock. A motor that holds zero speed creeps (35 mm in 2 s under the robot's weight), so braking
//! moves the joint's first frame to where the joint is and locks the last free axis; releasing undoes both.

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
}

impl Link {
    /// Wraps a joint just loaded, free and undriven.
    pub(super) fn new(handle: ImpulseJointHandle, joint: &ImpulseJoint) -> Self {
        let motion = if joint.data.locked_axes == JointAxesMask::LOCKED_PRISMATIC_AXES { Motion::Slide } else { Motion::Turn };
        Self {
            handle,
            motion,
            free_frame1: joint.data.local_frame1,
            limit_axes: joint.data.limit_axes,
            parent: joint.body1(),
            child: joint.body2(),
            drive: None,
        }
    }

    /// Coordinate and speed, in the joint's own sign. Independent of whether the joint is locked.
    pub(super) fn state(&self, world: &PhysicsWorld, joint: &GenericJoint) -> JointState {
        let (parent, child) = (&world.bodies[self.parent], &world.bodies[self.child]);
        let frame1 = *parent.position() * self.free_frame1;
        let frame2 = *child.position() * joint.local_frame2;
        let axis = frame1.rotation * Vector::X;
        let relative = frame1.inverse() * frame2;
        match self.motion {
            Motion::Slide => {
                let at = frame2.translation;
                let slip = child.velocity_at_point(at) - parent.velocity_at_point(at);
                JointState { position: relative.translation.x, velocity: axis.dot(slip) }
            }
            Motion::Turn => JointState {
                position: relative.rotation.to_scaled_axis().x,
                velocity: axis.dot(child.angvel() - parent.angvel()),
            },
        }
    }

    /// Applies `drive` from the next step on.
    pub(super) fn apply(&mut self, world: &mut PhysicsWorld, drive: Drive, motor: Motor) {
        if self.drive == Some(drive) {
            return;
        }
        let Some(joint) = world.impulse_joints.get(self.handle) else { return };
        let position = self.state(world, &joint.data).position;
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
                joint.set_motor_model(axis, MotorModel::ForceBased);
                joint.set_motor(axis, 0.0, speed.clamp(-motor.max_speed, motor.max_speed), 0.0, motor.gain);
                joint.set_motor_max_force(axis, motor.max_force);
            }
        }
        self.drive = Some(drive);
    }

    /// Force or torque of the motor over the last solver sub-step, in the joint's sign; zero while braked.
    pub(super) fn effort(&self, world: &PhysicsWorld) -> f32 {
        let axis = self.motion.axis() as usize;
        match (self.drive, world.impulse_joints.get(self.handle)) {
            (Some(Drive::Velocity(_)), Some(joint)) => {
                let p = &world.integration_parameters;
                joint.data.motors[axis].impulse * p.num_solver_iterations as f32 / p.dt
            }
            _ => 0.0,
        }
    }

    /// Drive in force.
    pub(super) fn drive(&self) -> Drive {
        self.drive.unwrap_or(Drive::Brake)
    }
}
