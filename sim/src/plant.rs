//! What moves the robot's body: rapier ([`Robot`](crate::robot::Robot)), or any simulator in a process of its own
//! ([`External`]).
//!
//! A plant is rigid bodies, contacts, motors and brakes, and nothing else. Sensors and their errors, actuator delays,
//! energy, pushes and verdicts are the same code above either.

mod external;
mod process;
mod wire;

use thiserror::Error;

pub use external::External;
pub use process::Patience;
pub use wire::{FromPlant, Setup, Snapshot, Step, ToPlant, VERSION};

use crate::robot::{Drive, Health, ImuState, Joint, JointState, TrunkState};

/// The robot's rigid body. SI units, REP-103 axes (x forward, y left, z up). Drives and pushes take effect at the next
/// [`Plant::step`]; everything that is read is the state after the last one.
pub trait Plant: Send {
    /// Sets what `joint` does from the next step on. A speed that is not finite brakes.
    fn drive(&mut self, joint: Joint, drive: Drive);
    /// What `joint` was last told to do.
    fn driven(&self, joint: Joint) -> Drive;
    /// Pushes the trunk with a force in world axes, N, applied `height_m` above its centre of mass, from the next
    /// step until changed or cleared.
    fn push(&mut self, force_n: [f32; 3], height_m: f32);
    /// Ends the push.
    fn clear_push(&mut self);
    /// Advances by [`Plant::dt_s`].
    fn step(&mut self) -> Result<(), PlantError>;

    /// Coordinate and speed of `joint`.
    fn joint(&self, joint: Joint) -> JointState;
    /// Force (N) or torque (N·m) the motor of `joint` applied in the last step, in the joint's sign; 0 while braked.
    fn effort(&self, joint: Joint) -> f32;
    /// Contact force of the ground on each pad along its normal, N: left heel, left toe, right heel, right toe.
    /// This is what a load cell under the pad reads; the pad's spring lags it by 50 ms.
    fn pad_loads_n(&self) -> [f32; 4];
    /// Motion of the trunk.
    fn trunk(&self) -> TrunkState;
    /// Motion of the IMU.
    fn imu(&self) -> ImuState;
    /// Whether the robot stands, has fallen, or the simulation went wrong.
    fn health(&self) -> Health;
    /// Height of the trunk's frame above the ground, m, measured vertically.
    fn height_m(&self) -> f32;
    /// Height of the trunk's frame above the ground on straight legs, m.
    fn standing_height_m(&self) -> f32;
    /// Gravity, m/s², downward positive.
    fn gravity_m_s2(&self) -> f32;
    /// Simulated time since construction, s.
    fn time_s(&self) -> f64;
    /// Length of a step, s.
    fn dt_s(&self) -> f32;
}

/// Why a plant in another process cannot be used, or cannot go on.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlantError {
    /// No such program.
    #[error(
        "cannot start the plant `{command}`: {why}; give a program and its arguments, such as \
         \"python3 sim/mujoco/plant.py\""
    )]
    Spawn {
        /// What was to be run.
        command: String,
        /// What the system says.
        why: String,
    },
    /// It has gone.
    #[error("the plant `{command}` ended while {doing}: {why}; what it printed before says more, or run it by itself")]
    Ended {
        /// Which.
        command: String,
        /// What was asked of it.
        doing: String,
        /// Exit status, or what the system says.
        why: String,
    },
    /// It does not answer.
    #[error(
        "the plant `{command}` has not answered for {patience_s} s while {doing}; every message needs a reply at once, \
         see docs/sim-to-sim.md"
    )]
    Silent {
        /// Which.
        command: String,
        /// What was asked of it.
        doing: String,
        /// How long was waited, s.
        patience_s: f32,
    },
    /// What it says is no reply.
    #[error(
        "the plant `{command}` answered with {what} while {doing}; its standard output is for the frames of \
         docs/sim-to-sim.md alone, messages belong to standard error"
    )]
    Malformed {
        /// Which.
        command: String,
        /// What was asked of it.
        doing: String,
        /// What came instead of the reply.
        what: String,
    },
    /// It speaks another version.
    #[error(
        "the plant `{command}` speaks version {theirs} of the plant's words, this program {VERSION}; use the plant of this release"
    )]
    Version {
        /// Which.
        command: String,
        /// Its version.
        theirs: u8,
    },
    /// It simulates another robot.
    #[error(
        "the plant `{command}` simulates another robot (CRC-32 {theirs:08x}, that of sim/assets/sarah.xml is {ours:08x}); \
         make its model anew from the file, or rebuild this program"
    )]
    Model {
        /// Which.
        command: String,
        /// CRC-32 of the file its model was made from.
        theirs: u32,
        /// CRC-32 of the file in this program.
        ours: u32,
    },
    /// It cannot do what is asked.
    #[error("the plant `{command}` cannot do robot.{setting}: {why}")]
    Refused {
        /// Which.
        command: String,
        /// Field of [`RobotConfig`](crate::robot::RobotConfig).
        setting: String,
        /// Why not, and what it can.
        why: String,
    },
}

#[cfg(test)]
mod tests;
