//! From what the robot and the link say to messages in units.

use foxglove::bytes::Bytes;
use foxglove::messages::Vector3;
use sarah_protocol::bus::{Mode, limits};
use sarah_protocol::host::ParamsReport;
use sarah_protocol::params::COUNT;
use sarah_protocol::session::LinkStats;
use sarah_protocol::telemetry::{Telemetry, faults};

use super::{
    Attitude, Control, Faults, Gait, Generation, Imu, KneePhase, Limits, Link, Pads, Params, Raw, State, SwingPhase,
};
use crate::recording::pose::lean;
use crate::task::observation::{acceleration_m_s2, loads_n, rate_rad_s};

impl From<&Telemetry> for Imu {
    fn from(telemetry: &Telemetry) -> Imu {
        Imu {
            robot_time_us: telemetry.time_us,
            acceleration_m_s2: vector(acceleration_m_s2(telemetry)),
            rotation_rad_s: vector(rate_rad_s(telemetry)),
        }
    }
}

impl From<&Telemetry> for Pads {
    fn from(telemetry: &Telemetry) -> Pads {
        let [left_heel_n, left_toe_n, right_heel_n, right_toe_n] = loads_n(telemetry).map(f64::from);
        Pads { robot_time_us: telemetry.time_us, left_heel_n, left_toe_n, right_heel_n, right_toe_n }
    }
}

impl From<&Telemetry> for Attitude {
    fn from(telemetry: &Telemetry) -> Attitude {
        let [forward_rad, left_rad] = lean(telemetry);
        Attitude { robot_time_us: telemetry.time_us, forward_rad, left_rad }
    }
}

impl From<&Telemetry> for Gait {
    fn from(telemetry: &Telemetry) -> Gait {
        let [knee, hip, abductor] = telemetry.phases;
        Gait {
            robot_time_us: telemetry.time_us,
            knee: match knee {
                1 => KneePhase::Kick,
                2 => KneePhase::Retract,
                3 => KneePhase::Extend,
                _ => KneePhase::KneeIdle,
            },
            hip: swing(hip),
            abductor: swing(abductor),
            factor: f64::from(telemetry.factor.to_f32()),
            steps: telemetry.steps,
            cycle: telemetry.cycle,
        }
    }
}

fn swing(phase: u8) -> SwingPhase {
    match phase {
        1 => SwingPhase::Ready,
        2 => SwingPhase::Moving,
        3 => SwingPhase::Held,
        _ => SwingPhase::SwingIdle,
    }
}

impl From<&Telemetry> for State {
    fn from(telemetry: &Telemetry) -> State {
        let fault = |bit: u16| telemetry.faults & bit != 0;
        let [knee, hip, abductor] = telemetry.limits.map(limits_of);
        State {
            robot_time_us: telemetry.time_us,
            armed: telemetry.mode == Mode::Armed,
            faults: Faults {
                e_stop: fault(faults::E_STOP),
                halted: fault(faults::HALTED),
                imu_lost: fault(faults::IMU_LOST),
                knee_lost: fault(faults::NODE_LOST),
                hip_lost: fault(faults::NODE_LOST << 1),
                abductor_lost: fault(faults::NODE_LOST << 2),
                generation_split: fault(faults::GENERATION_SPLIT),
                staging: fault(faults::STAGING),
            },
            knee,
            hip,
            abductor,
            reset_cause: format!("{:?}", telemetry.reset_cause),
        }
    }
}

fn limits_of(bits: u16) -> Limits {
    let limit = |bit: u16| bits & bit != 0;
    Limits {
        braked: limit(limits::BRAKED),
        halted: limit(limits::HALTED),
        coordinator_lost: limit(limits::COORDINATOR_LOST),
        end_stop: limit(limits::END_STOP),
        timed_out: limit(limits::TIMED_OUT),
        generation_missing: limit(limits::GENERATION_MISSING),
        sensor: limit(limits::SENSOR),
    }
}

impl From<&Telemetry> for Generation {
    fn from(telemetry: &Telemetry) -> Generation {
        Generation {
            robot_time_us: telemetry.time_us,
            generation: telemetry.generation,
            age_s: f64::from(telemetry.generation_age_ms) * 1e-3,
            stale: telemetry.stale,
        }
    }
}

impl From<&ParamsReport> for Params {
    fn from(report: &ParamsReport) -> Params {
        let [p1, p2, p3, h1, h2, h3, h4, h5, v1, v2, v3, v4, v5] =
            report.params.unwrap_or([f32::NAN; COUNT]).map(f64::from);
        Params {
            which: format!("{:?}", report.which).to_lowercase(),
            generation: report.generation,
            present: report.params.is_some(),
            p1,
            p2,
            p3,
            h1,
            h2,
            h3,
            h4,
            h5,
            v1,
            v2,
            v3,
            v4,
            v5,
        }
    }
}

impl Link {
    /// From the session's counters, and what the robot says it dropped.
    pub fn new(stats: &LinkStats, up: bool, reconnects: u32, dropped: u32) -> Link {
        Link {
            up,
            reconnects,
            frames: stats.frames,
            frame_errors: stats.frame_errors,
            undecodable: stats.undecodable,
            lost: stats.lost,
            retries: stats.retries,
            round_trip_ms: f64::from(stats.round_trip_us) * 1e-3,
            worst_round_trip_ms: f64::from(stats.worst_round_trip_us) * 1e-3,
            dropped,
        }
    }
}

impl Raw {
    /// Of a whole frame.
    pub fn new(frame: &[u8]) -> Raw {
        Raw { data: Bytes::copy_from_slice(frame) }
    }
}

impl Control {
    /// Of whole entries.
    pub fn new(entries: Vec<u8>) -> Control {
        Control { data: entries.into() }
    }
}

fn vector([x, y, z]: [f32; 3]) -> Vector3 {
    Vector3 { x: x.into(), y: y.into(), z: z.into() }
}
