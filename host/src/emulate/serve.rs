//! The robot on a pseudo-terminal: any host may connect, in real time.

use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use samc21::{Cycles, Stop};
use sarah_sim::emulated::{Emulated, NAMES};
use sarah_sim::robot::Health;
use sarah_sim::world::World;
use serialport::{SerialPort, TTYPort};

use super::logs::Logs;
use super::{EmulateError, Setup};

/// Bytes from the pseudo-terminal that are passed on at once.
const CHUNK: usize = 1024;

/// A robot whose host link is a pseudo-terminal.
pub struct Server {
    world: Emulated,
    near: TTYPort,
    /// Held open, so that a host may come and go.
    far: TTYPort,
    logs: Option<Logs>,
    pending: Vec<u8>,
    began: Instant,
    fast: bool,
    said_s: u64,
    end_us: u64,
}

impl Server {
    /// Powers the robot up and prints where its host link is. `fast`: does not wait for the clock on the wall.
    /// `logs`: prints what the chips log.
    pub fn start(setup: &Setup, fast: bool, logs: bool) -> Result<Server, EmulateError> {
        let world = setup.start()?;
        let (mut near, far) = TTYPort::pair()?;
        near.set_timeout(Duration::from_millis(1))?;
        println!("host link: {}", far.name().unwrap_or_default());
        let logs = if logs { Some(Logs::start(&setup.images, &world)?) } else { None };
        let (began, end_us) = (Instant::now(), setup.end_us());
        Ok(Server { world, near, far, logs, pending: vec![], began, fast, said_s: 0, end_us })
    }

    /// The robot.
    pub fn world(&self) -> &Emulated {
        &self.world
    }

    /// The robot, for a debugger.
    pub fn world_mut(&mut self) -> &mut Emulated {
        &mut self.world
    }

    /// The time is over, or the robot has fallen.
    pub fn ended(&self) -> bool {
        self.world.now_us() >= self.end_us || self.world.health() != Health::Upright
    }

    /// Passes bytes on and runs for `slice_us`, or until a chip is halted by a debugger: then which.
    pub fn turn(&mut self, slice_us: u64) -> Result<Option<usize>, EmulateError> {
        let mut bytes = [0; CHUNK];
        // Asked only when something waits: an empty read would cost its time-out.
        if self.near.bytes_to_read()? > 0 {
            match self.near.read(&mut bytes) {
                Ok(count) => self.world.host_write(&bytes[..count]),
                Err(error) if idle(&error) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let until = Cycles::from_micros(self.world.now_us() + slice_us);
        let halted = match self.world.run(until) {
            None | Some((_, Stop::Time)) => None,
            Some((chip, Stop::Breakpoint)) => Some(chip),
            Some((chip, Stop::Violation)) => return Err(self.world.violation(chip).into()),
        };
        self.pending.extend(self.world.host_read());
        if !self.pending.is_empty() {
            match self.near.write(&self.pending) {
                Ok(count) => drop(self.pending.drain(..count)),
                // Nobody reads: a serial line would lose it.
                Err(error) if idle(&error) => self.pending.clear(),
                Err(error) => return Err(error.into()),
            }
        }
        if let Some(logs) = &mut self.logs {
            logs.collect(&mut self.world)?;
        }
        self.keep_pace();
        Ok(halted)
    }

    fn keep_pace(&mut self) {
        let now = Duration::from_micros(self.world.now_us());
        if !self.fast {
            std::thread::sleep(now.saturating_sub(self.began.elapsed()));
        }
        if now.as_secs() > self.said_s {
            self.said_s = now.as_secs();
            println!("{}", self.line());
        }
    }

    /// The clock on the wall went on while the robot stood still; it does not run after it.
    pub fn resume(&mut self) {
        let now = Duration::from_micros(self.world.now_us());
        self.began = Instant::now().checked_sub(now).unwrap_or_else(Instant::now);
    }

    /// One line of live state.
    fn line(&self) -> String {
        let trunk = self.world.body().robot().trunk();
        let share = |chip: &samc21::Chip| 100.0 * chip.awake() as f64 / chip.now().0.max(1) as f64;
        let awake: Vec<String> =
            NAMES.iter().zip(self.world.chips()).map(|(name, chip)| format!("{name} {:.0} %", share(chip))).collect();
        let now_s = self.world.now_us() as f64 * 1e-6;
        format!(
            "{now_s:7.1} s ({:.1} x real time)  trunk {:+.2} {:+.2} {:.2} m  awake: {}",
            now_s / self.began.elapsed().as_secs_f64().max(1e-9),
            trunk.position_m[0],
            trunk.position_m[1],
            trunk.position_m[2],
            awake.join(", "),
        )
    }

    /// Path of the host link.
    pub fn path(&self) -> String {
        self.far.name().unwrap_or_default()
    }
}

fn idle(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

/// Length of a turn, µs.
const TURN_US: u64 = 2_000;

/// Serves until the time is over or the robot falls.
pub fn serve(mut server: Server) -> Result<Health, EmulateError> {
    while !server.ended() {
        server.turn(TURN_US)?;
    }
    Ok(server.world.health())
}
