//! The filter as it is meant, in 64-bit arithmetic: the quick one must say the same to the last bit.

use sarah_protocol::bus::{Mode, Motion};
use sarah_protocol::fixed::Q16;

use super::{
    BIAS_MAX, FAST_FOR_US, GATE, ImuSample, LEARN_AFTER_US, MAX_STEP_US, OFF_MAX, REST_GATE, REST_GYRO, REST_US,
    STEADY_GYRO, square,
};

const ONE: i64 = 1 << 30;
const ANGLE: i64 = super::ANGLE as i64;
const RATE: i64 = super::RATE as i64;
const ACCELERATION: u64 = super::ACCELERATION as u64;
const MOVING_US: i64 = 3_000_000;
const RESTING_US: i64 = 300_000;
const MEAN_US: i64 = 300_000;
const LEARNING_US: i64 = 500_000;
const FAST_US: i64 = 50_000;
const RATE_US: i64 = 21_200;

/// The filter.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Plain {
    /// World up in body axes, Q30.
    up: [i64; 3],
    /// The gyro sample before, without its bias, counts.
    gyro: [i16; 3],
    /// Of the gyro, counts · 2¹⁶.
    bias: [i64; 3],
    /// Of the gyro over 0.3 s, counts · 2¹⁶.
    mean: [i64; 3],
    /// Time at rest, µs.
    rest_us: u64,
    /// Time at rest or with a steady gyro, µs.
    steady_us: u64,
    /// Low-passed \[sagittal, lateral\] rate, rad/s, Q32.
    slow: [i64; 2],
    /// Time since the first sample, µs; stops at [`FAST_FOR_US`].
    age_us: u32,
    started: bool,
}

impl Plain {
    /// Upright until the first samples say otherwise.
    pub const fn new() -> Self {
        Plain {
            up: [0, 0, ONE],
            gyro: [0; 3],
            bias: [0; 3],
            mean: [0; 3],
            rest_us: 0,
            steady_us: 0,
            slow: [0; 2],
            age_us: 0,
            started: false,
        }
    }

    /// Takes a sample `dt_us` after the one before. Sequence and mode of the result are the caller's.
    pub fn update(&mut self, dt_us: u32, sample: &ImuSample) -> Motion {
        let dt_us = dt_us.min(MAX_STEP_US);
        // The first sample has no interval behind it: it can only tell where gravity is.
        if self.steady_us >= u64::from(LEARN_AFTER_US) {
            let gain = (i64::from(dt_us) * ONE / LEARNING_US) >> 14;
            for (bias, gyro) in self.bias.iter_mut().zip(sample.gyro) {
                let off = ((i64::from(gyro) << 16) - *bias).clamp(-i64::from(OFF_MAX), OFF_MAX.into());
                *bias = (*bias + (((off >> 8) * gain) >> 8)).clamp(-i64::from(BIAS_MAX), BIAS_MAX.into());
            }
        }
        let gain = (i64::from(dt_us) * ONE / MEAN_US) >> 14;
        let mut away = [0; 3];
        for ((away, mean), gyro) in away.iter_mut().zip(&mut self.mean).zip(sample.gyro) {
            let off = ((i64::from(gyro) << 16) - *mean).clamp(-i64::from(OFF_MAX), OFF_MAX.into());
            *mean += ((off >> 8) * gain) >> 8;
            *away = (off >> 16) as i16;
        }
        let mut gyro = sample.gyro;
        for (axis, bias) in gyro.iter_mut().zip(self.bias) {
            let unbiased = i64::from(*axis) - ((bias + (1 << 15)) >> 16);
            *axis = unbiased.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
        }
        if self.started {
            self.rotate(dt_us, self.gyro, gyro);
        }
        self.started = true;
        self.gyro = gyro;

        let squared = square(sample.accel);
        let (still, rests) = (REST_GATE.contains(&squared), square(gyro) < REST_GYRO);
        let steady = square(away) < STEADY_GYRO;
        self.rest_us = if still && rests { self.rest_us + u64::from(dt_us) } else { 0 };
        self.steady_us = if still && (rests || steady) { self.steady_us + u64::from(dt_us) } else { 0 };
        if GATE.contains(&squared) {
            let tau = if self.age_us < FAST_FOR_US {
                FAST_US
            } else if self.rest_us >= u64::from(REST_US) {
                RESTING_US
            } else {
                MOVING_US
            };
            self.correct(i64::from(dt_us) * ONE / tau, sample.accel);
        }
        self.normalise();
        self.age_us = (self.age_us + dt_us).min(FAST_FOR_US);

        let [wx, wy, _] = gyro;
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
            rotation: Q16((((u64::from(square(gyro)) << 16).isqrt() as i64 * RATE + (1 << 23)) >> 24) as i32),
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
