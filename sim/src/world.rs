//! A robot under control, whoever computes the control: the firmware library, or the flashed images on emulated chips.

use sarah_protocol::params::ParamSet;

use crate::body::Body;
use crate::emulated::Emulated;
use crate::robot::Health;
use crate::scenario::Episode;
use crate::sil::{Sil, SilConfig, SilError};

/// What a host sees of a simulated robot: bytes, time, and the truth for judging.
pub trait World: Send {
    /// Runs until `until_us`, or until the robot has fallen, the solver failed, or the firmware broke a rule.
    fn run_until(&mut self, until_us: u64) -> Result<Health, SilError>;
    /// Time line, µs since power-up.
    fn now_us(&self) -> u64;
    /// Bytes from the host.
    fn host_write(&mut self, bytes: &[u8]);
    /// Bytes for the host since the last call.
    fn host_read(&mut self) -> Vec<u8>;
    /// The truth, for rewards, figures and verdicts; no controller sees it.
    fn body(&self) -> &Body;
    /// The truth, to begin another episode.
    fn body_mut(&mut self) -> &mut Body;
    /// From here on a fall ends nothing: time goes on, the robot lies until [`Body::stand_up`].
    fn run_on(&mut self);
}

/// The world that `config` asks for, at the start of `episode`, with `default` built into the firmware and in the
/// coordinator's memory. Images have their own.
pub fn start(config: &SilConfig, default: ParamSet, episode: &Episode) -> Result<Box<dyn World>, SilError> {
    Ok(match &config.images {
        None => Box::new(Sil::new(config, default, default, episode)?),
        Some(folder) => Box::new(Emulated::start(config, folder, episode)?),
    })
}

impl<W: World + ?Sized> World for Box<W> {
    fn run_until(&mut self, until_us: u64) -> Result<Health, SilError> {
        (**self).run_until(until_us)
    }

    fn now_us(&self) -> u64 {
        (**self).now_us()
    }

    fn host_write(&mut self, bytes: &[u8]) {
        (**self).host_write(bytes);
    }

    fn host_read(&mut self) -> Vec<u8> {
        (**self).host_read()
    }

    fn body(&self) -> &Body {
        (**self).body()
    }

    fn body_mut(&mut self) -> &mut Body {
        (**self).body_mut()
    }

    fn run_on(&mut self) {
        (**self).run_on();
    }
}

impl World for Sil {
    fn run_until(&mut self, until_us: u64) -> Result<Health, SilError> {
        Sil::run_until(self, until_us)
    }

    fn now_us(&self) -> u64 {
        Sil::now_us(self)
    }

    fn host_write(&mut self, bytes: &[u8]) {
        Sil::host_write(self, bytes);
    }

    fn host_read(&mut self) -> Vec<u8> {
        Sil::host_read(self)
    }

    fn body(&self) -> &Body {
        Sil::body(self)
    }

    fn body_mut(&mut self) -> &mut Body {
        Sil::body_mut(self)
    }

    fn run_on(&mut self) {
        Sil::run_on(self);
    }
}
