//! The control code of the robot: pattern generators, nodes, coordinator. Pure, `no_std`, allocation-free.
//!
//! - [`attitude`]: which way is up. [`coordinator`]: IMU, parameter generations, arming, the host.
//! - `board`: the chips it runs on (feature `samc21`).
//! - [`calibration`]: converter readings and pulse widths in units.
//! - [`lpg`]: the three local pattern generators and eq. 1 and 2.
//! - [`node`]: a generator with its parameters on the bus. [`store`]: the set that survives a power cut.
//!
//! The flashed images and the simulator run exactly this code.
#![cfg_attr(not(test), no_std)]

pub mod attitude;
pub mod board;
pub mod calibration;
pub mod coordinator;
pub mod lpg;
pub mod node;
pub mod store;

use sarah_protocol::params::{ParamSet, RawParams};

const DEFAULT_VALUES: RawParams = include!(concat!(env!("OUT_DIR"), "/default_params.rs"));

/// The set built into the images, from `default-params.toml`: generation 0 of every node.
pub fn default_params() -> ParamSet {
    // The build checked the file with the same limits; Table II is what could be said if it had not.
    ParamSet::new(DEFAULT_VALUES).unwrap_or_else(|_| ParamSet::table_ii())
}

#[cfg(test)]
mod default_set {
    #[test]
    fn the_built_in_set_is_the_file() {
        assert_eq!(super::default_params().values(), &super::DEFAULT_VALUES);
    }
}
