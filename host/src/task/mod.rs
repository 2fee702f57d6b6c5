//! The task: what the agent sees, what it may do, and what that is worth.
//!
//! - [`observation`]: a second of telemetry in 54 numbers.
//! - [`action`]: from [-1, 1] to the parameters of one session and back.
//! - [`robots`]: with which robot.
//! - [`reward`]: eq. 5, as printed and gated.
//! - [`judge`]: measures a run of the robot: rewards, steps, drift, settling.
//! - [`odometry`]: where the trunk is, from telemetry alone. [`pose_source`]: or from outside.
//! - [`environment`]: all of it as the world an agent learns in.

pub mod action;
pub mod environment;
pub mod judge;
pub mod observation;
pub mod odometry;
pub mod pose_source;
pub mod reward;
pub mod robots;
