//! A process and the line to it: one message out, one reply in, in bounded time.
//!
//! Both directions are one local socket, which is the process's standard input and output: the system's own time limit
//! on reading needs no thread.

use std::io::{ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use sarah_protocol::frame::Deframer;

use super::PlantError;
use super::wire::{self, FromPlant, ToPlant, WireError};

/// How long a reply may take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patience {
    /// The first one, interpreter and libraries included.
    pub setup: Duration,
    /// One to a step.
    pub step: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        Self { setup: Duration::from_secs(60), step: Duration::from_secs(10) }
    }
}

/// Processes whose episode is over: to start an interpreter takes longer than an episode, so the next one takes over.
/// They end by themselves when this program does, and with it their input.
static IDLE: Mutex<Vec<Process>> = Mutex::new(Vec::new());

/// A plant's process, between two messages.
#[derive(Debug)]
pub(super) struct Process {
    pub command: String,
    child: Option<Child>,
    line: UnixStream,
    number: u16,
}

impl Process {
    /// One that runs `command` (a program and its arguments, separated by spaces): an idle one, or a new one.
    pub(super) fn start(command: &str) -> Result<Process, PlantError> {
        if let Some(idle) = take_idle(command) {
            return Ok(idle);
        }
        let spawn = |why: String| PlantError::Spawn { command: command.into(), why };
        let (near, far) = UnixStream::pair().map_err(|error| spawn(error.to_string()))?;
        let input = OwnedFd::from(far);
        let output = input.try_clone().map_err(|error| spawn(error.to_string()))?;
        let mut words = command.split_whitespace();
        let program = words.next().ok_or_else(|| spawn("it is empty".into()))?;
        let child = Command::new(program)
            .args(words)
            .stdin(Stdio::from(input))
            .stdout(Stdio::from(output))
            .spawn()
            .map_err(|error| spawn(error.to_string()))?;
        Ok(Process { command: command.into(), child: Some(child), line: near, number: 0 })
    }

    /// A plant that is already there, at the other end of `line`; `name` is for messages.
    #[cfg(test)]
    pub(super) fn over(line: UnixStream, name: &str) -> Process {
        Process { command: name.into(), child: None, line, number: 0 }
    }

    /// What the system knows it by.
    #[cfg(test)]
    pub(super) fn id(&self) -> Option<u32> {
        self.child.as_ref().map(Child::id)
    }

    /// Keeps the process for the next episode. Only between two messages, and only if it has answered all of them.
    pub(super) fn rest(self) {
        if self.child.is_some() {
            IDLE.lock().unwrap_or_else(PoisonError::into_inner).push(self);
        }
    }

    /// Sends `message` and waits for the reply. `doing` says what for, should it fail; nothing can be asked after that.
    pub(super) fn ask(
        &mut self,
        message: &ToPlant,
        patience: Duration,
        doing: impl Fn() -> String,
    ) -> Result<FromPlant, PlantError> {
        self.number = self.number.wrapping_add(1);
        self.exchange(message, patience).map_err(|failure| self.error(failure, patience, doing()))
    }

    fn exchange(&mut self, message: &ToPlant, patience: Duration) -> Result<FromPlant, Failure> {
        let began = Instant::now();
        let bytes = wire::encode(self.number, message).ok_or(Failure::Wire(WireError::Body(0)))?;
        self.line.set_write_timeout(Some(patience))?;
        self.line.set_read_timeout(Some(patience))?;
        self.line.write_all(&bytes)?;
        let mut deframer: Deframer = Deframer::new();
        let mut chunk = [0; 512];
        loop {
            let count = self.line.read(&mut chunk)?;
            if count == 0 {
                return Err(Failure::Io(ErrorKind::UnexpectedEof.into()));
            }
            for byte in &chunk[..count] {
                if let Some(packet) = deframer.push(*byte) {
                    return wire::reply(self.number, packet).map_err(Failure::Wire);
                }
            }
            // Bytes that never end a frame are no answer either.
            if began.elapsed() > patience {
                return Err(Failure::Io(ErrorKind::TimedOut.into()));
            }
        }
    }

    fn error(&mut self, failure: Failure, patience: Duration, doing: String) -> PlantError {
        let command = self.command.clone();
        match failure {
            Failure::Wire(WireError::Version(theirs)) => PlantError::Version { command, theirs },
            Failure::Wire(error) => PlantError::Malformed { command, doing, what: error.to_string() },
            Failure::Io(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                PlantError::Silent { command, doing, patience_s: patience.as_secs_f32() }
            }
            Failure::Io(error) => PlantError::Ended { command, doing, why: self.end().unwrap_or(error.to_string()) },
        }
    }

    /// Exit status, if it is over or about to be.
    fn end(&mut self) -> Option<String> {
        let child = self.child.as_mut()?;
        // It closes its output before it is gone: a moment's grace for the status.
        for _ in 0..50 {
            if let Ok(Some(status)) = child.try_wait() {
                return Some(status.to_string());
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        None
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            // One that has gone already cannot be ended: nothing to do about it.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

enum Failure {
    Wire(WireError),
    Io(std::io::Error),
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        Failure::Io(error)
    }
}

fn take_idle(command: &str) -> Option<Process> {
    let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
    let at = idle.iter().position(|process| process.command == command)?;
    let mut process = idle.swap_remove(at);
    let lives = process.child.as_mut().is_some_and(|child| matches!(child.try_wait(), Ok(None)));
    lives.then_some(process)
}
