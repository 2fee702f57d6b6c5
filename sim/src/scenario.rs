//! What happens to the robot in an episode: TOML descriptions, and their pure expansion into pushes.
//!
//! A [`Scenario`] is a distribution; [`Scenario::episode`] draws one [`Episode`] from it. The same scenario, seed,
//! index and overrides give the same episode everywhere, so controllers can be compared on common pushes.

use std::f32::consts::TAU;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Scenarios that come with the crate: name and TOML text.
pub const EMBEDDED: [(&str, &str); 4] = [
    ("paper", include_str!("../assets/scenarios/paper.toml")),
    ("push-grid", include_str!("../assets/scenarios/push-grid.toml")),
    ("stand", include_str!("../assets/scenarios/stand.toml")),
    ("train", include_str!("../assets/scenarios/train.toml")),
];

/// A distribution of episodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Longest episode, s, up to 3600.
    pub duration_s: f32,
    /// Height of the soles above the ground at the start, m, 0 to 1.
    pub drop_m: f32,
    /// Time braked and without control before the controller starts, s.
    pub settle_s: f32,
    /// End the episode this long after its last push began, s; without it every episode lasts `duration_s`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_after_push_s: Option<f32>,
    /// When and how the trunk is pushed.
    #[serde(default)]
    pub pushes: Pushes,
}

/// How the pushes of an episode are chosen.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub enum Pushes {
    /// None at all.
    #[default]
    None,
    /// The same list in every episode.
    Fixed(Vec<Push>),
    /// One push an episode, over a grid of directions.
    Grid(Grid),
    /// Random direction, strength and time.
    Random(Random),
}

/// One push at the trunk.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Push {
    /// Start, s from the episode's beginning.
    pub at_s: f32,
    /// Force times duration, N·s, 0 to 200.
    pub impulse_n_s: f32,
    /// Direction of the force, degrees from forward (x) towards the left (y).
    pub direction_deg: f32,
    /// Length, s, 0.002 to 10.
    #[serde(default = "push_duration_s")]
    pub duration_s: f32,
    /// Point of application above the trunk's centre of mass, m, within ±0.5.
    #[serde(default)]
    pub height_m: f32,
}

/// Evenly spaced directions, each repeated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Earliest start, s.
    pub at_s: f32,
    /// Every repeat but the first starts up to this much later, s: it meets the robot in another state.
    #[serde(default)]
    pub jitter_s: f32,
    /// Strength, N·s, 0 to 200.
    pub impulse_n_s: f32,
    /// Number of directions, 1 to 3600, starting with forward.
    pub directions: u32,
    /// Episodes a direction, 1 to 10000.
    #[serde(default = "one")]
    pub repeats: u32,
    /// Length of the push, s.
    #[serde(default = "push_duration_s")]
    pub duration_s: f32,
    /// Point of application above the trunk's centre of mass, m.
    #[serde(default)]
    pub height_m: f32,
}

/// Ranges from which each push is drawn evenly.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Random {
    /// Start of the first push, s.
    pub first_s: [f32; 2],
    /// From the start of a push to the start of the next, s.
    pub gap_s: [f32; 2],
    /// Strength, N·s, 0 to 200.
    pub impulse_n_s: [f32; 2],
    /// Most pushes an episode; without it, as many as fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u32>,
    /// Length of a push, s.
    #[serde(default = "push_duration_s")]
    pub duration_s: f32,
    /// Point of application above the trunk's centre of mass, m.
    #[serde(default)]
    pub height_m: f32,
}

fn push_duration_s() -> f32 {
    0.1
}

fn one() -> u32 {
    1
}

/// Changes to a scenario from the command line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Overrides {
    /// Strength of every push, N·s.
    pub impulse_n_s: Option<f32>,
    /// Length of every push, s; a longer one is a weaker force.
    pub duration_s: Option<f32>,
    /// Point of application of every push above the trunk's centre of mass, m.
    pub height_m: Option<f32>,
    /// Directions of a grid.
    pub directions: Option<u32>,
    /// Episodes a direction of a grid.
    pub repeats: Option<u32>,
}

/// One concrete episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// Number within the scenario and seed.
    pub index: u64,
    /// For sensors and anything else random in the episode; the same for no other index or seed.
    pub seed: u64,
    /// Length, s.
    pub duration_s: f32,
    /// Time braked and without control at the start, s.
    pub settle_s: f32,
    /// Height of the soles above the ground at the start, m.
    pub drop_m: f32,
    /// In order of time.
    pub pushes: Vec<Push>,
    /// Index of the push's direction in a grid, for the worst direction of a report.
    pub direction: Option<u32>,
}

impl Push {
    /// Force in world axes at `time_s`, N; zero before and after.
    pub fn force_n(&self, time_s: f64) -> [f32; 3] {
        let since_s = time_s - f64::from(self.at_s);
        // A microsecond of margin keeps the number of steps of a push free of rounding.
        if since_s < -1e-6 || since_s >= f64::from(self.duration_s) - 1e-6 {
            return [0.0; 3];
        }
        let force_n = self.impulse_n_s / self.duration_s;
        let (sin, cos) = self.direction_deg.to_radians().sin_cos();
        [force_n * cos, force_n * sin, 0.0]
    }
}

/// Why a scenario was refused.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// Neither an embedded scenario nor a readable file.
    #[error(
        "no scenario \"{name}\": give one of paper, push-grid, stand, train, or the path of a TOML file ({source})"
    )]
    NotFound {
        /// What was asked for.
        name: String,
        /// Why it is not readable as a file.
        source: std::io::Error,
    },
    /// Not TOML, or not a scenario.
    #[error("{name}: line {line}: {message}; correct that line of the scenario")]
    Parse {
        /// Scenario or file name.
        name: String,
        /// Line, from 1.
        line: usize,
        /// Why, in one line.
        message: String,
    },
    /// A value is not finite or out of range.
    #[error("scenario: {field} = {value} is out of range; give a finite number from {min} to {max}")]
    OutOfRange {
        /// Path of the field.
        field: &'static str,
        /// What was given.
        value: f64,
        /// Smallest accepted value.
        min: f64,
        /// Largest accepted value.
        max: f64,
    },
    /// A range whose ends are the wrong way round.
    #[error("scenario: {field} = [{low}, {high}] runs backwards; put the smaller number first")]
    Backwards {
        /// Path of the field.
        field: &'static str,
        /// First number.
        low: f32,
        /// Second number.
        high: f32,
    },
}

mod checks;

impl Scenario {
    /// Loads an embedded scenario by name, or any by its path.
    pub fn load(name: &str) -> Result<Self, ScenarioError> {
        match EMBEDDED.iter().find(|(embedded, _)| *embedded == name) {
            Some((_, text)) => Self::parse(name, text),
            None => {
                let text = std::fs::read_to_string(Path::new(name))
                    .map_err(|source| ScenarioError::NotFound { name: name.to_owned(), source })?;
                Self::parse(name, &text)
            }
        }
    }

    /// Reads and validates TOML; `name` is for messages.
    pub fn parse(name: &str, text: &str) -> Result<Self, ScenarioError> {
        let scenario: Self = toml::from_str(text).map_err(|error| ScenarioError::Parse {
            name: name.to_owned(),
            line: error.span().map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count()),
            message: error.message().split_whitespace().collect::<Vec<_>>().join(" "),
        })?;
        scenario.validate()?;
        Ok(scenario)
    }

    /// This scenario with `overrides` in place of its own values, validated.
    pub fn with(&self, overrides: &Overrides) -> Result<Self, ScenarioError> {
        let mut scenario = self.clone();
        let shape = |duration_s: &mut f32, height_m: &mut f32| {
            *duration_s = overrides.duration_s.unwrap_or(*duration_s);
            *height_m = overrides.height_m.unwrap_or(*height_m);
        };
        match &mut scenario.pushes {
            Pushes::None => {}
            Pushes::Fixed(pushes) => {
                for push in pushes {
                    push.impulse_n_s = overrides.impulse_n_s.unwrap_or(push.impulse_n_s);
                    shape(&mut push.duration_s, &mut push.height_m);
                }
            }
            Pushes::Grid(grid) => {
                grid.impulse_n_s = overrides.impulse_n_s.unwrap_or(grid.impulse_n_s);
                grid.directions = overrides.directions.unwrap_or(grid.directions);
                grid.repeats = overrides.repeats.unwrap_or(grid.repeats);
                shape(&mut grid.duration_s, &mut grid.height_m);
            }
            Pushes::Random(random) => {
                random.impulse_n_s = overrides.impulse_n_s.map_or(random.impulse_n_s, |i| [i, i]);
                shape(&mut random.duration_s, &mut random.height_m);
            }
        }
        scenario.validate()?;
        Ok(scenario)
    }

    /// Number of different episodes: directions times repeats of a grid, else `None` for as many as wanted.
    pub fn episodes(&self) -> Option<u64> {
        match &self.pushes {
            Pushes::Grid(grid) => Some(u64::from(grid.directions) * u64::from(grid.repeats)),
            _ => None,
        }
    }

    /// Draws episode `index` under `seed`. A grid runs through its directions first, then repeats.
    pub fn episode(&self, seed: u64, index: u64) -> Episode {
        let mut rng = Pcg64Mcg::seed_from_u64(mix(seed, index));
        let episode_seed = rng.random();
        let (pushes, direction) = self.draw(&mut rng, index);
        let ends_s = pushes.last().zip(self.end_after_push_s).map(|(push, after_s)| push.at_s + after_s);
        Episode {
            index,
            seed: episode_seed,
            duration_s: ends_s.map_or(self.duration_s, |end_s| end_s.min(self.duration_s)),
            settle_s: self.settle_s,
            drop_m: self.drop_m,
            pushes,
            direction,
        }
    }

    fn draw(&self, rng: &mut Pcg64Mcg, index: u64) -> (Vec<Push>, Option<u32>) {
        match &self.pushes {
            Pushes::None => (Vec::new(), None),
            Pushes::Fixed(pushes) => (pushes.clone(), None),
            Pushes::Grid(grid) => {
                let direction = (index % u64::from(grid.directions)) as u32;
                let jitter_s = if index < u64::from(grid.directions) { 0.0 } else { grid.jitter_s * unit(rng) };
                let push = Push {
                    at_s: grid.at_s + jitter_s,
                    impulse_n_s: grid.impulse_n_s,
                    direction_deg: 360.0 * direction as f32 / grid.directions as f32,
                    duration_s: grid.duration_s,
                    height_m: grid.height_m,
                };
                (vec![push], Some(direction))
            }
            Pushes::Random(random) => (self.draw_random(random, rng), None),
        }
    }

    fn draw_random(&self, random: &Random, rng: &mut Pcg64Mcg) -> Vec<Push> {
        let mut pushes = Vec::new();
        let mut at_s = between(rng, random.first_s);
        while at_s + random.duration_s <= self.duration_s && random.count.is_none_or(|n| pushes.len() < n as usize) {
            pushes.push(Push {
                at_s,
                impulse_n_s: between(rng, random.impulse_n_s),
                direction_deg: (unit(rng) * TAU).to_degrees(),
                duration_s: random.duration_s,
                height_m: random.height_m,
            });
            at_s += between(rng, random.gap_s);
        }
        pushes
    }
}

/// One 64-bit seed from two, so that neighbouring seeds and indices share no stream (SplitMix64's finaliser).
fn mix(seed: u64, index: u64) -> u64 {
    let mut z = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ index.wrapping_mul(0xD1B5_4A32_D192_ED03);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// Even over [0, 1), from the generator's top bits: the same on every platform.
fn unit(rng: &mut Pcg64Mcg) -> f32 {
    (rng.random::<u32>() >> 8) as f32 / (1 << 24) as f32
}

fn between(rng: &mut Pcg64Mcg, [low, high]: [f32; 2]) -> f32 {
    low + (high - low) * unit(rng)
}

#[cfg(test)]
mod tests;
