//! `sarah emulate`: the flashed images on four emulated chips with the simulated robot, as a whole.
//!
//! Either a host of one's own talks to the robot through a pseudo-terminal ([`serve`], [`terminal`]), somebody beside it
//! pushes it and picks it up ([`attendant`]), with GDB on one of the chips if asked for ([`gdb`]), or a host built in arms it with the set in its memory and the scenario's pushes come
//! ([`unattended`]): to compare chips with the library, or to see where their cycles go.

pub mod attendant;
pub mod gdb;
mod logs;
pub mod serve;
pub mod terminal;

use std::path::PathBuf;
use std::time::Instant;

use sarah_sim::awake::Summary;
use sarah_sim::emulated::{Emulated, Images, ImagesError};
use sarah_sim::mirror::{Compared, Difference};
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::{SilConfig, SilError};
use sarah_sim::world::World;
use thiserror::Error;

use crate::link::sim::{LinkError, SLICE_US, SimRobot};
use crate::progress::Progress;
use crate::run::RunError;
use attendant::Attendant;

/// Why an emulation ended early.
#[derive(Debug, Error)]
pub enum EmulateError {
    /// The images.
    #[error(transparent)]
    Images(#[from] ImagesError),
    /// The simulation.
    #[error(transparent)]
    Sil(#[from] SilError),
    /// The link to the robot.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// No pseudo-terminal.
    #[error("cannot open a pseudo-terminal: {0}; is /dev/pts mounted?")]
    Terminal(#[from] serialport::Error),
    /// The pseudo-terminal failed.
    #[error("the pseudo-terminal failed: {0}; start again")]
    Io(#[from] std::io::Error),
    /// The file of the coordinator's memory.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A file that is no memory.
    #[error("{path} is no memory of {expected} bytes; name another --memory file, or delete it to start without one")]
    Memory {
        /// Which.
        path: PathBuf,
        /// What it would have.
        expected: usize,
    },
    /// No listener for GDB.
    #[error("cannot listen for GDB on port {port}: {source}; choose another --gdb port")]
    Listen {
        /// Where.
        port: u16,
        /// Why.
        source: std::io::Error,
    },
    /// No words for the logs.
    #[error(
        "cannot decode logs with `defmt-print`: {0}; `cargo install defmt-print --version 1.2.0 --locked`, or leave --logs off"
    )]
    Decoder(std::io::Error),
    /// The debugger's session.
    #[error("the debugger's session failed: {0}; connect again")]
    Gdb(String),
    /// Chips and library differ.
    #[error("chips and library differ: {0}")]
    Different(Difference),
}

/// What is emulated.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Folder of the images.
    pub images: PathBuf,
    /// The robot.
    pub config: SilConfig,
    /// What happens to it, again and again.
    pub scenario: Scenario,
    /// Seed of pushes and sensor noise.
    pub seed: u64,
    /// How long, s.
    pub seconds: f64,
}

impl Setup {
    fn start(&self) -> Result<Emulated, EmulateError> {
        Ok(Emulated::new(&self.config, &Images::load(&self.images)?, &self.scenario.episode(self.seed, 0))?)
    }

    fn end_us(&self) -> u64 {
        (self.seconds * 1e6) as u64
    }
}

/// What an unattended run shows.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Chips against library, if asked for.
    pub compared: Option<Compared>,
    /// Awake cycles per tick, in the order of [`sarah_sim::emulated::NAMES`], if asked for.
    pub awake: Option<[Summary; 4]>,
    /// Cycles by function, most first, chip by chip, if asked for.
    pub functions: Vec<Vec<(String, u64)>>,
    /// Times the robot fell, and was put back on its feet.
    pub falls: u32,
    /// Emulated time, s.
    pub seconds: f64,
    /// Wall time it took, s.
    pub wall_s: f64,
}

/// Runs armed by a host built in, without waiting for the clock on the wall.
pub fn unattended(setup: &Setup, compare: bool, cycles: bool) -> Result<Shown, EmulateError> {
    let mut world = setup.start()?;
    if compare {
        world.compare()?;
    }
    if cycles {
        world.measure()?;
        for chip in world.chips_mut() {
            chip.set_profiling(true);
        }
    }
    let began = Instant::now();
    let progress = Progress::counting(setup.seconds.ceil() as u64, "seconds");
    let mut attendant = Attendant::new(&setup.scenario, setup.seed, &mut world);
    let mut robot = SimRobot::over(world);
    robot.arm();
    while robot.world().now_us() < setup.end_us() {
        let health = robot.advance()?.health;
        attendant.look(health, robot.world_mut())?;
        if robot.world().now_us() % 1_000_000 < SLICE_US {
            progress.episode(None);
        }
        if let Some(difference) = robot.world().mirror().and_then(|mirror| mirror.difference()) {
            progress.finish();
            return Err(EmulateError::Different(difference.clone()));
        }
    }
    progress.finish();
    let world = robot.world();
    let functions = match cycles {
        true => world.chips().iter().map(by_function).collect(),
        false => vec![],
    };
    Ok(Shown {
        compared: world.mirror().map(|mirror| mirror.compared()),
        awake: world.awake(),
        functions,
        falls: attendant.falls(),
        seconds: world.now_us() as f64 * 1e-6,
        wall_s: began.elapsed().as_secs_f64(),
    })
}

fn by_function(chip: &samc21::Chip) -> Vec<(String, u64)> {
    let all = chip.profile().map(|profile| profile.functions()).unwrap_or_default();
    all.into_iter().map(|(name, ticks)| (name.to_owned(), ticks)).collect()
}
