//! The host of S.A.R.A.H.: trains the robot, evaluates it, and reports.
//!
//! - [`enaf`]: the recurrent NAF agent. [`search`]: the baselines.
//! - [`task`]: what the agent sees, may do, and is rewarded for. [`link`]: the session to a robot.
//! - [`train`]: a run of three sessions over seeds. [`evaluate`]: controllers on common pushes.
//! - [`run`]: the folder a run lives in. [`metrics`], [`stats`], [`figures`], [`report`]: from numbers to a report.
//! - [`bake`]: a set becomes the firmware's own. [`flash`]: images onto boards.
//! - [`cli`]: the `sarah` command. [`progress`]: how far it is.

pub mod bake;
pub mod cli;
pub mod emulate;
pub mod enaf;
pub mod evaluate;
pub mod figures;
pub mod flash;
pub mod link;
pub mod metrics;
pub mod progress;
pub mod report;
pub mod run;
pub mod search;
pub mod stats;
pub mod task;
pub mod train;
