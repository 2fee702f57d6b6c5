//! What the robot tells of itself unasked: telemetry 100 times a second, and events when something happens.

use serde::{Deserialize, Serialize};

use crate::bus::{HaltReason, Mode, NodeId};
use crate::fixed::Q16;

/// One snapshot. At 100 Hz about 9 kB/s: a serial link needs 115200 Bd for it alone, 460800 Bd to be at ease.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Telemetry {
    /// Coordinator time, µs; wraps after 71 minutes.
    pub time_us: u32,
    /// Raw accelerometer, body x forward, y left, z up; 2048 counts per 9.80665 m/s².
    pub accel: [i16; 3],
    /// Raw gyro; 16.4 counts per degree per second.
    pub gyro: [i16; 3],
    /// Its bias as far as it is known, counts; the coordinator has taken it off before it used the gyro.
    pub gyro_bias: [i16; 3],
    /// Pad loads in 0.1 N: left heel, left toe, right heel, right toe.
    pub loads: [u16; 4],
    /// Joint positions: left abductor, hip (rad), knee (m), then right.
    pub joints: [Q16; 6],
    /// Lean \[sagittal, lateral\], rad.
    pub lean: [Q16; 2],
    /// Phase of each pattern generator, by node; 0 is idle.
    pub phases: [u8; 3],
    /// Factor (eq. 1).
    pub factor: Q16,
    /// Steps since the knee node's boot; wraps.
    pub steps: u32,
    /// Cycle number; wraps.
    pub cycle: u32,
    /// Generation in force.
    pub generation: u32,
    /// For how long it has been, ms; saturates.
    pub generation_age_ms: u32,
    /// The generation in force came from a host that is silent.
    pub stale: bool,
    /// Braked or armed.
    pub mode: Mode,
    /// Why it is braked, as [`faults`] bits; 0 when armed.
    pub faults: u16,
    /// Why each node moves less than asked, as [`crate::bus::limits`] bits.
    pub limits: [u16; 3],
    /// Why the coordinator last started.
    pub reset_cause: ResetCause,
    /// Telemetry frames that found the outbox full.
    pub dropped: u32,
}

/// Bits of [`Telemetry::faults`].
pub mod faults {
    /// Emergency stop, latched until cleared.
    pub const E_STOP: u16 = 1 << 0;
    /// Halted for another reason, latched until armed.
    pub const HALTED: u16 = 1 << 1;
    /// No IMU sample in time.
    pub const IMU_LOST: u16 = 1 << 2;
    /// A node is silent: knee, hip and abductor are bits 3, 4 and 5.
    pub const NODE_LOST: u16 = 1 << 3;
    /// The nodes do not hold the same generation.
    pub const GENERATION_SPLIT: u16 = 1 << 6;
    /// A staging or an activation did not finish in time.
    pub const STAGING: u16 = 1 << 7;
}

/// Why a chip started.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum ResetCause {
    /// Not known, or simulated.
    #[default]
    Unknown,
    /// Power came up.
    PowerOn,
    /// The supply sagged.
    BrownOut,
    /// The reset pin.
    External,
    /// The watchdog.
    Watchdog,
    /// Asked for by software.
    Software,
}

/// Something happened.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Event {
    /// Motion is allowed from now on.
    Armed,
    /// Everything brakes, latched.
    Halted(HaltReason),
    /// The emergency stop was cleared; still braked.
    EStopCleared,
    /// A node fell silent.
    NodeLost(NodeId),
    /// A silent node speaks again.
    NodeBack(NodeId),
    /// A node restarted: it runs its built-in set until staged anew.
    NodeRestarted(NodeId),
    /// The IMU delivers again.
    ImuBack,
    /// The writer was silent too long: anyone may claim.
    WriterLapsed,
    /// Every node runs this generation.
    Applied {
        /// The generation.
        generation: u32,
        /// The cycle from which on.
        cycle: u32,
    },
    /// The coordinator stages a set itself: the stored one at boot or after host silence, or the applied one for a node
    /// that restarted.
    Restaging {
        /// Its generation.
        generation: u32,
    },
    /// A node did not follow the others into a generation.
    GenerationSplit(NodeId),
    /// No node answered for this generation in time; it was given up.
    StagingFailed {
        /// The generation.
        generation: u32,
    },
}
