//! The local pattern generators: small white-box state machines, one per pair of joints.
//!
//! - [`knee`]: LPG1, linear actuators; owns the cycle and raises the flags (paper, Fig. 3).
//! - [`swing`]: LPG2 (hips) and LPG3 (abductors); one rule, two sets of numbers, driven by the flags (Fig. 2).
//! - [`factor`]: eq. 1 and 2 in fixed point.
//! - [`rules`]: the constants that are not trained.
//!
//! All are pure: `tick(inputs) -> outputs`, integers only, no allocation, bounded time, and no behaviour that depends on
//! the tick rate beyond sampling.

pub mod factor;
pub mod knee;
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

/// Squared length of a planar vector, Q32 in 64 bits: comparing squares needs no square root.
fn squared(a: Q16, b: Q16) -> i64 {
    let (a, b) = (a.0 as i64, b.0 as i64);
    (a * a).saturating_add(b * b)
}

/// Whether the vector (a, b) is longer than `limit` ≥ 0.
fn longer(a: Q16, b: Q16, limit: Q16) -> bool {
    squared(a, b) > limit.0 as i64 * limit.0 as i64
}
