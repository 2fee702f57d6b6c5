//! Recordings: what a robot told, in an MCAP file that Foxglove, Rerun and ROS tools open, and replaying it.
//!
//! ```text
//!   robot ──► link ──► Heard ──► Recorder ──► file.mcap ──► Foxglove, Rerun …
//!   simulated control code ──► Tape ──┘           └──────► replay ──► identical, or the first difference
//! ```
//!
//! - [`recorder`]: from news to messages. [`file`](self): readable up to the last second. [`schemas`]: our messages.
//! - [`scene`], [`description`]: the robot in space. [`pose`]: where something is. [`words`]: events in words.
//! - [`simulated`]: records a simulated robot, with every call of its control code on a [`tape`]. [`live`]: one on a port.
//! - [`parts`]: a recording without an end, in files that are each whole.
//! - [`reader`]: what a replay needs. [`mod@replay`]: the same inputs through this build.
//!
//! Topics, their messages and rates are in `docs/recording.md`. Times of a real robot are the host's since 1970, those of a
//! simulated one its own since power-up, so that equal seeds make equal files.

pub mod description;
pub mod error;
mod file;
pub mod live;
pub mod parts;
pub mod pose;
pub mod reader;
pub mod recorder;
pub mod replay;
pub mod scene;
pub mod schemas;
pub mod simulated;
pub mod tape;
pub mod words;

pub use error::RecordingError;
pub use parts::Parts;
pub use recorder::{About, Recorder};
pub use replay::replay;

#[cfg(test)]
mod tests;
