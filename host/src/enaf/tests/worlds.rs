//! Toy worlds.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use crate::enaf::{End, EnvError, Environment, Outcome};

/// Constants to find behind noise: reward = 1 − |u − u*|² + noise.
pub struct Bandit {
    pub best: Vec<f32>,
    pub noise: f32,
    pub decisions: usize,
    rng: Pcg64Mcg,
    step: usize,
}

impl Bandit {
    pub fn new(best: &[f32], noise: f32, decisions: usize) -> Self {
        Self { best: best.to_vec(), noise, decisions, rng: Pcg64Mcg::seed_from_u64(0), step: 0 }
    }
}

impl Environment for Bandit {
    fn observation_len(&self) -> usize {
        2
    }

    fn action_len(&self) -> usize {
        self.best.len()
    }

    fn reset(&mut self, episode_seed: u64) -> Result<Vec<f32>, EnvError> {
        self.rng = Pcg64Mcg::seed_from_u64(episode_seed);
        self.step = 0;
        Ok(vec![self.rng.sample(StandardNormal), 1.0])
    }

    fn decide(&mut self, action: &[f32]) -> Result<Outcome, EnvError> {
        self.step += 1;
        let miss: f32 = action.iter().zip(&self.best).map(|(u, best)| (u - best).powi(2)).sum();
        let noise: f32 = self.rng.sample(StandardNormal);
        Ok(Outcome {
            observation: vec![self.rng.sample(StandardNormal), 1.0],
            reward: 1.0 - miss + self.noise * noise,
            end: (self.step == self.decisions).then_some(End::TimeOut),
        })
    }
}

/// A cue of ±1 in the first observation only; the action is right at ±0.5 with the cue's sign, in every decision.
pub struct Memory {
    pub decisions: usize,
    cue: f32,
    step: usize,
}

impl Memory {
    pub fn new(decisions: usize) -> Self {
        Self { decisions, cue: 0.0, step: 0 }
    }
}

impl Environment for Memory {
    fn observation_len(&self) -> usize {
        2
    }

    fn action_len(&self) -> usize {
        1
    }

    fn reset(&mut self, episode_seed: u64) -> Result<Vec<f32>, EnvError> {
        self.cue = if episode_seed & 1 == 0 { 1.0 } else { -1.0 };
        self.step = 0;
        Ok(vec![self.cue, 0.0])
    }

    fn decide(&mut self, action: &[f32]) -> Result<Outcome, EnvError> {
        // The first decision still sees the cue; only the later ones are rewarded.
        let reward = if self.step == 0 { 0.0 } else { 1.0 - (action[0] - 0.5 * self.cue).powi(2) };
        self.step += 1;
        Ok(Outcome {
            observation: vec![0.0, self.step as f32 / self.decisions as f32],
            reward,
            end: (self.step == self.decisions).then_some(End::TimeOut),
        })
    }
}

/// Pays `reward` and falls at decision `falls_at`.
pub struct Scripted {
    pub reward: f32,
    pub falls_at: usize,
    pub step: usize,
}

impl Environment for Scripted {
    fn observation_len(&self) -> usize {
        2
    }

    fn action_len(&self) -> usize {
        1
    }

    fn reset(&mut self, _: u64) -> Result<Vec<f32>, EnvError> {
        self.step = 0;
        Ok(vec![0.0; 2])
    }

    fn decide(&mut self, _: &[f32]) -> Result<Outcome, EnvError> {
        self.step += 1;
        let end = (self.step == self.falls_at).then_some(End::Fall);
        Ok(Outcome { observation: vec![0.1; 2], reward: self.reward, end })
    }
}
