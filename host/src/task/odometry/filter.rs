//! The Kalman filter: where the IMU is, how fast, what the attitude is wrong by, and where the feet stand.
//!
//! ```text
//!  per axis:  p position   v velocity   θ error of the lean   b error of its rate   f left foot, f right foot
//!    p' = v        v' = a − g·θ        θ' = b                     a: accelerometer in the world, as the attitude has it
//!    foot seen from the IMU = f − p − h·θ                         h: height of the IMU above the foot
//! ```
//!
//! θ > 0 on an axis makes the attitude turn part of gravity that way, and every foot the other way. x and y do not touch and
//! share everything but the state, so one covariance serves both. What is found of θ and b goes back into the attitude after
//! every sample and starts at zero again.
//!
//! **Slip.** Reaction to a leg that swings drags the standing foot, at up to 0.9 m/s in the simulator, and so does landing.
//! The accelerometer knows better over such times. So a foot whose place differs from the expected one by more than
//! [`GATE`] standard deviations is taken to have moved by what it differs.

use super::stance::Footing;

const G0_M_S2: f64 = 9.806_65;
/// Spectral densities are given by the deviation of one sample of 10 ms.
const SAMPLE_S: f64 = 0.01;
/// Accelerometer, m/s²: noise 0.1, and what 100 Hz and alignment cost in a landing.
const FORCE_M_S2: f64 = 0.3;
/// Gyro noise, rad/s.
const GYRO_RAD_S: f64 = 0.01;
/// A standing foot, m: it creeps and rolls.
const CREEP_M: f64 = 0.0001;
/// Forward kinematics, m. Knees are read in steps of 5 mm, of which a lean of 0.1 rad leaves this.
const KINEMATICS_M: f64 = 0.0005;
/// Squared standard deviations that are no slip.
const GATE: f64 = 4.0;
/// What is not known at first: velocity, m/s; lean, rad; gyro bias, rad/s. How much that may wander, rad/s in √s.
const VELOCITY_M_S: f64 = 0.01;
const LEAN_RAD: f64 = 0.03;
const BIAS_RAD_S: f64 = 0.015;
const WANDER_RAD_S: f64 = 0.0002;
/// A foot not seen before, m.
const ANYWHERE_M: f64 = 1.0;
/// Bounds of the state: no such robot is faster or farther, no attitude worse; bounds of what goes back at once.
const FAST_M_S: f64 = 5.0;
const FAR_M: f64 = 100.0;
const LEAN_MAX_RAD: f64 = 0.2;

const P: usize = 0;
const V: usize = 1;
const LEAN: usize = 2;
const RATE: usize = 3;
const FOOT: usize = 4;
const N: usize = 6;

type Matrix = [[f64; N]; N];

/// State of both axes and their covariance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter {
    axes: [[f64; N]; 2],
    covariance: Matrix,
}

impl Default for Filter {
    /// At rest at the origin.
    fn default() -> Self {
        let mut covariance = [[0.0; N]; N];
        let deviations = [0.0, VELOCITY_M_S, LEAN_RAD, BIAS_RAD_S, ANYWHERE_M, ANYWHERE_M];
        for (i, deviation) in deviations.into_iter().enumerate() {
            covariance[i][i] = deviation * deviation;
        }
        Filter { axes: [[0.0; N]; 2], covariance }
    }
}

impl Filter {
    /// Position of the IMU, m.
    pub fn position_m(&self) -> [f32; 2] {
        self.axes.map(|state| state[P] as f32)
    }

    /// Its velocity, m/s.
    pub fn velocity_m_s(&self) -> [f32; 2] {
        self.axes.map(|state| state[V] as f32)
    }

    /// Moves on by a sample with this mean specific force, world axes, m/s².
    pub fn predict(&mut self, dt_s: f32, force_m_s2: [f32; 3]) {
        let dt = f64::from(dt_s);
        for (state, force) in self.axes.iter_mut().zip(force_m_s2) {
            let acceleration = f64::from(force) - G0_M_S2 * state[LEAN];
            state[P] = (state[P] + (state[V] + 0.5 * acceleration * dt) * dt).clamp(-FAR_M, FAR_M);
            state[V] = (state[V] + acceleration * dt).clamp(-FAST_M_S, FAST_M_S);
            state[LEAN] += state[RATE] * dt;
        }
        let mut step = [[0.0; N]; N];
        for (i, row) in step.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        step[P][V] = dt;
        step[P][LEAN] = -0.5 * G0_M_S2 * dt * dt;
        step[V][LEAN] = -G0_M_S2 * dt;
        step[LEAN][RATE] = dt;
        self.covariance = times(&times(&step, &self.covariance), &transposed(&step));
        let force = FORCE_M_S2 * FORCE_M_S2 * SAMPLE_S * dt;
        self.covariance[V][V] += force;
        self.covariance[P][P] += force * dt * dt / 3.0;
        self.covariance[P][V] += force * dt / 2.0;
        self.covariance[V][P] += force * dt / 2.0;
        self.covariance[LEAN][LEAN] += GYRO_RAD_S * GYRO_RAD_S * SAMPLE_S * dt;
        self.covariance[RATE][RATE] += WANDER_RAD_S * WANDER_RAD_S * dt;
    }

    /// A foot no longer stands: nothing is known of where it will.
    pub fn lifts(&mut self, foot: usize) {
        self.uncouple(FOOT + foot, ANYWHERE_M);
    }

    /// A foot stands there.
    pub fn stands(&mut self, foot: usize, dt_s: f32, footing: Footing) {
        let [x, y, z] = footing.from_imu_m.map(f64::from);
        let (at, height) = (FOOT + foot, -z);
        let mut seen = [0.0; N];
        (seen[P], seen[LEAN], seen[at]) = (-1.0, -height, 1.0);
        if footing.stood {
            self.covariance[at][at] += CREEP_M * CREEP_M / SAMPLE_S * f64::from(dt_s);
        } else {
            self.lifts(foot);
            for (state, place) in self.axes.iter_mut().zip([x, y]) {
                state[at] = state[P] + height * state[LEAN] + place;
            }
        }
        let surprise = [0, 1].map(|axis| [x, y][axis] - dot(&seen, &self.axes[axis]));
        let squared = surprise[0] * surprise[0] + surprise[1] * surprise[1];
        if footing.stood && squared > GATE * self.expected(&seen).1 {
            self.covariance[at][at] += squared;
        }
        let (column, variance) = self.expected(&seen);
        let gain = column.map(|c| c / variance);
        for (state, surprise) in self.axes.iter_mut().zip(surprise) {
            for (value, gain) in state.iter_mut().zip(gain) {
                *value += gain * surprise;
            }
        }
        for (row, gain) in self.covariance.iter_mut().zip(gain) {
            for (value, c) in row.iter_mut().zip(column) {
                *value -= gain * c;
            }
        }
        self.tidy();
    }

    /// Hands out the error of the lean, rad, and of its rate, rad/s, and has none any more.
    pub fn take_lean(&mut self) -> ([f32; 2], [f32; 2]) {
        let mut take = |index: usize| {
            [0, 1].map(|axis: usize| {
                let found = std::mem::take(&mut self.axes[axis][index]);
                found.clamp(-LEAN_MAX_RAD, LEAN_MAX_RAD) as f32
            })
        };
        (take(LEAN), take(RATE))
    }

    /// Stops, wherever that is, and looks for both feet anew.
    pub fn halt(&mut self) {
        for state in &mut self.axes {
            state[V] = 0.0;
        }
        self.uncouple(V, VELOCITY_M_S);
        self.uncouple(LEAN, LEAN_RAD);
        self.lifts(0);
        self.lifts(1);
    }

    fn uncouple(&mut self, index: usize, deviation: f64) {
        for other in 0..N {
            self.covariance[index][other] = 0.0;
            self.covariance[other][index] = 0.0;
        }
        self.covariance[index][index] = deviation * deviation;
    }

    /// Covariance of the state with what is seen, and the variance of that.
    fn expected(&self, seen: &[f64; N]) -> ([f64; N], f64) {
        let column = self.covariance.map(|row| dot(&row, seen));
        (column, dot(seen, &column) + KINEMATICS_M * KINEMATICS_M)
    }

    /// Symmetric, and no variance below zero, whatever rounding did.
    fn tidy(&mut self) {
        let other = transposed(&self.covariance);
        for (i, (row, other)) in self.covariance.iter_mut().zip(other).enumerate() {
            for (value, other) in row.iter_mut().zip(other) {
                *value = 0.5 * (*value + other);
            }
            row[i] = row[i].max(1e-12);
        }
    }
}

fn dot(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| a[column][row]))
}

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let b = transposed(b);
    std::array::from_fn(|row| std::array::from_fn(|column| dot(&a[row], &b[column])))
}
