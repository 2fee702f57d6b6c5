//! The flashed images in the loop: four emulated chips on one CAN bus, wired to the robot as `docs/wiring.md` says.
//!
//! ```text
//!             UART pins                CAN pins                 TCC and PORT pins
//!  host ◄──────────────► coordinator ◄────bus────► knee/hip/abductor ──────────────► actuators ──► rapier
//!                            ▲ IMU on SPI                  ▲ ADC inputs                              │
//!                            └───────────────────── sensors ◄────────────────────────────────────────┘
//! ```
//!
//! Chips and robot advance in lockstep: chips run a slice, then the bus and the wires exchange, and a physics step is
//! taken when it is due, with the commands that stand on the pins at that time. Equal images, configuration and seed give
//! equal bits.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use samc21::machine::SLICE;
use samc21::wires::{CanFrame, Serial, SpiLink, Uart, UartByte};
use samc21::{CanBus, Chip, Cycles, Exchange, Image, ImageError, Machine, Stop, Wires};
use sarah_firmware::board::samc21::pins::Pin;
use sarah_firmware::board::samc21::wiring;
use sarah_firmware::calibration::{Command, PWM_PERIOD};
use sarah_protocol::bus::{Frame, NodeId};
use thiserror::Error;

use crate::awake::{Awake, ENTRIES, Summary};
use crate::body::Body;
use crate::imu::Imu;
use crate::mirror::{Mirror, Nameless};
use crate::plant::PlantError;
use crate::robot::Health;
use crate::scenario::Episode;
use crate::sil::{SilConfig, SilError};
use crate::tap::Tap;
use crate::world::World;

/// Index of the coordinator's chip; the nodes follow in the order of [`NodeId`].
pub const COORDINATOR: usize = 0;
/// Names of the images, in the order of the chips.
pub const NAMES: [&str; 4] = ["coordinator", "knee", "hip", "abductor"];
/// SERCOM of the IMU and of the host link.
const IMU_SERCOM: usize = 1;
const HOST_SERCOM: usize = 4;
/// Supply of the chips, V; the converter's reference.
const SUPPLY_V: f32 = 5.0;
/// Between two looks at the sensors, µs: half of the shortest physics step.
const LOOK_US: u64 = 500;
/// A byte on the host link at 1 Mbaud: ten bits.
const BYTE: u64 = 480;

/// Why images cannot run.
#[derive(Debug, Clone, Error)]
pub enum ImagesError {
    /// Not built yet.
    #[error("no image at {0}; build the images with `cargo firmware`")]
    Missing(PathBuf),
    /// Not an image for this chip.
    #[error("{path} cannot be flashed: {why}; build the images anew with `cargo firmware`")]
    Unfit {
        /// Which.
        path: PathBuf,
        /// Why.
        why: Arc<ImageError>,
    },
    /// Not built from this source.
    #[error("the {image} image has no `{name}`; build it with `cargo firmware` from this source")]
    NoTick {
        /// Which image.
        image: &'static str,
        /// Its tick function.
        name: &'static str,
    },
    /// Not built from this source.
    #[error(transparent)]
    Nameless(#[from] Nameless),
    /// The firmware did what silicon would not forgive.
    #[error("the {image} image: {violation}")]
    Violation {
        /// Which.
        image: &'static str,
        /// What, where and when.
        violation: String,
    },
}

/// The four images.
#[derive(Clone, Debug)]
pub struct Images([Image; 4]);

impl Images {
    /// Reads `coordinator`, `knee`, `hip` and `abductor` from a folder; once per folder and process.
    pub fn load(folder: &Path) -> Result<Images, ImagesError> {
        static LOADED: Mutex<BTreeMap<PathBuf, Images>> = Mutex::new(BTreeMap::new());
        // A panic while the lock is held leaves the map as it was.
        let mut loaded = LOADED.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if let Some(images) = loaded.get(folder) {
            return Ok(images.clone());
        }
        let mut images = vec![];
        for name in NAMES {
            let path = folder.join(name);
            let bytes = std::fs::read(&path).map_err(|_| ImagesError::Missing(path.clone()))?;
            images.push(Image::from_elf(&bytes).map_err(|why| ImagesError::Unfit { path, why: Arc::new(why) })?);
        }
        let Ok(images) = <[Image; 4]>::try_from(images) else { return Err(ImagesError::Missing(folder.into())) };
        let images = Images(images);
        loaded.insert(folder.into(), images.clone());
        Ok(images)
    }

    /// One of [`NAMES`].
    pub fn get(&self, index: usize) -> &Image {
        &self.0[index]
    }
}

/// A robot whose controllers are emulated chips.
pub struct Emulated {
    machine: Machine,
    outside: Outside,
    images: Images,
    /// The host link is busy until then.
    host_line: Cycles,
    awake: Option<[Awake; 4]>,
}

/// Everything outside the chips.
struct Outside {
    body: Body,
    can: CanBus,
    imu: Imu,
    health: Health,
    /// Why the robot's body cannot go on.
    lost: Option<PlantError>,
    /// Whether time goes on after a fall.
    runs_on: bool,
    next_look_us: u64,
    mirror: Option<Mirror>,
}

impl Outside {
    fn ended(&self) -> bool {
        self.lost.is_some() || (self.health != Health::Upright && !self.runs_on)
    }
}

impl Emulated {
    /// Powers four chips up with the images in `folder`, at the start of `episode`.
    pub fn start(config: &SilConfig, folder: &Path, episode: &Episode) -> Result<Emulated, SilError> {
        Emulated::new(config, &Images::load(folder)?, episode)
    }

    /// Powers four chips up with `images`.
    pub fn new(config: &SilConfig, images: &Images, episode: &Episode) -> Result<Emulated, SilError> {
        let imu = Imu::default();
        let mut chips: Vec<Chip> = images.0.iter().map(Chip::new).collect();
        for (index, chip) in chips.iter_mut().enumerate() {
            chip.stop_at_violation(true);
            let wires = chip.wires_mut();
            wires.supply = SUPPLY_V;
            if index == COORDINATOR {
                let select = wiring::IMU_SELECT.pin;
                let link = SpiLink::new(imu.clone(), (select.group as usize, select.number));
                wires.serial[IMU_SERCOM] = Serial::Spi(link);
                wires.serial[HOST_SERCOM] = Serial::Uart(Uart::default());
            } else {
                for wire in wiring::BRAKE.iter().chain(&wiring::PWM) {
                    wires.pins[wire.pin.group as usize].solder(wire.pin.number, false);
                }
            }
        }
        let can = CanBus::of_chips(chips.len());
        let body = Body::new(config, episode)?;
        let health = Health::Upright;
        let outside = Outside { body, can, imu, health, lost: None, runs_on: false, next_look_us: 0, mirror: None };
        let mut emulated = Emulated {
            machine: Machine::new(chips),
            outside,
            images: images.clone(),
            host_line: Cycles(0),
            awake: None,
        };
        emulated.outside.look(0, &mut emulated.machine.chips);
        Ok(emulated)
    }

    /// The chips, in the order of [`NAMES`].
    pub fn chips(&self) -> &[Chip] {
        &self.machine.chips
    }

    /// The chips, for whoever breaks or debugs them.
    pub fn chips_mut(&mut self) -> &mut [Chip] {
        &mut self.machine.chips
    }

    /// The bus, to pull plugs and disturb.
    pub fn can_mut(&mut self) -> &mut CanBus {
        &mut self.outside.can
    }

    /// Commands on the pins of a node, left and right.
    pub fn commands(&self, id: NodeId) -> [Command; 2] {
        commands(&self.machine.chips, id)
    }

    /// Runs until `until`, the robot's end, or a chip stops; which chip, and why.
    pub fn run(&mut self, until: Cycles) -> Option<(usize, Stop)> {
        while self.machine.now() < until && !self.outside.ended() {
            // One slice, so that a fall ends the run at once.
            let end = Cycles((self.machine.now().0 / SLICE + 1) * SLICE);
            if let Some(stop) = self.machine.run_until(end, &mut self.outside) {
                return Some(stop);
            }
        }
        None
    }

    /// Lets the library repeat and check every tick of the nodes from here on; before the first run.
    pub fn compare(&mut self) -> Result<(), ImagesError> {
        let mirror = Mirror::new(|id| self.images.get(1 + id as usize).clone())?;
        for id in NodeId::ALL {
            self.machine.chips[1 + id as usize].watch(mirror.entry(id), true);
        }
        self.outside.can.record(true);
        self.outside.mirror = Some(mirror);
        Ok(())
    }

    /// Compares as [`Emulated::compare`] does, and connects `tap` to the nodes; before the first run.
    pub fn set_tap(&mut self, tap: Box<dyn Tap>) -> Result<(), ImagesError> {
        self.compare()?;
        if let Some(mirror) = &mut self.outside.mirror {
            mirror.set_tap(tap);
        }
        Ok(())
    }

    /// The comparison so far, if there is one.
    pub fn mirror(&self) -> Option<&Mirror> {
        self.outside.mirror.as_ref()
    }

    /// Measures from here on how long each chip is awake per tick.
    pub fn measure(&mut self) -> Result<(), ImagesError> {
        for (index, chip) in self.machine.chips.iter_mut().enumerate() {
            let name = ENTRIES[index];
            let symbols = self.images.get(index).symbols.all();
            let entry = symbols.iter().find(|symbol| symbol.name.starts_with(name)).map(|symbol| symbol.address);
            let entry = entry.ok_or(ImagesError::NoTick { image: NAMES[index], name })?;
            chip.watch(entry, true);
        }
        self.awake = Some(Default::default());
        Ok(())
    }

    /// Awake cycles per tick so far, chip by chip, if measured.
    pub fn awake(&self) -> Option<[Summary; 4]> {
        self.awake.as_ref().map(|chips| [0, 1, 2, 3].map(|index| chips[index].summary()))
    }

    /// What a chip's firmware did last that silicon would not forgive.
    pub fn violation(&self, chip: usize) -> ImagesError {
        let violation = self.machine.chips[chip].violations().last().map(ToString::to_string).unwrap_or_default();
        ImagesError::Violation { image: NAMES[chip], violation }
    }

    /// The images.
    pub fn images(&self) -> &Images {
        &self.images
    }

    /// The robot's state so far.
    pub fn health(&self) -> Health {
        self.outside.health
    }
}

impl World for Emulated {
    fn run_until(&mut self, until_us: u64) -> Result<Health, SilError> {
        while let Some((chip, stop)) = self.run(Cycles::from_micros(until_us)) {
            if stop == Stop::Violation {
                return Err(self.violation(chip).into());
            }
            if let Some(awake) = &mut self.awake {
                let halted = &self.machine.chips[chip];
                awake[chip].at_tick(halted.now(), halted.awake());
            }
            if let Some(mirror) = &mut self.outside.mirror
                && let Some(id) = NodeId::ALL.into_iter().find(|id| chip == 1 + *id as usize)
            {
                mirror.at_tick(id, &self.machine.chips[chip], told(&self.machine.chips, id));
            }
        }
        self.outside.lost.clone().map_or(Ok(self.outside.health), |lost| Err(lost.into()))
    }

    fn now_us(&self) -> u64 {
        micros(self.machine.now())
    }

    fn host_write(&mut self, bytes: &[u8]) {
        let now = self.machine.now();
        self.host_line = self.host_line.max(now);
        if let Serial::Uart(uart) = &mut self.machine.chips[COORDINATOR].wires_mut().serial[HOST_SERCOM] {
            for &byte in bytes {
                self.host_line += BYTE;
                uart.to_chip.push_back(UartByte { at: self.host_line, byte, framing_error: false });
            }
        }
    }

    fn host_read(&mut self) -> Vec<u8> {
        match &mut self.machine.chips[COORDINATOR].wires_mut().serial[HOST_SERCOM] {
            Serial::Uart(uart) => uart.from_chip.drain(..).map(|byte| byte.byte).collect(),
            _ => vec![],
        }
    }

    fn body(&self) -> &Body {
        &self.outside.body
    }

    fn body_mut(&mut self) -> &mut Body {
        &mut self.outside.body
    }

    fn run_on(&mut self) {
        self.outside.runs_on = true;
    }
}

impl Exchange for Outside {
    fn exchange(&mut self, now: Cycles, chips: &mut [Chip]) {
        self.can.exchange(now, chips);
        if let Some(mirror) = &mut self.mirror {
            for record in self.can.take_log().into_iter().filter(|record| record.error.is_none()) {
                let sender = NodeId::ALL.into_iter().find(|id| record.sender == 1 + *id as usize);
                let hears = |id: NodeId| chips[1 + id as usize].wires().can[0].takes_part();
                mirror.passed(sender, &frame(&record.frame), hears);
            }
        }
        let now_us = micros(now);
        if now_us >= self.body.next_us() && !self.ended() {
            match self.body.step(|id| commands(chips, id)) {
                Ok(health) => self.health = health,
                Err(error) => self.lost = Some(error),
            }
            self.next_look_us = now_us;
        }
        if now_us >= self.next_look_us {
            self.look(now_us, chips);
        }
    }
}

impl Outside {
    /// Puts what the sensors say onto the wires.
    fn look(&mut self, now_us: u64, chips: &mut [Chip]) {
        self.next_look_us = now_us + LOOK_US;
        self.imu.set(self.body.imu(now_us));
        for id in NodeId::ALL {
            let counts = self.body.counts(id, now_us);
            let chip = &mut chips[1 + id as usize];
            let readings = counts.position.into_iter().chain(counts.load);
            for (input, reading) in wiring::ANALOGUE.iter().zip(readings) {
                // In the middle of the step, so that the converter reads this very count.
                let volts = (f32::from(reading) + 0.5) / 4096.0 * SUPPLY_V;
                if chip.wires().analog[0][usize::from(input.input)] != volts {
                    chip.wires_mut().analog[0][usize::from(input.input)] = volts;
                }
            }
        }
    }
}

fn micros(cycles: Cycles) -> u64 {
    cycles.0 / 48
}

/// What the pins of a node tell its actuators, left and right.
fn commands(chips: &[Chip], id: NodeId) -> [Command; 2] {
    let wires = chips[1 + id as usize].wires();
    [0, 1].map(|side| {
        if share_high(wires, wiring::BRAKE[side].pin) < 0.5 {
            return Command::Brake;
        }
        let duty = (share_high(wires, wiring::PWM[side].pin) * f32::from(PWM_PERIOD)).round() as u16;
        Command::Run { forward: share_high(wires, wiring::DIRECTION[side].pin) > 0.5, duty }
    })
}

/// What the timer of a node has been told; on the pins from its next period on.
fn told(chips: &[Chip], id: NodeId) -> [Command; 2] {
    let chip = &chips[1 + id as usize];
    let timer = &chip.peripherals().tcc[0];
    [0, 1].map(|side| match timer.upcoming(side + 2) {
        0 => Command::Brake,
        _ => Command::Run {
            forward: share_high(chip.wires(), wiring::DIRECTION[side].pin) > 0.5,
            duty: timer.upcoming(side) as u16,
        },
    })
}

fn frame(frame: &CanFrame) -> Frame {
    let bytes = &frame.data[..usize::from(frame.length).min(frame.data.len())];
    Frame { id: frame.id as u16, data: bytes.iter().copied().collect() }
}

fn share_high(wires: &Wires, pin: Pin) -> f32 {
    wires.share_high(pin.group as usize, pin.number).unwrap_or(0.0)
}
