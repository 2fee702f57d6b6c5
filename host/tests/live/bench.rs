//! A simulated robot on a pseudo-terminal, in real time, with a cable to pull and a switch to turn off.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sarah::emulate::attendant::Attendant;
use sarah::emulate::terminal::Terminal;
use sarah_firmware::default_params;
use sarah_protocol::bus::Mode;
use sarah_protocol::params::ParamSet;
use sarah_sim::line::{BadLine, Faults};
use sarah_sim::scenario::Scenario;
use sarah_sim::sil::{Sil, SilConfig};
use sarah_sim::world::World;
use tempfile::TempDir;

use crate::tty::PATIENCE;

/// Length of a turn, µs.
const TURN_US: u64 = 2_000;

type Work = Box<dyn FnOnce(&mut Robot) + Send>;

/// The robot's side of the cable.
struct Robot {
    world: BadLine<Sil>,
    terminal: Option<Terminal>,
    attendant: Attendant,
    link: PathBuf,
    /// Added to the world's time: it was switched off in between.
    off_us: u64,
}

impl Robot {
    fn new(scenario: &Scenario, stored: ParamSet, link: &Path, seed: u64) -> Robot {
        let config = SilConfig::default();
        let sil = Sil::new(&config, default_params(), stored, &scenario.episode(seed, 0)).expect("starts");
        let mut world = BadLine::new(sil, Faults::default(), seed);
        let attendant = Attendant::new(scenario, seed, &mut world);
        Robot { world, terminal: None, attendant, link: link.into(), off_us: 0 }
    }

    fn plug(&mut self) {
        let terminal = Terminal::new().expect("a pseudo-terminal");
        let _ = std::fs::remove_file(&self.link);
        std::os::unix::fs::symlink(terminal.path(), &self.link).expect("a link");
        self.terminal = Some(terminal);
    }

    /// As for a real port, its name goes first: the system gives the number behind it to whoever asks next, such as another
    /// robot, and the host would talk to that one.
    fn unplug(&mut self) {
        let _ = std::fs::remove_file(&self.link);
        self.terminal = None;
    }

    fn turn(&mut self) {
        let until_us = self.world.now_us() + TURN_US;
        let health = self.world.run_until(until_us).expect("simulates");
        match &mut self.terminal {
            Some(terminal) => {
                let heard = terminal.exchange(&self.world.host_read()).expect("exchanges");
                self.world.host_write(&heard);
            }
            None => drop(self.world.host_read()),
        }
        self.attendant.look(health, &mut self.world).expect("stands up");
    }
}

/// A robot, from outside.
pub struct Bench {
    folder: TempDir,
    work: Option<Sender<Work>>,
    thread: Option<JoinHandle<()>>,
}

impl Bench {
    /// Powers a robot up that nobody pushes.
    pub fn new() -> Bench {
        Bench::of("duration_s = 30.0\ndrop_m = 0.02\nsettle_s = 1.0\n")
    }

    /// Powers a robot up to which `scenario` happens again and again.
    pub fn of(scenario: &str) -> Bench {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scenario.toml");
        std::fs::write(&path, scenario).expect("writes");
        let scenario = Scenario::load(path.to_str().expect("UTF-8")).expect("a scenario");
        let (work, todo) = channel::<Work>();
        let link = folder.path().join("ttyROBOT");
        let mut robot = Robot::new(&scenario, default_params(), &link, 5);
        robot.plug();
        let thread = std::thread::spawn(move || run(&mut robot, &todo));
        Bench { folder, work: Some(work), thread: Some(thread) }
    }

    /// The port, as `--link` takes it.
    pub fn target(&self) -> String {
        format!("serial:{}", self.folder.path().join("ttyROBOT").display())
    }

    /// A path beside the robot.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn with<T: Send + 'static>(&self, work: impl FnOnce(&mut Robot) -> T + Send + 'static) -> T {
        let (done, result) = channel();
        let work: Work = Box::new(move |robot| drop(done.send(work(robot))));
        assert!(self.work.as_ref().is_some_and(|queue| queue.send(work).is_ok()), "the robot's thread lives");
        result.recv().expect("the robot's thread lives")
    }

    /// Whether motion is allowed.
    pub fn armed(&self) -> bool {
        self.with(|robot| robot.world.world().coordinator().mode() == Mode::Armed)
    }

    /// Generation in force, and its set.
    pub fn applied(&self) -> (u32, ParamSet) {
        self.with(|robot| {
            let (generation, set) = robot.world.world().coordinator().applied();
            (generation, *set)
        })
    }

    /// The set that the next power-up begins with.
    pub fn stored(&self) -> Option<ParamSet> {
        self.with(|robot| robot.world.world().stored().map(|(_, set)| *set))
    }

    /// Pulls the cable; the robot stays on.
    pub fn unplug(&self) {
        self.with(Robot::unplug);
    }

    /// Plugs it in again, as another device of the same name.
    pub fn plug(&self) {
        self.with(Robot::plug);
    }

    /// The line is like this from now on.
    pub fn line(&self, faults: Faults) {
        self.with(move |robot| robot.world.set_faults(faults));
    }

    /// Off and on again.
    pub fn power_cycle(&self, scenario: &str) {
        let path = self.path("scenario.toml");
        std::fs::write(&path, scenario).expect("writes");
        let scenario = Scenario::load(path.to_str().expect("UTF-8")).expect("a scenario");
        self.with(move |robot| {
            let stored = robot.world.world().stored().map_or(default_params(), |(_, set)| *set);
            let off_us = robot.off_us + robot.world.now_us();
            let link = robot.link.clone();
            // The debugger on the board keeps the port open, whatever happens to the chip.
            let terminal = robot.terminal.take();
            *robot = Robot { off_us, terminal, ..Robot::new(&scenario, stored, &link, 6) };
        });
    }

    /// Waits until `holds`, at most [`PATIENCE`].
    pub fn wait(&self, what: &str, holds: impl Fn(&Bench) -> bool) {
        wait(what, || holds(self));
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.work = None;
        if let Some(thread) = self.thread.take() {
            let ended = thread.join();
            assert!(ended.is_ok() || std::thread::panicking(), "the robot's thread failed");
        }
    }
}

fn run(robot: &mut Robot, todo: &Receiver<Work>) {
    let began = Instant::now();
    loop {
        match todo.try_recv() {
            Ok(work) => work(robot),
            Err(std::sync::mpsc::TryRecvError::Disconnected) => return,
            Err(std::sync::mpsc::TryRecvError::Empty) => {}
        }
        robot.turn();
        let now = Duration::from_micros(robot.off_us + robot.world.now_us());
        std::thread::sleep(now.saturating_sub(began.elapsed()));
    }
}

/// Waits until `holds`, at most [`PATIENCE`].
pub fn wait(what: &str, holds: impl Fn() -> bool) {
    let began = Instant::now();
    while !holds() {
        assert!(began.elapsed() < PATIENCE, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}
