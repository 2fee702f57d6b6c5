//! Ranges of every field of a scenario.

use super::{Pushes, Scenario, ScenarioError};

fn within(field: &'static str, value: f32, min: f32, max: f32) -> Result<(), ScenarioError> {
    // `contains` is false for NaN, so one test covers both.
    if (min..=max).contains(&value) {
        Ok(())
    } else {
        Err(ScenarioError::OutOfRange { field, value: value.into(), min: min.into(), max: max.into() })
    }
}

fn ordered(field: &'static str, [low, high]: [f32; 2], min: f32, max: f32) -> Result<(), ScenarioError> {
    within(field, low, min, max)?;
    within(field, high, min, max)?;
    if low > high { Err(ScenarioError::Backwards { field, low, high }) } else { Ok(()) }
}

fn count(field: &'static str, value: u32, max: u32) -> Result<(), ScenarioError> {
    if (1..=max).contains(&value) {
        Ok(())
    } else {
        Err(ScenarioError::OutOfRange { field, value: value.into(), min: 1.0, max: max.into() })
    }
}

/// Length and height are common to every kind of push.
fn shape(duration_s: f32, height_m: f32) -> Result<(), ScenarioError> {
    within("pushes.duration_s", duration_s, 0.002, 10.0)?;
    within("pushes.height_m", height_m, -0.5, 0.5)
}

impl Scenario {
    /// Checks every field against its documented range.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        within("duration_s", self.duration_s, 0.01, 3600.0)?;
        within("drop_m", self.drop_m, 0.0, 1.0)?;
        within("settle_s", self.settle_s, 0.0, self.duration_s)?;
        if let Some(after_s) = self.end_after_push_s {
            within("end_after_push_s", after_s, 0.0, 3600.0)?;
        }
        let latest_s = self.duration_s;
        match &self.pushes {
            Pushes::None => Ok(()),
            Pushes::Fixed(pushes) => pushes.iter().try_for_each(|push| {
                within("pushes.fixed.at_s", push.at_s, 0.0, latest_s)?;
                within("pushes.fixed.impulse_n_s", push.impulse_n_s, 0.0, 200.0)?;
                within("pushes.fixed.direction_deg", push.direction_deg, -360.0, 360.0)?;
                shape(push.duration_s, push.height_m)
            }),
            Pushes::Grid(grid) => {
                within("pushes.grid.at_s", grid.at_s, 0.0, latest_s)?;
                within("pushes.grid.jitter_s", grid.jitter_s, 0.0, latest_s - grid.at_s)?;
                within("pushes.grid.impulse_n_s", grid.impulse_n_s, 0.0, 200.0)?;
                count("pushes.grid.directions", grid.directions, 3600)?;
                count("pushes.grid.repeats", grid.repeats, 10_000)?;
                shape(grid.duration_s, grid.height_m)
            }
            Pushes::Random(random) => {
                ordered("pushes.random.first_s", random.first_s, 0.0, latest_s)?;
                // A floor under the gap bounds the number of pushes.
                ordered("pushes.random.gap_s", random.gap_s, 0.05, 3600.0)?;
                ordered("pushes.random.impulse_n_s", random.impulse_n_s, 0.0, 200.0)?;
                shape(random.duration_s, random.height_m)
            }
        }
    }
}
