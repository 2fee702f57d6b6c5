//! What can go wrong with a recording, each said in one line with what to do next.

use std::io;
use std::path::{Path, PathBuf};

use sarah_protocol::host::Refusal;
use sarah_protocol::session::SessionError;
use sarah_sim::emulated::ImagesError;
use sarah_sim::robot::RobotError;
use sarah_sim::sil::SilError;
use thiserror::Error;

use super::replay::Difference;
use crate::link::port::PortError;

/// A problem with recording or replaying.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// A recording is never overwritten.
    #[error("{} exists already: choose another file with --out, or move that one away", .0.display())]
    Exists(PathBuf),
    /// The operating system refused.
    #[error("cannot {doing} {}: {source}{}", .path.display(), hint(.source))]
    Io {
        /// What was being done, as a verb.
        doing: &'static str,
        /// To which file.
        path: PathBuf,
        /// Why it failed.
        source: io::Error,
    },
    /// Not a file of ours.
    #[error("{} is not a recording: {why}; give a file that `sarah record` wrote", .path.display())]
    Unfit {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// Another build's messages.
    #[error(
        "{} was recorded with schema {recorded}, this build has {ours}: replay it with the build that recorded it{}",
        .path.display(),
        of(.program)
    )]
    Schema {
        /// The file.
        path: PathBuf,
        /// Its schema hash.
        recorded: String,
        /// This build's.
        ours: String,
        /// The program that wrote it, as far as it says so.
        program: String,
    },
    /// Nothing in it that could be computed again.
    #[error("{} holds neither control inputs nor telemetry: there is nothing to replay", .0.display())]
    Empty(PathBuf),
    /// This build computes something else.
    #[error("recorded and replayed differ: {0}")]
    Different(Box<Difference>),
    /// The robot's description.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The simulation.
    #[error(transparent)]
    Sil(#[from] SilError),
    /// The flashed images.
    #[error(transparent)]
    Images(#[from] ImagesError),
    /// The serial port.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The robot's firmware does not match.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The robot refused to move.
    #[error("the robot refused to arm: {0}")]
    Refused(Refusal),
    /// A part of a simulated robot's recording could not be replayed: its replay begins at power-up.
    #[error(
        "--split is for a robot on a port; a simulated one is replayed from its power-up on, so its recording is one \
         file: leave --split out, and end it with --seconds"
    )]
    NotSplit,
    /// No way to notice Ctrl-C.
    #[error("cannot listen for Ctrl-C: {0}; end the recording with --seconds")]
    Signal(String),
}

impl RecordingError {
    /// Wraps an I/O error; use as `.map_err(RecordingError::io("open", path))`.
    pub(super) fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> RecordingError {
        let path = path.to_path_buf();
        move |source| match source.kind() {
            // Not of a folder: where that cannot be made because a file is there, the recording itself is not.
            io::ErrorKind::AlreadyExists if doing == "create" => RecordingError::Exists(path),
            _ => RecordingError::Io { doing, path, source },
        }
    }

    /// Wraps an error of the writer.
    pub(super) fn writing(path: &Path) -> impl FnOnce(mcap::McapError) -> RecordingError {
        let path = path.to_path_buf();
        move |error| {
            let source = match error {
                mcap::McapError::Io(source) => source,
                other => io::Error::other(other.to_string()),
            };
            RecordingError::Io { doing: "write", path, source }
        }
    }
}

fn hint(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; what was written before is readable; free some space, or record elsewhere with --out"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "; choose a folder you may write to with --out"
        }
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => "; check the path",
        _ => "; check the disk and the path",
    }
}

fn of(program: &str) -> String {
    if program.is_empty() { String::new() } else { format!(" ({program})") }
}
