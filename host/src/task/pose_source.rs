//! A pose measured from outside, in place of odometry while it is fresh.
//!
//! Motion capture, a camera over the robot or a tracker on it tell its position better than [`Odometry`] can. They send UDP
//! datagrams, each one JSON object (at most 512 bytes, further fields are ignored):
//!
//! ```text
//!  {"t": 12.345, "x": 0.102, "y": -0.034, "z": 0.838, "yaw": 0.02, "quality": 0.97}
//!    t        sender's clock, s, increasing; only differences count
//!    x, y, z  of any point fixed to the trunk, m, within ±1000; z up, x and y in any level frame, right-handed
//!    yaw      of the trunk in that frame, rad, counterclockwise seen from above, within ±1000
//!    quality  0 to 1; below 0.5 the pose is not used
//! ```
//!
//! The first pose that is used fixes where that frame lies in the episode's: from then on the output follows its changes.
//! So a marker need not sit in the middle of the trunk, and the position never jumps when a source appears, goes, or
//! comes back. Between two poses, and after the last one, odometry carries on from where the source left it.
//!
//! A pose is refused if it is not newer than the last one, or if it and odometry moved apart faster than a robot can slip.
//! After 0.2 s without a pose that could be used the source counts as lost, and the next one starts it anew: a source that
//! was restarted or whose frame was moved heals by itself.
//!
//! Nothing is authenticated: bind to the loopback or to a network of the robot's own.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};

use sarah_protocol::telemetry::Telemetry;
use serde::Deserialize;
use thiserror::Error;

use super::odometry::{Estimate, Odometry};

/// A pose older than this is no longer followed, s.
pub const FRESH_S: f64 = 0.2;
/// Least quality that is used.
pub const MIN_QUALITY: f64 = 0.5;
/// Longest datagram that is read, bytes.
pub const MAX_DATAGRAM: usize = 512;
/// Datagrams read at once: a flood must not keep the host from its telemetry.
const MAX_AT_ONCE: usize = 64;
/// Largest coordinate, m, and yaw, rad.
const FAR: f64 = 1000.0;
/// Distance by which source and odometry may differ at once, m, and how fast they may part, m/s.
const JUMP_M: f64 = 0.05;
const SLIP_M_S: f64 = 1.5;
/// The same for yaw, rad and rad/s.
const JUMP_RAD: f64 = 0.2;
const SPIN_RAD_S: f64 = 3.0;

/// One datagram.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct Message {
    /// Sender's clock, s.
    pub t: f64,
    /// Position in the sender's frame, m.
    pub x: f64,
    /// Position in the sender's frame, m.
    pub y: f64,
    /// Height in the sender's frame, m.
    pub z: f64,
    /// Heading in the sender's frame, rad.
    pub yaw: f64,
    /// How sure the sender is, 0 to 1.
    pub quality: f64,
}

/// Why a datagram was not used.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum PoseError {
    /// Not the JSON object described above.
    #[error("not a pose: {0}")]
    Malformed(String),
    /// A number beyond what makes sense.
    #[error("{field} = {value} is out of range; give a number from {min} to {max}")]
    OutOfRange {
        /// Which one.
        field: &'static str,
        /// What was given.
        value: f64,
        /// Smallest accepted value.
        min: f64,
        /// Largest accepted value.
        max: f64,
    },
    /// The sender itself does not trust it.
    #[error("quality {0} is below {MIN_QUALITY}")]
    Doubtful(f64),
    /// Not newer than the last one.
    #[error("t = {t} s does not come after {last} s")]
    Late {
        /// The pose's.
        t: f64,
        /// The last used one's.
        last: f64,
    },
    /// Farther from where odometry expects it than the robot can have slipped.
    #[error("{distance_m:.3} m and {turn_rad:.3} rad away from where odometry expects it")]
    Jump {
        /// In the plane, m.
        distance_m: f64,
        /// In heading, rad.
        turn_rad: f64,
    },
}

impl Message {
    /// Reads a datagram and checks every number.
    pub fn parse(datagram: &[u8]) -> Result<Message, PoseError> {
        let message: Message =
            serde_json::from_slice(datagram).map_err(|error| PoseError::Malformed(error.to_string()))?;
        let Message { t, x, y, z, yaw, quality } = message;
        let fields = [("t", t, 0.0, 1e12), ("x", x, -FAR, FAR), ("y", y, -FAR, FAR), ("z", z, -FAR, FAR)];
        let fields = fields.into_iter().chain([("yaw", yaw, -FAR, FAR), ("quality", quality, 0.0, 1.0)]);
        for (field, value, min, max) in fields {
            // `contains` is false for NaN, so one test covers both.
            if !(min..=max).contains(&value) {
                return Err(PoseError::OutOfRange { field, value, min, max });
            }
        }
        if quality < MIN_QUALITY { Err(PoseError::Doubtful(quality)) } else { Ok(message) }
    }

    fn plane(&self) -> Plane {
        Plane { x: self.x, y: self.y, yaw: self.yaw }
    }
}

/// Position and heading in a level plane; also the motion that leads there from the origin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Plane {
    x: f64,
    y: f64,
    yaw: f64,
}

impl Plane {
    fn of(estimate: &Estimate) -> Plane {
        let [x, y, _] = estimate.pose.position_m.map(f64::from);
        Plane { x, y, yaw: estimate.yaw_rad.into() }
    }

    /// `self`, then `next` seen from there.
    fn then(self, next: Plane) -> Plane {
        let (sin, cos) = self.yaw.sin_cos();
        Plane {
            x: self.x + cos * next.x - sin * next.y,
            y: self.y + sin * next.x + cos * next.y,
            yaw: self.yaw + next.yaw,
        }
    }

    fn inverse(self) -> Plane {
        let (sin, cos) = self.yaw.sin_cos();
        Plane { x: -cos * self.x - sin * self.y, y: sin * self.x - cos * self.y, yaw: -self.yaw }
    }
}

/// A source that is being followed.
#[derive(Clone, Copy, Debug)]
struct Followed {
    /// From the sender's frame into the episode's.
    frame: Plane,
    /// Height of the trunk over the tracked point, m.
    above_m: f64,
    /// The last used pose's time by the sender's clock, and by ours, s.
    t: f64,
    at_s: f64,
}

/// Odometry, corrected by whoever sees the robot from outside.
///
/// Pure: datagrams and the time come from the caller, usually from a [`PoseSocket`] and a monotonic clock.
#[derive(Clone, Debug)]
pub struct PoseSource {
    odometry: Odometry,
    /// The last of odometry's own estimates.
    raw: Estimate,
    /// What makes the episode's pose of odometry's.
    correction: Plane,
    higher_m: f64,
    followed: Option<Followed>,
}

impl PoseSource {
    /// Odometry alone, until a pose arrives.
    pub fn new(odometry: Odometry) -> PoseSource {
        let raw = odometry.estimate();
        PoseSource { odometry, raw, correction: Plane::default(), higher_m: 0.0, followed: None }
    }

    /// A new episode: where the robot is now becomes the origin.
    pub fn reset(&mut self) {
        self.odometry.reset();
        *self = PoseSource::new(self.odometry.clone());
    }

    /// Takes a telemetry frame received at `now_s` (any monotonic clock).
    pub fn saw(&mut self, now_s: f64, frame: &Telemetry) -> Estimate {
        self.forget_stale(now_s);
        self.raw = self.odometry.saw(frame);
        self.estimate()
    }

    /// Takes a datagram received at `now_s`, after the telemetry that arrived before it.
    pub fn heard(&mut self, now_s: f64, datagram: &[u8]) -> Result<(), PoseError> {
        self.forget_stale(now_s);
        let message = Message::parse(datagram)?;
        let expected = self.correction.then(Plane::of(&self.raw));
        let odometry_z = f64::from(self.raw.pose.position_m[2]);
        let Some(followed) = self.followed else {
            let frame = expected.then(message.plane().inverse());
            let above_m = odometry_z - message.z;
            self.followed = Some(Followed { frame, above_m, t: message.t, at_s: now_s });
            return Ok(());
        };
        if message.t <= followed.t {
            return Err(PoseError::Late { t: message.t, last: followed.t });
        }
        let seen = followed.frame.then(message.plane());
        let since_s = now_s - followed.at_s;
        let distance_m = (seen.x - expected.x).hypot(seen.y - expected.y);
        let turn_rad = wrapped(seen.yaw - expected.yaw);
        if distance_m > JUMP_M + SLIP_M_S * since_s || turn_rad.abs() > JUMP_RAD + SPIN_RAD_S * since_s {
            return Err(PoseError::Jump { distance_m, turn_rad });
        }
        // The sender's yaw may have wrapped: count on from ours.
        let seen = Plane { yaw: expected.yaw + turn_rad, ..seen };
        self.correction = seen.then(Plane::of(&self.raw).inverse());
        self.higher_m = message.z + followed.above_m - odometry_z;
        self.followed = Some(Followed { t: message.t, at_s: now_s, ..followed });
        Ok(())
    }

    /// Whether a source is being followed.
    pub fn external(&self) -> bool {
        self.followed.is_some()
    }

    /// The newest estimate, in the episode's frame.
    pub fn estimate(&self) -> Estimate {
        let mut estimate = self.raw;
        let Plane { x, y, yaw } = self.correction.then(Plane::of(&self.raw));
        let z = f64::from(self.raw.pose.position_m[2]) + self.higher_m;
        estimate.pose.position_m = [x, y, z].map(|metres| metres as f32);
        estimate.yaw_rad = yaw as f32;
        let (sin, cos) = (self.correction.yaw as f32).sin_cos();
        let [forward, left] = self.raw.velocity_m_s;
        estimate.velocity_m_s = [cos * forward - sin * left, sin * forward + cos * left];
        estimate
    }

    fn forget_stale(&mut self, now_s: f64) {
        if self.followed.is_some_and(|followed| now_s - followed.at_s > FRESH_S) {
            self.followed = None;
            // The feet know the height without help; a correction would be kept for ever.
            self.higher_m = 0.0;
        }
    }
}

fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    (angle + PI).rem_euclid(TAU) - PI
}

/// The socket that datagrams arrive at. Reading never waits.
#[derive(Debug)]
pub struct PoseSocket {
    socket: UdpSocket,
}

impl PoseSocket {
    /// Listens at `address`, for example `127.0.0.1:7755`.
    pub fn bind(address: impl ToSocketAddrs) -> io::Result<PoseSocket> {
        let socket = UdpSocket::bind(address)?;
        socket.set_nonblocking(true)?;
        Ok(PoseSocket { socket })
    }

    /// Where it listens.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Hands on what has arrived, oldest first, at most 64 datagrams a call. A longer datagram than
    /// [`MAX_DATAGRAM`] is cut, and then no JSON any more.
    pub fn receive(&self, mut datagram: impl FnMut(&[u8])) -> io::Result<()> {
        let mut buffer = [0; MAX_DATAGRAM];
        for _ in 0..MAX_AT_ONCE {
            match self.socket.recv(&mut buffer) {
                Ok(length) => datagram(&buffer[..length]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                // An answer to nobody: this socket never sends, but some systems report others' ICMP here.
                Err(error) if matches!(error.kind(), ErrorKind::ConnectionReset | ErrorKind::Interrupted) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
