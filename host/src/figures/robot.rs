//! The robot as boxes: forward kinematics for pictures. Sizes are those of the simulated robot (our assumptions).

use serde::{Deserialize, Serialize};

/// The robot at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Time of the episode, s.
    pub t_s: f32,
    /// Centre of the trunk (the origin of its body): forward, left, up, m.
    pub trunk_m: [f32; 3],
    /// Orientation of the trunk: x, y, z, w.
    pub trunk_quat: [f32; 4],
    /// Abductors left, right (rad about forward: positive moves the foot to the left); hips left, right (rad,
    /// positive moves the foot forward); knees left, right (m, positive is longer).
    pub joints: [f32; 6],
    /// Contact force: left heel, left toe, right heel, right toe, N.
    pub pads_n: [f32; 4],
}

/// What a box belongs to; it decides the colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Trunk,
    Upper,
    Lower,
    Foot { loaded: bool },
}

/// A box in space: its eight corners, bit 0 of the index along x, bit 1 along y, bit 2 along z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Block {
    pub part: Part,
    pub corners: [[f64; 3]; 8],
}

const TRUNK_HALF: [f64; 3] = [0.13, 0.15, 0.16];
const HIP_BELOW_TRUNK: f64 = 0.12;
const HIP_SIDE: f64 = 0.12;
const LEG: f64 = 0.72;
const HEEL: f64 = 0.13;
const TOE: f64 = 0.18;
const FOOT_HALF_WIDTH: f64 = 0.07;
const LOADED_N: f32 = 15.0;

/// Height of the trunk's centre when the robot stands straight, m.
#[cfg(test)]
const STANDING: f64 = LEG + HIP_BELOW_TRUNK;

/// The robot's boxes in the world.
pub(super) fn blocks(pose: &Pose) -> Vec<Block> {
    let trunk = Frame { rotation: matrix(pose.trunk_quat), origin: pose.trunk_m.map(f64::from) };
    let mut blocks = vec![trunk.block(Part::Trunk, [0.0, 0.0, 0.04], TRUNK_HALF)];
    for side in 0..2 {
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let [abductor, hip, knee] = [side, 2 + side, 4 + side].map(|joint| f64::from(pose.joints[joint]));
        let leg = trunk.moved([0.0, sign * HIP_SIDE, -HIP_BELOW_TRUNK]).turned(about_x(abductor)).turned(about_y(-hip));
        let length = LEG + knee;
        blocks.push(leg.block(Part::Upper, [0.0, 0.0, -0.19], [0.055, 0.045, 0.19]));
        // The lower leg slides in the upper one: its length stays, its place changes.
        blocks.push(leg.block(Part::Lower, [0.0, 0.0, -length + 0.24], [0.035, 0.03, 0.20]));
        let loaded = [2 * side, 2 * side + 1].iter().any(|&pad| pose.pads_n[pad] > LOADED_N);
        let foot = |part, from: f64, to: f64| {
            let centre = [(from + to) / 2.0, 0.0, -length + 0.02];
            leg.block(part, centre, [(to - from) / 2.0, FOOT_HALF_WIDTH, 0.02])
        };
        blocks.push(foot(Part::Foot { loaded }, -HEEL, 0.0));
        blocks.push(foot(Part::Foot { loaded }, 0.004, TOE));
    }
    blocks
}

type Matrix = [[f64; 3]; 3];

#[derive(Clone, Copy)]
struct Frame {
    rotation: Matrix,
    origin: [f64; 3],
}

impl Frame {
    fn point(&self, local: [f64; 3]) -> [f64; 3] {
        let turned = apply(&self.rotation, local);
        std::array::from_fn(|axis| self.origin[axis] + turned[axis])
    }
    fn moved(&self, local: [f64; 3]) -> Self {
        Self { origin: self.point(local), ..*self }
    }
    fn turned(&self, by: Matrix) -> Self {
        let columns: [[f64; 3]; 3] =
            std::array::from_fn(|column| apply(&self.rotation, std::array::from_fn(|row| by[row][column])));
        Self { rotation: std::array::from_fn(|row| std::array::from_fn(|column| columns[column][row])), ..*self }
    }
    fn block(&self, part: Part, centre: [f64; 3], half: [f64; 3]) -> Block {
        let corner = |index: usize| {
            self.point(std::array::from_fn(|axis| {
                centre[axis] + if index >> axis & 1 == 1 { half[axis] } else { -half[axis] }
            }))
        };
        Block { part, corners: std::array::from_fn(corner) }
    }
}

fn apply(matrix: &Matrix, v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|row| matrix[row][0] * v[0] + matrix[row][1] * v[1] + matrix[row][2] * v[2])
}

fn about_x(angle: f64) -> Matrix {
    let (s, c) = angle.sin_cos();
    [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
}

fn about_y(angle: f64) -> Matrix {
    let (s, c) = angle.sin_cos();
    [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
}

fn matrix(quat: [f32; 4]) -> Matrix {
    let [x, y, z, w] = quat.map(f64::from);
    let norm = (x * x + y * y + z * z + w * w).sqrt();
    // A quaternion that is none is drawn upright rather than not at all.
    let [x, y, z, w] = if norm > 1e-6 { [x, y, z, w].map(|part| part / norm) } else { [0.0, 0.0, 0.0, 1.0] };
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn foot_centre(joints: [f32; 6]) -> [f64; 3] {
        let pose = Pose {
            t_s: 0.0,
            trunk_m: [0.0, 0.0, STANDING as f32],
            trunk_quat: [0.0, 0.0, 0.0, 1.0],
            joints,
            pads_n: [0.0; 4],
        };
        let heel = blocks(&pose)[3];
        std::array::from_fn(|axis| heel.corners.iter().map(|corner| corner[axis]).sum::<f64>() / 8.0)
    }

    #[test]
    fn standing_straight_the_soles_are_on_the_ground() {
        let [_, y, z] = foot_centre([0.0; 6]);
        assert!((y - 0.12).abs() < 1e-6 && (z - 0.02).abs() < 1e-6);
    }

    #[test]
    fn joints_move_the_foot_where_they_say() {
        let [x, y, z] = foot_centre([0.0; 6]);
        assert!(foot_centre([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])[1] > y + 0.1, "abductor: to the left");
        assert!(foot_centre([0.0, 0.0, 0.3, 0.0, 0.0, 0.0])[0] > x + 0.1, "hip: forward");
        assert!(foot_centre([0.0, 0.0, 0.0, 0.0, -0.05, 0.0])[2] > z + 0.04, "knee: shorter is higher");
    }
}
