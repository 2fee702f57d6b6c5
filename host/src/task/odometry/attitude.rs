//! How the trunk stands, from the gyro; the filter says where that went wrong.
//!
//! The lean in telemetry is not used but to begin with: the coordinator's filter believes the accelerometer, and a push
//! and the steps after it are a lean of 0.01 to 0.03 rad to it, which is 1 to 2.5 cm of trunk. Here the accelerometer is
//! weighed against the feet instead, and the gyro alone carries the attitude over a step.

use super::align::Sample;
use super::vector::{Vector, add, cross, dot, normal, scale, sub};

/// How long the gyro's mean must have been steady before it counts as bias, s.
const QUIET_S: f32 = 0.3;
/// Averaging time of that mean, s.
const MEAN_S: f32 = 0.3;
/// The bias is the mean of all quiet time, and of the last so many seconds at most.
const LEARN_S: f32 = 5.0;
/// Deviation of one sample, rad/s, that ends the quiet: five times its noise.
const UNQUIET_RAD_S: f32 = 0.05;
/// No gyro is off by more, rad/s: 4.6 °/s, with the common parts at 1 °/s.
const BIAS_MAX_RAD_S: f32 = 0.08;

/// Rows of the matrix that turns trunk axes into world axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes([Vector; 3]);

impl Axes {
    /// A trunk in which the world's up is `up`, turned by `yaw_rad` about the vertical.
    fn new(up: Vector, yaw_rad: f32) -> Axes {
        let [x, y, z] = up;
        // The shortest rotation that takes `up` to z; upside down there is none.
        let k = 1.0 / (1.0 + z).max(0.05);
        let forward = [1.0 - k * x * x, -k * x * y, -x];
        let left = [-k * x * y, 1.0 - k * y * y, -y];
        let (sin, cos) = yaw_rad.sin_cos();
        Axes([sub(scale(forward, cos), scale(left, sin)), add(scale(forward, sin), scale(left, cos)), up])
    }

    /// From trunk axes to world axes.
    pub fn world(&self, v: Vector) -> Vector {
        self.0.map(|row| dot(row, v))
    }

    /// From world axes to trunk axes.
    fn trunk(&self, v: Vector) -> Vector {
        let [x, y, z] = self.0;
        add(add(scale(x, v[0]), scale(y, v[1])), scale(z, v[2]))
    }

    /// Angle between the trunk's z axis and the vertical, rad.
    pub fn lean_rad(&self) -> f32 {
        let [x, y, z] = self.0[2];
        x.hypot(y).atan2(z)
    }
}

/// Attitude and gyro bias.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attitude {
    /// World up in trunk axes, length 1.
    up: Vector,
    yaw_rad: f32,
    bias_rad_s: Vector,
    mean_rad_s: Vector,
    quiet_s: f32,
    /// Quiet time the bias was learned from, s.
    learned_s: f32,
}

impl Default for Attitude {
    fn default() -> Self {
        Attitude {
            up: [0.0, 0.0, 1.0],
            yaw_rad: 0.0,
            bias_rad_s: [0.0; 3],
            mean_rad_s: [0.0; 3],
            quiet_s: 0.0,
            learned_s: 0.0,
        }
    }
}

impl Attitude {
    /// Upright and not turned, with the bias learned so far.
    pub fn restarted(&self) -> Attitude {
        Attitude { bias_rad_s: self.bias_rad_s, learned_s: self.learned_s, ..Attitude::default() }
    }

    /// Takes another's word for which way is up.
    pub fn level(&mut self, up: Vector) {
        self.up = up;
    }

    pub fn axes(&self) -> Axes {
        Axes::new(self.up, self.yaw_rad)
    }

    pub fn yaw_rad(&self) -> f32 {
        self.yaw_rad
    }

    /// Turns by what the gyro measured; that rate without its bias, trunk axes, rad/s.
    pub fn turn(&mut self, sample: &Sample) -> Vector {
        let rate = sub(sample.rate_rad_s, self.bias_rad_s);
        self.learn(sample);
        let angle = scale(rate, sample.dt_s);
        // The world turns the other way: Rodrigues' formula with the second-order terms of small angles, then length 1.
        let first = cross(self.up, angle);
        self.up = normal(add(add(self.up, first), scale(cross(first, angle), 0.5)));
        let [x, y, z] = self.up;
        let yaw = angle[2] + (angle[0] * x + angle[1] * y) / (1.0 + z).max(0.05);
        self.yaw_rad += yaw;
        rate
    }

    /// A robot that stands has a gyro that reads its bias. Only about the vertical: the filter knows the others better.
    fn learn(&mut self, sample: &Sample) {
        let away = sub(sample.rate_rad_s, self.mean_rad_s);
        self.mean_rad_s = add(self.mean_rad_s, scale(away, (sample.dt_s / MEAN_S).min(1.0)));
        let unquiet = away.iter().any(|w| w.abs() > UNQUIET_RAD_S)
            || self.mean_rad_s.iter().any(|w| w.abs() > BIAS_MAX_RAD_S)
            || !sample.idle;
        self.quiet_s = if unquiet { 0.0 } else { self.quiet_s + sample.dt_s };
        if self.quiet_s > QUIET_S {
            self.learned_s = (self.learned_s + sample.dt_s).min(LEARN_S);
            let error = sample.rate_rad_s[2] - self.bias_rad_s[2];
            self.bias_rad_s[2] += error * (sample.dt_s / self.learned_s.max(sample.dt_s).max(1e-3));
        }
    }

    /// Takes out errors the filter found: of the lean, rad, and of its rate, rad/s, each towards x and y of the world.
    pub fn correct(&mut self, [x, y]: [f32; 2], [dx, dy]: [f32; 2]) {
        let axes = self.axes();
        self.up = normal(add(self.up, axes.trunk([x, y, 0.0])));
        // Leaning towards x is turning about y.
        let bias = add(self.bias_rad_s, axes.trunk([-dy, dx, 0.0]));
        self.bias_rad_s = bias.map(|w| w.clamp(-BIAS_MAX_RAD_S, BIAS_MAX_RAD_S));
    }
}
