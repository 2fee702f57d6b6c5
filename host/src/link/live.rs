//! The link to a robot on a serial port: a thread that owns port and session, and goes on trying when the port is gone.
//!
//! ```text
//!   Link::ask ──► asks ──► ┌────────┐ ──► port      read, write, and a look at the asks every millisecond
//!   Link::next ◄─ heard ◄─ │ thread │ ◄── port
//!   Link::health ◄──────── └────────┘               port gone: again after 0.1 s, 0.2 s … 2 s
//! ```
//!
//! It never arms by itself: a reconnection leaves the robot as it is, and an [`Ask::Arm`] counts once.

use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sarah_protocol::host::{HelloReply, Which};
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::{HostSession, LinkStats, News, NotNow, State};
use serialport::SerialPort;

use super::client::Client;
use super::port::{self, PortError, Target};

/// The first and the longest pause before a port is tried again.
const PAUSE: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(2));
/// A host that goes lets the robot go, and waits this long for its answer.
const FAREWELL: Duration = Duration::from_millis(150);
/// Bytes of one read: a hundredth of a second at 1 Mbaud.
const CHUNK: usize = 1024;

/// What a host may ask.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Ask {
    /// This set, at the next cycle boundary.
    Params(ParamSet),
    /// Allow motion.
    Arm,
    /// Brake.
    Disarm,
    /// Brake now, latched.
    EStop,
    /// Unlatch the emergency stop.
    ClearEStop,
    /// Keep the applied set over power cycles.
    Persist,
    /// Send a set.
    Get(Which),
    /// Telemetry frames per second.
    Telemetry(u16),
    /// Let others write.
    Release,
}

/// What was heard, and when.
#[derive(Clone, PartialEq, Debug)]
pub struct Heard {
    /// Time since the link was opened, µs.
    pub at_us: u64,
    /// What.
    pub what: What,
}

/// What the link tells.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, PartialEq, Debug)]
pub enum What {
    /// From the session.
    News(News),
    /// The port is open.
    Up {
        /// Its path.
        port: String,
    },
    /// The port is gone; it is tried again.
    Down {
        /// Why.
        why: String,
    },
    /// The session would not even ask.
    NotNow {
        /// What was asked.
        ask: Ask,
        /// Why not.
        why: NotNow,
    },
}

/// Whether a host writes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Role {
    /// Claims the robot.
    Writer,
    /// Only reads.
    Observer,
}

/// How the link is.
#[derive(Clone, Debug)]
pub struct LinkHealth {
    /// Path of the port.
    pub port: String,
    /// Whether it is open.
    pub up: bool,
    /// Times it came back.
    pub reconnects: u32,
    /// Where the conversation is.
    pub state: State,
    /// The robot's last hello.
    pub robot: Option<HelloReply>,
    /// Counters.
    pub stats: LinkStats,
    /// Generation in force.
    pub applied: u32,
    /// Generation last staged by this host.
    pub staged: Option<u32>,
    /// Generation last persisted by this host.
    pub persisted: Option<u32>,
    /// The set in force, as far as it is known.
    pub params: Option<ParamSet>,
    /// No parameter change is under way.
    pub settled: bool,
}

impl LinkHealth {
    fn of(port: &str, client: &Client) -> LinkHealth {
        let session = client.session();
        LinkHealth {
            port: port.into(),
            up: true,
            reconnects: 0,
            state: session.state(),
            robot: session.robot().copied(),
            stats: *session.stats(),
            applied: session.applied(),
            staged: session.staged(),
            persisted: session.persisted(),
            params: client.applied().copied(),
            settled: client.settled(),
        }
    }
}

/// A link to one robot. Dropping it lets the robot go: it balances on.
pub struct Link {
    asks: Option<Sender<Ask>>,
    heard: Receiver<Heard>,
    health: Arc<Mutex<LinkHealth>>,
    began: Instant,
    thread: Option<JoinHandle<()>>,
}

impl Link {
    /// Opens the port; the conversation begins by itself.
    pub fn open(target: &Target, role: Role) -> Result<Link, PortError> {
        let port = port::open(target)?;
        let path = port.name().unwrap_or_default();
        let session = match role {
            Role::Writer => HostSession::new(session_number()),
            Role::Observer => HostSession::observer(session_number()),
        };
        let client = Client::new(session, None);
        let health = Arc::new(Mutex::new(LinkHealth::of(&path, &client)));
        let (asks, to_do) = channel();
        let (said, heard) = channel();
        let began = Instant::now();
        let mut pump = Pump {
            target: target.clone(),
            path,
            port: Some(port),
            client,
            asks: to_do,
            said,
            health: health.clone(),
            began,
            retry_at: began,
            pause: PAUSE.0,
            reconnects: 0,
        };
        pump.say(What::Up { port: pump.path.clone() });
        let thread = std::thread::spawn(move || pump.run());
        Ok(Link { asks: Some(asks), heard, health, began, thread: Some(thread) })
    }

    /// Asks; never waits.
    pub fn ask(&self, ask: Ask) {
        if let Some(asks) = &self.asks {
            // The thread lives as long as this; if it failed there is nobody to ask.
            let _ = asks.send(ask);
        }
    }

    /// What was heard next, within `timeout`.
    pub fn next(&self, timeout: Duration) -> Option<Heard> {
        self.heard.recv_timeout(timeout).ok()
    }

    /// How the link is.
    pub fn health(&self) -> LinkHealth {
        lock(&self.health).clone()
    }

    /// Time since the link was opened, µs; the clock of [`Heard::at_us`].
    pub fn now_us(&self) -> u64 {
        micros(self.began)
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.asks = None;
        if let Some(thread) = self.thread.take() {
            // A panic there has been reported there.
            let _ = thread.join();
        }
    }
}

/// The thread's side.
struct Pump {
    target: Target,
    path: String,
    port: Option<Box<dyn SerialPort>>,
    client: Client,
    asks: Receiver<Ask>,
    said: Sender<Heard>,
    health: Arc<Mutex<LinkHealth>>,
    began: Instant,
    retry_at: Instant,
    pause: Duration,
    reconnects: u32,
}

impl Pump {
    fn run(&mut self) {
        while self.obey() {
            match self.port.is_some() {
                true => self.exchange(),
                false => self.reopen(),
            }
        }
        // Nobody asks any more.
        if self.client.session_mut().release().is_ok() {
            let end = Instant::now() + FAREWELL;
            while self.port.is_some() && self.client.session().state() == State::Open && Instant::now() < end {
                self.exchange();
            }
        }
    }

    /// Passes the host's wishes on. False when there is no host any more.
    fn obey(&mut self) -> bool {
        loop {
            let ask = match self.asks.try_recv() {
                Ok(ask) => ask,
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => return false,
            };
            let session = self.client.session_mut();
            let done = match ask {
                Ask::Params(set) => {
                    self.client.set_params(set);
                    Ok(())
                }
                Ask::Arm => session.arm(),
                Ask::Disarm => {
                    session.disarm();
                    Ok(())
                }
                Ask::EStop => {
                    session.e_stop();
                    Ok(())
                }
                Ask::ClearEStop => session.clear_e_stop(),
                Ask::Persist => session.persist(),
                Ask::Get(which) => session.get_params(which),
                Ask::Telemetry(rate_hz) => session.set_telemetry(rate_hz),
                Ask::Release => session.release(),
            };
            if let Err(why) = done {
                self.say(What::NotNow { ask, why });
            }
        }
    }

    fn exchange(&mut self) {
        let Some(port) = &mut self.port else { return };
        let now_us = micros(self.began);
        while let Some(bytes) = self.client.poll(now_us) {
            match port.write_all(&bytes) {
                Ok(()) => {}
                // The line is full: what is lost is asked again.
                Err(error) if idle(&error) => break,
                Err(error) => return self.lost(&error),
            }
        }
        let mut bytes = [0; CHUNK];
        match port.read(&mut bytes) {
            Ok(0) => {}
            Ok(count) => {
                let mut news = vec![];
                let now_us = micros(self.began);
                self.client.on_bytes(now_us, &bytes[..count], &mut news);
                for item in news {
                    self.say(What::News(item));
                }
            }
            Err(error) if idle(&error) => {}
            Err(error) => return self.lost(&error),
        }
        self.publish(true);
    }

    fn lost(&mut self, error: &std::io::Error) {
        self.port = None;
        self.client.session_mut().cut();
        self.pause = PAUSE.0;
        self.retry_at = Instant::now() + self.pause;
        self.publish(false);
        self.say(What::Down { why: error.to_string() });
    }

    fn reopen(&mut self) {
        if Instant::now() < self.retry_at {
            std::thread::sleep(Duration::from_millis(5));
            return;
        }
        match port::open(&self.target) {
            Ok(port) => {
                self.path = port.name().unwrap_or_default();
                self.port = Some(port);
                self.reconnects = self.reconnects.saturating_add(1);
                self.publish(true);
                self.say(What::Up { port: self.path.clone() });
            }
            Err(_) => {
                self.pause = (self.pause * 2).min(PAUSE.1);
                self.retry_at = Instant::now() + self.pause;
            }
        }
    }

    fn publish(&self, up: bool) {
        let health = LinkHealth { up, reconnects: self.reconnects, ..LinkHealth::of(&self.path, &self.client) };
        *lock(&self.health) = health;
    }

    fn say(&self, what: What) {
        // Nobody listens while the link is being dropped.
        let _ = self.said.send(Heard { at_us: micros(self.began), what });
    }
}

fn idle(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

fn micros(since: Instant) -> u64 {
    u64::try_from(since.elapsed().as_micros()).unwrap_or(u64::MAX)
}

/// A panic while the lock was held leaves the last snapshot.
fn lock(health: &Mutex<LinkHealth>) -> MutexGuard<'_, LinkHealth> {
    health.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// Tells hosts apart; not 0, which is nobody.
fn session_number() -> u16 {
    use std::hash::{BuildHasher, Hasher};
    // The standard library's own source of randomness.
    let random = std::hash::RandomState::new().build_hasher().finish();
    (random as u16).max(1)
}
