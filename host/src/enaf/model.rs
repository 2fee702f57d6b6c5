//! The network: V(x), μ(x), L(x) and from them Q(x, u) (eq. 3–4).
//!
//! ```text
//! x = (observation, previous action*) ─ encoder ─ dense ─ LayerNorm ─ ReLU ─ head ─┬─ V   [1]
//!                                                                                ├─ μ   [A]
//!                                                                                └─ L   [A(A+1)/2]
//! ```
//! * if so shaped. L is a function of x only, never of the action, and its diagonal is positive, so Q has one maximum in u, at μ.
//!
//! The weights of a network are one flat vector, its parts one after another ([`Shape::part`]). What treats all weights
//! alike (Adam, Polyak, the clip, a checkpoint) is then one loop over numbers.

use std::ops::Range;

use burn::tensor::{Device, Tensor, activation::relu, s};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

use super::encoder::{Encoder, Trace, matrix, numbers};
use super::{EnafConfig, EnafError, Form};

/// The exponent of L's diagonal is kept within these bounds.
const LOG_DIAGONAL: (f32, f32) = (-5.0, 3.0);

/// Sizes and kind of a network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// Numbers in an observation, O.
    pub observation: usize,
    /// Numbers in an action, A.
    pub action: usize,
    /// Units, H.
    pub hidden: usize,
    /// GRU or feed-forward encoder.
    pub recurrent: bool,
    /// The network sees the previous action beside the observation.
    pub previous_action: bool,
    /// LayerNorm after the dense layer.
    pub layer_norm: bool,
    /// How μ is made.
    pub form: Form,
    /// Bound of the state-dependent part of μ (constants-first), action units.
    pub residual_bound: f32,
}

/// The parts of the weight vector, in their order in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// `[I, 3H]` (feed-forward `[I, H]`).
    Input,
    /// `[3H]` (`[H]`).
    InputBias,
    /// `[H, 3H]` (none).
    Recurrent,
    /// `[H]` (none).
    RecurrentBias,
    /// `[H, H]`.
    Dense,
    /// `[H]`.
    DenseBias,
    /// LayerNorm's factor, `[H]`.
    NormScale,
    /// LayerNorm's summand, `[H]`.
    NormShift,
    /// `[H, 1+A+A(A+1)/2]`: V, μ and L side by side.
    Head,
    /// `[1+A+A(A+1)/2]`.
    HeadBias,
    /// m, `[A]`, before the tanh; unused by the paper form.
    Constants,
}

impl Shape {
    /// The shape `config` asks for.
    #[must_use]
    pub fn new(config: &EnafConfig, observation: usize, action: usize) -> Self {
        Self {
            observation,
            action,
            hidden: config.hidden(),
            recurrent: config.recurrent,
            previous_action: config.previous_action(),
            layer_norm: config.layer_norm,
            form: config.form,
            residual_bound: config.residual_bound,
        }
    }

    /// Numbers the network sees at a decision, I: the observation and, if so shaped, the previous action.
    #[must_use]
    pub fn input(&self) -> usize {
        self.observation + if self.previous_action { self.action } else { 0 }
    }

    /// What the network sees, `[I]`, after `observation` `[O]` and the action `previous` `[A]` before it.
    #[must_use]
    pub fn see(&self, observation: &[f32], previous: &[f32]) -> Vec<f32> {
        let previous = if self.previous_action { previous } else { &[] };
        [observation, previous].concat()
    }

    /// Numbers of the fused head.
    #[must_use]
    pub fn outputs(&self) -> usize {
        1 + self.action + self.action * (self.action + 1) / 2
    }

    fn sizes(&self) -> [[usize; 2]; 11] {
        let h = self.hidden;
        let (gates, state) = if self.recurrent { (3 * h, h) } else { (h, 0) };
        [
            [self.input(), gates],
            [1, gates],
            [state, 3 * state],
            [1, state],
            [h, h],
            [1, h],
            [1, h],
            [1, h],
            [h, self.outputs()],
            [1, self.outputs()],
            [1, self.action],
        ]
    }

    /// Where `part` lies in the weight vector.
    #[must_use]
    pub fn part(&self, part: Part) -> Range<usize> {
        let sizes = self.sizes();
        let start = sizes[..part as usize].iter().map(|[r, c]| r * c).sum();
        let [rows, columns] = sizes[part as usize];
        start..start + rows * columns
    }

    /// Numbers in the weight vector.
    #[must_use]
    pub fn weights(&self) -> usize {
        self.part(Part::Constants).end
    }

    /// Fresh weights drawn from `rng`; μ starts at `initial_action` `[A]`, in [-1, 1].
    pub fn initial_weights(&self, initial_action: &[f32], rng: &mut Pcg64Mcg) -> Vec<f32> {
        let mut weights = vec![0.0; self.weights()];
        let wide = 1.0 / (self.hidden as f32).sqrt();
        for (part, width) in [
            (Part::Input, 1.0 / (self.input() as f32).sqrt()),
            (Part::Recurrent, wide),
            (Part::Dense, wide),
            // A small head starts V and L flat and μ on its bias.
            (Part::Head, 0.01),
        ] {
            for w in &mut weights[self.part(part)] {
                *w = rng.random_range(-width..width);
            }
        }
        weights[self.part(Part::NormScale)].fill(1.0);
        // tanh's slope vanishes at the ends of the range: start a little inside, or nothing could be learned there.
        let start = initial_action.iter().map(|u| u.clamp(-0.97, 0.97).atanh());
        match self.form {
            Form::Paper => {
                let mu_bias = self.part(Part::HeadBias).start + 1;
                weights[mu_bias..mu_bias + self.action].iter_mut().zip(start).for_each(|(w, m)| *w = m);
            }
            Form::ConstantsFirst => {
                weights[self.part(Part::Constants)].iter_mut().zip(start).for_each(|(w, m)| *w = m);
                // The state-dependent part starts at zero.
                for row in weights[self.part(Part::Head)].chunks_exact_mut(self.outputs()) {
                    row[1..=self.action].fill(0.0);
                }
            }
        }
        weights
    }
}

/// A network ready to compute: the weight vector as tensors.
#[derive(Clone, Debug)]
pub struct Network {
    shape: Shape,
    encoder: Encoder,
    weights: Vec<f32>,
    /// The torso without autodiff, for acting and for targets.
    torso: Torso,
    gate: bool,
}

/// Dense layer, LayerNorm and heads; the tensors in the order of [`TORSO`].
#[derive(Clone, Debug)]
struct Torso([Tensor<2>; 7]);

const TORSO: [Part; 7] =
    [Part::Dense, Part::DenseBias, Part::NormScale, Part::NormShift, Part::Head, Part::HeadBias, Part::Constants];

impl Torso {
    fn new(shape: &Shape, weights: &[f32], device: &Device) -> Self {
        let sizes = shape.sizes();
        Self(TORSO.map(|part| matrix(weights[shape.part(part)].to_vec(), sizes[part as usize], device)))
    }

    fn track(self) -> Self {
        Self(self.0.map(Tensor::require_grad))
    }

    /// Features `[N, H]` to the fused head `[N, 1+A+A(A+1)/2]`.
    fn head(&self, shape: &Shape, features: Tensor<2>) -> Tensor<2> {
        let [dense, dense_bias, scale, shift, head, head_bias, _] = &self.0;
        let mut y = features.matmul(dense.clone()) + dense_bias.clone();
        if shape.layer_norm {
            let centred = y.clone() - y.mean_dim(1);
            let variance = (centred.clone() * centred.clone()).mean_dim(1);
            y = centred / (variance + 1e-5).sqrt() * scale.clone() + shift.clone();
        }
        relu(y).matmul(head.clone()) + head_bias.clone()
    }

    /// μ, `[N, A]`, or `[1, A]` where it depends on no state.
    fn mu(&self, shape: &Shape, head: &Tensor<2>, gate: bool) -> Tensor<2> {
        let constants = &self.0[6];
        let from_state = || head.clone().slice(s![.., 1..1 + shape.action]).tanh();
        match shape.form {
            Form::Paper => from_state(),
            Form::ConstantsFirst if gate => (constants.clone() + from_state() * shape.residual_bound).tanh(),
            Form::ConstantsFirst => constants.clone().tanh(),
        }
    }

    /// A(x, u) = −½ |Lᵀ (u − μ)|², `[N, 1]` (eq. 4).
    fn advantage(&self, shape: &Shape, head: &Tensor<2>, u: Tensor<2>, gate: bool) -> Tensor<2> {
        let a = shape.action;
        let device = head.device();
        // L is kept as its lower triangle, row by row: entry k is L[i][j], j ≤ i. `rows` copies d_i to every entry of
        // row i and `columns` sums each column j, so Lᵀ d = (flat ∘ (d · rows)) · columns, and no [N, A, A] is built.
        let triangle: Vec<(usize, usize)> = (0..a).flat_map(|i| (0..=i).map(move |j| (i, j))).collect();
        let n = triangle.len();
        let (mut rows, mut columns) = (vec![0.0; a * n], vec![0.0; n * a]);
        let (mut diagonal, mut below) = (vec![0.0; n], vec![1.0; n]);
        for (k, &(i, j)) in triangle.iter().enumerate() {
            rows[i * n + k] = 1.0;
            columns[k * a + j] = 1.0;
            if i == j {
                (diagonal[k], below[k]) = (1.0, 0.0);
            }
        }
        let flat = head.clone().slice(s![.., 1 + a..]);
        let positive = flat.clone().clamp(LOG_DIAGONAL.0, LOG_DIAGONAL.1).exp();
        let lower = flat * matrix(below, [1, n], &device) + positive * matrix(diagonal, [1, n], &device);
        let d = u - self.mu(shape, head, gate);
        let y = (d.matmul(matrix(rows, [a, n], &device)) * lower).matmul(matrix(columns, [n, a], &device));
        (y.clone() * y).sum_dim(1) * -0.5
    }
}

impl Network {
    /// The network of `shape` with `weights`; `gate` lets the state-dependent part in (constants-first).
    #[must_use]
    pub fn new(shape: &Shape, weights: &[f32], gate: bool) -> Self {
        let device = Device::flex();
        let of = |part| &weights[shape.part(part)];
        let encoder = Encoder::new(
            of(Part::Input),
            of(Part::InputBias),
            of(Part::Recurrent),
            of(Part::RecurrentBias),
            shape.hidden,
            &device,
        );
        let torso = Torso::new(shape, weights, &device);
        Self { shape: shape.clone(), encoder, torso, weights: weights.to_vec(), gate }
    }

    /// The network's shape.
    #[must_use]
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    fn encode(&self, inputs: &[f32], batch: usize) -> Result<(Tensor<2>, Trace), EnafError> {
        let columns = self.shape.input();
        let x = matrix(inputs.to_vec(), [inputs.len() / columns, columns], &Device::flex());
        let trace = self.encoder.forward(x.clone(), &vec![0.0; batch * self.shape.hidden])?;
        Ok((x, trace))
    }

    fn features(&self, trace: &Trace, device: &Device) -> Tensor<2> {
        let features = trace.features(self.shape.hidden).to_vec();
        let rows = features.len() / self.shape.hidden;
        matrix(features, [rows, self.shape.hidden], device)
    }

    /// V of every step, `[T·B]`, unrolling `inputs` `[T·B, I]` (time-major) from a zero state.
    ///
    /// # Errors
    /// [`EnafError::Tensor`] if the tensor library fails.
    pub fn values(&self, inputs: &[f32], batch: usize) -> Result<Vec<f32>, EnafError> {
        let (_, trace) = self.encode(inputs, batch)?;
        let head = self.torso.head(&self.shape, self.features(&trace, &Device::flex()));
        numbers(head.slice(s![.., 0..1]))
    }

    /// One decision: V and μ `[A]` after `input` `[I]`; `state` `[H]` moves one step on.
    ///
    /// # Errors
    /// [`EnafError::Tensor`] if the tensor library fails.
    pub fn decide(&self, input: &[f32], state: &mut Vec<f32>) -> Result<(f32, Vec<f32>), EnafError> {
        let device = Device::flex();
        let trace = self.encoder.forward(matrix(input.to_vec(), [1, input.len()], &device), state)?;
        *state = trace.last(self.shape.hidden).to_vec();
        let head = self.torso.head(&self.shape, self.features(&trace, &device));
        let mu = numbers(self.torso.mu(&self.shape, &head, self.gate))?;
        let value = numbers(head.slice(s![.., 0..1]))?;
        Ok((value[0], mu))
    }

    /// Q(x, u) of every step, `[T·B]`, and the gradient of Σ slope·Q over the weights, where `slope` makes `[T·B]`
    /// numbers of Q. (A loss whose derivative by Q is `slope` has exactly this gradient.)
    ///
    /// `inputs` `[T·B, I]` and `actions` `[T·B, A]` are time-major and start at the episodes' first decision.
    ///
    /// # Errors
    /// [`EnafError::Tensor`] if the tensor library fails.
    pub fn differentiate(
        &self,
        inputs: &[f32],
        actions: &[f32],
        batch: usize,
        slope: impl FnOnce(&[f32]) -> Vec<f32>,
    ) -> Result<(Vec<f32>, Vec<f32>), EnafError> {
        let (shape, device) = (&self.shape, Device::flex().autodiff());
        let (x, trace) = self.encode(inputs, batch)?;
        // Autodiff begins at the features and ends there; the encoder takes over with its own backward.
        let features = self.features(&trace, &device).require_grad();
        let torso = Torso::new(shape, &self.weights, &device).track();
        let head = torso.head(shape, features.clone());
        let rows = actions.len() / shape.action;
        let u = matrix(actions.to_vec(), [rows, shape.action], &device);
        let q = head.clone().slice(s![.., 0..1]) + torso.advantage(shape, &head, u, self.gate);
        let q_numbers = numbers(q.clone().inner())?;
        let slopes = matrix(slope(&q_numbers), [rows, 1], &device);
        let gradients = (q * slopes).sum().backward();

        let mut gradient = vec![0.0; shape.weights()];
        for (part, tensor) in TORSO.into_iter().zip(&torso.0) {
            // What took no part (the constants in the paper form, a switched-off LayerNorm) has no gradient.
            if let Some(g) = tensor.grad(&gradients) {
                gradient[shape.part(part)].copy_from_slice(&numbers(g)?);
            }
        }
        if let Some(g) = features.grad(&gradients) {
            let encoder = self.encoder.backward(x, &trace, &numbers(g)?)?;
            gradient[shape.part(Part::Input)].copy_from_slice(&encoder.input);
            gradient[shape.part(Part::InputBias)].copy_from_slice(&encoder.input_bias);
            gradient[shape.part(Part::Recurrent)].copy_from_slice(&encoder.recurrent);
            gradient[shape.part(Part::RecurrentBias)].copy_from_slice(&encoder.recurrent_bias);
        }
        Ok((q_numbers, gradient))
    }
}
