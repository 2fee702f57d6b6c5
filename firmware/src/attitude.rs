//! Which way is up, from gyro and accelerometer, in integers.
//!
//! ```text
//!  gyro ω − bias ──► up += dt·(up × ω) + …(3rd order) ──►(+)──► one Newton step to length 1 ──► up (body frame, Q30)
//!  accel a ───────── only while ||a| − g| < 2 m/s² ── (a/g − up)·dt/τ ┘
//! ```
//!
//! Body axes: x forward, y left, z up. The state is the world's up in body axes, so there is no angle to wrap and no
//! singular pose. The gyro is taken as the mean of the last two samples (trapezoid): at 100 Hz a plain sum lags by 5 ms,
//! which at 2 rad/s is 10 mrad.
//!
//! A push and a step look like a lean to the accelerometer, so it is believed at rest (τ = 0.3 s) and hardly while the
//! trunk moves (3 s). At rest the gyro's mean is learned as its bias, or those 3 s would make a lean of it; and while the
//! gyro is steady, or a bias that has grown past what counts as rest would never be learned again. For the first 0.3 s the
//! gain is 20/s: a robot that starts tilted knows it before it may move.

mod arithmetic;

use core::ops::Range;

use sarah_protocol::bus::{Mode, Motion};
use sarah_protocol::fixed::{Q16, wide};

use arithmetic::{TimeConstant, root, sixth, times};

/// One IMU sample as the sensor gives it, body axes x forward, y left, z up.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct ImuSample {
    /// Specific force; 2048 counts per 9.80665 m/s².
    pub accel: [i16; 3],
    /// Rotation; 16.4 counts per degree per second.
    pub gyro: [i16; 3],
}

/// Longest step integrated at once, µs; a longer gap counts as this much.
pub const MAX_STEP_US: u32 = 20_000;

const ONE: i32 = 1 << 30;
/// rad/s per gyro count.
const RADIANS_PER_COUNT: f64 = core::f64::consts::PI / 180.0 / 16.4;
/// Gyro count · µs → rad in Q30, times 2²⁰.
const ANGLE: i32 = (RADIANS_PER_COUNT * 1e-6 * (1u64 << 50) as f64 + 0.5) as i32;
/// Gyro count → rad/s in Q16, times 2¹⁶.
const RATE: i32 = (RADIANS_PER_COUNT * (1u64 << 32) as f64 + 0.5) as i32;
/// Accelerometer count → m/s² in Q16, times 2⁸.
const ACCELERATION: i32 = (9.80665 / 2048.0 * (1u64 << 24) as f64 + 0.5) as i32;
/// Squared counts between which the accelerometer is believed: g ± 2 m/s².
const GATE: Range<u32> = gate(2.0);
const MOVING: TimeConstant = TimeConstant::us(3_000_000);
const RESTING: TimeConstant = TimeConstant::us(300_000);
const FAST: TimeConstant = TimeConstant::us(50_000);
const FAST_FOR_US: u32 = 300_000;
/// At rest the acceleration is g ± 0.6 m/s² …
const REST_GATE: Range<u32> = gate(0.6);
/// … and the rotation below 0.08 rad/s, in squared counts, …
const REST_GYRO: u32 = (0.08 * 0.08 / (RADIANS_PER_COUNT * RADIANS_PER_COUNT)) as u32;
/// … for this long.
const REST_US: u32 = 100_000;
/// Of the gyro's mean.
const MEAN: TimeConstant = TimeConstant::us(300_000);
/// A gyro is steady within 0.05 rad/s of that mean, in squared counts: a fall passes that at 0.1 rad/s.
const STEADY_GYRO: u32 = (0.05 * 0.05 / (RADIANS_PER_COUNT * RADIANS_PER_COUNT)) as u32;
/// Rest, or steadiness, after which the gyro's bias is learned, and how fast.
const LEARN_AFTER_US: u32 = 300_000;
const LEARNING: TimeConstant = TimeConstant::us(500_000);
/// The largest bias, 0.35 rad/s, in counts · 2¹⁶: the zero-rate tolerance of such parts, 20°/s (MPU-6050, table of gyroscope
/// specifications).
const BIAS_MAX: i32 = (0.35 / RADIANS_PER_COUNT * 65536.0) as i32;
/// The most that one sample may be off bias or mean, 128 counts · 2¹⁶: a robot at rest stays below, and products fit 32
/// bits.
const OFF_MAX: i32 = 1 << 23;
/// Of the slow rate.
const LOW_PASS: TimeConstant = TimeConstant::us(21_200);

/// g ± `spread`, m/s², in squared counts.
const fn gate(spread: f64) -> Range<u32> {
    let (low, high) = (2048.0 - spread * 2048.0 / 9.80665, 2048.0 + spread * 2048.0 / 9.80665);
    (low * low) as u32..(high * high) as u32
}

/// The filter. Same input, same output, bit for bit, on every machine.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Attitude {
    /// World up in body axes, Q30; each at most 1.
    up: [i32; 3],
    /// The gyro sample before, without its bias, counts.
    gyro: [i16; 3],
    /// Of the gyro, counts · 2¹⁶.
    bias: [i32; 3],
    /// Of the gyro over 0.3 s, counts · 2¹⁶.
    mean: [i32; 3],
    /// Time at rest, µs; stops at [`REST_US`].
    rest_us: u32,
    /// Time at rest or with a steady gyro, µs; stops at [`LEARN_AFTER_US`].
    steady_us: u32,
    /// Low-passed \[sagittal, lateral\] rate, rad/s, Q32.
    slow: [i64; 2],
    /// Of that low-pass, with the interval it holds for, µs: a steady clock asks for the same one again and again.
    gain: (u32, i32),
    /// Time since the first sample, µs; stops at [`FAST_FOR_US`].
    age_us: u32,
    started: bool,
}

impl Default for Attitude {
    fn default() -> Self {
        Attitude::new()
    }
}

impl Attitude {
    /// Upright until the first samples say otherwise.
    pub const fn new() -> Self {
        Attitude {
            up: [0, 0, ONE],
            gyro: [0; 3],
            bias: [0; 3],
            mean: [0; 3],
            rest_us: 0,
            steady_us: 0,
            slow: [0; 2],
            gain: (0, 0),
            age_us: 0,
            started: false,
        }
    }

    /// Whether the first 0.3 s of fast convergence are over.
    pub const fn settled(&self) -> bool {
        self.age_us >= FAST_FOR_US
    }

    /// World up in body axes, steps of 2⁻³⁰.
    pub fn up(&self) -> [i32; 3] {
        self.up
    }

    /// What was taken off the newest gyro sample, counts.
    pub fn bias(&self) -> [i16; 3] {
        self.bias.map(|bias| ((bias + (1 << 15)) >> 16) as i16)
    }

    /// Takes `counts` for the gyro's bias: for whoever follows a filter that has learned longer.
    pub fn assume_bias(&mut self, counts: [i16; 3]) {
        self.bias = counts.map(|axis| i32::from(axis) << 16);
    }

    /// Takes a sample `dt_us` after the one before. Sequence and mode of the result are the caller's.
    pub fn update(&mut self, dt_us: u32, sample: &ImuSample) -> Motion {
        let dt_us = dt_us.min(MAX_STEP_US);
        if self.steady_us == LEARN_AFTER_US {
            self.learn(dt_us, sample.gyro);
        }
        let steady = self.steady(dt_us, sample.gyro);
        let gyro = self.unbiased(sample.gyro);
        // The first sample has no interval behind it: it can only tell where gravity is.
        let mut up = match self.started {
            true => self.rotated(dt_us, gyro),
            false => self.up.map(i64::from),
        };
        self.started = true;
        self.gyro = gyro;

        let (squared, turning) = (square(sample.accel), square(gyro));
        let (still, rests) = (REST_GATE.contains(&squared), turning < REST_GYRO);
        self.rest_us = if still & rests { (self.rest_us + dt_us).min(REST_US) } else { 0 };
        self.steady_us = if still & (rests | steady) { (self.steady_us + dt_us).min(LEARN_AFTER_US) } else { 0 };
        if GATE.contains(&squared) {
            let tau = match self.settled() {
                false => FAST,
                true if self.rest_us == REST_US => RESTING,
                true => MOVING,
            };
            correct(&mut up, tau.share(dt_us), sample.accel);
        }
        self.up = normalised(up);
        self.age_us = (self.age_us + dt_us).min(FAST_FOR_US);

        let [wx, wy, _] = gyro;
        let rate = [rate(wy), -rate(wx)];
        if self.gain.0 != dt_us {
            self.gain = (dt_us, low_pass_gain(dt_us));
        }
        let (_, gain) = self.gain;
        for (slow, rate) in self.slow.iter_mut().zip(rate) {
            // Both are rates: 38 bits, of which 23 are left.
            *slow += wide((((i64::from(rate.0) << 16) - *slow) >> 15) as i32, gain) >> 15;
        }
        let [x, y, _] = self.up;
        Motion {
            sequence: 0,
            mode: Mode::Braked,
            acceleration: Q16(((wide(root(squared), ACCELERATION) + (1 << 15)) >> 16) as i32),
            rotation: Q16(((wide(root(turning), RATE) + (1 << 23)) >> 24) as i32),
            rate,
            slow_rate: self.slow.map(|slow| Q16(((slow + (1 << 15)) >> 16) as i32)),
            lean: [arc_sine(-x), arc_sine(-y)],
        }
    }

    fn unbiased(&self, mut gyro: [i16; 3]) -> [i16; 3] {
        for (axis, bias) in gyro.iter_mut().zip(self.bias()) {
            *axis = axis.saturating_sub(bias);
        }
        gyro
    }

    fn learn(&mut self, dt_us: u32, gyro: [i16; 3]) {
        // Q16: at most 2622.
        let gain = LEARNING.share(dt_us) >> 14;
        for (bias, gyro) in self.bias.iter_mut().zip(gyro) {
            *bias = (*bias + share_of(off(gyro, *bias), gain)).clamp(-BIAS_MAX, BIAS_MAX);
        }
    }

    /// Follows the gyro's mean; whether this sample is near it.
    fn steady(&mut self, dt_us: u32, gyro: [i16; 3]) -> bool {
        // Q16: at most 4370.
        let gain = MEAN.share(dt_us) >> 14;
        let mut away = [0; 3];
        for ((away, mean), gyro) in away.iter_mut().zip(&mut self.mean).zip(gyro) {
            let off = off(gyro, *mean);
            *mean += share_of(off, gain);
            *away = (off >> 16) as i16;
        }
        square(away) < STEADY_GYRO
    }

    /// Up, rotated by the mean of two gyro samples: u + u×θ + ½(u×θ)×θ + ⅙((u×θ)×θ)×θ.
    fn rotated(&self, dt_us: u32, gyro: [i16; 3]) -> [i64; 3] {
        let mut theta = [0; 3];
        for ((angle, before), now) in theta.iter_mut().zip(self.gyro).zip(gyro) {
            // Half of the sum of both: one more bit to shift out. At most 0.7 rad.
            *angle = (wide((i32::from(before) + i32::from(now)) * dt_us as i32, ANGLE) >> 21) as i32;
        }
        // With angles of at most 0.7 the first two stay below 2 in every axis, so they fit, and the third below 4.
        let first = cross(self.up, theta).map(|axis| axis as i32);
        let second = cross(first, theta).map(|axis| axis as i32);
        let third = cross(second, theta);
        let mut up = self.up.map(i64::from);
        for (((up, a), b), c) in up.iter_mut().zip(first).zip(second).zip(third) {
            *up += i64::from(a) + i64::from(b / 2) + sixth(c);
        }
        up
    }
}

/// Moves by `gain` (Q30) towards the accelerometer, which at rest reads g upwards.
fn correct(up: &mut [i64; 3], gain: i32, accel: [i16; 3]) {
    for (up, accel) in up.iter_mut().zip(accel) {
        // 2048 counts are g: 11 bits, 19 short of Q30.
        let goal = i64::from(accel) << 19;
        *up += times(goal - *up, gain) >> 30;
    }
}

/// One Newton step towards length 1: u·(3 − u²)/2.
fn normalised(up: [i64; 3]) -> [i32; 3] {
    let one = i64::from(ONE);
    let squared: i64 = up.iter().map(|axis| arithmetic::square(*axis) >> 30).sum();
    let factor = ((3 * one - squared.min(2 * one)) / 2) as i32;
    up.map(|axis| ((times(axis, factor) + one / 2) >> 30).clamp(-one, one) as i32)
}

/// How far a gyro sample is from `from`, counts · 2¹⁶, at most [`OFF_MAX`].
fn off(gyro: i16, from: i32) -> i32 {
    (i32::from(gyro) << 16).saturating_sub(from).clamp(-OFF_MAX, OFF_MAX)
}

/// `off` · `gain`, of Q16 and at most 2¹⁵.
fn share_of(off: i32, gain: i32) -> i32 {
    ((off >> 8) * gain) >> 8
}

fn square(v: [i16; 3]) -> u32 {
    // Three times 2³⁰ at most.
    v.iter().map(|&axis| u32::from(axis.unsigned_abs()) * u32::from(axis.unsigned_abs())).sum()
}

fn cross([ax, ay, az]: [i32; 3], [bx, by, bz]: [i32; 3]) -> [i64; 3] {
    let minor = |a, b, c, d| (wide(a, b) - wide(c, d)) >> 30;
    [minor(ay, bz, az, by), minor(az, bx, ax, bz), minor(ax, by, ay, bx)]
}

fn rate(counts: i16) -> Q16 {
    Q16(((wide(counts.into(), RATE) + (1 << 15)) >> 16) as i32)
}

/// 1 − exp(−dt/τ) in Q30, by its series up to the seventh power: within 1e-5 up to [`MAX_STEP_US`].
fn low_pass_gain(dt_us: u32) -> i32 {
    let x = LOW_PASS.share(dt_us);
    let share_of_x = |sum| (wide(x, sum) >> 30) as i32;
    let mut sum = ONE;
    // x·(1 − x/2·(1 − x/3·(…)))
    for part in arithmetic::SEVENTH_TO_THIRD {
        sum = ONE - part.of(share_of_x(sum));
    }
    share_of_x(ONE - share_of_x(sum) / 2)
}

/// asin by s + s³/6: exact to 0.1 mrad up to 0.25 rad, to 2 mrad up to 0.5 rad.
fn arc_sine(sine: i32) -> Q16 {
    let square = (wide(sine, sine) >> 30) as i32;
    let cube = wide(square, sine) >> 30;
    Q16(((i64::from(sine) + sixth(cube) + (1 << 13)) >> 14) as i32)
}

#[cfg(test)]
mod plain;
#[cfg(test)]
mod tests;
