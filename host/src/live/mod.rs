//! Training on a robot in real time: a serial port instead of a simulator, the clock on the wall instead of its own.
//!
//! ```text
//!            Seen (observation, reward)            Played (an episode)
//!  collector ─────────────────────────► predictor ─────────────────────► learner
//!   │   ▲    ◄───────────────────────── 1 ms a    ◄───────────────────── depth gradient steps
//!   │   │         Act (action)          decision      weights            per decision, own thread
//!   ▼   │
//!  link, recorder
//! ```
//!
//! The collector asks for a decision once a second by the clock and never waits for the answer: until it comes, the robot
//! keeps the parameters that it has. The learner has a thread of its own; weights go over when they are ready, between
//! two decisions. [`seam`] is all that collector and predictor say to each other, and could as well be a network.
//!
//! - [`collector`]: telemetry to observations and rewards; when an episode begins and ends. [`arming`]: who allowed what.
//! - [`watch`]: what the robot is doing.
//! - [`predictor`]: observation to action. [`learner`]: episodes to weights, and the run folder.
//! - [`console`]: what the operator types. [`trainer`]: all of it together. [`recorder`]: everything heard, on disk.

pub mod arming;
pub mod collector;
pub mod console;
pub mod learner;
pub mod predictor;
pub mod recorder;
pub mod seam;
pub mod trainer;
pub mod watch;
