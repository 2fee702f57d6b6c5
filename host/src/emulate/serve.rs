//! The robot on a pseudo-terminal: any host may connect, in real time.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use samc21::nvm::RWWEE_BASE;
use samc21::{Cycles, Stop};
use sarah_sim::emulated::{COORDINATOR, Emulated, NAMES};
use sarah_sim::world::World;

use super::attendant::Attendant;
use super::logs::Logs;
use super::terminal::Terminal;
use super::{EmulateError, Setup};
use crate::run::{read_bytes, write_atomic};

/// How the robot is served.
#[derive(Clone, Debug, Default)]
pub struct Service {
    /// Does not wait for the clock on the wall.
    pub fast: bool,
    /// Prints what the chips log.
    pub logs: bool,
    /// File with the coordinator's non-volatile memory, kept from one power-up to the next.
    pub memory: Option<PathBuf>,
}

/// A robot whose host link is a pseudo-terminal.
pub struct Server {
    world: Emulated,
    terminal: Terminal,
    attendant: Attendant,
    logs: Option<Logs>,
    memory: Option<Memory>,
    began: Instant,
    fast: bool,
    said_s: u64,
    end_us: u64,
}

/// Non-volatile memory that outlives the process.
struct Memory {
    path: PathBuf,
    kept: Vec<u8>,
}

impl Memory {
    /// Puts what the file holds into the coordinator; without a file the memory is as the factory left it.
    fn open(path: &Path, world: &mut Emulated) -> Result<Memory, EmulateError> {
        let chip = &mut world.chips_mut()[COORDINATOR];
        if path.exists() {
            let bytes = read_bytes(path)?;
            if bytes.len() != chip.nvm().rwwee().len() {
                return Err(EmulateError::Memory { path: path.into(), expected: chip.nvm().rwwee().len() });
            }
            chip.nvm_mut().load(RWWEE_BASE, &bytes);
        }
        Ok(Memory { path: path.into(), kept: chip.nvm().rwwee().to_vec() })
    }

    fn keep(&mut self, world: &Emulated) -> Result<(), EmulateError> {
        let now = world.chips()[COORDINATOR].nvm().rwwee();
        if now != self.kept {
            write_atomic(&self.path, now)?;
            self.kept = now.to_vec();
        }
        Ok(())
    }
}

impl Server {
    /// Powers the robot up and prints where its host link is.
    pub fn start(setup: &Setup, service: &Service) -> Result<Server, EmulateError> {
        let mut world = setup.start()?;
        let memory = service.memory.as_ref().map(|path| Memory::open(path, &mut world)).transpose()?;
        let terminal = Terminal::new()?;
        println!("host link: {}", terminal.path());
        let logs = if service.logs { Some(Logs::start(&setup.images, &world)?) } else { None };
        let attendant = Attendant::new(&setup.scenario, setup.seed, &mut world);
        let (began, end_us, fast) = (Instant::now(), setup.end_us(), service.fast);
        Ok(Server { world, terminal, attendant, logs, memory, began, fast, said_s: 0, end_us })
    }

    /// The robot.
    pub fn world(&self) -> &Emulated {
        &self.world
    }

    /// The robot, for a debugger.
    pub fn world_mut(&mut self) -> &mut Emulated {
        &mut self.world
    }

    /// The time is over.
    pub fn ended(&self) -> bool {
        self.world.now_us() >= self.end_us
    }

    /// Passes bytes on and runs for `slice_us`, or until a chip is halted by a debugger: then which.
    pub fn turn(&mut self, slice_us: u64) -> Result<Option<usize>, EmulateError> {
        let until = Cycles::from_micros(self.world.now_us() + slice_us);
        let halted = match self.world.run(until) {
            None | Some((_, Stop::Time)) => None,
            Some((chip, Stop::Breakpoint)) => Some(chip),
            Some((chip, Stop::Violation)) => return Err(self.world.violation(chip).into()),
        };
        let heard = self.terminal.exchange(&self.world.host_read())?;
        self.world.host_write(&heard);
        self.attendant.look(self.world.health(), &mut self.world)?;
        if let Some(memory) = &mut self.memory {
            memory.keep(&self.world)?;
        }
        if let Some(logs) = &mut self.logs {
            logs.collect(&mut self.world)?;
        }
        self.keep_pace()?;
        Ok(halted)
    }

    fn keep_pace(&mut self) -> Result<(), EmulateError> {
        let now = Duration::from_micros(self.world.now_us());
        if !self.fast {
            std::thread::sleep(now.saturating_sub(self.began.elapsed()));
        }
        if now.as_secs() > self.said_s {
            self.said_s = now.as_secs();
            println!("{}", self.line());
        }
        Ok(())
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
            "{now_s:7.1} s ({:.1} x real time)  trunk {:+.2} {:+.2} {:.2} m  falls {}  awake: {}",
            now_s / self.began.elapsed().as_secs_f64().max(1e-9),
            trunk.position_m[0],
            trunk.position_m[1],
            trunk.position_m[2],
            self.attendant.falls(),
            awake.join(", "),
        )
    }
}

/// Length of a turn, µs.
const TURN_US: u64 = 2_000;

/// Serves until the time is over.
pub fn serve(mut server: Server) -> Result<(), EmulateError> {
    while !server.ended() {
        server.turn(TURN_US)?;
    }
    Ok(())
}
