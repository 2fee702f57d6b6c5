//! The boards the firmware runs on: everything between the pure library and the pins.

#[cfg(any(all(feature = "samc21", target_os = "none"), test))]
pub mod imu;
pub mod samc21;
