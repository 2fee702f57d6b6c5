//! Serial ports: which there are, and opening one with errors that say what to do.

use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serialport::{ErrorKind, SerialPort, SerialPortType};
use thiserror::Error;

/// Rate of the coordinator's UART, Bd.
pub const BAUD: u32 = 1_000_000;
/// A read waits this long for a byte; a request of the host waits as long for the reader.
const READ: Duration = Duration::from_millis(1);
/// USB vendor and product of the debugger on SAM C21 and E54 Xplained Pro boards, which is also their serial port.
const EDBG: (u16, u16) = (0x03eb, 0x2111);

/// Which port a robot is on; in text `serial`, or `serial:PATH`.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Target {
    /// The only board that is plugged in.
    Only,
    /// This one.
    Path(String),
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Target, String> {
        match text.strip_prefix("serial").map(|rest| rest.strip_prefix(':').unwrap_or(rest)) {
            Some("") if !text.ends_with(':') => Ok(Target::Only),
            Some(path) if !path.is_empty() && text.starts_with("serial:") => Ok(Target::Path(path.into())),
            _ => Err("give serial:PATH, for instance serial:/dev/ttyACM0, or serial for the only board".into()),
        }
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Target::Only => f.write_str("serial"),
            Target::Path(path) => write!(f, "serial:{path}"),
        }
    }
}

impl TryFrom<String> for Target {
    type Error = String;

    fn try_from(text: String) -> Result<Target, String> {
        text.parse()
    }
}

impl From<Target> for String {
    fn from(target: Target) -> String {
        target.to_string()
    }
}

/// A port with a board on it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Found {
    /// Its path.
    pub path: String,
    /// The board's serial number.
    pub serial: Option<String>,
}

/// Why a port does not open.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum PortError {
    /// No board.
    #[error(
        "no board is plugged in (USB 03eb:2111); plug the coordinator in, or name its port with --link serial:PATH"
    )]
    NoBoard,
    /// More than one.
    #[error("several boards are plugged in: {0}; name the coordinator's port with --link serial:PATH")]
    Several(String),
    /// No such path.
    #[error("there is no port {path}; {there}")]
    Missing {
        /// Which.
        path: String,
        /// What there is instead.
        there: String,
    },
    /// Another program has it.
    #[error("{0} is in use by another program; end that one first, it may be a trainer, a monitor or a terminal")]
    Busy(String),
    /// Not allowed.
    #[error("no permission for {0}; `sudo usermod -aG dialout $USER`, then log in again")]
    Permission(String),
    /// Not a serial port, or broken.
    #[error("{path} does not open as a serial port at 1 Mbaud: {why}; check the path")]
    Unfit {
        /// Which.
        path: String,
        /// What the system says.
        why: String,
    },
}

/// The boards plugged in, by their USB ids.
pub fn boards() -> Vec<Found> {
    if !Path::new("/sys/class/tty").exists() && cfg!(target_os = "linux") {
        return vec![];
    }
    let mut found: Vec<Found> = serialport::available_ports()
        .unwrap_or_default()
        .into_iter()
        .filter_map(|port| match port.port_type {
            SerialPortType::UsbPort(usb) if (usb.vid, usb.pid) == EDBG => {
                Some(Found { path: port.port_name, serial: usb.serial_number })
            }
            _ => None,
        })
        .collect();
    found.sort_by(|a, b| a.path.cmp(&b.path));
    found
}

/// The path a target means at this moment.
pub fn resolve(target: &Target) -> Result<String, PortError> {
    match target {
        Target::Path(path) => Ok(path.clone()),
        Target::Only => match &boards()[..] {
            [] => Err(PortError::NoBoard),
            [one] => Ok(one.path.clone()),
            many => Err(PortError::Several(names(many))),
        },
    }
}

/// Opens a target's port for this process alone.
pub fn open(target: &Target) -> Result<Box<dyn SerialPort>, PortError> {
    let path = resolve(target)?;
    // Names may be links that udev makes; the lock is on what they lead to.
    match serialport::new(&path, BAUD).timeout(READ).open() {
        Ok(port) => Ok(port),
        Err(error) if !Path::new(&path).exists() => {
            drop(error);
            let there = match &boards()[..] {
                [] => "no board is plugged in".into(),
                some => format!("there is {}", names(some)),
            };
            Err(PortError::Missing { path, there })
        }
        Err(error) => Err(match error.kind() {
            ErrorKind::NoDevice => PortError::Busy(path),
            ErrorKind::Io(std::io::ErrorKind::PermissionDenied) => PortError::Permission(path),
            _ => PortError::Unfit { path, why: error.description },
        }),
    }
}

fn names(found: &[Found]) -> String {
    let name = |port: &Found| match &port.serial {
        Some(serial) => format!("{} (board {serial})", port.path),
        None => port.path.clone(),
    };
    found.iter().map(name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use serialport::TTYPort;

    use super::*;

    #[test]
    fn a_target_is_the_only_board_or_a_path() {
        assert_eq!("serial".parse(), Ok(Target::Only));
        assert_eq!("serial:/dev/ttyACM0".parse(), Ok(Target::Path("/dev/ttyACM0".into())));
        for text in ["serial", "serial:/dev/ttyACM0"] {
            assert_eq!(text.parse::<Target>().map(|target| target.to_string()).as_deref(), Ok(text));
        }
        for wrong in ["serial:", "seriell", "serial/dev/ttyACM0", "", "tcp:1"] {
            assert!(wrong.parse::<Target>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_way_not_to_open_says_what_to_do() {
        let missing = open(&Target::Path("/dev/no-such-port".into())).err().map(|error| error.to_string());
        assert!(missing.as_ref().is_some_and(|text| text.contains("no port /dev/no-such-port")), "{missing:?}");
        let file = tempfile::NamedTempFile::new().expect("a file");
        let path = file.path().display().to_string();
        assert!(matches!(open(&Target::Path(path)), Err(PortError::Unfit { .. })));
    }

    #[test]
    fn a_port_in_use_is_busy() {
        let (_near, far) = TTYPort::pair().expect("a pseudo-terminal");
        let target = Target::Path(far.name().expect("has a path"));
        let first = open(&target).expect("opens");
        assert!(matches!(open(&target), Err(PortError::Busy(_))));
        drop(first);
        open(&target).expect("free again");
    }
}
