//! The robot in space: its links' transforms from joint positions and lean, and what it looks like. The geometry is
//! `sarah_sim::skeleton`'s, that is the robot's own description.

use foxglove::messages::{
    Color, CubePrimitive, CylinderPrimitive, Duration, FrameTransform, FrameTransforms, JointState, JointStates,
    Pose as PoseMessage, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive, Timestamp, Vector3,
};
use sarah_protocol::telemetry::Telemetry;
use sarah_sim::robot::{Joint, RobotError};
use sarah_sim::skeleton::{self, Link, Shape};

use super::description::Description;
use super::pose::{Pose, lean};

/// The frame everything is in: x forward at power-up, z up, the ground at z = 0.
pub const WORLD: &str = "world";

const GREY: [f64; 3] = [0.55, 0.57, 0.6];
const BLUE: [f64; 3] = [0.25, 0.47, 0.85];
const ORANGE: [f64; 3] = [0.93, 0.55, 0.2];

/// The robot's links.
#[derive(Clone, Debug)]
pub struct Scene {
    links: Vec<Link>,
    /// Which of [`Telemetry::joints`] moves each link.
    moved_by: Vec<Option<usize>>,
}

impl Scene {
    /// From the robot's description.
    pub fn new() -> Result<Scene, RobotError> {
        let links = skeleton::links()?;
        let index = |name: &str| Joint::ALL.iter().position(|joint| joint.name() == name);
        let moved_by = links.iter().map(|link| link.joint.as_ref().and_then(|joint| index(&joint.name))).collect();
        Ok(Scene { links, moved_by })
    }

    /// The same for tools that draw from URDF.
    pub fn description(&self) -> Description {
        Description::of(&self.links)
    }

    /// Every link against its parent, the trunk against the world. Without a pose of the trunk it leans as the robot
    /// says, and its lower foot stands on the ground at the origin.
    pub fn transforms(&self, at: Timestamp, telemetry: &Telemetry, trunk: Option<&Pose>) -> FrameTransforms {
        let mut poses = self.against_parents(telemetry);
        if let Some(first) = poses.first_mut() {
            *first = trunk.copied().unwrap_or_else(|| Pose::leaning(lean(telemetry)));
        }
        if trunk.is_none() {
            let lowest_m = self.lowest_m(&poses);
            if let Some(first) = poses.first_mut() {
                first.position_m[2] -= lowest_m;
            }
        }
        let transform = |(link, pose): (&Link, &Pose)| FrameTransform {
            timestamp: Some(at),
            parent_frame_id: link.parent.map_or(WORLD, |parent| self.links[parent].name.as_str()).into(),
            child_frame_id: link.name.clone(),
            translation: Some(vector(pose.position_m)),
            rotation: Some(quaternion(pose.turn_xyzw)),
        };
        FrameTransforms { transforms: self.links.iter().zip(&poses).map(transform).collect() }
    }

    fn against_parents(&self, telemetry: &Telemetry) -> Vec<Pose> {
        let pose = |(link, moved_by): (&Link, &Option<usize>)| {
            let at = Pose { position_m: link.at_m, turn_xyzw: link.turn_xyzw };
            let position = moved_by.map_or(0.0, |index| f64::from(telemetry.joints[index].to_f32()));
            match &link.joint {
                Some(joint) if joint.slides => at.then(&Pose::moved(joint.axis, position)),
                Some(joint) => at.then(&Pose::turned(joint.axis, position)),
                None => at,
            }
        };
        self.links.iter().zip(&self.moved_by).map(pose).collect()
    }

    /// Height of the lowest corner of any box, m.
    fn lowest_m(&self, against_parents: &[Pose]) -> f64 {
        let mut lowest = f64::INFINITY;
        let mut against_world: Vec<Pose> = vec![];
        for (link, pose) in self.links.iter().zip(against_parents) {
            let pose = link.parent.map_or(*pose, |parent| against_world[parent].then(pose));
            against_world.push(pose);
            for shape in &link.shapes {
                let Shape::Box { at_m: [x, y, z], half_m: [a, b, c] } = *shape else { continue };
                for (a, b, c) in [(a, b, c), (a, b, -c), (a, -b, c), (a, -b, -c)] {
                    for sign in [1.0, -1.0] {
                        lowest = lowest.min(pose.point([x + sign * a, y + sign * b, z + sign * c])[2]);
                    }
                }
            }
        }
        if lowest.is_finite() { lowest } else { 0.0 }
    }

    /// What the robot looks like; it follows its links' frames.
    pub fn look(&self, at: Timestamp) -> SceneUpdate {
        let entity = |link: &Link| {
            let mut entity = SceneEntity {
                timestamp: Some(at),
                frame_id: link.name.clone(),
                id: link.name.clone(),
                lifetime: Some(Duration::new(0, 0)),
                frame_locked: true,
                ..SceneEntity::default()
            };
            let [r, g, b] = colour(&link.name);
            let colour = Color { r, g, b, a: 1.0 };
            for shape in &link.shapes {
                draw(&mut entity, shape, colour);
            }
            entity
        };
        let entities = self.links.iter().filter(|link| !link.shapes.is_empty()).map(entity).collect();
        SceneUpdate { deletions: vec![], entities }
    }
}

/// The driven joints, by their names in the robot's description: rad, knees m.
pub fn joints(at: Timestamp, telemetry: &Telemetry) -> JointStates {
    let state = |joint: &Joint| JointState {
        name: joint.name().into(),
        position: Some(f64::from(telemetry.joints[*joint as usize].to_f32())),
        ..JointState::default()
    };
    JointStates { timestamp: Some(at), joints: Joint::ALL.iter().map(state).collect() }
}

fn draw(entity: &mut SceneEntity, shape: &Shape, colour: Color) {
    match *shape {
        Shape::Box { at_m, half_m } => entity.cubes.push(CubePrimitive {
            pose: Some(message(&Pose { position_m: at_m, ..Pose::HERE })),
            size: Some(vector(half_m.map(|half| 2.0 * half))),
            color: Some(colour),
        }),
        Shape::Capsule { from_m, to_m, radius_m } => {
            let (middle, length) = along_z(from_m, to_m);
            entity.cylinders.push(CylinderPrimitive {
                pose: Some(message(&middle)),
                size: Some(vector([2.0 * radius_m, 2.0 * radius_m, length])),
                bottom_scale: 1.0,
                top_scale: 1.0,
                color: Some(colour),
            });
            entity.spheres.extend([from_m, to_m].map(|end| SpherePrimitive {
                pose: Some(message(&Pose { position_m: end, ..Pose::HERE })),
                size: Some(vector([2.0 * radius_m; 3])),
                color: Some(colour),
            }));
        }
    }
}

/// Middle and length of a rod, with z along it.
pub(super) fn along_z(from_m: [f64; 3], to_m: [f64; 3]) -> (Pose, f64) {
    let along: [f64; 3] = std::array::from_fn(|i| to_m[i] - from_m[i]);
    let length = along.iter().map(|d| d * d).sum::<f64>().sqrt();
    let position_m = std::array::from_fn(|i| 0.5 * (from_m[i] + to_m[i]));
    (Pose { position_m, turn_xyzw: from_z(along, length) }, length)
}

/// The turn that takes z to `along`.
fn from_z([x, y, z]: [f64; 3], length: f64) -> [f64; 4] {
    let w = length + z;
    let norm = (x * x + y * y + w * w).sqrt();
    // Straight down, any turn by half a circle across z does.
    if norm < 1e-9 * length { [1.0, 0.0, 0.0, 0.0] } else { [-y / norm, x / norm, 0.0, w / norm] }
}

/// Red, green and blue of a link, 0 to 1.
pub(super) fn colour(link: &str) -> [f64; 3] {
    match link.split_once('_') {
        Some(("l", _)) => BLUE,
        Some(("r", _)) => ORANGE,
        _ => GREY,
    }
}

fn message(pose: &Pose) -> PoseMessage {
    PoseMessage { position: Some(vector(pose.position_m)), orientation: Some(quaternion(pose.turn_xyzw)) }
}

fn vector([x, y, z]: [f64; 3]) -> Vector3 {
    Vector3 { x, y, z }
}

fn quaternion([x, y, z, w]: [f64; 4]) -> Quaternion {
    Quaternion { x, y, z, w }
}

#[cfg(test)]
mod tests {
    use sarah_protocol::fixed::Q16;

    use super::*;

    fn trunk_height(telemetry: &Telemetry) -> f64 {
        let scene = Scene::new().expect("the robot's own file");
        let transforms = scene.transforms(Timestamp::new(0, 0), telemetry, None).transforms;
        transforms[0].translation.map_or(f64::NAN, |at| at.z)
    }

    #[test]
    fn without_a_pose_the_robot_stands_on_the_ground() {
        let straight = trunk_height(&Telemetry::default());
        assert!((straight - 0.84).abs() < 1e-6, "{straight}");
        let mut bent = Telemetry::default();
        bent.joints[2] = Q16::lit(-0.05);
        bent.joints[5] = Q16::lit(-0.05);
        assert!((trunk_height(&bent) - 0.79).abs() < 1e-4, "shorter legs, lower trunk");
    }

    #[test]
    fn every_link_hangs_on_the_world_by_a_chain_of_frames() {
        let scene = Scene::new().expect("the robot's own file");
        let transforms = scene.transforms(Timestamp::new(0, 0), &Telemetry::default(), None).transforms;
        for transform in &transforms {
            let parent = &transform.parent_frame_id;
            assert!(parent == WORLD || transforms.iter().any(|other| &other.child_frame_id == parent), "{parent}");
        }
        for entity in scene.look(Timestamp::new(0, 0)).entities {
            assert!(transforms.iter().any(|transform| transform.child_frame_id == entity.frame_id));
        }
    }

    #[test]
    fn a_rod_lies_between_its_ends() {
        for along in [[0.0, 0.0, -0.3], [0.0, 0.0, 0.3], [0.1, -0.2, 0.2]] {
            let length = along.iter().map(|d| d * d).sum::<f64>().sqrt();
            let turned = Pose { turn_xyzw: from_z(along, length), ..Pose::HERE }.point([0.0, 0.0, length]);
            assert!(turned.iter().zip(along).all(|(a, b)| (a - b).abs() < 1e-9), "{turned:?} for {along:?}");
        }
    }
}
