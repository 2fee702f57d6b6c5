//! Robot without hardware.

pub mod actuator;
pub mod energy;
pub mod robot;
pub mod sensors;
