//! Where the trunk is, from telemetry alone: what stands in for the simulator's truth on a robot.
//!
//! ```text
//!  telemetry ─► align: every signal of one instant ─► attitude: gyro ─► filter: accelerometer, feet ─► Estimate
//!                                                        ▲  lean, gyro bias   │                         │
//!                                                        └────────────────────┘                judge::Pose, fell
//! ```
//!
//! Legged odometry after Bloesch et al., *State Estimation for Legged Robots*, RSS 2012: the accelerometer carries the
//! trunk from frame to frame, and a foot that stands is a landmark that forward kinematics sees from the trunk. A foot
//! carries from 15 N on; both are used when both do. What the accelerometer contradicts is taken for what it is, a foot that
//! slides. See `filter` for the numbers and `stance` for the feet.
//!
//! The world's axes are the trunk's at the first frame, made level: x forward, y left, z up (REP-103), origin on the ground
//! under the trunk. The ground is taken to be level. Heading is the gyro's alone; its bias is learned while the robot is
//! quiet. Errors and limits are measured in `docs/odometry.md`.
//!
//! [`Odometry::saw`] is total: any frame leaves a finite estimate within ±100 m.

mod align;
mod attitude;
pub mod audit;
mod filter;
mod stance;
mod vector;

use sarah_protocol::telemetry::Telemetry;
use sarah_sim::robot::{FALLEN_HEIGHT, FALLEN_LEAN_RAD, Geometry};

use super::judge::Pose;
pub use align::Ages;
use align::{Aligner, Sample, Seen};
use attitude::Attitude;
use filter::Filter;
use stance::Stance;
use vector::{add, length, scale, sub};

/// A robot outside its alive zone for this long has fallen, s.
pub const FELL_AFTER_S: f32 = 0.1;
/// A robot that has not stood on a foot for this long is being carried, s. Its own flights take 0.1 s.
const CARRIED_AFTER_S: f32 = 0.5;
/// Rotation speed is averaged over about this long, s: it must tell 0.02 rad/s from 0.01 rad/s of noise per axis.
const ROTATION_S: f32 = 0.1;
/// Bound of the position on every axis, m.
const FAR_M: f32 = 100.0;

/// What is known of the trunk, in the episode's frame.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Estimate {
    /// Position, rotation speed and standing height, as the reward takes them.
    pub pose: Pose,
    /// Velocity forward and left, m/s.
    pub velocity_m_s: [f32; 2],
    /// Heading, rad, counterclockwise; counts on past a full turn.
    pub yaw_rad: f32,
    /// Angle between the trunk's z axis and the vertical, rad.
    pub lean_rad: f32,
    /// A foot carries.
    pub standing: bool,
    /// Within the alive zone of [`sarah_sim::robot`]: lean and height.
    pub upright: bool,
    /// It has been outside for [`FELL_AFTER_S`]. Stays until [`Odometry::reset`].
    pub fell: bool,
}

/// Follows the trunk frame by frame.
#[derive(Clone, Debug)]
pub struct Odometry {
    geometry: Geometry,
    ages: Ages,
    aligner: Aligner,
    attitude: Attitude,
    filter: Filter,
    stance: Option<Stance>,
    /// Where the trunk was first, in the filter's frame, m.
    origin_m: Option<[f32; 2]>,
    height_m: f32,
    rate_rad_s: [f32; 3],
    unloaded_s: f32,
    down_s: f32,
    estimate: Estimate,
}

impl Odometry {
    /// Waiting for the first frame of a robot of this shape, with signals as old as the simulated robot's.
    pub fn new(geometry: Geometry) -> Odometry {
        Odometry::with_ages(geometry, Ages::default())
    }

    /// The same for a robot whose signals are of other ages.
    pub fn with_ages(geometry: Geometry, ages: Ages) -> Odometry {
        let pose =
            Pose { position_m: [0.0, 0.0, geometry.standing_m], standing_m: geometry.standing_m, ..Pose::default() };
        Odometry {
            geometry,
            ages,
            aligner: Aligner::default(),
            attitude: Attitude::default(),
            filter: Filter::default(),
            stance: None,
            origin_m: None,
            height_m: geometry.standing_m,
            rate_rad_s: [0.0; 3],
            unloaded_s: 0.0,
            down_s: 0.0,
            estimate: Estimate { pose, upright: true, ..Estimate::default() },
        }
    }

    /// A new episode: where the robot is now becomes the origin. The gyro's bias is kept.
    pub fn reset(&mut self) {
        let attitude = self.attitude.restarted();
        *self = Odometry { attitude, ..Odometry::with_ages(self.geometry, self.ages) };
    }

    /// The newest estimate.
    pub fn estimate(&self) -> Estimate {
        self.estimate
    }

    /// Takes the next frame. Frames may be lost; after a gap too long to bridge the robot is taken to be where it was.
    pub fn saw(&mut self, frame: &Telemetry) -> Estimate {
        match self.aligner.saw(&self.ages, frame) {
            Seen::Again => {}
            Seen::Fresh(sample) => {
                self.attitude.level(sample.up);
                self.filter.halt();
                self.stance = None;
                self.step(&sample);
            }
            Seen::Next(sample) => self.step(&sample),
        }
        self.estimate
    }

    fn step(&mut self, sample: &Sample) {
        let dt_s = sample.dt_s;
        let before = self.attitude.axes();
        let rate = self.attitude.turn(sample);
        if dt_s > 0.0 {
            // The force was measured on the way from one attitude to the other.
            let force = [before, self.attitude.axes()].map(|axes| axes.world(sample.force_m_s2));
            self.filter.predict(dt_s, scale(add(force[0], force[1]), 0.5));
        }
        let stance = Stance::new(&self.geometry, &self.attitude.axes(), sample, self.stance.as_ref());
        for (foot, footing) in stance.feet().into_iter().enumerate() {
            match footing {
                Some(footing) => self.filter.stands(foot, dt_s, footing),
                None => self.filter.lifts(foot),
            }
        }
        let (lean, drift) = self.filter.take_lean();
        self.height_m = stance.height_m().unwrap_or(self.height_m);
        self.unloaded_s = if stance.stands() { 0.0 } else { self.unloaded_s + dt_s };
        // How somebody carries a robot, or puts a fallen one back on its feet, is not for feet to tell, nor a reason to
        // think otherwise of the gyro: the coordinator knows which way is up.
        if self.unloaded_s > CARRIED_AFTER_S || self.estimate.fell {
            self.filter.halt();
            self.attitude.level(sample.up);
        } else {
            self.attitude.correct(lean, drift);
        }
        self.rate_rad_s = add(self.rate_rad_s, scale(sub(rate, self.rate_rad_s), (dt_s / ROTATION_S).min(1.0)));
        self.stance = Some(stance);
        self.conclude(dt_s, stance.stands());
    }

    fn conclude(&mut self, dt_s: f32, standing: bool) {
        let axes = self.attitude.axes();
        // The filter follows the IMU, which sits ahead of the trunk's origin.
        let [dx, dy, dz] = axes.world(self.geometry.imu_m);
        let ([x, y], velocity_m_s) = (self.filter.position_m(), self.filter.velocity_m_s());
        let at_m = [x - dx, y - dy];
        let origin_m = *self.origin_m.get_or_insert(at_m);
        // Everything above is as old as the oldest signal.
        let now = |axis: usize| at_m[axis] - origin_m[axis] + velocity_m_s[axis] * self.ages.of_estimate_s;
        let height_m = self.height_m - dz;
        let lean_rad = axes.lean_rad();
        let upright = lean_rad <= FALLEN_LEAN_RAD && height_m >= FALLEN_HEIGHT * self.geometry.standing_m;
        self.down_s = if upright { 0.0 } else { self.down_s + dt_s };
        self.estimate = Estimate {
            pose: Pose {
                position_m: [now(0), now(1), height_m].map(|metres| metres.clamp(-FAR_M, FAR_M)),
                rotation_rad_s: length(self.rate_rad_s),
                standing_m: self.geometry.standing_m,
            },
            velocity_m_s,
            yaw_rad: self.attitude.yaw_rad(),
            lean_rad,
            standing,
            upright,
            fell: self.estimate.fell || self.down_s > FELL_AFTER_S,
        };
    }
}

#[cfg(test)]
mod tests;
