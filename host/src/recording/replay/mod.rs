//! Computes a recording again with the control code of this build, and says where it comes out otherwise.
//!
//! - [`control`]: every call of a simulated robot's control code, bit for bit.
//! - [`telemetry`]: what the telemetry of any robot determines by itself.

pub mod control;
pub mod telemetry;

use std::fmt;
use std::path::Path;

use sarah_protocol::bus::NodeId;

use super::error::RecordingError;
use super::reader::Recording;
use super::tape;

pub use control::{Compared, Replayer};
pub use telemetry::Checked;

/// The first thing that comes out otherwise.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Difference {
    /// Which chip: `None` is the coordinator.
    pub node: Option<NodeId>,
    /// Its tick, from 1 at its start; of telemetry, the frame.
    pub tick: u64,
    /// When, µs on the robot's clock.
    pub at_us: u64,
    /// What the recording has.
    pub recorded: String,
    /// What this build makes.
    pub replayed: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.node {
            Some(node) => write!(f, "{node:?}")?,
            None => f.write_str("Coordinator")?,
        }
        let Difference { tick, at_us, recorded, replayed, .. } = self;
        let at_s = *at_us as f64 * 1e-6;
        write!(f, ", tick {tick} at {at_s:.4} s: recorded {recorded}, replayed {replayed}")
    }
}

/// What a replay shows.
#[derive(Clone, Debug)]
pub struct Replayed {
    /// The control code, if its inputs were recorded.
    pub control: Option<Compared>,
    /// The telemetry.
    pub telemetry: Checked,
    /// The outputs were emulated chips'.
    pub emulated: bool,
    /// The recording was ended properly.
    pub complete: bool,
}

/// Replays a file. `progress` is called with the share of the tape that is done, 0 to 1.
pub fn replay(path: &Path, progress: &mut dyn FnMut(f64)) -> Result<Replayed, RecordingError> {
    let recording = Recording::read(path)?;
    if recording.tape.is_empty() && recording.telemetry.is_empty() {
        return Err(RecordingError::Empty(path.to_path_buf()));
    }
    let unfit = |why: String| RecordingError::Unfit { path: path.to_path_buf(), why };
    let mut replayer: Option<Replayer> = None;
    let mut count: u64 = 0;
    for (entry, left) in tape::entries(&recording.tape) {
        let entry = entry.map_err(|error| unfit(format!("the tape of the control code does not decode: {error}")))?;
        match (entry, &mut replayer) {
            (tape::Entry::Born(born), None) => {
                replayer = Some(Replayer::new(&born).map_err(|error| unfit(error.to_string()))?);
            }
            (tape::Entry::Passed { at_us, chip, what }, Some(replayer)) => {
                replayer.passed(at_us, chip, what).map_err(|found| RecordingError::Different(Box::new(found)))?;
            }
            _ => return Err(unfit("the tape of the control code does not begin with a power-up".into())),
        }
        count += 1;
        if count.is_multiple_of(1 << 16) {
            progress(1.0 - left as f64 / recording.tape.len() as f64);
        }
    }
    let emulated = replayer.as_ref().is_some_and(Replayer::emulated);
    let control = match replayer {
        Some(replayer) => Some(replayer.finish().map_err(|found| RecordingError::Different(Box::new(found)))?),
        None => None,
    };
    let telemetry =
        telemetry::check(&recording.telemetry).map_err(|found| RecordingError::Different(Box::new(found)))?;
    Ok(Replayed { control, telemetry, emulated, complete: recording.complete })
}

impl fmt::Display for Replayed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(Compared { ticks, commands, frames, bytes }) = self.control {
            writeln!(
                f,
                "identical: {ticks} ticks, {commands} actuator commands, {frames} bus frames and {bytes} bytes for the \
                 host compared"
            )?;
            if self.emulated {
                writeln!(f, "not compared: the coordinator; of emulated chips only the nodes' inputs are recorded")?;
            }
        }
        write!(f, "{}", self.telemetry)?;
        if self.control.is_none() {
            writeln!(
                f,
                "not compared: commands and frames; of a robot on a serial port only its telemetry is recorded"
            )?;
        }
        if !self.complete {
            writeln!(f, "the recording was cut off: up to its last second is missing")?;
        }
        Ok(())
    }
}
