//! Which way is up, from gyro and accelerometer, in integers.
//!
//! ```text
//!  gyro ω ──► up += dt·(up × ω) + …(3rd order) ──►(+)──► one Newton step to length 1 ──► up (body frame, Q30)
//!  accel a ── only while ||a| − g| < 2 m/s² ─ (a/g − up)·dt/τ ┘
//! ```
//!
//! Body axes: x forward, y left, z up. The state is the world's up in body axes, so there is no angle to wrap and no
//! singular pose. τ = 0.5 s; for the first 0.3 s the gain is 20/s, so that a robot that starts tilted knows it before it
//! may move. The gyro is taken as the mean of the last two samples (trapezoid): at 100 Hz a plain sum lags by 5 ms,
//! which at 2 rad/s is 10 mrad.

use sarah_protocol::bus::{Mode, Motion};
use sarah_protocol::fixed::Q16;

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

const ONE: i64 = 1 << 30;
/// rad/s per gyro count.
const RADIANS_PER_COUNT: f64 = core::f64::consts::PI / 180.0 / 16.4;
/// Gyro count · µs → rad in Q30, times 2²⁰.
const ANGLE: i64 = (RADIANS_PER_COUNT * 1e-6 * (1u64 << 50) as f64 + 0.5) as i64;
/// Gyro count → rad/s in Q16, times 2¹⁶.
const RATE: i64 = (RADIANS_PER_COUNT * (1u64 << 32) as f64 + 0.5) as i64;
/// Accelerometer count → m/s² in Q16, times 2⁸.
const ACCELERATION: u64 = (9.80665 / 2048.0 * (1u64 << 24) as f64 + 0.5) as u64;
/// Squared counts between which the accelerometer is believed: g ± 2 m/s².
const GATE: core::ops::Range<u32> = gate(9.80665 - 2.0)..gate(9.80665 + 2.0);
const SLOW_US: i64 = 500_000;
const FAST_US: i64 = 50_000;
const FAST_FOR_US: u32 = 300_000;
/// Time constant of the slow rate, µs.
const RATE_US: i64 = 21_200;

const fn gate(acceleration: f64) -> u32 {
    let counts = acceleration * 2048.0 / 9.80665;
    (counts * counts) as u32
}

/// The filter. Same input, same output, bit for bit, on every machine.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Attitude {
    /// World up in body axes, Q30.
    up: [i64; 3],
    /// The gyro sample before, counts.
    gyro: [i16; 3],
    /// Low-passed \[sagittal, lateral\] rate, rad/s, Q32.
    slow: [i64; 2],
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
        Attitude { up: [0, 0, ONE], gyro: [0; 3], slow: [0; 2], age_us: 0, started: false }
    }

    /// Whether the first 0.3 s of fast convergence are over.
    pub const fn settled(&self) -> bool {
        self.age_us >= FAST_FOR_US
    }

    /// World up in body axes, steps of 2⁻³⁰.
    pub fn up(&self) -> [i32; 3] {
        self.up.map(|axis| axis as i32)
    }

    /// Takes a sample `dt_us` after the one before. Sequence and mode of the result are the caller's.
    pub fn update(&mut self, dt_us: u32, sample: &ImuSample) -> Motion {
        let dt_us = dt_us.min(MAX_STEP_US);
        // The first sample has no interval behind it: it can only tell where gravity is.
        if self.started {
            self.rotate(dt_us, self.gyro, sample.gyro);
        }
        self.started = true;
        self.gyro = sample.gyro;

        let squared = square(sample.accel);
        if GATE.contains(&squared) {
            let tau = if self.settled() { SLOW_US } else { FAST_US };
            self.correct(i64::from(dt_us) * ONE / tau, sample.accel);
        }
        self.normalise();
        self.age_us = (self.age_us + dt_us).min(FAST_FOR_US);

        let [wx, wy, _] = sample.gyro;
        let rate = [rate(wy), -rate(wx)];
        let gain = low_pass_gain(dt_us);
        for (slow, rate) in self.slow.iter_mut().zip(rate) {
            *slow += ((((i64::from(rate.0) << 16) - *slow) >> 15) * gain) >> 15;
        }
        let [x, y, _] = self.up;
        Motion {
            sequence: 0,
            mode: Mode::Braked,
            acceleration: Q16((((u64::from(squared) << 16).isqrt() * ACCELERATION + (1 << 15)) >> 16) as i32),
            rotation: Q16((((u64::from(square(sample.gyro)) << 16).isqrt() as i64 * RATE + (1 << 23)) >> 24) as i32),
            rate,
            slow_rate: self.slow.map(|slow| Q16(((slow + (1 << 15)) >> 16) as i32)),
            lean: [arc_sine(-x), arc_sine(-y)],
        }
    }

    /// Rotates by the mean of two gyro samples: u + u×θ + ½(u×θ)×θ + ⅙((u×θ)×θ)×θ.
    fn rotate(&mut self, dt_us: u32, before: [i16; 3], now: [i16; 3]) {
        let mut theta = [0i64; 3];
        for ((angle, a), b) in theta.iter_mut().zip(before).zip(now) {
            // Half of the sum of both: one more bit to shift out.
            *angle = ((i64::from(a) + i64::from(b)) * i64::from(dt_us) * ANGLE) >> 21;
        }
        let first = cross(self.up, theta);
        let second = cross(first, theta);
        let third = cross(second, theta);
        for (((up, a), b), c) in self.up.iter_mut().zip(first).zip(second).zip(third) {
            *up += a + b / 2 + c / 6;
        }
    }

    /// Moves by `gain` (Q30) towards the accelerometer, which at rest reads g upwards.
    fn correct(&mut self, gain: i64, accel: [i16; 3]) {
        for (up, accel) in self.up.iter_mut().zip(accel) {
            // 2048 counts are g: 11 bits, 19 short of Q30.
            let goal = i64::from(accel) << 19;
            *up += ((goal - *up) * gain) >> 30;
        }
    }

    /// One Newton step towards length 1: u·(3 − u²)/2.
    fn normalise(&mut self) {
        let squared: i64 = self.up.iter().map(|axis| (axis * axis) >> 30).sum();
        let factor = (3 * ONE - squared.min(2 * ONE)) / 2;
        for axis in &mut self.up {
            *axis = ((*axis * factor + (ONE / 2)) >> 30).clamp(-ONE, ONE);
        }
    }
}

fn square(v: [i16; 3]) -> u32 {
    // Three times 2³⁰ at most.
    v.iter().map(|&axis| u32::from(axis.unsigned_abs()) * u32::from(axis.unsigned_abs())).sum()
}

fn cross([ax, ay, az]: [i64; 3], [bx, by, bz]: [i64; 3]) -> [i64; 3] {
    [(ay * bz - az * by) >> 30, (az * bx - ax * bz) >> 30, (ax * by - ay * bx) >> 30]
}

fn rate(counts: i16) -> Q16 {
    Q16(((i64::from(counts) * RATE + (1 << 15)) >> 16) as i32)
}

/// 1 − exp(−dt/τ) in Q30, by its series up to the seventh power: within 1e-5 up to [`MAX_STEP_US`].
fn low_pass_gain(dt_us: u32) -> i64 {
    let x = i64::from(dt_us) * ONE / RATE_US;
    let mut sum = ONE;
    let mut k = 7;
    // x·(1 − x/2·(1 − x/3·(…)))
    while k > 1 {
        sum = ONE - ((x * sum) >> 30) / k;
        k -= 1;
    }
    (x * sum) >> 30
}

/// asin by s + s³/6: exact to 0.1 mrad up to 0.25 rad, to 2 mrad up to 0.5 rad.
fn arc_sine(sine: i64) -> Q16 {
    let cube = (((sine * sine) >> 30) * sine) >> 30;
    Q16(((sine + cube / 6 + (1 << 13)) >> 14) as i32)
}

#[cfg(test)]
mod tests;
