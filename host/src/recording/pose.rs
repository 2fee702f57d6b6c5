//! Where something is: a position and a turn.

use sarah_protocol::telemetry::Telemetry;

/// Position and turn of a frame against another.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pose {
    /// Position, m.
    pub position_m: [f64; 3],
    /// Unit quaternion x, y, z, w from this frame's axes into the other's.
    pub turn_xyzw: [f64; 4],
}

impl Pose {
    /// Where the other is.
    pub const HERE: Pose = Pose { position_m: [0.0; 3], turn_xyzw: [0.0, 0.0, 0.0, 1.0] };

    /// Turned by `angle_rad` about a unit vector.
    pub fn turned(axis: [f64; 3], angle_rad: f64) -> Pose {
        let (sin, cos) = (angle_rad * 0.5).sin_cos();
        let [x, y, z] = axis.map(|component| component * sin);
        Pose { turn_xyzw: [x, y, z, cos], ..Pose::HERE }
    }

    /// Moved by `by_m` along a unit vector.
    pub fn moved(axis: [f64; 3], by_m: f64) -> Pose {
        Pose { position_m: axis.map(|component| component * by_m), ..Pose::HERE }
    }

    /// Upright but for this lean, forward and to the left positive, rad; its heading is that of the world.
    pub fn leaning([forward_rad, left_rad]: [f64; 2]) -> Pose {
        // The world's up in this frame's axes; the shortest turn that takes it there has its axis across both.
        let (x, y) = (-forward_rad.sin(), -left_rad.sin());
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        let length = (y * y + x * x + (1.0 + z) * (1.0 + z)).sqrt();
        Pose { turn_xyzw: [y / length, -x / length, 0.0, (1.0 + z) / length], ..Pose::HERE }
    }

    /// Of a trunk that odometry puts at `position_m`, heading `yaw_rad` to the left, and that leans as the robot says.
    pub fn estimated(position_m: [f32; 3], yaw_rad: f32, telemetry: &Telemetry) -> Pose {
        let heading = Pose { position_m: position_m.map(f64::from), ..Pose::turned([0.0, 0.0, 1.0], yaw_rad.into()) };
        heading.then(&Pose::leaning(lean(telemetry)))
    }

    /// A pose against this one, against what this one is against.
    pub fn then(&self, next: &Pose) -> Pose {
        let [ax, ay, az, aw] = self.turn_xyzw;
        let [bx, by, bz, bw] = next.turn_xyzw;
        Pose {
            position_m: self.point(next.position_m),
            turn_xyzw: [
                aw * bx + ax * bw + ay * bz - az * by,
                aw * by - ax * bz + ay * bw + az * bx,
                aw * bz + ax * by - ay * bx + az * bw,
                aw * bw - ax * bx - ay * by - az * bz,
            ],
        }
    }

    /// A point of this frame, m, in the other.
    pub fn point(&self, [px, py, pz]: [f64; 3]) -> [f64; 3] {
        let [x, y, z, w] = self.turn_xyzw;
        // p + 2·q × (q × p + w·p)
        let (tx, ty, tz) = (y * pz - z * py + w * px, z * px - x * pz + w * py, x * py - y * px + w * pz);
        let [ox, oy, oz] = self.position_m;
        [ox + px + 2.0 * (y * tz - z * ty), oy + py + 2.0 * (z * tx - x * tz), oz + pz + 2.0 * (x * ty - y * tx)]
    }
}

/// Lean as the robot says, forward and to the left, rad.
pub(super) fn lean(telemetry: &Telemetry) -> [f64; 2] {
    telemetry.lean.map(|lean| f64::from(lean.to_f32()))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use sarah_protocol::fixed::Q16;

    use super::*;

    fn close(a: [f64; 3], b: [f64; 3]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    #[test]
    fn turns_are_right_handed_and_follow_one_another() {
        let about_z = Pose::turned([0.0, 0.0, 1.0], FRAC_PI_2);
        assert!(close(about_z.point([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]));
        let there = Pose::moved([1.0, 0.0, 0.0], 2.0).then(&about_z).then(&Pose::moved([1.0, 0.0, 0.0], 1.0));
        assert!(close(there.point([0.0, 0.0, 3.0]), [2.0, 1.0, 3.0]));
    }

    #[test]
    fn an_estimated_trunk_leans_towards_where_it_heads() {
        let telemetry = Telemetry { lean: [Q16::lit(0.1), Q16::ZERO], ..Telemetry::default() };
        let trunk = Pose::estimated([1.0, 2.0, 0.8], FRAC_PI_2 as f32, &telemetry);
        let [x, y, z] = trunk.point([0.0, 0.0, 1.0]);
        assert!((x - 1.0).abs() < 1e-6 && (y - 2.1).abs() < 1e-3 && (z - 1.795).abs() < 1e-3, "{x} {y} {z}");
    }

    #[test]
    fn leaning_forward_lowers_what_is_in_front() {
        let forward = Pose::leaning([0.1, 0.0]);
        assert!(close(forward.point([1.0, 0.0, 0.0]), [0.1_f64.cos(), 0.0, -(0.1_f64.sin())]));
        let left = Pose::leaning([0.0, 0.1]);
        assert!(close(left.point([0.0, 1.0, 0.0]), [0.0, 0.1_f64.cos(), -(0.1_f64.sin())]));
    }
}
