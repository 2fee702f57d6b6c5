//! What the agent sees of a decision: the telemetry of its second, condensed.
//!
//! ```text
//!  18 channels: accelerometer x y z, gyro x y z, lean (sagittal, lateral), four pad loads, then per leg abductor, hip,
//!               knee (left, right)
//!  3 numbers each: mean, last, half of the range           →  54 numbers, each about [-3, 3]
//! ```
//!
//! Normalised by fixed physical ranges, so that an agent means the same on every robot and after every restart.

use sarah_protocol::telemetry::Telemetry;

/// Channels of one telemetry frame.
pub const CHANNELS: usize = 18;
/// Numbers in an observation.
pub const LEN: usize = CHANNELS * 3;

/// Beyond this a number says "a lot" and nothing more.
const CLIP: f32 = 3.0;
const G0: f32 = 9.806_65;
const ACCEL_M_S2_PER_COUNT: f32 = G0 / 2048.0;
const GYRO_RAD_S_PER_COUNT: f32 = core::f32::consts::PI / 180.0 / 16.4;

/// Specific force in m/s², body axes.
pub fn acceleration_m_s2(telemetry: &Telemetry) -> [f32; 3] {
    telemetry.accel.map(|count| count as f32 * ACCEL_M_S2_PER_COUNT)
}

/// Angular rate in rad/s, body axes, as the gyro has it.
pub fn rate_rad_s(telemetry: &Telemetry) -> [f32; 3] {
    telemetry.gyro.map(|count| count as f32 * GYRO_RAD_S_PER_COUNT)
}

/// The same without the bias that the coordinator has learned.
pub fn unbiased_rate_rad_s(telemetry: &Telemetry) -> [f32; 3] {
    let unbiased = |axis: usize| f32::from(telemetry.gyro[axis]) - f32::from(telemetry.gyro_bias[axis]);
    [0, 1, 2].map(|axis| unbiased(axis) * GYRO_RAD_S_PER_COUNT)
}

/// Pad loads in N: left heel, left toe, right heel, right toe.
pub fn loads_n(telemetry: &Telemetry) -> [f32; 4] {
    telemetry.loads.map(|load| load as f32 * 0.1)
}

/// The channels of one frame in units of their range: 5 m/s² about rest, 1 rad/s, 0.05 rad of lean, 100 N
/// about 100 N, 0.3 rad of joint, 50 mm. Lean has the finest: ground that falls away by 3° is all that it shows of it.
fn channels(telemetry: &Telemetry) -> [f32; CHANNELS] {
    let [ax, ay, az] = acceleration_m_s2(telemetry);
    let [gx, gy, gz] = unbiased_rate_rad_s(telemetry);
    let [l0, l1, l2, l3] = loads_n(telemetry).map(|n| n / 100.0 - 1.0);
    let [sagittal, lateral] = telemetry.lean.map(|lean| lean.to_f32() / 0.05);
    let [abd_l, hip_l, knee_l, abd_r, hip_r, knee_r] = telemetry.joints.map(|q| q.to_f32());
    let (turn, stroke) = (1.0 / 0.3, 1.0 / 0.05);
    [
        ax / 5.0,
        ay / 5.0,
        (az - G0) / 5.0,
        gx,
        gy,
        gz,
        sagittal,
        lateral,
        l0,
        l1,
        l2,
        l3,
        abd_l * turn,
        hip_l * turn,
        knee_l * stroke,
        abd_r * turn,
        hip_r * turn,
        knee_r * stroke,
    ]
}

/// Condenses a decision's telemetry. Without any, all zeros.
pub fn observe(second: &[Telemetry]) -> Vec<f32> {
    let frames: Vec<_> = second.iter().map(channels).collect();
    let Some(last) = frames.last() else { return vec![0.0; LEN] };
    (0..CHANNELS)
        .flat_map(|channel| {
            let values = frames.iter().map(|frame| frame[channel]);
            let mean = values.clone().sum::<f32>() / frames.len() as f32;
            let high = values.clone().fold(f32::MIN, f32::max);
            let low = values.fold(f32::MAX, f32::min);
            [mean, last[channel], (high - low) * 0.5].map(|x| x.clamp(-CLIP, CLIP))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use sarah_protocol::fixed::Q16;

    #[test]
    fn rest_is_near_zero_and_every_extreme_is_clipped() {
        let rest = Telemetry { accel: [0, 0, 2048], loads: [1000; 4], ..Telemetry::default() };
        assert!(observe(&[rest; 100]).iter().all(|x| x.abs() < 1e-4));
        let wild = Telemetry {
            accel: [i16::MAX; 3],
            gyro: [i16::MIN; 3],
            loads: [u16::MAX; 4],
            joints: [Q16::MAX; 6],
            ..Telemetry::default()
        };
        assert!(observe(&[rest, wild]).iter().all(|x| x.abs() <= CLIP));
    }

    #[test]
    fn each_channel_gives_mean_last_and_half_range() {
        let frame = |count| Telemetry { accel: [count, 0, 2048], ..Telemetry::default() };
        let seen = observe(&[frame(0), frame(1024), frame(512)]);
        let half = G0 / 4.0 / 5.0; // 512 counts are a quarter of g, in units of 5 m/s²
        for number in &seen[..3] {
            assert!((number - half).abs() < 1e-4, "{number}");
        }
    }

    #[test]
    fn silence_is_all_zeros() {
        assert_eq!(observe(&[]), vec![0.0; LEN]);
    }
}
