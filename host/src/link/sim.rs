//! A simulated robot at the other end of the link: real session, real bytes, simulated time.

use sarah_firmware::default_params;
use sarah_protocol::host::{Command, Refusal};
use sarah_protocol::params::ParamSet;
use sarah_protocol::session::{HostSession, News, SessionError};
use sarah_protocol::telemetry::Telemetry;
use sarah_sim::body::Body;
use sarah_sim::robot::Health;
use sarah_sim::scenario::Episode;
use sarah_sim::sil::{SilConfig, SilError};
use sarah_sim::world::{self, World};
use thiserror::Error;

use super::client::Client;
use crate::task::judge::Pose;

/// The host looks at the link this often, µs.
pub const SLICE_US: u64 = 10_000;
/// An answer that takes longer than this will not come, µs.
const PATIENCE_US: u64 = 3_000_000;

/// What went wrong between host and simulated robot.
#[derive(Debug, Error)]
pub enum LinkError {
    /// The simulation could not start.
    #[error(transparent)]
    Sil(#[from] SilError),
    /// The robot's firmware does not match.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The robot refused.
    #[error("the robot refused {command}: {refusal}")]
    Refused {
        /// What it was asked.
        command: &'static str,
        /// Why not.
        refusal: Refusal,
    },
    /// No answer.
    #[error("no answer from the robot while {0}; this is a bug of the link, please report it with the seed")]
    Silent(&'static str),
}

/// What one slice of time brought.
#[derive(Clone, Debug)]
pub struct Slice {
    /// Telemetry received.
    pub telemetry: Vec<Telemetry>,
    /// Verdict of the simulator.
    pub health: Health,
    /// Indices of the pushes that began in this slice.
    pub pushed: bool,
}

/// A simulated robot with a session open to it.
pub struct SimRobot<W = Box<dyn World>> {
    world: W,
    client: Client,
    want_armed: bool,
    armed: bool,
    asked_to_arm: bool,
    pushes_begun: usize,
}

impl SimRobot {
    /// Powers the robot up and opens the session. It runs its stored set, the default, until told otherwise.
    pub fn start(config: &SilConfig, episode: &Episode) -> Result<SimRobot, LinkError> {
        Ok(SimRobot::over(world::start(config, default_params(), episode)?))
    }
}

impl<W: World> SimRobot<W> {
    /// Opens the session to a robot that has just been powered up.
    pub fn over(world: W) -> SimRobot<W> {
        SimRobot {
            world,
            client: Client::new(HostSession::new(1), Some(default_params())),
            want_armed: false,
            armed: false,
            asked_to_arm: false,
            pushes_begun: 0,
        }
    }

    /// What is simulated.
    pub fn world(&self) -> &W {
        &self.world
    }

    /// What is simulated, to break or watch it.
    pub fn world_mut(&mut self) -> &mut W {
        &mut self.world
    }

    /// Asks for a set. It takes force at a cycle boundary, in as many generations as its rate limits ask for.
    pub fn set_params(&mut self, goal: ParamSet) {
        self.client.set_params(goal);
    }

    /// Asks for motion; repeated until the robot is ready for it.
    pub fn arm(&mut self) {
        self.want_armed = true;
    }

    /// Whether the robot said that it is armed.
    pub fn armed(&self) -> bool {
        self.armed
    }

    /// Whether the last set asked for is in force.
    pub fn settled(&self) -> bool {
        self.client.settled()
    }

    /// Simulation time, s since power-up.
    pub fn now_s(&self) -> f32 {
        self.world.now_us() as f32 * 1e-6
    }

    /// The robot behind the link, for the truth.
    pub fn body(&self) -> &Body {
        self.world.body()
    }

    /// Where the trunk truly is.
    pub fn pose(&self) -> Pose {
        let robot = self.world.body().robot();
        let trunk = robot.trunk();
        let [x, y, _] = trunk.position_m;
        let spin = trunk.angular_velocity_rad_s.iter().map(|w| w * w).sum::<f32>().sqrt();
        Pose { position_m: [x, y, robot.height_m()], rotation_rad_s: spin, standing_m: robot.standing_height_m() }
    }

    /// Runs the world and the link for [`SLICE_US`].
    pub fn advance(&mut self) -> Result<Slice, LinkError> {
        self.talk()?;
        let until_us = self.world.now_us() + SLICE_US;
        let health = self.world.run_until(until_us)?;
        let telemetry = self.listen()?;
        let begun = self.world.body().episode().pushes.iter().filter(|push| push.at_s <= self.now_s()).count();
        let pushed = begun > std::mem::replace(&mut self.pushes_begun, begun);
        Ok(Slice { telemetry, health, pushed })
    }

    /// Runs until armed with the set asked for, at least until `at_s`.
    pub fn ready_at(&mut self, at_s: f32) -> Result<Health, LinkError> {
        self.arm();
        loop {
            let health = self.advance()?.health;
            let now_us = self.world.now_us();
            let done = self.armed && self.settled();
            if health != Health::Upright || (done && now_us as f32 * 1e-6 >= at_s - 1e-4) {
                return Ok(health);
            }
            if now_us > (at_s * 1e6) as u64 + PATIENCE_US {
                return Err(LinkError::Silent(if self.armed { "changing parameters" } else { "arming" }));
            }
        }
    }

    fn talk(&mut self) -> Result<(), LinkError> {
        if self.want_armed && !self.armed && !self.asked_to_arm {
            self.asked_to_arm = self.client.session_mut().arm().is_ok();
        }
        let now_us = self.world.now_us();
        while let Some(bytes) = self.client.poll(now_us) {
            self.world.host_write(&bytes);
        }
        Ok(())
    }

    fn listen(&mut self) -> Result<Vec<Telemetry>, LinkError> {
        let bytes = self.world.host_read();
        let mut news = vec![];
        self.client.on_bytes(self.world.now_us(), &bytes, &mut news);
        let mut telemetry = vec![];
        for item in news {
            match item {
                News::Telemetry(frame) => telemetry.push(frame),
                News::Done(Command::Arm { .. }) => self.armed = true,
                // Not ready yet: the IMU still finds up, or a set is on its way. Asked again.
                News::Refused(Command::Arm { .. }, Refusal::NotReady(_)) => self.asked_to_arm = false,
                News::Refused(command, refusal) => {
                    return Err(LinkError::Refused { command: name(&command), refusal });
                }
                News::Failed(error) => return Err(error.into()),
                _ => {}
            }
        }
        Ok(telemetry)
    }
}

fn name(command: &Command) -> &'static str {
    match command {
        Command::Claim => "the claim",
        Command::Arm { .. } => "to arm",
        Command::Stage { .. } => "to stage parameters",
        Command::Commit { .. } => "to commit parameters",
        _ => "a request",
    }
}
