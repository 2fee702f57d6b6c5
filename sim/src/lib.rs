//! Robot without hardware.

pub mod robot;
