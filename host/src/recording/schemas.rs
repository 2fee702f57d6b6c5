//! Our own messages, in units, as tools plot them. Every file carries their Protobuf descriptors, made from these types.
//!
//! A field's name ends in its unit. `robot_time_us` is the coordinator's own clock, which wraps after 71 minutes.

mod convert;

use foxglove::Encode;
use foxglove::bytes::Bytes;
use foxglove::messages::Vector3;

/// The inertial sensor, body axes x forward, y left, z up.
#[derive(Encode, Clone, Debug)]
pub struct Imu {
    robot_time_us: u32,
    acceleration_m_s2: Vector3,
    rotation_rad_s: Vector3,
}

/// Loads under the feet.
#[derive(Encode, Clone, Debug)]
pub struct Pads {
    robot_time_us: u32,
    left_heel_n: f64,
    left_toe_n: f64,
    right_heel_n: f64,
    right_toe_n: f64,
}

/// Lean of the trunk, as the robot's own filter says.
#[derive(Encode, Clone, Debug)]
pub struct Attitude {
    robot_time_us: u32,
    forward_rad: f64,
    left_rad: f64,
}

/// Phase of LPG1. Names differ between the two phases because Protobuf puts them in one scope.
#[derive(Encode, Clone, Copy, PartialEq, Eq, Debug)]
pub enum KneePhase {
    /// At rest.
    KneeIdle,
    /// Shifting the weight.
    Kick,
    /// Lifting the foot.
    Retract,
    /// Bringing it down.
    Extend,
}

/// Phase of LPG2 and LPG3.
#[derive(Encode, Clone, Copy, PartialEq, Eq, Debug)]
pub enum SwingPhase {
    /// Waiting for a cycle.
    SwingIdle,
    /// The foot has not lifted yet.
    Ready,
    /// Moving.
    Moving,
    /// On target, or the foot is down.
    Held,
}

/// The pattern generators.
#[derive(Encode, Clone, Debug)]
pub struct Gait {
    robot_time_us: u32,
    knee: KneePhase,
    hip: SwingPhase,
    abductor: SwingPhase,
    factor: f64,
    steps: u32,
    cycle: u32,
}

/// Why a node moves less than asked.
#[derive(Encode, Clone, Debug)]
pub struct Limits {
    braked: bool,
    halted: bool,
    coordinator_lost: bool,
    end_stop: bool,
    timed_out: bool,
    generation_missing: bool,
    sensor: bool,
}

/// Why the robot is braked.
#[derive(Encode, Clone, Debug)]
pub struct Faults {
    e_stop: bool,
    halted: bool,
    imu_lost: bool,
    knee_lost: bool,
    hip_lost: bool,
    abductor_lost: bool,
    generation_split: bool,
    staging: bool,
}

/// Whether the robot may move, and what keeps it from it.
#[derive(Encode, Clone, Debug)]
pub struct State {
    robot_time_us: u32,
    armed: bool,
    faults: Faults,
    knee: Limits,
    hip: Limits,
    abductor: Limits,
    reset_cause: String,
}

/// The generation in force.
#[derive(Encode, Clone, Debug)]
pub struct Generation {
    robot_time_us: u32,
    generation: u32,
    age_s: f64,
    stale: bool,
}

/// A parameter set the robot was asked for; units and meanings in `docs/recording.md`.
#[derive(Encode, Clone, Debug)]
pub struct Params {
    /// Applied, stored or staged.
    which: String,
    generation: u32,
    /// False: there is no such set, and the values mean nothing.
    present: bool,
    p1: f64,
    p2: f64,
    p3: f64,
    h1: f64,
    h2: f64,
    h3: f64,
    h4: f64,
    h5: f64,
    v1: f64,
    v2: f64,
    v3: f64,
    v4: f64,
    v5: f64,
}

/// How good the link to the robot is.
#[derive(Encode, Clone, Debug)]
pub struct Link {
    up: bool,
    reconnects: u32,
    frames: u32,
    frame_errors: u32,
    undecodable: u32,
    lost: u32,
    retries: u32,
    round_trip_ms: f64,
    worst_round_trip_ms: f64,
    /// Telemetry the robot had no room to send.
    dropped: u32,
}

/// A message of the robot as it was sent: one serial frame.
#[derive(Encode, Clone, Debug)]
pub struct Raw {
    /// First and only field: the reader relies on it.
    data: Bytes,
}

/// What went into and came out of the control code: entries of [`super::tape`].
#[derive(Encode, Clone, Debug)]
pub struct Control {
    /// First and only field: the reader relies on it.
    data: Bytes,
}

/// The bytes of a [`Raw`] or a [`Control`] as it stands in a file.
pub(super) fn data_of(message: &[u8]) -> Option<&[u8]> {
    // Field 1, length-delimited; then the length, seven bits a byte, the lowest first.
    let mut rest = message.strip_prefix(&[0x0a])?;
    let mut length = 0_usize;
    for shift in (0..35).step_by(7) {
        let (byte, tail) = rest.split_first()?;
        rest = tail;
        length |= usize::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return (rest.len() == length).then_some(rest);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_comes_back_as_it_went_in() {
        for length in [0, 1, 127, 128, 20_000] {
            let bytes: Vec<u8> = (0..length).map(|i| i as u8).collect();
            let mut message = vec![];
            Control::new(bytes.clone()).encode(&mut message).expect("a vector has room");
            assert_eq!(data_of(&message), Some(&bytes[..]), "{length} bytes");
            assert_eq!(data_of(&message[..message.len() - 1]), None);
        }
    }
}
