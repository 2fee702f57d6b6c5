//! `sarah monitor`: what the robot does, on the terminal, and the keys that stop it.
//!
//! ```text
//!   link ── Heard ──► Dashboard ── view ──► terminal
//!    ▲                    ▲ │
//!    └─────── Ask ────────┼─┘
//!   keyboard ── Act ──────┘
//! ```
//!
//! The core is pure: [`Dashboard`] takes in what the link heard and what [`keys`] mean, and says what to ask; `view`
//! and its panels only look at it. This file is the shell: a loop over link, keyboard and terminal.
//!
//! The monitor never moves the robot by itself: it arms only after a question was answered, and leaving it changes
//! nothing about the robot. The emergency stop needs no claim, so it works from an observer too.

mod attention;
mod energy;
mod keys;
mod log;
mod panels;
mod plain;
mod sets;
mod state;
#[cfg(test)]
mod tests;
mod text;
mod trend;
mod view;
pub mod words;

use std::io::{self, IsTerminal, Write};
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event};
use thiserror::Error;

pub use attention::Level;
pub use keys::{Act, keys};
pub use state::Dashboard;
pub use words::{Advice, event_words, fault_advice, limit_advice};

use crate::link::live::{Link, Role};
use crate::link::port::{PortError, Target};
use crate::stop;

/// Pictures per second: enough for the eye, little for a Raspberry Pi.
const PICTURE: Duration = Duration::from_millis(66);
/// Where there is no terminal, a line this often.
const LINE: Duration = Duration::from_secs(1);

/// Why the monitor ends early.
#[derive(Debug, Error)]
pub enum MonitorError {
    /// The port.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The screen.
    #[error("the terminal failed: {0}; try another one, or pipe the output to get lines: sarah monitor … | cat")]
    Terminal(io::Error),
    /// No way to notice that the process is asked to end: it would leave the terminal as it is.
    #[error("cannot listen for signals: {0}; pipe the output to get lines instead: sarah monitor … | cat")]
    Signal(String),
    /// Standard output, where it is no terminal.
    #[error("cannot write to standard output: {0}; check where it leads to")]
    Output(io::Error),
}

/// Shows the robot at `target` until the operator quits. Where standard output is no terminal nobody can press keys:
/// then it only watches, and prints a line of state every second.
pub fn run(target: &Target, role: Role) -> Result<(), MonitorError> {
    if !io::stdout().is_terminal() {
        return lines(&Link::open(target, Role::Observer)?).map_err(MonitorError::Output);
    }
    let link = Link::open(target, role)?;
    // Before the screen: whoever is asked to end from here on gives the terminal back first.
    let stop = stop::when_asked().map_err(MonitorError::Signal)?;
    let mut screen = Screen::open().map_err(MonitorError::Terminal)?;
    let shown = show(&mut screen.0, &link, role, &stop);
    drop(screen);
    match shown {
        // The terminal was closed: there is nothing to give back, and nobody to tell.
        Err(_) if stop.load(Ordering::Relaxed) => return Ok(()),
        shown => shown.map_err(MonitorError::Terminal)?,
    }
    let farewell = "The robot goes on as it was. Without another host its stored set is back in force 10 s from now.";
    // A terminal that was closed in the meantime is no failure.
    let _ = writeln!(io::stdout(), "{farewell}");
    Ok(())
}

/// The terminal, given back on every way out; after a panic the hook of `try_init` gives it back before the message.
///
/// Its own farewell, a cursor that is shown again, panics where the terminal has been closed: that is done here.
struct Screen(ManuallyDrop<DefaultTerminal>);

impl Screen {
    fn open() -> io::Result<Screen> {
        ratatui::try_init().map(|terminal| Screen(ManuallyDrop::new(terminal)))
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // Nothing can be done about a terminal that does not let itself be restored.
        let _ = self.0.show_cursor();
        let _ = ratatui::try_restore();
    }
}

/// What is typed, from a thread of its own: where the terminal is closed, waiting for a key may never come back.
fn keyboard() -> Receiver<io::Result<Event>> {
    let (typed, events) = channel();
    std::thread::spawn(move || {
        loop {
            let event = event::read();
            let last = event.is_err();
            if typed.send(event).is_err() || last {
                return;
            }
        }
    });
    events
}

fn show(terminal: &mut DefaultTerminal, link: &Link, role: Role, stop: &AtomicBool) -> io::Result<()> {
    let mut dashboard = Dashboard::new(role);
    let events = keyboard();
    while !dashboard.quits() && !stop.load(Ordering::Relaxed) {
        hear(&mut dashboard, link);
        terminal.draw(|frame| dashboard.view(frame, link.now_us()))?;
        // The wait is for keys, so that a stop does not wait for the next picture.
        let next = Instant::now() + PICTURE;
        while !dashboard.quits() {
            let event = match events.recv_timeout(next.saturating_duration_since(Instant::now())) {
                Ok(event) => event?,
                Err(RecvTimeoutError::Timeout) => break,
                Err(RecvTimeoutError::Disconnected) => return Err(io::ErrorKind::UnexpectedEof.into()),
            };
            if let Event::Key(key) = event
                && let Some(act) = keys(key)
                && let Some(ask) = dashboard.act(act, link.now_us())
            {
                link.ask(ask);
            }
        }
    }
    Ok(())
}

fn hear(dashboard: &mut Dashboard, link: &Link) {
    while let Some(heard) = link.next(Duration::ZERO) {
        dashboard.on(&heard);
    }
    dashboard.set_health(link.health());
    if let Some(ask) = dashboard.due(link.now_us()) {
        link.ask(ask);
    }
}

fn lines(link: &Link) -> io::Result<()> {
    let mut dashboard = Dashboard::new(Role::Observer);
    let mut out = io::stdout();
    loop {
        std::thread::sleep(LINE);
        hear(&mut dashboard, link);
        match writeln!(out, "{}", dashboard.line(link.now_us())).and_then(|()| out.flush()) {
            // Whoever read has enough.
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => return Ok(()),
            written => written?,
        }
    }
}
