//! The robots of a task: the same in every episode, or one drawn anew for each.

use sarah_sim::sil::SilConfig;
use thiserror::Error;
use toml::Table;

use crate::overrides::{corners, drawn};

/// Seeds of draws lie here.
pub const DRAW_SEED: u64 = 1 << 62;

/// A robot, and ranges from which every episode draws changes of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Robots {
    robot: SilConfig,
    draw: Table,
}

/// A draw that does not fit the robot.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("draw: {0}")]
pub struct DrawError(String);

impl Robots {
    /// Checks that the ends of all ranges are keys of the robot; whether such robots can be built is not asked here.
    pub fn new(robot: SilConfig, draw: Table) -> Result<Robots, DrawError> {
        corners(&robot, &draw).map_err(DrawError)?;
        Ok(Robots { robot, draw })
    }

    /// Robots that are all alike.
    pub fn alike(robot: SilConfig) -> Robots {
        Robots { robot, draw: Table::new() }
    }

    /// The robot of an episode; the same seed gives the same one.
    pub fn of(&self, seed: u64) -> Result<SilConfig, DrawError> {
        match self.draw.is_empty() {
            true => Ok(self.robot.clone()),
            false => drawn(&self.robot, &self.draw, DRAW_SEED.wrapping_add(seed)).map_err(DrawError),
        }
    }

    /// The robot before any draw, and those at the two ends of all ranges.
    pub fn extremes(&self) -> Result<Vec<SilConfig>, DrawError> {
        let mut robots = vec![self.robot.clone()];
        if !self.draw.is_empty() {
            robots.extend(corners(&self.robot, &self.draw).map_err(DrawError)?);
        }
        Ok(robots)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_follow_from_the_seed_and_stay_within_their_ranges() {
        let draw: Table = "robot.slope_pitch_rad = [-0.05, 0.05]".parse().unwrap();
        let robots = Robots::new(SilConfig::default(), draw).unwrap();
        assert_eq!(robots.of(3), robots.of(3));
        assert_ne!(robots.of(3), robots.of(4));
        let slopes = robots.extremes().unwrap().into_iter().map(|robot| robot.robot.slope_pitch_rad);
        assert_eq!(slopes.collect::<Vec<_>>(), [0.0, -0.05, 0.05]);
        assert_eq!(Robots::alike(SilConfig::default()).of(9), Ok(SilConfig::default()));
        let unknown = "robot.slope = [0, 1]".parse().unwrap();
        assert!(Robots::new(SilConfig::default(), unknown).unwrap_err().to_string().contains("slope"));
    }
}
