//! Continuous-time episodic replay (§IV, Fig. 4): episodes stored whole, drawn at random, unrolled from their start.
//!
//! Every unroll begins at its episode's own t = 0 with a zero hidden state, so the state at every later step is exact,
//! and rows of different episodes never meet: nothing crosses from one episode to the next.

use std::collections::VecDeque;

use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// One stored episode of T decisions.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Episode {
    /// `[T+1, I]`: what the network saw before each decision (observation, then previous action), and after the last.
    pub inputs: Vec<f32>,
    /// `[T, A]`: what was done, noise included.
    pub actions: Vec<f32>,
    /// `[T]`.
    pub rewards: Vec<f32>,
    /// Ended by a fall: nothing is earned after the last decision.
    pub fell: bool,
}

impl Episode {
    /// Up to `length` decisions from decision `at` on; its end counts only if it is the episode's.
    fn piece(&self, at: usize, length: usize, input_len: usize, action_len: usize) -> Episode {
        let end = (at + length).min(self.rewards.len());
        Episode {
            inputs: self.inputs[at * input_len..(end + 1) * input_len].to_vec(),
            actions: self.actions[at * action_len..end * action_len].to_vec(),
            rewards: self.rewards[at..end].to_vec(),
            fell: self.fell && end == self.rewards.len(),
        }
    }
}

/// Episodes side by side, time-major: row `t·B + b` is step t of episode b. Shorter episodes are padded with zeros and
/// masked out.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// Episodes, B.
    pub episodes: usize,
    /// Longest unroll, T.
    pub steps: usize,
    /// `[(T+1)·B, I]`.
    pub inputs: Vec<f32>,
    /// `[T·B, A]`.
    pub actions: Vec<f32>,
    /// `[T·B]`.
    pub rewards: Vec<f32>,
    /// `[T·B]`: 1 where a decision was made, 0 in the padding.
    pub mask: Vec<f32>,
    /// `[B]`: decisions of each unroll.
    pub lengths: Vec<usize>,
    /// `[B]`: the unroll ends in a fall (not in a time-out, and not because it was trimmed).
    pub fell: Vec<bool>,
}

impl Batch {
    /// Lines up `episodes`, trimmed to at most `unroll` decisions from their start.
    #[must_use]
    pub fn new(episodes: &[&Episode], unroll: usize, input_len: usize, action_len: usize) -> Self {
        let b = episodes.len();
        let lengths: Vec<usize> = episodes.iter().map(|e| e.rewards.len().min(unroll)).collect();
        let t = lengths.iter().copied().max().unwrap_or(0);
        let mut batch = Self {
            episodes: b,
            steps: t,
            inputs: vec![0.0; (t + 1) * b * input_len],
            actions: vec![0.0; t * b * action_len],
            rewards: vec![0.0; t * b],
            mask: vec![0.0; t * b],
            fell: episodes.iter().zip(&lengths).map(|(e, &n)| e.fell && n == e.rewards.len()).collect(),
            lengths,
        };
        for (column, episode) in episodes.iter().enumerate() {
            let length = batch.lengths[column];
            for (step, input) in episode.inputs.chunks_exact(input_len).take(length + 1).enumerate() {
                batch.inputs[(step * b + column) * input_len..][..input_len].copy_from_slice(input);
            }
            for (step, action) in episode.actions.chunks_exact(action_len).take(length).enumerate() {
                let row = step * b + column;
                batch.actions[row * action_len..][..action_len].copy_from_slice(action);
                batch.rewards[row] = episode.rewards[step];
                batch.mask[row] = 1.0;
            }
        }
        batch
    }
}

/// The stored episodes of a session, oldest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Replay {
    rng: Pcg64Mcg,
    capacity: usize,
    episodes: VecDeque<Episode>,
}

impl Replay {
    /// An empty store of `capacity` episodes that draws with `rng`.
    #[must_use]
    pub fn new(capacity: usize, rng: Pcg64Mcg) -> Self {
        Self { rng, capacity, episodes: VecDeque::new() }
    }

    /// Stores an episode; one without a decision teaches nothing and is dropped.
    pub fn push(&mut self, episode: Episode) {
        if episode.rewards.is_empty() {
            return;
        }
        if self.episodes.len() == self.capacity {
            self.episodes.pop_front();
        }
        self.episodes.push_back(episode);
    }

    /// Episodes stored.
    #[must_use]
    pub fn len(&self) -> usize {
        self.episodes.len()
    }

    /// Whether nothing is stored.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.episodes.is_empty()
    }

    /// Draws `count` episodes, with replacement; `None` while nothing is stored.
    pub fn draw(&mut self, count: usize, unroll: usize, input_len: usize, action_len: usize) -> Option<Batch> {
        if self.episodes.is_empty() {
            return None;
        }
        let drawn: Vec<usize> = (0..count).map(|_| self.rng.random_range(0..self.episodes.len())).collect();
        let episodes: Vec<&Episode> = drawn.iter().map(|&i| &self.episodes[i]).collect();
        Some(Batch::new(&episodes, unroll, input_len, action_len))
    }

    /// Draws `count` pieces of at most `length` decisions: each begins anywhere in any episode, every decision being as
    /// likely. `None` while nothing is stored.
    pub fn draw_pieces(&mut self, count: usize, length: usize, input_len: usize, action_len: usize) -> Option<Batch> {
        let decisions: usize = self.episodes.iter().map(|episode| episode.rewards.len()).sum();
        if decisions == 0 {
            return None;
        }
        let pieces: Vec<Episode> = (0..count)
            .map(|_| {
                let mut at = self.rng.random_range(0..decisions);
                let mut whole = &self.episodes[0];
                for episode in &self.episodes {
                    whole = episode;
                    if at < episode.rewards.len() {
                        break;
                    }
                    at -= episode.rewards.len();
                }
                whole.piece(at, length, input_len, action_len)
            })
            .collect();
        Some(Batch::new(&pieces.iter().collect::<Vec<_>>(), length, input_len, action_len))
    }
}
