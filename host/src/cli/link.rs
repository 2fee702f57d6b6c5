//! `--link`: what is at the other end.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

use crate::link::port::Target;

/// Where `cargo firmware` puts the images.
pub(super) const IMAGES: &str = "target/thumbv6m-none-eabi/firmware";

/// What balances.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum LinkName {
    /// The firmware library in the simulator.
    Sim,
    /// The flashed images on emulated chips.
    Emulated,
    /// A robot on a serial port.
    Serial(Target),
}

impl FromStr for LinkName {
    type Err = String;

    fn from_str(text: &str) -> Result<LinkName, String> {
        match text {
            "sim" => Ok(LinkName::Sim),
            "emulated" => Ok(LinkName::Emulated),
            text => text.parse().map(LinkName::Serial).map_err(|remedy| format!("{remedy}; or sim, or emulated")),
        }
    }
}

impl fmt::Display for LinkName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LinkName::Sim => f.write_str("sim"),
            LinkName::Emulated => f.write_str("emulated"),
            LinkName::Serial(target) => target.fmt(f),
        }
    }
}

#[derive(Args, Debug)]
pub(super) struct LinkArgs {
    /// What balances: `sim`, the firmware's library, which it is if nothing is said; `emulated`, its images on emulated
    /// chips; `serial:PATH`, a robot, or `serial` for the only board that is plugged in.
    #[arg(long, value_name = "LINK")]
    pub(super) link: Option<LinkName>,
    /// Where the images lie.
    #[arg(long, default_value = IMAGES)]
    images: PathBuf,
}

impl LinkArgs {
    pub(super) fn images(&self) -> Option<PathBuf> {
        (self.link == Some(LinkName::Emulated)).then(|| self.images.clone())
    }

    pub(super) fn serial(&self) -> Option<&Target> {
        match &self.link {
            Some(LinkName::Serial(target)) => Some(target),
            _ => None,
        }
    }

    /// A simulated robot was asked for in so many words.
    pub(super) fn simulated(&self) -> bool {
        matches!(self.link, Some(LinkName::Sim | LinkName::Emulated))
    }
}
