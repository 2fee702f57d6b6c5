//! The boards the firmware runs on: everything between the pure library and the pins.

pub mod samc21;
