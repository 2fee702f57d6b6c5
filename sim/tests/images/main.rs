//! What the flashed images do when something breaks: four emulated chips with the robot, and a host session on the line.
//!
//! One binary, so that the images are built once: see [`build`]. [`rig`] is what a test drives.

mod build;
mod bus;
mod host;
mod memory;
mod mirror;
mod resets;
mod rig;
mod snapshot;
mod stops;
