//! Records a simulated robot: armed by a host built in, as fast as it goes, with every call of its control code.

use std::sync::atomic::{AtomicBool, Ordering};

use sarah_firmware::default_params;
use sarah_protocol::host::{Command, Refusal, Which};
use sarah_protocol::session::{HostSession, News};
use sarah_sim::emulated::{Emulated, Images};
use sarah_sim::plant::Plant;
use sarah_sim::robot::Health;
use sarah_sim::scenario::Episode;
use sarah_sim::sil::{Sil, SilConfig};
use sarah_sim::world::World;

use super::error::RecordingError;
use super::pose::Pose;
use super::recorder::Recorder;
use super::tape::{Born, Tape};
use crate::link::client::Client;
use crate::link::live::{Heard, What};

/// Longest time between two looks of the host at the link, µs.
const SLICE_US: u64 = 10_000;
/// Until a robot that was not ready to arm is asked again, µs.
const AGAIN_US: u64 = 100_000;
/// Between two messages on how good the link is, µs.
const LINK_US: u64 = 1_000_000;

/// What is simulated.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// The robot; with `images`, on emulated chips.
    pub config: SilConfig,
    /// What happens to it.
    pub episode: Episode,
    /// How long, s.
    pub seconds: f64,
    /// Telemetry frames per second, 1 to 1000.
    pub rate_hz: u16,
}

/// What came of it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ended {
    /// Simulated time, s.
    pub seconds: f64,
    /// The robot at the end.
    pub health: Health,
}

impl Simulation {
    /// Powers the robot up with a tape on its control code.
    fn start(&self) -> Result<(Box<dyn World>, Tape), RecordingError> {
        let default = default_params();
        Ok(match &self.config.images {
            None => {
                let mut world = Sil::new(&self.config, default, default, &self.episode)?;
                let tape = Tape::new(Born::of(world.birth()));
                world.set_tap(Box::new(tape.clone()));
                (Box::new(world), tape)
            }
            Some(folder) => {
                let mut world = Emulated::new(&self.config, &Images::load(folder)?, &self.episode)?;
                let tape = Tape::new(Born::emulated());
                world.set_tap(Box::new(tape.clone()))?;
                (Box::new(world), tape)
            }
        })
    }

    /// Runs it into `recorder`, until its time is over, the robot falls, or `stop` is set. `progress` is called with the
    /// time that has passed, s.
    pub fn record<W: std::io::Write + std::io::Seek>(
        &self,
        recorder: &mut Recorder<W>,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Ended, RecordingError> {
        let (mut world, tape) = self.start()?;
        let mut host = Host::new(self.rate_hz);
        let end_us = (self.seconds * 1e6) as u64;
        let slice_us = (1_000_000 / u64::from(self.rate_hz.max(1))).clamp(1_000, SLICE_US);
        let mut health = Health::Upright;
        let mut link_at_us = 0;
        while health == Health::Upright && world.now_us() < end_us && !stop.load(Ordering::Relaxed) {
            host.talk(&mut *world);
            health = world.run_until((world.now_us() + slice_us).min(end_us))?;
            let now_us = world.now_us();
            let trunk = pose_of(world.body().robot());
            for news in host.listen(&mut *world)? {
                recorder.hear(&Heard { at_us: now_us, what: What::News(news) }, Some(&trunk))?;
            }
            recorder.control(now_us, tape.take())?;
            if now_us >= link_at_us {
                link_at_us = now_us + LINK_US;
                recorder.link(now_us, host.client.session().stats(), true, 0)?;
                progress(now_us as f64 * 1e-6);
            }
        }
        Ok(Ended { seconds: world.now_us() as f64 / 1e6, health })
    }
}

/// The host built in: arms, and asks for every set that takes force.
struct Host {
    client: Client,
    rate_hz: Option<u16>,
    /// When to ask for motion; `None` once asked.
    arm_at_us: Option<u64>,
}

impl Host {
    fn new(rate_hz: u16) -> Host {
        let client = Client::new(HostSession::new(1), Some(default_params()));
        Host { client, rate_hz: Some(rate_hz), arm_at_us: Some(0) }
    }

    fn talk(&mut self, world: &mut dyn World) {
        let session = self.client.session_mut();
        if let Some(rate_hz) = self.rate_hz {
            self.rate_hz = session.set_telemetry(rate_hz).err().map(|_| rate_hz);
        }
        let now_us = world.now_us();
        if self.arm_at_us.is_some_and(|at| at <= now_us) && session.arm().is_ok() {
            self.arm_at_us = None;
        }
        while let Some(bytes) = self.client.poll(now_us) {
            world.host_write(&bytes);
        }
    }

    fn listen(&mut self, world: &mut dyn World) -> Result<Vec<News>, RecordingError> {
        let bytes = world.host_read();
        let mut news = vec![];
        self.client.on_bytes(world.now_us(), &bytes, &mut news);
        for item in &news {
            match item {
                News::Connected(_) | News::Applied { .. } => {
                    // No room: the next set is asked for again.
                    let _ = self.client.session_mut().get_params(Which::Applied);
                }
                // Not ready yet: the IMU still finds up. Asked again.
                News::Refused(Command::Arm { .. }, Refusal::NotReady(_)) => {
                    self.arm_at_us = Some(world.now_us() + AGAIN_US);
                }
                News::Refused(Command::Arm { .. }, refusal) => return Err(RecordingError::Refused(*refusal)),
                News::Failed(error) => return Err((*error).into()),
                _ => {}
            }
        }
        Ok(news)
    }
}

fn pose_of(robot: &dyn Plant) -> Pose {
    let trunk = robot.trunk();
    Pose { position_m: trunk.position_m.map(f64::from), turn_xyzw: trunk.rotation_xyzw.map(f64::from) }
}
