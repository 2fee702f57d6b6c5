//! Records a robot on a serial port, until told to stop, in as many parts as it takes. It only listens, unless another
//! telemetry rate is asked for.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use sarah_protocol::host::Which;
use sarah_protocol::session::News;

use super::error::RecordingError;
use super::parts::Parts;
use crate::link::live::{Ask, Heard, Link, Role, What};
use crate::link::port::Target;

/// Between two messages on how good the link is, µs.
const LINK_US: u64 = 1_000_000;
/// Longest wait for news: how late a stop is noticed.
const WAIT: Duration = Duration::from_millis(100);

/// Which robot, and for how long.
#[derive(Clone, Debug)]
pub struct Listening {
    /// Its port.
    pub target: Target,
    /// Telemetry frames per second to ask for; this needs the claim, so without it the robot keeps its rate and its writer.
    pub rate_hz: Option<u16>,
    /// How long, s; without it until told to stop.
    pub seconds: Option<f64>,
}

/// How the recording goes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Going {
    /// Since it began, s.
    pub seconds: f64,
    /// Telemetry frames.
    pub frames: u64,
    /// Frames missing by their numbers.
    pub lost: u32,
    /// The port is open.
    pub up: bool,
}

impl Listening {
    /// Opens the port.
    pub fn open(&self) -> Result<Link, RecordingError> {
        let role = if self.rate_hz.is_some() { Role::Writer } else { Role::Observer };
        Ok(Link::open(&self.target, role)?)
    }

    /// Records until the time is over or `stop` is set. `progress` is called once a second.
    pub fn record(
        &self,
        link: &Link,
        parts: &mut Parts<'_>,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(Going),
    ) -> Result<Going, RecordingError> {
        let end_us = self.seconds.map_or(u64::MAX, |seconds| (seconds * 1e6) as u64);
        let mut link_at_us = LINK_US;
        while !stop.load(Ordering::Relaxed) && link.now_us() < end_us {
            if parts.turn(link.now_us())? {
                self.introduce(link, parts)?;
            }
            match link.next(WAIT) {
                Some(heard) => {
                    parts.recorder().hear(&heard, None)?;
                    self.answer(link, &heard.what)?;
                }
                None => parts.recorder().keep()?,
            }
            let now_us = link.now_us();
            if now_us >= link_at_us {
                link_at_us = now_us + LINK_US;
                let health = link.health();
                parts.recorder().link(now_us, &health.stats, health.up, health.reconnects)?;
                progress(going(link, parts));
            }
        }
        Ok(going(link, parts))
    }

    /// A part is understood without the ones before it: which robot this is, and which sets it has.
    fn introduce(&self, link: &Link, parts: &mut Parts<'_>) -> Result<(), RecordingError> {
        let Some(robot) = link.health().robot else { return Ok(()) };
        let connected = Heard { at_us: link.now_us(), what: What::News(News::Connected(robot)) };
        parts.recorder().hear(&connected, None)?;
        ask_for_sets(link);
        Ok(())
    }

    fn answer(&self, link: &Link, what: &What) -> Result<(), RecordingError> {
        match what {
            What::News(News::Connected(_)) => {
                if let Some(rate_hz) = self.rate_hz {
                    link.ask(Ask::Telemetry(rate_hz));
                }
                ask_for_sets(link);
            }
            // Another host's generation, or this one's: the values have to be asked for.
            What::News(News::Event { event: sarah_protocol::telemetry::Event::Applied { .. }, .. }) => {
                link.ask(Ask::Get(Which::Applied));
            }
            What::News(News::Failed(error)) => return Err((*error).into()),
            _ => {}
        }
        Ok(())
    }
}

fn ask_for_sets(link: &Link) {
    link.ask(Ask::Get(Which::Stored));
    link.ask(Ask::Get(Which::Applied));
}

fn going(link: &Link, parts: &Parts<'_>) -> Going {
    let health = link.health();
    Going { seconds: link.now_us() as f64 * 1e-6, frames: parts.telemetry(), lost: health.stats.lost, up: health.up }
}
