//! From the robot's truth to what its sensors say.
//!
//! The IMU averages specific force and angular rate over 10 ms before sampling, as a real one's anti-alias filter
//! does, and gives counts: 2048 per g for acceleration (±16 g), 16.4 per °/s for rates (±2000 °/s), the scales of the
//! common MEMS parts. Then noise, a bias per episode, quantisation, saturation, delay.
//!
//! A frame is made at every physics step and stamped with its time; a query returns the newest frame that is old
//! enough. So neither the noise nor the delay depends on how often anybody asks.

use std::collections::VecDeque;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rapier3d::math::{Rotation, Vector};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::plant::Plant;
use crate::robot::{ImuState, Joint};

/// Standard gravity, m/s², the unit of the accelerometer's scale.
pub const G0_M_S2: f32 = 9.80665;
/// Accelerometer counts per g; ±16 g fill an `i16`.
pub const ACCEL_COUNTS_PER_G: f32 = 2048.0;
/// Gyroscope counts per °/s; ±2000 °/s fill an `i16`.
pub const GYRO_COUNTS_PER_DEG_S: f32 = 16.4;
/// Width of the IMU's averaging window, s.
pub const IMU_WINDOW_S: f32 = 0.010;

/// Sensor errors. The default has all of them on; [`SensorConfig::perfect`] has none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SensorConfig {
    /// Accelerometer noise, m/s² rms per axis.
    pub accel_noise_m_s2: f32,
    /// Constant accelerometer offset in trunk axes, m/s².
    pub accel_bias_m_s2: [f32; 3],
    /// Gyroscope noise, rad/s rms per axis.
    pub gyro_noise_rad_s: f32,
    /// Spread of the gyroscope bias, rad/s rms per axis, drawn once per episode.
    pub gyro_bias_rad_s: f32,
    /// Growth of the gyroscope bias in its own direction, rad/s per s rms per axis, 0 to 0.1: a part that warms up.
    pub gyro_bias_growth_rad_s2: f32,
    /// Age of an IMU sample when it can first be read, s, 0 to 0.2.
    pub imu_delay_s: f32,
    /// Pad load noise, N rms.
    pub pad_noise_n: f32,
    /// Pad load resolution, N; 0 for none.
    pub pad_quantum_n: f32,
    /// Age of a pad load when it can first be read, s, 0 to 0.2.
    pub pad_delay_s: f32,
    /// Resolution of the linear actuators' position, m; 0 for none. The paper gives 5 mm.
    pub knee_quantum_m: f32,
    /// Resolution of the rotary encoders, rad; 0 for none (assumption: 1 mrad).
    pub hip_quantum_rad: f32,
    /// Age of a joint position when it can first be read, s, 0 to 0.2.
    pub joint_delay_s: f32,
}

impl Default for SensorConfig {
    fn default() -> Self {
        Self {
            accel_noise_m_s2: 0.1,
            accel_bias_m_s2: [0.0; 3],
            gyro_noise_rad_s: 0.01,
            gyro_bias_rad_s: 0.01,
            gyro_bias_growth_rad_s2: 0.0,
            imu_delay_s: 0.010,
            pad_noise_n: 1.0,
            pad_quantum_n: 0.1,
            pad_delay_s: 0.010,
            knee_quantum_m: 0.005,
            hip_quantum_rad: 0.001,
            joint_delay_s: 0.0,
        }
    }
}

/// A field of [`SensorConfig`] is not finite or out of range.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("sensors.{field} = {value} is out of range; give a finite number from {min} to {max}")]
pub struct SensorError {
    /// Field name.
    pub field: &'static str,
    /// What was given.
    pub value: f32,
    /// Smallest accepted value.
    pub min: f32,
    /// Largest accepted value.
    pub max: f32,
}

impl SensorConfig {
    /// No noise, bias, quantum or delay; the IMU keeps its averaging window and its counts.
    pub fn perfect() -> Self {
        Self {
            accel_noise_m_s2: 0.0,
            accel_bias_m_s2: [0.0; 3],
            gyro_noise_rad_s: 0.0,
            gyro_bias_rad_s: 0.0,
            gyro_bias_growth_rad_s2: 0.0,
            imu_delay_s: 0.0,
            pad_noise_n: 0.0,
            pad_quantum_n: 0.0,
            pad_delay_s: 0.0,
            knee_quantum_m: 0.0,
            hip_quantum_rad: 0.0,
            joint_delay_s: 0.0,
        }
    }

    /// Checks every field against its range.
    pub fn validate(&self) -> Result<(), SensorError> {
        let [x, y, z] = self.accel_bias_m_s2;
        let fields = [
            ("accel_noise_m_s2", self.accel_noise_m_s2, 0.0, 10.0),
            ("accel_bias_m_s2", x, -10.0, 10.0),
            ("accel_bias_m_s2", y, -10.0, 10.0),
            ("accel_bias_m_s2", z, -10.0, 10.0),
            ("gyro_noise_rad_s", self.gyro_noise_rad_s, 0.0, 1.0),
            ("gyro_bias_rad_s", self.gyro_bias_rad_s, 0.0, 1.0),
            ("gyro_bias_growth_rad_s2", self.gyro_bias_growth_rad_s2, 0.0, 0.1),
            ("imu_delay_s", self.imu_delay_s, 0.0, 0.2),
            ("pad_noise_n", self.pad_noise_n, 0.0, 100.0),
            ("pad_quantum_n", self.pad_quantum_n, 0.0, 100.0),
            ("pad_delay_s", self.pad_delay_s, 0.0, 0.2),
            ("knee_quantum_m", self.knee_quantum_m, 0.0, 0.05),
            ("hip_quantum_rad", self.hip_quantum_rad, 0.0, 0.1),
            ("joint_delay_s", self.joint_delay_s, 0.0, 0.2),
        ];
        for (field, value, min, max) in fields {
            if !(min..=max).contains(&value) {
                return Err(SensorError { field, value, min, max });
            }
        }
        Ok(())
    }
}

/// What the IMU's registers hold, in trunk axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ImuCounts {
    /// Specific force x, y, z: [`ACCEL_COUNTS_PER_G`] each g, so z reads about +2048 at rest.
    pub accel: [i16; 3],
    /// Angular rate x, y, z: [`GYRO_COUNTS_PER_DEG_S`] each °/s.
    pub gyro: [i16; 3],
}

impl ImuCounts {
    /// Rounds and saturates physical values to counts.
    pub fn from_si(accel_m_s2: [f32; 3], gyro_rad_s: [f32; 3]) -> Self {
        // A float-to-integer cast saturates.
        Self {
            accel: accel_m_s2.map(|a| (a / G0_M_S2 * ACCEL_COUNTS_PER_G).round() as i16),
            gyro: gyro_rad_s.map(|w| (w.to_degrees() * GYRO_COUNTS_PER_DEG_S).round() as i16),
        }
    }

    /// Specific force, m/s².
    pub fn accel_m_s2(&self) -> [f32; 3] {
        self.accel.map(|counts| f32::from(counts) / ACCEL_COUNTS_PER_G * G0_M_S2)
    }

    /// Angular rate, rad/s.
    pub fn gyro_rad_s(&self) -> [f32; 3] {
        self.gyro.map(|counts| (f32::from(counts) / GYRO_COUNTS_PER_DEG_S).to_radians())
    }
}

/// Everything measured at one physics step.
#[derive(Debug, Clone, Copy)]
struct Frame {
    time_us: u64,
    imu: ImuCounts,
    pads_n: [f32; 4],
    joints: [f32; 6],
}

/// The robot's sensors over one episode.
#[derive(Debug, Clone)]
pub struct Sensors {
    config: SensorConfig,
    rng: Pcg64Mcg,
    gyro_bias_rad_s: [f32; 3],
    gyro_bias_growth_rad_s2: [f32; 3],
    /// Body-frame specific force and rate of the last [`IMU_WINDOW_S`], newest last.
    window: VecDeque<(Vector, Vector)>,
    last: Option<ImuState>,
    /// Newest last; the front is kept until nothing can ask for it.
    frames: VecDeque<Frame>,
}

fn micros(seconds: f64) -> u64 {
    (seconds * 1e6).round() as u64
}

fn quantise(value: f32, quantum: f32) -> f32 {
    if quantum > 0.0 { (value / quantum).round() * quantum } else { value }
}

impl Sensors {
    /// Sensors of one episode; `seed` fixes the gyroscope bias and all noise.
    pub fn new(config: &SensorConfig, seed: u64) -> Result<Self, SensorError> {
        config.validate()?;
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let direction = [(); 3].map(|()| normal(&mut rng));
        Ok(Self {
            config: config.clone(),
            rng,
            gyro_bias_rad_s: direction.map(|axis| config.gyro_bias_rad_s * axis),
            gyro_bias_growth_rad_s2: direction.map(|axis| config.gyro_bias_growth_rad_s2 * axis),
            window: VecDeque::new(),
            last: None,
            frames: VecDeque::new(),
        })
    }

    /// Measures the robot. Call once before the first step (so that a first frame exists) and after every one.
    pub fn observe(&mut self, robot: &dyn Plant) {
        let imu = robot.imu();
        self.observe_imu(&imu, robot.dt_s(), robot.gravity_m_s2());
        let mean = self.window_mean();
        let (accel, gyro) = (mean.0.to_array(), mean.1.to_array());
        let bias = self.gyro_bias_rad_s(robot.time_s() as f32);
        let mut noise = |rms: f32| rms * normal(&mut self.rng);
        let config = &self.config;
        let accel = [0, 1, 2].map(|i| accel[i] + config.accel_bias_m_s2[i] + noise(config.accel_noise_m_s2));
        let gyro = [0, 1, 2].map(|i| gyro[i] + bias[i] + noise(config.gyro_noise_rad_s));
        let pads_n = robot.pad_loads_n().map(|n| {
            let measured_n = n + noise(config.pad_noise_n);
            quantise(measured_n, config.pad_quantum_n)
        });
        let joints = Joint::ALL.map(|joint| {
            let quantum = if joint.is_linear() { config.knee_quantum_m } else { config.hip_quantum_rad };
            quantise(robot.joint(joint).position, quantum)
        });
        let frame = Frame { time_us: micros(robot.time_s()), imu: ImuCounts::from_si(accel, gyro), pads_n, joints };
        self.push(frame);
    }

    /// The gyroscope's bias `time_s` after power-up, or after somebody put the robot back on its feet.
    fn gyro_bias_rad_s(&self, time_s: f32) -> [f32; 3] {
        [0, 1, 2].map(|i| self.gyro_bias_rad_s[i] + self.gyro_bias_growth_rad_s2[i] * time_s)
    }

    fn observe_imu(&mut self, now: &ImuState, dt_s: f32, gravity_m_s2: f32) {
        let to_body = Rotation::from_array(now.rotation_xyzw).inverse();
        let velocity = Vector::from_array(now.velocity_m_s);
        let before = self.last.map_or(velocity, |last| Vector::from_array(last.velocity_m_s));
        // An accelerometer feels what holds it up: acceleration minus gravity.
        let force = (velocity - before) / dt_s + Vector::Z * gravity_m_s2;
        self.window.push_back((to_body * force, to_body * Vector::from_array(now.angular_velocity_rad_s)));
        let length = (IMU_WINDOW_S / dt_s).round().max(1.0) as usize;
        while self.window.len() > length {
            self.window.pop_front();
        }
        self.last = Some(*now);
    }

    fn window_mean(&self) -> (Vector, Vector) {
        let mut sum = (Vector::ZERO, Vector::ZERO);
        for (force, rate) in &self.window {
            sum.0 += *force;
            sum.1 += *rate;
        }
        let n = self.window.len().max(1) as f32;
        (sum.0 / n, sum.1 / n)
    }

    fn push(&mut self, frame: Frame) {
        self.frames.push_back(frame);
        let c = &self.config;
        let longest_s = c.imu_delay_s.max(c.pad_delay_s).max(c.joint_delay_s);
        let oldest_us = frame.time_us.saturating_sub(micros(f64::from(longest_s)));
        while self.frames.get(1).is_some_and(|second| second.time_us <= oldest_us) {
            self.frames.pop_front();
        }
    }

    /// Newest frame made at least `delay_s` before `now_s`; the first one while there is none so old.
    fn at(&self, now_s: f64, delay_s: f32) -> Option<&Frame> {
        let latest_us = micros(now_s).checked_sub(micros(f64::from(delay_s)));
        let old_enough = |frame: &&Frame| latest_us.is_some_and(|latest| frame.time_us <= latest);
        self.frames.iter().rev().find(old_enough).or(self.frames.front())
    }

    /// IMU registers at `now_s`, which must not be before the last observation; zeros before the first one.
    pub fn imu(&self, now_s: f64) -> ImuCounts {
        self.at(now_s, self.config.imu_delay_s).map_or_else(ImuCounts::default, |f| f.imu)
    }

    /// Pad loads at `now_s`, N: left heel, left toe, right heel, right toe. Noise makes an unloaded pad read slightly
    /// below zero at times.
    pub fn pads_n(&self, now_s: f64) -> [f32; 4] {
        self.at(now_s, self.config.pad_delay_s).map_or([0.0; 4], |f| f.pads_n)
    }

    /// Joint positions at `now_s` in [`Joint`] order, m for knees and rad for the others.
    pub fn joints(&self, now_s: f64) -> [f32; 6] {
        self.at(now_s, self.config.joint_delay_s).map_or([0.0; 6], |f| f.joints)
    }
}

fn normal(rng: &mut Pcg64Mcg) -> f32 {
    StandardNormal.sample(rng)
}

#[cfg(test)]
mod tests;
