//! The robot's description for tools that draw a robot from URDF, as ROS does: text on a topic, made from the skeleton.

use std::fmt::Write;

use foxglove::bytes::BufMut;
use foxglove::{Encode, Schema};
use sarah_sim::skeleton::{Link, Shape};

use super::pose::Pose;
use super::scene::{along_z, colour};

/// A ROS 2 string (`std_msgs/msg/String`), which is what such tools look for on `/robot_description`.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Description(pub String);

impl Encode for Description {
    type Error = std::io::Error;

    fn get_schema() -> Option<Schema> {
        Some(Schema::new("std_msgs/msg/String", "ros2msg", &b"string data\n"[..]))
    }

    fn get_message_encoding() -> String {
        "cdr".into()
    }

    fn encode(&self, buffer: &mut impl BufMut) -> Result<(), std::io::Error> {
        // CDR, little-endian; a string's length counts the zero at its end.
        let length = u32::try_from(self.0.len() + 1).map_err(std::io::Error::other)?;
        buffer.put_slice(&[0, 1, 0, 0]);
        buffer.put_u32_le(length);
        buffer.put_slice(self.0.as_bytes());
        buffer.put_u8(0);
        Ok(())
    }
}

impl Description {
    /// Of these links.
    pub fn of(links: &[Link]) -> Description {
        let mut text = String::from("<?xml version=\"1.0\"?>\n<robot name=\"sarah\">\n");
        for link in links {
            let name = &link.name;
            // Writing into a string cannot fail.
            let _ = writeln!(text, "  <link name=\"{name}\">");
            for shape in &link.shapes {
                draw(&mut text, name, shape);
            }
            let _ = writeln!(text, "  </link>");
            let (Some(parent), Some(joint)) = (link.parent.and_then(|parent| links.get(parent)), &link.joint) else {
                continue;
            };
            let kind = if joint.slides { "prismatic" } else { "revolute" };
            let origin = origin(&Pose { position_m: link.at_m, turn_xyzw: link.turn_xyzw });
            let ([x, y, z], [low, high]) = (joint.axis, joint.range);
            let _ = writeln!(
                text,
                "  <joint name=\"{}\" type=\"{kind}\">\n    <parent link=\"{}\"/><child link=\"{name}\"/>{origin}\n    \
                 <axis xyz=\"{x} {y} {z}\"/><limit lower=\"{low}\" upper=\"{high}\" effort=\"0\" velocity=\"0\"/>\n  \
                 </joint>",
                joint.name, parent.name
            );
        }
        text.push_str("</robot>\n");
        Description(text)
    }
}

fn draw(text: &mut String, link: &str, shape: &Shape) {
    let [r, g, b] = colour(link);
    let mut visual = |at: &Pose, geometry: String| {
        let _ = writeln!(
            text,
            "    <visual>{}<geometry><{geometry}/></geometry><material name=\"{link}\"><color rgba=\"{r} {g} {b} 1\"/>\
             </material></visual>",
            origin(at)
        );
    };
    let there = |position_m: [f64; 3]| Pose { position_m, ..Pose::HERE };
    match *shape {
        Shape::Box { at_m, half_m } => {
            let [x, y, z] = half_m.map(|half| 2.0 * half);
            visual(&there(at_m), format!("box size=\"{x} {y} {z}\""));
        }
        Shape::Capsule { from_m, to_m, radius_m } => {
            let (middle, length) = along_z(from_m, to_m);
            visual(&middle, format!("cylinder radius=\"{radius_m}\" length=\"{length}\""));
            for end in [from_m, to_m] {
                visual(&there(end), format!("sphere radius=\"{radius_m}\""));
            }
        }
    }
}

fn origin(pose: &Pose) -> String {
    let ([px, py, pz], [x, y, z, w]) = (pose.position_m, pose.turn_xyzw);
    let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
    let pitch = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin();
    let yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
    format!("<origin xyz=\"{px} {py} {pz}\" rpy=\"{roll} {pitch} {yaw}\"/>")
}

#[cfg(test)]
mod tests {
    use sarah_sim::skeleton;

    use super::*;

    #[test]
    fn every_link_and_joint_of_the_skeleton_is_described() {
        let links = skeleton::links().expect("the robot's own file");
        let Description(text) = Description::of(&links);
        for link in &links {
            assert!(text.contains(&format!("<link name=\"{}\">", link.name)), "{}", link.name);
            let Some(joint) = &link.joint else { continue };
            assert!(text.contains(&format!("<joint name=\"{}\" type=", joint.name)), "{}", joint.name);
        }
        let shapes: usize = links.iter().map(|link| link.shapes.len()).sum();
        // Four rods are drawn as three bodies each.
        assert_eq!(text.matches("<visual>").count(), shapes + 2 * 4);
        assert!(!text.contains("NaN"));
    }

    #[test]
    fn a_string_ends_in_a_zero_that_is_counted() {
        let mut bytes = vec![];
        Description("ab".into()).encode(&mut bytes).expect("a vector has room");
        assert_eq!(bytes, [0, 1, 0, 0, 3, 0, 0, 0, b'a', b'b', 0]);
    }
}
