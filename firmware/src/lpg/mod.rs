//! The local pattern generators: small white-box state machines, one per pair of joints.
//!
//! - [`knee`]: LPG1, linear actuators; owns the cycle and raises the flags (paper, Fig. 3). `recovery`: how legs come home.
//! - [`swing`]: LPG2 (hips) and LPG3 (abductors); one rule, two sets of numbers, driven by the flags (Fig. 2).
//! - [`fall`]: what LPG1 reads from the IMU. [`factor`]: eq. 1 and 2 in fixed point.
//! - [`rules`]: the constants that are not trained. `arithmetic`: what a chip without a divider can do in 32 bits.
//!
//! All are pure: `tick(inputs) -> outputs`, integers only, no allocation, bounded time, and no behaviour that depends on
//! the tick rate beyond sampling.

pub(crate) mod arithmetic;
pub mod factor;
pub mod fall;
pub mod knee;
mod recovery;
pub mod rules;
pub mod swing;

use sarah_protocol::fixed::Q16;

/// What an actuator is told. Power is drawn, and the brake coil energised, only by [`Drive::Velocity`].
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Drive {
    /// Brake engaged, motor off: holds without power.
    #[default]
    Brake,
    /// Brake released, moving at this speed: m/s or rad/s.
    Velocity(Q16),
}
