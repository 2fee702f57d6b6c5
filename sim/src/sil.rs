//! Software in the loop: the firmware library, unchanged, on the simulated robot.
//!
//! ```text
//!        host bytes                      frames                      drives
//!  host ◄──────────► coordinator ◄────────bus────────► knee/hip/abductor ──► actuators ──► plant
//!                        ▲ IMU counts                        ▲ positions, pads                │
//!                        └──────────────────── sensors ◄────────────────────────────────────── ┘
//! ```
//!
//! Every message crosses the bus and the host link as encoded bytes, every sensor value the converter's counts and
//! every drive the pulse widths of the boards. Four clocks run on one microsecond time line:
//! physics, coordinator, nodes, bus. Chips tick in turn within a period (coordinator, knee, swing nodes, a tenth of the
//! period apart), as free-running chips do on average; a command acts from the next physics step. Equal configuration
//! and seed give equal bits.

use std::collections::VecDeque;
use std::path::PathBuf;

use sarah_firmware::coordinator::{BusOutbox, Coordinator, HostOutbox, ImuSample};
use sarah_firmware::lpg::Drive as Command;
use sarah_firmware::node::{Node, NodeKind, Outputs};
use sarah_protocol::bus::{Frame, Message, NodeId};
use sarah_protocol::params::ParamSet;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::actuator::{ActuatorConfig, ActuatorError};
use crate::body::{Body, calibration_of, joints_of};
use crate::bus::{Bus, Station};
use crate::chips::{self, Birth};
use crate::emulated::ImagesError;
use crate::energy::{EnergyConfig, EnergyError, EnergyMeter};
use crate::plant::{Plant, PlantError};
use crate::robot::{Health, RobotConfig, RobotError};
use crate::scenario::Episode;
use crate::sensors::{SensorConfig, SensorError};
use crate::tap::{Passing, Socket, Tap};

/// What is simulated, and how finely.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SilConfig {
    /// Ticks of every pattern generator per second, 100 to 10000. The paper trains at 100 and runs at 10000.
    pub lpg_rate_hz: u32,
    /// Time from sending a frame to receiving it, µs, at most 100000.
    pub bus_latency_us: u32,
    /// Arm at boot, without a host.
    pub arm_at_boot: bool,
    /// Folder of the flashed images, to run on emulated chips instead of the library; their rates are their own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub images: Option<PathBuf>,
    /// Program and arguments, separated by spaces, that simulate the robot's body instead of rapier: see
    /// `docs/sim-to-sim.md`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plant: Option<String>,
    /// The robot.
    pub robot: RobotConfig,
    /// Its sensors.
    pub sensors: SensorConfig,
    /// Its actuators.
    pub actuators: ActuatorConfig,
    /// What it draws.
    pub energy: EnergyConfig,
}

impl Default for SilConfig {
    fn default() -> Self {
        SilConfig {
            lpg_rate_hz: 100,
            bus_latency_us: 300,
            arm_at_boot: false,
            images: None,
            plant: None,
            robot: RobotConfig::default(),
            sensors: SensorConfig::default(),
            actuators: ActuatorConfig::default(),
            energy: EnergyConfig::default(),
        }
    }
}

/// Why a simulation cannot start, or cannot go on.
#[derive(Debug, Clone, Error)]
pub enum SilError {
    /// Tick rate.
    #[error("lpg_rate_hz = {0} is out of range; give 100 to 10000, a divisor of 1000000")]
    Rate(u32),
    /// Bus latency.
    #[error("bus_latency_us = {0} is out of range; give at most 100000")]
    Latency(u32),
    /// The robot.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The sensors.
    #[error(transparent)]
    Sensors(#[from] SensorError),
    /// The actuators.
    #[error(transparent)]
    Actuators(#[from] ActuatorError),
    /// What they draw.
    #[error(transparent)]
    Energy(#[from] EnergyError),
    /// The robot in another process.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The flashed images.
    #[error(transparent)]
    Images(#[from] ImagesError),
}

/// The fastest the coordinator reads its IMU, samples per second.
const IMU_RATE_MAX_HZ: u32 = 1_000;

struct Chip {
    station: Station,
    period_us: u64,
    next_us: u64,
}

/// A robot with its firmware, in one world.
pub struct Sil {
    body: Body,
    birth: Birth,
    coordinator: Coordinator,
    nodes: [NodeKind; 3],
    bus: Bus,
    chips: [Chip; 4],
    to_coordinator: VecDeque<u8>,
    to_host: Vec<u8>,
    stored: Option<(u32, ParamSet)>,
    commands: [Command; 6],
    now_us: u64,
    /// Whether time goes on after a fall.
    runs_on: bool,
    tap: Socket,
}

impl Sil {
    /// Powers everything up at the start of `episode`, with `stored` in the coordinator's memory. Nothing moves before
    /// it is armed.
    pub fn new(config: &SilConfig, default: ParamSet, stored: ParamSet, episode: &Episode) -> Result<Sil, SilError> {
        let rate = config.lpg_rate_hz;
        if !(100..=10_000).contains(&rate) || 1_000_000 % rate != 0 {
            return Err(SilError::Rate(rate));
        }
        if config.bus_latency_us > 100_000 {
            return Err(SilError::Latency(config.bus_latency_us));
        }
        let tick_us = 1_000_000 / rate;
        let imu_us = tick_us.max(1_000_000 / IMU_RATE_MAX_HZ);
        let birth = Birth {
            boot_nonce: episode.seed as u32 | 1,
            arm_at_boot: config.arm_at_boot,
            imu_period_us: imu_us,
            default,
            stored,
        };
        let chip = |index: u64, station, period: u32| Chip {
            station,
            period_us: period.into(),
            next_us: index * u64::from(tick_us) / 10,
        };
        Ok(Sil {
            body: Body::new(config, episode)?,
            birth,
            coordinator: birth.coordinator(),
            nodes: NodeId::ALL.map(|id| birth.node(id)),
            bus: Bus::new(config.bus_latency_us),
            chips: [
                chip(0, Station::Coordinator, imu_us),
                chip(1, Station::Node(NodeId::Knee), tick_us),
                chip(2, Station::Node(NodeId::Hip), tick_us),
                chip(2, Station::Node(NodeId::Abductor), tick_us),
            ],
            to_coordinator: VecDeque::new(),
            to_host: Vec::new(),
            stored: None,
            commands: [Command::Brake; 6],
            now_us: 0,
            runs_on: false,
            tap: Socket::default(),
        })
    }

    /// Runs until `until_us`, or until the robot has fallen or the solver failed.
    pub fn run_until(&mut self, until_us: u64) -> Result<Health, SilError> {
        while let Some(at_us) = self.next_event_us().filter(|at| *at < until_us) {
            self.now_us = at_us;
            if at_us == self.body.next_us() {
                let health = self.step_physics()?;
                if health != Health::Upright && !self.runs_on {
                    return Ok(health);
                }
            }
            self.deliver();
            self.tick_chips();
        }
        self.now_us = until_us;
        Ok(if self.runs_on { self.body.robot().health() } else { Health::Upright })
    }

    /// From here on a fall ends nothing.
    pub fn run_on(&mut self) {
        self.runs_on = true;
    }

    fn next_event_us(&self) -> Option<u64> {
        let chips = self.chips.iter().map(|chip| chip.next_us);
        chips.chain(self.bus.next_due_us()).chain([self.body.next_us()]).min()
    }

    fn step_physics(&mut self) -> Result<Health, PlantError> {
        let commands = self.commands;
        self.body.step(|id| joints_of(id).map(|joint| calibration_of(id).command(commands[joint as usize])))
    }

    fn deliver(&mut self) {
        while let Some((from, frame)) = self.bus.deliver(self.now_us) {
            for to in Station::ALL {
                if self.bus.hears(from, to) {
                    self.receive(to, &frame);
                }
            }
        }
    }

    fn receive(&mut self, to: Station, frame: &Frame) {
        match to {
            Station::Coordinator => {
                let (mut bus, mut host) = (BusOutbox::new(), HostOutbox::new());
                self.pass(to, Passing::Frame(frame));
                self.coordinator.on_bus(self.now_us as u32, frame, &mut bus, &mut host);
                self.send(&mut bus, &mut host);
            }
            Station::Node(id) => {
                // What does not decode is dropped, as the chip's receive task does.
                let Ok(message) = Message::decode(frame) else { return };
                self.pass(to, Passing::Frame(frame));
                if let Some(answer) = self.nodes[id as usize].on_message(&message) {
                    self.send_frame(to, answer.encode());
                }
            }
        }
    }

    fn tick_chips(&mut self) {
        for index in 0..self.chips.len() {
            if self.chips[index].next_us != self.now_us {
                continue;
            }
            let Chip { station, period_us, .. } = self.chips[index];
            self.chips[index].next_us += period_us;
            match station {
                Station::Coordinator => self.tick_coordinator(),
                Station::Node(id) => self.tick_node(id, period_us as u32),
            }
        }
    }

    fn tick_coordinator(&mut self) {
        let now = self.now_us as u32;
        let counts = self.body.imu(self.now_us);
        let (mut bus, mut host) = (BusOutbox::new(), HostOutbox::new());
        let bytes: Vec<u8> = self.to_coordinator.drain(..).collect();
        let imu = ImuSample { accel: counts.accel, gyro: counts.gyro };
        self.pass(Station::Coordinator, Passing::Turn { host: &bytes, imu: &imu });
        if let Some(stored) = chips::turn(&mut self.coordinator, now, &bytes, &imu, &mut bus, &mut host) {
            self.stored = Some(stored);
            self.pass(Station::Coordinator, Passing::Stored(stored.0));
        }
        self.send(&mut bus, &mut host);
    }

    fn tick_node(&mut self, id: NodeId, dt_us: u32) {
        let calibration = calibration_of(id);
        let counts = self.body.counts(id, self.now_us);
        self.pass(Station::Node(id), Passing::Tick { dt_us, counts: &counts });
        let sensors = calibration.sensors(&counts);
        let Outputs { drive, messages } = self.nodes[id as usize].tick(dt_us, &sensors);
        let [left, right] = joints_of(id);
        self.commands[left as usize] = drive[0];
        self.commands[right as usize] = drive[1];
        self.pass(Station::Node(id), Passing::Commands(drive.map(|drive| calibration.command(drive))));
        for message in messages {
            self.send_frame(Station::Node(id), message.encode());
        }
    }

    fn send(&mut self, bus: &mut BusOutbox, host: &mut HostOutbox) {
        while let Some(frame) = bus.pop() {
            self.send_frame(Station::Coordinator, frame);
        }
        while let Some(bytes) = host.pop() {
            self.pass(Station::Coordinator, Passing::Told(&bytes));
            self.to_host.extend_from_slice(&bytes);
        }
    }

    fn send_frame(&mut self, from: Station, frame: Frame) {
        self.pass(from, Passing::Sent(&frame));
        self.bus.send(self.now_us, from, frame);
    }

    fn pass(&mut self, chip: Station, what: Passing<'_>) {
        self.tap.pass(self.now_us, chip, what);
    }

    /// Connects `tap` to the control code of all four chips; before the first run.
    pub fn set_tap(&mut self, tap: Box<dyn Tap>) {
        self.tap.connect(tap);
    }

    /// What the chips were born with.
    pub fn birth(&self) -> &Birth {
        &self.birth
    }

    /// Bytes from the host; read at the coordinator's next tick.
    pub fn host_write(&mut self, bytes: &[u8]) {
        self.to_coordinator.extend(bytes);
    }

    /// Bytes for the host since the last call.
    pub fn host_read(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.to_host)
    }

    /// Time line, µs since power-up.
    pub fn now_us(&self) -> u64 {
        self.now_us
    }

    /// The robot with its sensors and actuators.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The robot with its sensors and actuators, to begin another episode.
    pub fn body_mut(&mut self) -> &mut Body {
        &mut self.body
    }

    /// The truth, for rewards, figures and verdicts; no controller sees it.
    pub fn robot(&self) -> &dyn Plant {
        self.body.robot()
    }

    /// What the robot has drawn so far.
    pub fn meter(&self) -> &EnergyMeter {
        self.body.meter()
    }

    /// What happens to the robot in this episode.
    pub fn episode(&self) -> &Episode {
        self.body.episode()
    }

    /// Commands of the nodes, in [`crate::robot::Joint`] order.
    pub fn commands(&self) -> [Command; 6] {
        self.commands
    }

    /// A node, to look at.
    pub fn node(&self, id: NodeId) -> &NodeKind {
        &self.nodes[id as usize]
    }

    /// The coordinator, to look at.
    pub fn coordinator(&self) -> &Coordinator {
        &self.coordinator
    }

    /// The set last written to the coordinator's memory, with its generation.
    pub fn stored(&self) -> Option<&(u32, ParamSet)> {
        self.stored.as_ref()
    }

    /// Pulls or plugs a station's bus connector.
    pub fn unplug(&mut self, station: Station, unplugged: bool) {
        self.bus.unplug(station, unplugged);
    }
}
