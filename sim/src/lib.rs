//! Robot without hardware.

pub mod actuator;
pub mod awake;
pub mod body;
pub mod bus;
pub mod chips;
pub mod emulated;
pub mod energy;
pub mod imu;
pub mod line;
pub mod mirror;
pub mod plant;
pub mod robot;
pub mod scenario;
pub mod sensors;
pub mod sil;
pub mod skeleton;
pub mod tap;
pub mod world;
