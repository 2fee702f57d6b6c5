//! A host at the end of a world's link, in the world's own time.

use sarah_protocol::session::{HostSession, News, State};
use sarah_sim::world::World;

use super::BenchError;
use crate::link::client::Client;

/// The host looks at the link this often, µs.
pub const LOOK_US: u64 = 100;
/// What takes longer than this has failed, µs.
pub const PATIENCE_US: u64 = 10_000_000;

/// A host and its robot.
pub struct Wire<W> {
    /// The robot.
    pub world: W,
    /// The host.
    pub client: Client,
    /// Off while the cable is pulled.
    pub plugged: bool,
}

impl<W: World> Wire<W> {
    /// A host that claims a robot that has just been powered up.
    pub fn new(world: W) -> Wire<W> {
        Wire { world, client: Client::new(HostSession::new(1), None), plugged: true }
    }

    /// One look: what the host has to say goes out, what has come is heard.
    pub fn look(&mut self, news: &mut Vec<News>) -> Result<(), BenchError> {
        let now_us = self.world.now_us();
        while let Some(bytes) = self.client.poll(now_us) {
            if self.plugged {
                self.world.host_write(&bytes);
            }
        }
        self.world.run_until(now_us + LOOK_US)?;
        let bytes = self.world.host_read();
        if self.plugged {
            self.client.on_bytes(self.world.now_us(), &bytes, news);
        }
        Ok(())
    }

    /// Looks until `found` in the news; everything else is dropped. How long it took, µs.
    pub fn until(&mut self, what: &str, mut found: impl FnMut(&News) -> bool) -> Result<u64, BenchError> {
        let began_us = self.world.now_us();
        let mut news = vec![];
        loop {
            self.look(&mut news)?;
            let took_us = self.world.now_us() - began_us;
            if news.drain(..).any(|item| found(&item)) {
                return Ok(took_us);
            }
            if took_us > PATIENCE_US {
                return Err(self.broken(format!("waited in vain for {what}")));
            }
        }
    }

    /// Looks for `us`; what was heard.
    pub fn idle(&mut self, us: u64) -> Result<Vec<News>, BenchError> {
        let end_us = self.world.now_us() + us;
        let mut news = vec![];
        while self.world.now_us() < end_us {
            self.look(&mut news)?;
        }
        Ok(news)
    }

    /// Waits for the session, and for the set in force to be known.
    pub fn connect(&mut self) -> Result<(), BenchError> {
        let mut news = vec![];
        let began_us = self.world.now_us();
        while self.client.session().state() != State::Open || self.client.applied().is_none() {
            self.look(&mut news)?;
            if self.world.now_us() - began_us > PATIENCE_US {
                return Err(self.broken("no session".into()));
            }
        }
        Ok(())
    }

    /// A promise was broken.
    pub fn broken(&self, what: String) -> BenchError {
        BenchError::Broken { at_s: self.world.now_us() as f64 * 1e-6, what }
    }
}
