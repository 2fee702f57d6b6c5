//! A robot on a serial port, as its users meet it: real time, real processes, a pseudo-terminal for the cable.
//!
//! The robot is the firmware's library in the simulator ([`bench`]); the flashed images on emulated chips speak the same
//! bytes, and `sarah emulate` puts them on the same kind of cable.
//!
//! - `bench`: the robot and its cable. `link`: arming, losses, two hosts. `training`: a whole run, killed and resumed.
//! - `monitor`: the dashboard on a terminal, `tty`. `record`: a recording in parts.

mod bench;
mod link;
mod monitor;
mod record;
mod training;
mod tty;
