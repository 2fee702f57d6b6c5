//! A pseudo-terminal as a robot's host link: bytes between a simulated one and its host.

use std::io::{ErrorKind, Read, Write};
use std::os::fd::{AsRawFd, BorrowedFd, FromRawFd, IntoRawFd, OwnedFd};
use std::time::Duration;

use serialport::{SerialPort, TTYPort};

use super::EmulateError;

/// Bytes from the pseudo-terminal that are passed on at once.
const CHUNK: usize = 1024;

/// The robot's end of a pseudo-terminal.
pub struct Terminal {
    near: TTYPort,
    /// The host's end, held open so that a host may come and go.
    far: OwnedFd,
    path: String,
    pending: Vec<u8>,
}

impl Terminal {
    /// A new one.
    pub fn new() -> Result<Terminal, EmulateError> {
        let (near, far) = TTYPort::pair()?;
        let path = far.name().unwrap_or_default();
        let [near, far] = [own(&near)?, own(&far)?];
        // SAFETY: the descriptor was ours alone and is given away here.
        let mut near = unsafe { TTYPort::from_raw_fd(near.into_raw_fd()) };
        near.set_timeout(Duration::from_millis(1))?;
        Ok(Terminal { near, far, path, pending: vec![] })
    }

    /// Path of the host's end.
    pub fn path(&self) -> String {
        self.path.clone()
    }

    /// Passes on what the robot has said; what the host has said.
    pub fn exchange(&mut self, said: &[u8]) -> Result<Vec<u8>, EmulateError> {
        let mut heard = vec![];
        // Asked only when something waits: an empty read would cost its time-out.
        if self.near.bytes_to_read()? > 0 {
            let mut bytes = [0; CHUNK];
            match self.near.read(&mut bytes) {
                Ok(count) => heard.extend(&bytes[..count]),
                Err(error) if idle(&error) => {}
                Err(error) => return Err(error.into()),
            }
        }
        if heard.is_empty() {
            // A host that was killed leaves the terminal marked as exclusive for as long as this end is open. A living one
            // holds a lock as well, which keeps out all who ask for one, as every host of this project does.
            rustix::termios::ioctl_tiocnxcl(&self.far).map_err(std::io::Error::from)?;
        }
        self.pending.extend(said);
        if !self.pending.is_empty() {
            match self.near.write(&self.pending) {
                Ok(count) => drop(self.pending.drain(..count)),
                // Nobody reads: a serial line would lose it.
                Err(error) if idle(&error) => self.pending.clear(),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(heard)
    }
}

/// The same terminal under a descriptor that no child process inherits: a child that held it would keep the cable
/// plugged.
fn own(port: &TTYPort) -> Result<OwnedFd, EmulateError> {
    // SAFETY: the port lives, and keeps its descriptor open, until the end of this function.
    let port = unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) };
    Ok(port.try_clone_to_owned()?)
}

fn idle(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted)
}
