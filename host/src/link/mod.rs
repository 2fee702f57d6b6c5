//! The host's end of the link to a robot.
//!
//! - [`client`]: what a host wants, over one session. [`sim`]: with a simulated robot, in simulated time.
//! - [`live`]: with a robot on a serial port, in real time. [`port`]: which ports there are, and opening one.

pub mod client;
pub mod live;
pub mod port;
pub mod sim;
