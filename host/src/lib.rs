//! The host of S.A.R.A.H.: trains the robot, evaluates it, and reports.
//!
//! - [`enaf`]: the recurrent NAF agent. [`search`]: the baselines.
//! - [`task`]: what the agent sees, may do, and is rewarded for. [`link`]: the session to a robot.
//! - [`train`]: a run of three sessions over seeds. [`live`]: the same on a robot, in real time.
//! - [`evaluate`]: controllers on common pushes.
//! - [`study`]: many of both, from one file to tables and figures.
//! - [`monitor`]: the robot in a terminal. [`recording`]: everything heard, for viewers and for replay.
//! - [`run`]: the folder a run lives in. [`metrics`], [`stats`], [`figures`], [`report`]: from numbers to a report.
//! - [`overrides`]: changes of a configuration by dotted keys.
//! - [`params`]: sets of files and robots. [`bake`]: a set becomes the firmware's own. [`flash`]: images onto boards.
//! - [`mod@bench`]: how good the link is.
//! - [`cli`]: the `sarah` command. [`progress`]: how far it is. [`stop`]: whether it is asked to end.

pub mod bake;
pub mod bench;
pub mod cli;
pub mod emulate;
pub mod enaf;
pub mod evaluate;
pub mod figures;
pub mod flash;
pub mod link;
pub mod live;
pub mod metrics;
pub mod monitor;
pub mod overrides;
pub mod params;
pub mod progress;
pub mod recording;
pub mod report;
pub mod run;
pub mod search;
pub mod stats;
pub mod stop;
pub mod study;
pub mod task;
pub mod train;
