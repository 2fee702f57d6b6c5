//! Exploration (§IV "double randomness"): noise that decays over the episodes, behind a coin per episode.

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use super::EnafConfig;

/// The exploration of one session; `begin` starts an episode, `draw` gives one decision's noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    rng: Pcg64Mcg,
    theta: f32,
    sigma: f32,
    offset_sigma: f32,
    decay_episodes: f32,
    coin: f64,
    warm_up_episodes: u64,
    noisy: bool,
    /// Width of the OU process in this episode, action units.
    width: f32,
    /// The OU process' value, `[A]`.
    process: Vec<f32>,
    /// This episode's constant offset, `[A]`.
    offset: Vec<f32>,
}

impl Noise {
    /// Exploration of `action_len` numbers, all randomness from `rng`.
    #[must_use]
    pub fn new(config: &EnafConfig, action_len: usize, rng: Pcg64Mcg) -> Self {
        Self {
            rng,
            theta: config.noise.theta,
            sigma: config.noise.sigma,
            offset_sigma: config.offset_sigma(),
            decay_episodes: config.noise.decay_episodes,
            coin: config.noise.coin,
            warm_up_episodes: config.warm_up_episodes() as u64,
            noisy: false,
            width: 0.0,
            process: vec![0.0; action_len],
            offset: vec![0.0; action_len],
        }
    }

    /// Starts episode number `episode` (from 0): tosses the coin, draws the offset, starts the process from its
    /// stationary distribution, as an episode is too short to wait for it to spread.
    pub fn begin(&mut self, episode: u64) {
        let warming_up = episode < self.warm_up_episodes;
        let age = episode.saturating_sub(self.warm_up_episodes) as f32;
        let scale = (-age / self.decay_episodes).exp();
        self.width = self.sigma * scale;
        let stationary = self.width / (self.theta * (2.0 - self.theta)).sqrt();
        // The same draws whatever the coin shows, so that one episode's coin does not shift all later noise.
        self.noisy = self.rng.random_bool(self.coin) || warming_up;
        for i in 0..self.process.len() {
            self.process[i] = stationary * self.rng.sample::<f32, _>(StandardNormal);
            self.offset[i] = self.offset_sigma * scale * self.rng.sample::<f32, _>(StandardNormal);
        }
    }

    /// Noise of the next decision, `[A]`, action units: zeros in an episode that does not explore.
    pub fn draw(&mut self) -> Vec<f32> {
        for x in &mut self.process {
            *x += -self.theta * *x + self.width * self.rng.sample::<f32, _>(StandardNormal);
        }
        if !self.noisy {
            return vec![0.0; self.process.len()];
        }
        self.process.iter().zip(&self.offset).map(|(process, offset)| process + offset).collect()
    }

    /// Whether this episode explores.
    #[must_use]
    pub fn noisy(&self) -> bool {
        self.noisy
    }

    /// Width of the OU process in this episode, action units.
    #[must_use]
    pub fn width(&self) -> f32 {
        self.width
    }
}
