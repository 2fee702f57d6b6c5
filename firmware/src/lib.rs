//! The control code of the robot: pattern generators, nodes, coordinator. Pure, `no_std`, allocation-free.
//!
//! - [`attitude`]: which way is up. [`coordinator`]: IMU, parameter generations, arming, the host.
//! - [`lpg`]: the three local pattern generators and eq. 1 and 2.
//! - [`node`]: a generator with its parameters on the bus.
//!
//! The flashed images and the simulator run exactly this code.
#![cfg_attr(not(test), no_std)]

pub mod attitude;
pub mod coordinator;
pub mod lpg;
pub mod node;
