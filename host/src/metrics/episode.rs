//! The result of one episode.

use crate::task::reward::RewardForm;
use serde::{Deserialize, Serialize};

/// How an episode ended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The robot stood to the end.
    Survived,
    /// The trunk left its alive zone.
    Fell {
        /// When, s of the episode.
        at_s: f32,
    },
    /// The simulation produced a number that is not finite.
    NonFinite {
        /// When, s of the episode.
        at_s: f32,
    },
    /// The solver blew up: speeds no such robot can have.
    Exploded {
        /// When, s of the episode.
        at_s: f32,
    },
}

impl Outcome {
    /// Whether the episode says something about the robot. What does not is reported, never averaged in.
    pub fn is_valid(self) -> bool {
        matches!(self, Self::Survived | Self::Fell { .. })
    }
}

/// Energy of an episode by consumer, J.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct EnergyJ {
    /// Linear and rotary actuators (36 V), which draw only while moving.
    pub actuators: f32,
    /// Brake coils, energised while released.
    pub brakes: f32,
    /// Computers (12 V).
    pub compute: f32,
}

impl EnergyJ {
    /// All together, J.
    pub fn total(self) -> f32 {
        self.actuators + self.brakes + self.compute
    }
}

/// The result of one episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpisodeResult {
    /// Where the push went, degrees from forward to the left; `None` if nobody pushed or pushes were many.
    pub direction_deg: Option<f32>,
    /// How hard, N·s.
    pub impulse_n_s: f32,
    /// The seed of the episode: sensors, pushes.
    pub seed: u64,
    /// How it ended.
    pub outcome: Outcome,
    /// Steps taken.
    pub steps: u32,
    /// Step frequency while recovering, 1/s; `None` if it took no step.
    pub steps_per_s: Option<f32>,
    /// Distance of the trunk, in the transverse plane, 3 s after the push from where it was pushed, m.
    pub drift_3s_m: Option<f32>,
    /// Time from the push until quiet, s; `None` if it never became quiet.
    pub settle_s: Option<f32>,
    /// Energy by consumer.
    pub energy_j: EnergyJ,
    /// Mean reward of eq. 5 as printed.
    pub reward_paper: f32,
    /// Mean reward of the gated form.
    pub reward_gated: f32,
}

impl EpisodeResult {
    /// The mean reward in one of its forms.
    pub fn reward(&self, form: RewardForm) -> f32 {
        match form {
            RewardForm::Paper => self.reward_paper,
            RewardForm::Gated => self.reward_gated,
        }
    }
}
