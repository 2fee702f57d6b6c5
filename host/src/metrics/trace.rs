//! What happened within an episode, for figures 8 and 9.

use serde::{Deserialize, Serialize};

/// One instant.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct TraceSample {
    /// Time of the episode, s.
    pub t_s: f32,
    /// Trunk: displacement x (forward) and y (left) from the episode's origin, height z, m.
    pub trunk_m: [f32; 3],
    /// Accelerometer, trunk axes, gravity included, m/s².
    pub accel_m_s2: [f32; 3],
    /// Gyro, trunk axes, rad/s.
    pub gyro_rad_s: [f32; 3],
    /// Factor (eq. 1).
    pub factor: f32,
    /// State of the knee LPG; 0 is idle.
    pub phase: u8,
    /// Contact force: left heel, left toe, right heel, right toe, N.
    pub pads_n: [f32; 4],
    /// Abductors left, right (rad); hips left, right (rad); knees left, right (m).
    pub joints: [f32; 6],
}

/// An episode, sample by sample.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Trace {
    /// Samples in order of time.
    pub samples: Vec<TraceSample>,
}
