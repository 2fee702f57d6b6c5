//! Flashing: an image goes onto a board, is verified, and starts.
//!
//! ```text
//!  --node, --all, --elf ─► Job (image, probe) ─► Tool (OpenOCD or probe-rs) ─► command ─► its words ─► ours
//! ```
//!
//! - `boards`: which board is which node. `probes`: which boards are plugged in. `tool`: the commands, and what their
//!   messages mean. `logs`: the logs of a running image.

mod boards;
mod logs;
mod probes;
mod tool;

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::ValueEnum;
use thiserror::Error;

use crate::run::RunError;

pub use boards::{BOARDS_FILE, Boards};
pub use probes::{Probe, attached};
pub use tool::Tool;

/// An image and the board it belongs on.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum Node {
    /// LPG1: linear actuators and foot pads.
    Knee,
    /// LPG2.
    Hip,
    /// LPG3.
    Abductor,
    /// IMU, parameter sets, host link.
    Coordinator,
}

impl Node {
    /// All four.
    pub const ALL: [Node; 4] = [Node::Knee, Node::Hip, Node::Abductor, Node::Coordinator];

    /// As images and board maps call it.
    pub const fn name(self) -> &'static str {
        match self {
            Node::Knee => "knee",
            Node::Hip => "hip",
            Node::Abductor => "abductor",
            Node::Coordinator => "coordinator",
        }
    }
}

impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One image for one board.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Job {
    /// The ELF file.
    pub elf: PathBuf,
    /// Serial number of the board's probe; without it the only board plugged in.
    pub probe: Option<String>,
}

/// Why flashing failed; each says what to do.
#[derive(Debug, Error)]
pub enum FlashError {
    /// No image.
    #[error("{} is not there: build the images with `cargo firmware`", .0.display())]
    NotBuilt(PathBuf),
    /// Not an image.
    #[error("{} is no ELF file for an Arm chip: give an image built with `cargo firmware`", .0.display())]
    NotAnImage(PathBuf),
    /// A path the tool cannot take.
    #[error("{} holds one of {{}}[]\"$\\ or a line break, which the flashing tool cannot take: move the image", .0.display())]
    Path(PathBuf),
    /// A serial number that cannot be one.
    #[error("\"{0}\" is no probe serial number: give letters and digits as `lsusb -v` or the board's label shows them")]
    Serial(String),
    /// More than one board, and none chosen.
    #[error("{} boards are plugged in ({}): say which with --probe", .0.len(), .0.join(", "))]
    Several(Vec<String>),
    /// The program is missing.
    #[error("{program} is not installed: {hint}")]
    NoTool {
        /// The program.
        program: &'static str,
        /// How to get it.
        hint: &'static str,
    },
    /// No board.
    #[error(
        "no board found{wanted}: plug the DEBUG USB socket in, and let your user open it (docs/firmware.md){attached}"
    )]
    NoProbe {
        /// Which one was wanted.
        wanted: String,
        /// Which ones are there.
        attached: String,
    },
    /// The probe is there but may not be opened.
    #[error("the board's probe may not be opened by this user: add the udev rule of docs/firmware.md, then replug it")]
    Permission,
    /// The board's chip does not answer.
    #[error("the probe answers but its chip does not ({0}): power the board, and see `recover` in docs/firmware.md")]
    NoChip(String),
    /// Another chip.
    #[error(
        "this board's chip is no ATSAMC21J18A (DSU.DID = {found}): nothing was written; check the board and --probe"
    )]
    WrongChip {
        /// What it says it is.
        found: String,
    },
    /// Writing failed.
    #[error("writing the flash failed ({0}): is it locked? See `recover` in docs/firmware.md")]
    Write(String),
    /// What was written is not what is there.
    #[error(
        "verify failed, the flash does not hold the image: flash again; if it fails again, the board is worn or its supply is weak"
    )]
    Verify,
    /// Anything else.
    #[error("{program} failed: {why}")]
    Tool {
        /// The program.
        program: &'static str,
        /// Its last words.
        why: String,
    },
    /// A file.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The board map.
    #[error("{file}: {why}")]
    Boards {
        /// The file.
        file: String,
        /// What is wrong with it.
        why: String,
    },
}

impl Job {
    /// Refuses an image that is missing or is none, and a board that is not one for sure.
    pub fn checked(self, attached: &[Probe]) -> Result<Job, FlashError> {
        check_image(&self.elf)?;
        match &self.probe {
            Some(serial)
                if serial.is_empty() || !serial.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_".contains(&b)) =>
            {
                Err(FlashError::Serial(serial.clone()))
            }
            None if attached.len() > 1 => {
                Err(FlashError::Several(attached.iter().map(|probe| probe.serial.clone()).collect()))
            }
            _ => Ok(self),
        }
    }

    /// Writes and verifies the image and lets it start.
    pub fn flash(&self, tool: Tool) -> Result<(), FlashError> {
        let mut command = tool.flash(self);
        let output =
            command.stdin(Stdio::null()).output().map_err(|error| missing(tool.program(), tool.hint(), &error))?;
        let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        match output.status.success() {
            true => Ok(()),
            false => Err(tool.explain(self, &said, &attached())),
        }
    }

    /// Writes and verifies the image, lets it start, and shows its logs until interrupted.
    pub fn run(&self, tool: Tool) -> Result<(), FlashError> {
        logs::run(self, tool)
    }
}

/// The command as one would type it.
pub fn typed(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    let quoted = words.map(|word| {
        let word = word.to_string_lossy();
        let plain = word.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_./:=".contains(&b));
        if plain && !word.is_empty() { word.into_owned() } else { format!("'{}'", word.replace('\'', r"'\''")) }
    });
    quoted.collect::<Vec<_>>().join(" ")
}

fn missing(program: &'static str, hint: &'static str, error: &io::Error) -> FlashError {
    match error.kind() {
        io::ErrorKind::NotFound => FlashError::NoTool { program, hint },
        _ => FlashError::Tool { program, why: error.to_string() },
    }
}

fn check_image(elf: &Path) -> Result<(), FlashError> {
    if !elf.is_file() {
        return Err(FlashError::NotBuilt(elf.to_path_buf()));
    }
    if elf.to_string_lossy().contains(['{', '}', '[', ']', '"', '$', '\\', '\n']) {
        return Err(FlashError::Path(elf.to_path_buf()));
    }
    let bytes = std::fs::read(elf).map_err(RunError::io("read", elf))?;
    // ELF, 32 bit, little-endian, machine 40 (Arm).
    let arm = bytes.get(..6) == Some(b"\x7fELF\x01\x01") && bytes.get(18..20) == Some(&[40, 0]);
    if arm { Ok(()) } else { Err(FlashError::NotAnImage(elf.to_path_buf())) }
}
