//! A bad host link: bytes that are lost, doubled or flipped, at random but the same for the same seed.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::body::Body;
use crate::robot::Health;
use crate::sil::SilError;
use crate::world::World;

/// How often something happens to a byte, in either direction: probabilities.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// It is lost.
    pub lose: f64,
    /// It comes twice.
    pub double: f64,
    /// One of its bits is flipped.
    pub flip: f64,
}

impl Faults {
    /// One byte in `period`, by each fault as often.
    pub fn one_in(period: f64) -> Faults {
        let each = 1.0 / (3.0 * period);
        Faults { lose: each, double: each, flip: each }
    }
}

/// What becomes of bytes on a bad line.
#[derive(Clone, Debug)]
pub struct Line {
    faults: Faults,
    rng: Pcg64Mcg,
    hit: u64,
}

impl Line {
    /// A line with `faults`.
    pub fn new(faults: Faults, seed: u64) -> Line {
        Line { faults, rng: Pcg64Mcg::seed_from_u64(seed), hit: 0 }
    }

    /// What arrives of `bytes`.
    pub fn pass(&mut self, bytes: &[u8]) -> Vec<u8> {
        let Faults { lose, double, flip } = self.faults;
        let mut out = Vec::with_capacity(bytes.len());
        for &byte in bytes {
            let fate: f64 = self.rng.random();
            if fate >= lose + double + flip {
                out.push(byte);
                continue;
            }
            self.hit += 1;
            if fate < double {
                out.extend([byte, byte]);
            } else if fate < double + flip {
                out.push(byte ^ (1 << self.rng.random_range(0..8)));
            }
        }
        out
    }
}

/// A world behind a bad line.
pub struct BadLine<W> {
    world: W,
    line: Line,
    /// Each frame begins and ends with one, and has no other.
    zeros: u64,
}

impl<W: World> BadLine<W> {
    /// `world` behind a line with `faults`.
    pub fn new(world: W, faults: Faults, seed: u64) -> BadLine<W> {
        BadLine { world, line: Line::new(faults, seed), zeros: 0 }
    }

    /// The world.
    pub fn world(&self) -> &W {
        &self.world
    }

    /// The world, to break it.
    pub fn world_mut(&mut self) -> &mut W {
        &mut self.world
    }

    /// From here on the line is like this.
    pub fn set_faults(&mut self, faults: Faults) {
        self.line.faults = faults;
    }

    /// Bytes that something happened to.
    pub fn hit(&self) -> u64 {
        self.line.hit
    }

    /// Frames that the robot has sent, before anything happened to them.
    pub fn frames(&self) -> u64 {
        self.zeros / 2
    }
}

impl<W: World> World for BadLine<W> {
    fn run_until(&mut self, until_us: u64) -> Result<Health, SilError> {
        self.world.run_until(until_us)
    }

    fn now_us(&self) -> u64 {
        self.world.now_us()
    }

    fn host_write(&mut self, bytes: &[u8]) {
        let bytes = self.line.pass(bytes);
        self.world.host_write(&bytes);
    }

    fn host_read(&mut self) -> Vec<u8> {
        let bytes = self.world.host_read();
        self.zeros += bytes.iter().filter(|byte| **byte == 0).count() as u64;
        self.line.pass(&bytes)
    }

    fn body(&self) -> &Body {
        self.world.body()
    }

    fn body_mut(&mut self) -> &mut Body {
        self.world.body_mut()
    }

    fn run_on(&mut self) {
        self.world.run_on();
    }
}
