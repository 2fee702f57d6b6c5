//! Robot without hardware.

pub mod actuator;
pub mod body;
pub mod bus;
pub mod energy;
pub mod robot;
pub mod scenario;
pub mod sensors;
pub mod sil;
