//! The boards the firmware runs on: everything between the pure library and the pins.
//!
//! [`samc21`] is the board of all four images, `same54` a second home of the coordinator. What does not depend on the
//! board lies here: `coordinator` (its tasks), `can`, `imu`, `time_driver`, `log`, `boot`, `fault`, `vitals`. A board
//! brings its clocks, peripherals and interrupts.

#[cfg(all(feature = "samc21", feature = "same54", target_os = "none"))]
compile_error!("an image is for one board: either the feature samc21 or the feature same54");

#[cfg(any(feature = "samc21", feature = "same54", test))]
pub mod boot;
#[cfg(all(any(feature = "samc21", feature = "same54"), target_os = "none"))]
pub mod can;
#[cfg(all(any(feature = "samc21", feature = "same54"), target_os = "none"))]
pub mod coordinator;
#[cfg(all(any(feature = "samc21", feature = "same54"), target_os = "none"))]
pub mod fault;
#[cfg(any(all(any(feature = "samc21", feature = "same54"), target_os = "none"), test))]
pub mod imu;
#[cfg(all(any(feature = "samc21", feature = "same54"), target_os = "none"))]
pub mod log;
#[cfg(all(any(feature = "samc21", feature = "same54"), target_os = "none"))]
pub mod time_driver;
#[cfg(any(feature = "samc21", feature = "same54", test))]
pub mod vitals;

pub mod samc21;
#[cfg(all(feature = "same54", target_os = "none"))]
pub mod same54;
