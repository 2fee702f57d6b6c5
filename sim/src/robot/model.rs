//! `assets/sarah.xml` into a rapier world: bodies, joints, actuator limits, ground.

use std::collections::HashMap;

use rapier3d::prelude::*;
use rapier3d_mjcf::mjcf_rs::extras::{Actuator, ActuatorKind};
use rapier3d_mjcf::mjcf_rs::model::Model as Mjcf;
use rapier3d_mjcf::{ContactFilterMode, MjcfJoint, MjcfLoaderOptions, MjcfRobot};

use super::joint::{Link, Motor};
use super::{Contacts, Joint, RobotConfig, RobotError};

/// The robot's MJCF description, for tools that load it elsewhere (MuJoCo).
pub const SARAH_MJCF: &str = include_str!("../../assets/sarah.xml");

/// Pads in the order of every four-element pad array: left heel, left toe, right heel, right toe.
pub(super) const PADS: [&str; 4] = ["l_heel", "l_toe", "r_heel", "r_toe"];

/// A loaded world with the handles the robot is driven and read through.
pub(super) struct Model {
    pub world: PhysicsWorld,
    pub trunk: RigidBodyHandle,
    /// Every moving body, trunk first.
    pub bodies: Vec<RigidBodyHandle>,
    pub links: [Link; 6],
    pub motors: [Motor; 6],
    pub pads: [Link; 4],
    pub pad_colliders: [ColliderHandle; 4],
    pub ground: ColliderHandle,
    /// Normal of the ground plane, which passes through the origin.
    pub ground_normal: Vector,
    /// Where the IMU sits in the trunk's frame, m.
    pub imu_m: Vector,
    /// Height of the trunk's frame above the ground on straight legs, m.
    pub standing_height_m: f32,
}

pub(super) fn missing(kind: &'static str, name: &str) -> RobotError {
    RobotError::Missing { kind, name: name.to_owned() }
}

/// Turns `items` into an array of the length asked for; the length is fixed by the caller's own constant.
fn array<T, const N: usize>(items: impl Iterator<Item = Result<T, RobotError>>) -> Result<[T; N], RobotError> {
    let items: Vec<T> = items.collect::<Result<_, _>>()?;
    items.try_into().map_err(|_| missing("joint", "of the expected number"))
}

impl Model {
    /// Loads the file and applies the variations of `config`, which must be valid.
    pub(super) fn load(config: &RobotConfig) -> Result<Self, RobotError> {
        let options = MjcfLoaderOptions {
            // The file's contact bits agree under "and", so no per-step filter is needed.
            contact_filter_mode: ContactFilterMode::Asymmetric,
            rigid_body_blueprint: RigidBodyBuilder::dynamic().can_sleep(false),
            ..Default::default()
        };
        let (robot, mjcf) =
            MjcfRobot::from_str(SARAH_MJCF, options, ".").map_err(|e| RobotError::Parse(e.to_string()))?;

        let motors = array(Joint::ALL.iter().map(|joint| motor(&robot, *joint, config)))?;
        let pad_springs: [(f32, f32); 4] = array(PADS.iter().map(|name| {
            let joint = mjcf_joint(&robot, name)?;
            Ok((joint.spring_stiffness_per_dof, joint.damping_per_dof))
        }))?;
        let imu_m = site(&mjcf, "imu")?;
        let joint_index = robot.joint_name_to_idx.clone();
        let body_index = robot.body_name_to_idx.clone();
        let geom_index = robot.geom_name_to_collider.clone();

        let mut world = PhysicsWorld::new();
        world.gravity = robot.gravity;
        let params = &mut world.integration_parameters;
        params.dt = config.dt_s;
        params.num_solver_iterations = config.solver_iterations;
        params.warmstart_joints = true;
        params.max_ccd_substeps = 0;
        if config.contacts == Contacts::Exact {
            params.friction_model = FrictionModel::Coulomb;
            params.normalized_prediction_distance = 0.002;
            params.num_internal_pgs_iterations = 4;
        }
        let handles =
            robot.insert_using_impulse_joints(&mut world.bodies, &mut world.colliders, &mut world.impulse_joints);

        let body = |name: &str| {
            let handle = body_index.get(name).and_then(|i| handles.bodies[*i].as_ref());
            handle.map(|b| b.body).ok_or_else(|| missing("body", name))
        };
        let collider = |name: &str| find_collider(&geom_index, &handles.bodies, name);
        let link = |name: &str| {
            let handle = joint_index.get(name).and_then(|i| handles.joints.get(*i)).map(|j| j.joint);
            let joint = handle.and_then(|h| Some((h, world.impulse_joints.get(h)?)));
            joint.map(|(h, j)| Link::new(h, j)).ok_or_else(|| missing("joint", name))
        };

        let trunk = body("trunk")?;
        let ground = collider("ground")?;
        let pad_colliders = array(PADS.iter().map(|name| collider(&format!("{name}_pad"))))?;
        let links = array(Joint::ALL.iter().map(|joint| link(joint.name())))?;
        let pads: [Link; 4] = array(PADS.iter().map(|name| link(name)))?;
        let bodies: Vec<_> =
            handles.bodies.iter().flatten().map(|b| b.body).filter(|h| world.bodies[*h].is_dynamic()).collect();

        let mut model = Self {
            standing_height_m: world.bodies[trunk].translation().z,
            world,
            trunk,
            bodies,
            links,
            motors,
            pads,
            pad_colliders,
            ground,
            ground_normal: Vector::Z,
            imu_m,
        };
        model.set_pad_springs(&pad_springs);
        model.set_masses(config);
        model.set_ground(config);
        Ok(model)
    }

    /// Pads push with a force that depends on their travel, not on their mass: the loader's own springs are
    /// acceleration-based.
    fn set_pad_springs(&mut self, springs: &[(f32, f32); 4]) {
        for (pad, (stiffness, damping)) in self.pads.iter().zip(springs) {
            if let Some(joint) = self.world.impulse_joints.get_mut(pad.handle, false) {
                joint.data.set_motor_model(JointAxis::LinX, MotorModel::ForceBased);
                joint.data.set_motor_position(JointAxis::LinX, 0.0, *stiffness, *damping);
            }
        }
    }

    fn set_masses(&mut self, config: &RobotConfig) {
        for &handle in &self.bodies {
            let body = &mut self.world.bodies[handle];
            // The colliders weigh nothing; this copies the file's <inertial> to where it can be read.
            body.recompute_mass_properties_from_colliders(&self.world.colliders);
            let loaded = body.mass_properties().local_mprops;
            let of_trunk = handle == self.trunk;
            let (payload_kg, shift_m) = if of_trunk {
                (config.payload_kg, Vector::from_array(config.com_shift_m))
            } else {
                (0.0, Vector::ZERO)
            };
            let properties = MassProperties::with_principal_inertia_frame(
                loaded.local_com + shift_m,
                loaded.mass() * config.mass_scale + payload_kg,
                loaded.principal_inertia() * config.mass_scale,
                loaded.principal_inertia_local_frame,
            );
            body.set_additional_mass_properties(properties, false);
            body.recompute_mass_properties_from_colliders(&self.world.colliders);
        }
    }

    /// Tilts the ground about the origin and the robot with it, as rigid feet stand flat on a slope only if the legs are
    /// square to it; sets the friction; and lifts the robot until its lowest sole corner is `drop_m` above the ground.
    fn set_ground(&mut self, config: &RobotConfig) {
        let tilt = ground_turn(config);
        self.ground_normal = tilt * Vector::Z;
        if let Some(ground) = self.world.colliders.get(self.ground).and_then(Collider::parent) {
            self.world.bodies[ground].set_rotation(tilt, false);
        }
        if let Some(friction) = config.friction {
            for handle in self.pad_colliders.into_iter().chain([self.ground]) {
                self.world.colliders[handle].set_friction(friction);
            }
        }
        for (_, collider) in self.world.colliders.iter_mut() {
            collider.set_active_hooks(ActiveHooks::empty());
        }
        for &handle in &self.bodies {
            let body = &mut self.world.bodies[handle];
            let (at, turned) = (tilt * body.translation(), tilt * *body.rotation());
            body.set_translation(at, false);
            body.set_rotation(turned, false);
        }
        let mut lift_m = 0.0f32;
        for (pad, collider) in self.pads.iter().zip(self.pad_colliders) {
            let joint = self.world.impulse_joints.get(pad.handle);
            let (Some(joint), Some(cuboid)) = (joint, self.world.colliders[collider].shape().as_cuboid()) else {
                continue;
            };
            let half = cuboid.half_extents;
            for (x, y) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                let corner = self.world.bodies[joint.body2()].position() * Vector::new(x * half.x, y * half.y, -half.z);
                // Vertical distance down to the plane through the origin.
                lift_m = lift_m.max(-corner.dot(self.ground_normal) / self.ground_normal.z);
            }
        }
        let up = Vector::Z * (config.drop_m + lift_m);
        for &handle in &self.bodies {
            let body = &mut self.world.bodies[handle];
            let raised = body.translation() + up;
            body.set_translation(raised, false);
        }
    }
}

/// How the ground of `config` is turned.
pub(crate) fn ground_turn(config: &RobotConfig) -> Rotation {
    Rotation::from_axis_angle(Vector::Y, config.slope_pitch_rad)
        * Rotation::from_axis_angle(Vector::X, config.slope_roll_rad)
}

fn find_collider(
    index: &HashMap<String, (usize, usize)>,
    bodies: &[Option<rapier3d_mjcf::MjcfBodyHandle>],
    name: &str,
) -> Result<ColliderHandle, RobotError> {
    let found = index.get(name).and_then(|(body, collider)| bodies[*body].as_ref()?.colliders.get(*collider));
    found.map(|c| c.handle).ok_or_else(|| missing("geom", name))
}

fn mjcf_joint<'a>(robot: &'a MjcfRobot, name: &str) -> Result<&'a MjcfJoint, RobotError> {
    robot.joint_name_to_idx.get(name).and_then(|i| robot.joints.get(*i)).ok_or_else(|| missing("joint", name))
}

pub(super) fn site(mjcf: &Mjcf, name: &str) -> Result<Vector, RobotError> {
    let (body, site) = mjcf.site_by_name(name).ok_or_else(|| missing("site", name))?;
    let at = mjcf.bodies[body].body.sites[site].pose.translation;
    Ok(Vector::new(at.x as f32, at.y as f32, at.z as f32))
}

/// The velocity actuator that drives `joint`, scaled as `config` asks.
fn motor(robot: &MjcfRobot, joint: Joint, config: &RobotConfig) -> Result<Motor, RobotError> {
    let (speed_scale, force_scale) = config.actuator_scales(joint);
    let joint = joint.name();
    let drives = |a: &&Actuator| a.kind == ActuatorKind::Velocity && a.joint.as_deref() == Some(joint);
    let actuator =
        robot.actuators.iter().map(|a| &a.actuator).find(drives).ok_or_else(|| missing("velocity actuator", joint))?;
    let need = |attribute| RobotError::Attribute { name: joint.to_owned(), attribute };
    Ok(Motor {
        gain: actuator.kv.ok_or_else(|| need("kv"))? as f32,
        max_speed: actuator.ctrl_range.ok_or_else(|| need("ctrlrange"))?[1] as f32 * speed_scale,
        max_force: actuator.force_range.ok_or_else(|| need("forcerange"))?[1] as f32 * force_scale,
    })
}
