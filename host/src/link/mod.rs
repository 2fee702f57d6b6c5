//! The host's end of the link to a robot.

pub mod sim;
