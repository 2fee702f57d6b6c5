//! The robot's measures, for whoever has no simulator: where the joints are, where the soles are.
//!
//! Read from the same file the simulator loads, so that a length is written down once.

use rapier3d_mjcf::mjcf_rs::model::Model as Mjcf;

use super::model::{PADS, SARAH_MJCF, missing, site};
use super::{Joint, RobotError};
use crate::skeleton::{self, Shape};

/// A driven joint: where it is in the frame before it, and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Link {
    at_m: [f32; 3],
    axis: [f32; 3],
    /// Along the axis, m, rather than about it, rad.
    slides: bool,
    range: [f32; 2],
}

/// A leg: abductor, hip, knee, then the soles of its two pads.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    links: [Link; 3],
    /// Lower corners of heel and toe pad in the frame of the lower leg, springs unloaded, m.
    soles_m: [[[f32; 3]; 4]; 2],
}

/// Measures of the robot in `assets/sarah.xml`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    /// Left, right.
    legs: [Leg; 2],
    /// Where the IMU sits in the trunk's frame, m.
    pub imu_m: [f32; 3],
    /// Height of the trunk's frame above the ground on straight legs, m.
    pub standing_m: f32,
    /// Gravity, m/s², downward positive.
    pub gravity_m_s2: f32,
}

impl Geometry {
    /// Reads the file.
    pub fn load() -> Result<Geometry, RobotError> {
        let mjcf = Mjcf::from_str(SARAH_MJCF, ".").map_err(|error| RobotError::Parse(error.to_string()))?;
        let links = skeleton::links()?;
        let trunk = links.first().ok_or_else(|| missing("body", "trunk"))?;
        let [left_heel, left_toe, right_heel, right_toe] = PADS;
        Ok(Geometry {
            legs: [
                leg(&links, [left_heel, left_toe], [Joint::LeftAbductor, Joint::LeftHip, Joint::LeftKnee])?,
                leg(&links, [right_heel, right_toe], [Joint::RightAbductor, Joint::RightHip, Joint::RightKnee])?,
            ],
            imu_m: site(&mjcf, "imu")?.to_array(),
            standing_m: trunk.at_m[2] as f32,
            gravity_m_s2: -mjcf.option.gravity[2] as f32,
        })
    }

    /// Lower corners of the four pads in the trunk's frame, m: left heel, left toe, right heel, right toe. `joints` as in
    /// [`Joint::ALL`], m for knees and rad for the others. A pad's own travel, 4 mm at most, is not in it.
    pub fn soles_m(&self, joints: [f32; 6]) -> [[[f32; 3]; 4]; 4] {
        let [a, b, c, d, e, f] = joints;
        let [[left_heel, left_toe], [right_heel, right_toe]] =
            [self.legs[0].soles_m([a, b, c]), self.legs[1].soles_m([d, e, f])];
        [left_heel, left_toe, right_heel, right_toe]
    }

    /// Smallest and largest position of each driven joint, m for knees and rad for the others.
    pub fn ranges(&self) -> [[f32; 2]; 6] {
        Joint::ALL.map(|joint| self.legs[usize::from(!joint.is_left())].links[joint as usize % 3].range)
    }
}

impl Leg {
    fn soles_m(&self, joints: [f32; 3]) -> [[[f32; 3]; 4]; 2] {
        self.soles_m.map(|pad| {
            pad.map(|corner| {
                // From the foot up: each link moves the point in its own frame, then stands in the one before.
                let links = self.links.iter().zip(joints).rev();
                links.fold(corner, |point, (link, position)| add(link.at_m, link.moved(point, position)))
            })
        })
    }
}

impl Link {
    fn moved(&self, point: [f32; 3], position: f32) -> [f32; 3] {
        match self.slides {
            true => add(point, self.axis.map(|a| a * position)),
            // Rodrigues: p cos + (axis × p) sin + axis (axis · p)(1 − cos).
            false => {
                let (sin, cos) = position.sin_cos();
                let [x, y, z] = self.axis;
                let [px, py, pz] = point;
                let along = (x * px + y * py + z * pz) * (1.0 - cos);
                let across = [y * pz - z * py, z * px - x * pz, x * py - y * px];
                [0, 1, 2].map(|i| point[i] * cos + across[i] * sin + self.axis[i] * along)
            }
        }
    }
}

fn leg(links: &[skeleton::Link], pads: [&str; 2], joints: [Joint; 3]) -> Result<Leg, RobotError> {
    let [abductor, hip, knee] = joints.map(|joint| link(links, joint.name()));
    let [heel, toe] = pads.map(|pad| sole(links, pad));
    Ok(Leg { links: [abductor?, hip?, knee?], soles_m: [heel?, toe?] })
}

fn link(links: &[skeleton::Link], name: &str) -> Result<Link, RobotError> {
    let moved =
        |link: &skeleton::Link| link.joint.clone().filter(|joint| joint.name == name).map(|joint| (link.at_m, joint));
    let (at_m, joint) = links.iter().find_map(moved).ok_or_else(|| missing("joint", name))?;
    let [at_m, axis] = [at_m, joint.axis].map(|vector| vector.map(|a| a as f32));
    Ok(Link { at_m, axis, slides: joint.slides, range: joint.range.map(|end| end as f32) })
}

fn sole(links: &[skeleton::Link], name: &str) -> Result<[[f32; 3]; 4], RobotError> {
    let pad = links.iter().find(|link| link.name == name).ok_or_else(|| missing("body", name))?;
    let Some(Shape::Box { at_m, half_m }) = pad.shapes.first() else { return Err(missing("box of", name)) };
    let middle = add(pad.at_m.map(|a| a as f32), at_m.map(|a| a as f32));
    let [x, y, z] = half_m.map(|half| half as f32);
    Ok([[x, y, -z], [x, -y, -z], [-x, y, -z], [-x, -y, -z]].map(|corner| add(middle, corner)))
}

fn add(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
