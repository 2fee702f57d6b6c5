//! What a coordinator is born with.

use sarah_protocol::params::ParamSet;
use sarah_protocol::telemetry::ResetCause;

/// Who this robot is, for the hello.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Identity {
    /// Drawn at boot.
    pub boot_nonce: u32,
    /// Which board; 0 is simulated.
    pub board: u8,
    /// Firmware build, ASCII, padded with zeros.
    pub build: [u8; 16],
    /// Why the chip started.
    pub reset_cause: ResetCause,
}

/// What the coordinator is born with. Times in µs.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Config {
    /// Who this is.
    pub identity: Identity,
    /// The set built into the nodes' images: generation 0.
    pub default: ParamSet,
    /// The set in non-volatile memory, or the default.
    pub stored: ParamSet,
    /// Arm once, without a host, as soon as IMU and nodes are there. For a robot that is to balance unattended from
    /// power-up; any halt ends it, and then only an explicit arm resumes. Off unless a deployment asks for it.
    pub arm_at_boot: bool,
    /// Nominal time between IMU samples; the first one counts as this much.
    pub imu_period_us: u32,
    /// The IMU is lost after this silence.
    pub imu_silence_us: u32,
    /// A node is lost after this silence.
    pub node_silence_us: u32,
    /// Between telemetry frames until a host asks for another rate.
    pub telemetry_period_us: u32,
    /// A silent writer loses its claim after this.
    pub writer_lapse_us: u32,
    /// The applied set is stale after this silence of its host.
    pub host_silence_us: u32,
    /// The stored set returns after this silence of its host.
    pub host_fallback_us: u32,
}

impl Config {
    /// The usual times: IMU 1 kHz, telemetry 100 Hz, IMU lost after 50 ms, node after 100 ms, host stale after 2 s, fall
    /// back after 10 s.
    pub const fn new(identity: Identity, default: ParamSet, stored: ParamSet) -> Config {
        Config {
            identity,
            default,
            stored,
            arm_at_boot: false,
            imu_period_us: 1_000,
            imu_silence_us: 50_000,
            node_silence_us: 100_000,
            telemetry_period_us: 10_000,
            writer_lapse_us: 2_000_000,
            host_silence_us: 2_000_000,
            host_fallback_us: 10_000_000,
        }
    }
}
