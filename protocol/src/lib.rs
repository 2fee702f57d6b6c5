//! The words host, coordinator and nodes share.
#![cfg_attr(not(test), no_std)]

pub mod bus;
pub mod fixed;
pub mod frame;
pub mod host;
pub mod params;
pub mod refusal;
pub mod schema;
pub mod session;
pub mod telemetry;
mod write;

/// Whether `a` is newer than `b` on a counter that wraps: less than half of its range ahead.
pub const fn newer(a: u32, b: u32) -> bool {
    (a.wrapping_sub(b) as i32) > 0
}
