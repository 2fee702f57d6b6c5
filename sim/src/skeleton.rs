//! The robot's links as a tree, from `assets/sarah.xml`: where each hangs, how its joint moves it, what it looks like.
//! For those who draw the robot or place it in space without simulating it.

use rapier3d_mjcf::mjcf_rs::body::{Body, Geom, GeomType, JointType};
use rapier3d_mjcf::mjcf_rs::model::Model;

use crate::robot::{RobotError, SARAH_MJCF};

/// One link. Metres, radians; axes of the link unless said otherwise.
#[derive(Clone, PartialEq, Debug)]
pub struct Link {
    /// Its body's name in the file.
    pub name: String,
    /// Index of the link it hangs on; `None` for the trunk, which is free.
    pub parent: Option<usize>,
    /// Its origin in the parent's axes with its joint at zero; of the trunk, in the world on straight legs.
    pub at_m: [f64; 3],
    /// How it turns against its parent with its joint at zero: unit quaternion x, y, z, w.
    pub turn_xyzw: [f64; 4],
    /// What moves it; `None` for the trunk.
    pub joint: Option<LinkJoint>,
    /// What it looks like.
    pub shapes: Vec<Shape>,
}

/// A joint of one degree of freedom.
#[derive(Clone, PartialEq, Debug)]
pub struct LinkJoint {
    /// Its name in the file; [`crate::robot::Joint::name`] of a driven one.
    pub name: String,
    /// Unit vector it turns about or slides along.
    pub axis: [f64; 3],
    /// It slides (m) rather than turns (rad).
    pub slides: bool,
    /// Its ends, m or rad.
    pub range: [f64; 2],
}

/// A body's outer form.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Shape {
    /// A box along the link's axes.
    Box {
        /// Its centre.
        at_m: [f64; 3],
        /// Half of its edges.
        half_m: [f64; 3],
    },
    /// A rod with round ends.
    Capsule {
        /// Centre of one end.
        from_m: [f64; 3],
        /// Centre of the other.
        to_m: [f64; 3],
        /// Its radius.
        radius_m: f64,
    },
}

/// The links, parents first: the trunk is the first.
pub fn links() -> Result<Vec<Link>, RobotError> {
    let model = Model::from_str(SARAH_MJCF, ".").map_err(|error| RobotError::Parse(error.to_string()))?;
    // Body 0 is the world.
    model.bodies.iter().skip(1).map(|entry| link(&entry.body, entry.parent)).collect()
}

fn link(body: &Body, parent: Option<usize>) -> Result<Link, RobotError> {
    let name = body.name.clone().unwrap_or_default();
    let mut joint = None;
    for found in &body.joints {
        let slides = match found.type_ {
            JointType::Slide => true,
            JointType::Hinge => false,
            _ => continue,
        };
        if found.pos != [0.0; 3] || joint.is_some() {
            return Err(RobotError::Attribute { name, attribute: "a single joint at the body's origin" });
        }
        let joint_name = found.name.clone().unwrap_or_default();
        let Some(range) = found.range else {
            return Err(RobotError::Attribute { name: joint_name, attribute: "range" });
        };
        joint = Some(LinkJoint { name: joint_name, axis: found.axis, slides, range });
    }
    Ok(Link {
        parent: parent.and_then(|parent| parent.checked_sub(1)),
        at_m: body.pose.translation.to_array(),
        turn_xyzw: body.pose.rotation.to_array(),
        joint,
        shapes: body.geoms.iter().map(|geom| shape(geom, &name)).collect::<Result<_, _>>()?,
        name,
    })
}

fn shape(geom: &Geom, link: &str) -> Result<Shape, RobotError> {
    match (geom.type_, geom.fromto) {
        (GeomType::Box, None) => Ok(Shape::Box { at_m: geom.pose.translation.to_array(), half_m: geom.size }),
        (GeomType::Capsule, Some([a, b, c, d, e, f])) => {
            Ok(Shape::Capsule { from_m: [a, b, c], to_m: [d, e, f], radius_m: geom.size[0] })
        }
        _ => {
            let name = geom.name.clone().unwrap_or_else(|| link.to_owned());
            Err(RobotError::Attribute { name, attribute: "type \"box\", or \"capsule\" with fromto" })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Joint;

    #[test]
    fn every_driven_joint_moves_a_link_that_hangs_on_another() {
        let links = links().expect("the robot's own file");
        assert_eq!((links[0].name.as_str(), links[0].parent), ("trunk", None));
        for (index, link) in links.iter().enumerate().skip(1) {
            assert!(link.parent.is_some_and(|parent| parent < index), "{}", link.name);
        }
        for joint in Joint::ALL {
            let moved = links.iter().filter_map(|link| link.joint.as_ref()).find(|found| found.name == joint.name());
            assert_eq!(moved.map(|found| found.slides), Some(joint.is_linear()), "{}", joint.name());
        }
    }

    #[test]
    fn straight_legs_stand_on_the_ground() {
        let links = links().expect("the robot's own file");
        let sole = |mut index: usize, mut z: f64| {
            while let Some(parent) = links[index].parent {
                z += links[index].at_m[2];
                index = parent;
            }
            z + links[index].at_m[2]
        };
        for (index, link) in links.iter().enumerate().filter(|(_, link)| link.name.ends_with("_toe")) {
            let Shape::Box { at_m, half_m } = link.shapes[0] else { panic!("a pad is a box") };
            assert!(sole(index, at_m[2] - half_m[2]).abs() < 1e-9, "{}", link.name);
        }
    }
}
