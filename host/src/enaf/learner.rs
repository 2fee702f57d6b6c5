//! Learning: λ-returns from a target network, one clipped Adam step, the target drawn along.

use serde::{Deserialize, Serialize};

use super::model::{Network, Shape};
use super::replay::Batch;
use super::{EnafConfig, EnafError};

/// One network under training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Net {
    weights: Vec<f32>,
    target: Vec<f32>,
    /// Adam's running means of the gradient and of its square.
    mean: Vec<f32>,
    square: Vec<f32>,
}

/// What one gradient step reports.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// Huber loss per decision.
    pub loss: f32,
    /// Global norm of the gradient before the clip.
    pub grad_norm: f32,
}

/// The networks of a session and their optimiser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Learner {
    shape: Shape,
    nets: Vec<Net>,
    updates: u64,
}

impl Learner {
    /// A learner whose networks start with these weights (two vectors for twin training).
    #[must_use]
    pub fn new(shape: Shape, weights: Vec<Vec<f32>>) -> Self {
        let nets = weights
            .into_iter()
            .map(|w| Net { target: w.clone(), mean: vec![0.0; w.len()], square: vec![0.0; w.len()], weights: w })
            .collect();
        Self { shape, nets, updates: 0 }
    }

    /// The networks' shape.
    #[must_use]
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// The weights that act: those of the first network.
    #[must_use]
    pub fn weights(&self) -> &[f32] {
        &self.nets[0].weights
    }

    /// Gradient steps taken.
    #[must_use]
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// One gradient step on `batch`. A step that meets a number that is not finite changes nothing.
    ///
    /// # Errors
    /// [`EnafError::LearningNotFinite`] with the quantity and the update.
    pub fn step(&mut self, batch: &Batch, config: &EnafConfig, gate: bool) -> Result<Step, EnafError> {
        let update = self.updates;
        let finite = |quantity, values: &[f32]| match values.iter().all(|x| x.is_finite()) {
            true => Ok(()),
            false => Err(EnafError::LearningNotFinite { update, quantity }),
        };
        finite("reward", &batch.rewards)?;
        let mut next = Vec::new();
        for net in &self.nets {
            let values = Network::new(&self.shape, &net.target, gate).values(&batch.inputs, batch.episodes)?;
            next = if next.is_empty() { values } else { std::iter::zip(next, values).map(|(a, b)| a.min(b)).collect() };
        }
        finite("target V", &next)?;
        let targets = lambda_returns(batch, &next, config.gamma, config.lambda());

        let decided = batch.mask.iter().sum::<f32>().max(1.0);
        let inputs = &batch.inputs[..batch.steps * batch.episodes * self.shape.input()];
        let mut report = Step::default();
        let mut gradients = Vec::with_capacity(self.nets.len());
        for net in &self.nets {
            let mut loss = 0.0;
            let (q, gradient) = Network::new(&self.shape, &net.weights, gate).differentiate(
                inputs,
                &batch.actions,
                batch.episodes,
                |q| {
                    let rows = q.iter().zip(&targets).zip(&batch.mask);
                    rows.map(|((q, target), mask)| {
                        let (cost, slope) = huber(q - target, config.huber_delta);
                        loss += cost * mask / decided;
                        slope * mask / decided
                    })
                    .collect()
                },
            )?;
            finite("Q", &q)?;
            finite("loss", &[loss])?;
            let norm = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
            finite("gradient", &[norm])?;
            report.loss += loss / self.nets.len() as f32;
            report.grad_norm = report.grad_norm.max(norm);
            gradients.push((gradient, (config.max_grad_norm / norm).min(1.0)));
        }
        self.updates += 1;
        for (net, (gradient, scale)) in self.nets.iter_mut().zip(gradients) {
            net.adam(&gradient, scale, config.learning_rate(), self.updates);
            net.polyak(config.tau);
        }
        Ok(report)
    }
}

impl Net {
    /// Adam (Kingma & Ba 2015) with β = (0.9, 0.999), ε = 1e-8; `step` counts from 1.
    fn adam(&mut self, gradient: &[f32], scale: f32, rate: f32, step: u64) {
        let (b1, b2) = (0.9_f32, 0.999_f32);
        let step = i32::try_from(step).unwrap_or(i32::MAX);
        let (c1, c2) = (1.0 - b1.powi(step), 1.0 - b2.powi(step));
        let moments = self.mean.iter_mut().zip(&mut self.square);
        for ((w, g), (m, v)) in self.weights.iter_mut().zip(gradient).zip(moments) {
            let g = g * scale;
            *m = b1 * *m + (1.0 - b1) * g;
            *v = b2 * *v + (1.0 - b2) * g * g;
            *w -= rate * (*m / c1) / ((*v / c2).sqrt() + 1e-8);
        }
    }

    fn polyak(&mut self, tau: f32) {
        for (target, w) in self.target.iter_mut().zip(&self.weights) {
            *target += tau * (w - *target);
        }
    }
}

/// The Huber cost of `error` and its derivative.
fn huber(error: f32, delta: f32) -> (f32, f32) {
    match error.abs() <= delta {
        true => (0.5 * error * error, error),
        false => (delta * (error.abs() - 0.5 * delta), error.clamp(-delta, delta)),
    }
}

/// Targets `[T·B]`: G_t = r_t + γ·((1−λ)·V(x_{t+1}) + λ·G_{t+1}), from V `[(T+1)·B]` of the target network.
///
/// After the last decision G is V, because a time-out (or a trimmed unroll) could have gone on; after a fall it is 0.
/// λ = 0 is the paper's one-step target. Padding gets 0.
#[must_use]
pub fn lambda_returns(batch: &Batch, values: &[f32], gamma: f32, lambda: f32) -> Vec<f32> {
    let b = batch.episodes;
    let mut targets = vec![0.0; batch.steps * b];
    for (column, &length) in batch.lengths.iter().enumerate() {
        let mut after = values[length * b + column];
        for step in (0..length).rev() {
            let row = step * b + column;
            let onward = match batch.fell[column] && step + 1 == length {
                true => 0.0,
                false => (1.0 - lambda) * values[row + b] + lambda * after,
            };
            after = batch.rewards[row] + gamma * onward;
            targets[row] = after;
        }
    }
    targets
}
