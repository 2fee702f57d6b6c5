//! Where the feet are from the trunk, and which point of them stands.
//!
//! A sole is two pads. A foot that tips does so over the end of a pad, or over its side, and the point it stands on wanders
//! through the sole. So a foot is followed by its increments: each corner of a pad counts by the pad's load, and within the
//! pad by how low it is; the foot's motion past the trunk is that of its corners, by the mean of their shares before and
//! now. While shares stay, increments cancel out; when they move, it rolls.

use sarah_sim::robot::Geometry;

use super::align::Sample;
use super::attitude::Axes;
use super::vector::{Vector, add, scale, sub};

/// A foot carries from this load on, N; the pattern generators take the same.
pub(super) const LOADED_N: f32 = 15.0;
/// Height above the lowest corner at which a corner counts by 1/e, m: a pad's spring gives about as much.
const GIVE_M: f32 = 0.005;

/// A foot that carries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Footing {
    /// From the IMU to where the foot stands, world axes, m.
    pub from_imu_m: Vector,
    /// It carried in the sample before as well.
    pub stood: bool,
}

#[derive(Clone, Copy, Debug)]
struct Foot {
    /// Corners of heel and toe from the IMU, world axes, m.
    corners_m: [[Vector; 4]; 2],
    /// Share of each in what the foot carries.
    shares: [[f32; 4]; 2],
    load_n: f32,
    footing: Option<Footing>,
}

/// Both feet at one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stance {
    feet: [Foot; 2],
}

impl Stance {
    /// The feet of a sample, followed on from the one before.
    pub fn new(geometry: &Geometry, axes: &Axes, sample: &Sample, before: Option<&Stance>) -> Stance {
        let mut joints = sample.joints;
        for (joint, [min, max]) in joints.iter_mut().zip(geometry.ranges()) {
            *joint = joint.clamp(min, max);
        }
        let [a, b, c, d] = geometry.soles_m(joints).map(|pad| pad.map(|m| axes.world(sub(m, geometry.imu_m))));
        let [l, m, n, o] = sample.loads_n;
        let before = before.map(|stance| stance.feet);
        Stance {
            feet: [
                Foot::new([a, b], [l, m], before.as_ref().map(|feet| &feet[0])),
                Foot::new([c, d], [n, o], before.as_ref().map(|feet| &feet[1])),
            ],
        }
    }

    /// Left and right; `None` for a foot that does not carry.
    pub fn feet(&self) -> [Option<Footing>; 2] {
        self.feet.map(|foot| foot.footing)
    }

    /// Whether a foot carries.
    pub fn stands(&self) -> bool {
        self.feet.iter().any(|foot| foot.footing.is_some())
    }

    /// Height of the IMU above the ground under the feet, m; `None` in the air.
    pub fn height_m(&self) -> Option<f32> {
        let carrying = self.feet.iter().filter(|foot| foot.footing.is_some());
        let (moment, load) = carrying
            .fold((0.0, 0.0), |(moment, load), foot| (moment - foot.load_n * foot.middle()[2], load + foot.load_n));
        (load > 0.0).then(|| moment / load)
    }
}

impl Foot {
    fn new(corners_m: [[Vector; 4]; 2], loads_n: [f32; 2], before: Option<&Foot>) -> Foot {
        let load_n = loads_n[0] + loads_n[1];
        let shares = [0, 1].map(|pad| {
            let low_m = corners_m[pad].iter().map(|corner| corner[2]).fold(f32::MAX, f32::min);
            let weights = corners_m[pad].map(|corner| (-(corner[2] - low_m) / GIVE_M).exp());
            // The lowest weighs 1.
            let sum: f32 = weights.iter().sum();
            weights.map(|weight| weight / sum * loads_n[pad] / load_n.max(1.0))
        });
        let mut foot = Foot { corners_m, shares, load_n, footing: None };
        if load_n >= LOADED_N {
            foot.footing = Some(match before.and_then(|before| Some((before, before.footing?))) {
                Some((before, footing)) => {
                    Footing { from_imu_m: add(footing.from_imu_m, foot.moved(before)), stood: true }
                }
                None => Footing { from_imu_m: foot.middle(), stood: false },
            });
        }
        foot
    }

    /// Where the load is, m.
    fn middle(&self) -> Vector {
        let corners = self.corners_m.as_flattened().iter().zip(self.shares.as_flattened());
        corners.fold([0.0; 3], |sum, (corner, share)| add(sum, scale(*corner, *share)))
    }

    /// How far it moved past the trunk since `before`, m.
    fn moved(&self, before: &Foot) -> Vector {
        let corners = self.corners_m.as_flattened().iter().zip(before.corners_m.as_flattened());
        let shares = self.shares.as_flattened().iter().zip(before.shares.as_flattened());
        corners.zip(shares).fold([0.0; 3], |sum, ((now, before), (share, share_before))| {
            add(sum, scale(sub(*now, *before), 0.5 * (share + share_before)))
        })
    }
}
