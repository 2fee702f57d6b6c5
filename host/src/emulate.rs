//! `sarah emulate`: the flashed images on four emulated chips with the simulated robot, as a whole.
//!
//! Either a host of one's own talks to the robot through a pseudo-terminal ([`serve`]), or a host built in arms it with
//! the set in its memory and the scenario's pushes come ([`unattended`]): to compare chips with the library, or to see
//! where their cycles go.

use std::io::{ErrorKind, Read, Write};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use sarah_sim::awake::Summary;
use sarah_sim::emulated::{Emulated, Images, ImagesError, NAMES};
use sarah_sim::mirror::{Compared, Difference};
use sarah_sim::robot::Health;
use sarah_sim::scenario::Episode;
use sarah_sim::sil::{SilConfig, SilError};
use sarah_sim::world::World;
use serialport::{SerialPort, TTYPort};
use thiserror::Error;

use crate::link::sim::{LinkError, SLICE_US, SimRobot};
use crate::progress::Progress;

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
    /// What happens to it.
    pub episode: Episode,
    /// How long, s.
    pub seconds: f64,
}

impl Setup {
    fn start(&self) -> Result<Emulated, EmulateError> {
        Ok(Emulated::new(&self.config, &Images::load(&self.images)?, &self.episode)?)
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
    /// Awake cycles per tick, in the order of [`NAMES`], if asked for.
    pub awake: Option<[Summary; 4]>,
    /// Cycles by function, most first, chip by chip, if asked for.
    pub functions: Vec<Vec<(String, u64)>>,
    /// The robot at the end.
    pub health: Health,
    /// Emulated time, s.
    pub seconds: f64,
    /// Wall time it took, s.
    pub wall_s: f64,
}

/// Runs armed by a host built in, without waiting for the clock on the wall; until the end, or until the robot falls.
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
    let mut robot = SimRobot::over(world);
    robot.arm();
    let mut health = Health::Upright;
    while health == Health::Upright && robot.world().now_us() < setup.end_us() {
        health = robot.advance()?.health;
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
        health,
        seconds: world.now_us() as f64 * 1e-6,
        wall_s: began.elapsed().as_secs_f64(),
    })
}

fn by_function(chip: &samc21::Chip) -> Vec<(String, u64)> {
    let all = chip.profile().map(|profile| profile.functions()).unwrap_or_default();
    all.into_iter().map(|(name, ticks)| (name.to_owned(), ticks)).collect()
}

/// Runs at the pace of the wall clock (or as fast as it can), the coordinator's UART on a pseudo-terminal, until the time
/// is over or the robot falls.
pub fn serve(setup: &Setup, fast: bool) -> Result<Health, EmulateError> {
    let mut world = setup.start()?;
    let (mut near, far) = TTYPort::pair()?;
    near.set_timeout(Duration::ZERO)?;
    println!("host link: {}", far.name().unwrap_or_default());
    let began = Instant::now();
    let mut pending = vec![];
    let mut said_s = 0;
    let mut health = Health::Upright;
    while health == Health::Upright && world.now_us() < setup.end_us() {
        let mut bytes = [0; 1024];
        match near.read(&mut bytes) {
            Ok(count) => world.host_write(&bytes[..count]),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {}
            Err(error) => return Err(error.into()),
        }
        health = world.run_until(world.now_us() + SLICE_US)?;
        pending.extend(world.host_read());
        match near.write(&pending) {
            Ok(count) => drop(pending.drain(..count)),
            // Nobody reads: a serial line would lose it.
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => pending.clear(),
            Err(error) => return Err(error.into()),
        }
        let now = Duration::from_micros(world.now_us());
        if !fast {
            std::thread::sleep(now.saturating_sub(began.elapsed()));
        }
        if now.as_secs() > said_s {
            said_s = now.as_secs();
            println!("{}", line(&world, began.elapsed()));
        }
    }
    Ok(health)
}

/// One line of live state.
fn line(world: &Emulated, wall: Duration) -> String {
    let trunk = world.body().robot().trunk();
    let awake: Vec<String> = NAMES
        .iter()
        .zip(world.chips())
        .map(|(name, chip)| format!("{name} {:.0} %", 100.0 * chip.awake() as f64 / chip.now().0.max(1) as f64))
        .collect();
    format!(
        "{:7.1} s ({:.1} x real time)  trunk {:+.2} {:+.2} {:.2} m  awake: {}",
        world.now_us() as f64 * 1e-6,
        world.now_us() as f64 * 1e-6 / wall.as_secs_f64().max(1e-9),
        trunk.position_m[0],
        trunk.position_m[1],
        trunk.position_m[2],
        awake.join(", "),
    )
}
