//! The encoder: a sequence of inputs to a sequence of features, forward and backward.
//!
//! The only sequential part of the network, and so the only one differentiated by hand: an autodiff graph of thirty
//! GRU steps costs more in bookkeeping than in arithmetic. Matrix products are burn's; everything between two products
//! is one loop over slices.
//!
//! Sequences are time-major: row `t·B + b` of a `[T·B, ·]` matrix is step t of episode b, so one step is one contiguous
//! block. GRU (gates r, z, n side by side, r multiplies after the product as in cuDNN and PyTorch):
//!
//! ```text
//! r = σ(x·Wxr + bxr + h·Whr)      n = tanh(x·Wxn + bxn + r ∘ (h·Whn + bn))
//! z = σ(x·Wxz + bxz + h·Whz)      h' = n + z ∘ (h − n)
//! ```

use burn::tensor::{Device, Tensor, TensorData};

use super::EnafError;

/// A `[rows, columns]` tensor of `values` on `device`.
pub(crate) fn matrix(values: Vec<f32>, [rows, columns]: [usize; 2], device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values, [rows, columns]), device)
}

/// The numbers of a tensor, row after row.
pub(crate) fn numbers<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, EnafError> {
    tensor.try_into_vec_as::<f32>().map_err(|error| EnafError::Tensor(error.to_string()))
}

/// Weights of the encoder. The feed-forward encoder is `tanh(x·Wx + bx)` and has no recurrent part.
#[derive(Clone, Debug)]
pub struct Encoder {
    /// `[I, 3H]`, feed-forward `[I, H]`.
    input: Tensor<2>,
    /// `[3H]`, feed-forward `[H]`.
    input_bias: Vec<f32>,
    /// `[H, 3H]` and bn `[H]`; `None` for the feed-forward encoder.
    recurrent: Option<(Tensor<2>, Vec<f32>)>,
    hidden: usize,
}

/// What the forward pass leaves for the backward pass. All sequences time-major.
#[derive(Debug)]
pub struct Trace {
    /// `[(T+1)·B, H]`: the state before each step, and the last one.
    states: Vec<f32>,
    /// `[T·B, 4H]`: r, z, n and the inner `h·Whn + bn` of every step; empty for the feed-forward encoder.
    gates: Vec<f32>,
    batch: usize,
}

impl Trace {
    /// Features `[T·B, H]`: the state after each step.
    #[must_use]
    pub fn features(&self, hidden: usize) -> &[f32] {
        &self.states[self.batch * hidden..]
    }

    /// The last state `[B, H]`.
    #[must_use]
    pub fn last(&self, hidden: usize) -> &[f32] {
        &self.states[self.states.len() - self.batch * hidden..]
    }
}

/// Gradients, laid out like the weights.
#[derive(Debug)]
pub struct EncoderGradient {
    /// Like the input weights.
    pub input: Vec<f32>,
    /// Like the input bias.
    pub input_bias: Vec<f32>,
    /// `[H, 3H]`; empty for the feed-forward encoder.
    pub recurrent: Vec<f32>,
    /// `[H]`; empty for the feed-forward encoder.
    pub recurrent_bias: Vec<f32>,
}

impl Encoder {
    /// Takes the weights; an empty `recurrent` makes the feed-forward encoder.
    pub(crate) fn new(
        input: &[f32],
        input_bias: &[f32],
        recurrent: &[f32],
        recurrent_bias: &[f32],
        hidden: usize,
        device: &Device,
    ) -> Self {
        let columns = input_bias.len();
        Self {
            input: matrix(input.to_vec(), [input.len() / columns, columns], device),
            input_bias: input_bias.to_vec(),
            recurrent: (!recurrent.is_empty())
                .then(|| (matrix(recurrent.to_vec(), [hidden, 3 * hidden], device), recurrent_bias.to_vec())),
            hidden,
        }
    }

    /// Encodes `x` `[T·B, I]` from the state `start` `[B, H]`.
    ///
    /// # Errors
    /// [`EnafError::Tensor`] if the tensor library fails.
    pub fn forward(&self, x: Tensor<2>, start: &[f32]) -> Result<Trace, EnafError> {
        let h = self.hidden;
        let batch = start.len() / h;
        // One product for all steps: only what depends on the previous state waits its turn.
        let device = x.device();
        let mut projected = numbers(x.matmul(self.input.clone()))?;
        for row in projected.chunks_exact_mut(self.input_bias.len()) {
            for (p, b) in row.iter_mut().zip(&self.input_bias) {
                *p += b;
            }
        }
        let mut states = Vec::with_capacity((projected.len() / self.input_bias.len() + batch) * h);
        states.extend_from_slice(start);
        let Some((recurrent, inner_bias)) = &self.recurrent else {
            states.extend(projected.iter().map(|&x| tanh(x)));
            return Ok(Trace { states, gates: Vec::new(), batch });
        };
        let steps = projected.len() / (3 * h * batch);
        let mut gates = vec![0.0; steps * batch * 4 * h];
        for step in 0..steps {
            let before = states[states.len() - batch * h..].to_vec();
            let from_state = numbers(matrix(before.clone(), [batch, h], &device).matmul(recurrent.clone()))?;
            let rows = step * batch..(step + 1) * batch;
            let saved = &mut gates[rows.start * 4 * h..rows.end * 4 * h];
            let from_input = &projected[rows.start * 3 * h..rows.end * 3 * h];
            for (((saved, a), g), before) in saved
                .chunks_exact_mut(4 * h)
                .zip(from_input.chunks_exact(3 * h))
                .zip(from_state.chunks_exact(3 * h))
                .zip(before.chunks_exact(h))
            {
                let (rz, rest) = saved.split_at_mut(2 * h);
                for ((out, a), g) in rz.iter_mut().zip(&a[..2 * h]).zip(&g[..2 * h]) {
                    *out = sigmoid(a + g);
                }
                let (n, inner) = rest.split_at_mut(h);
                for ((inner, g), b) in inner.iter_mut().zip(&g[2 * h..]).zip(inner_bias) {
                    *inner = g + b;
                }
                let (r, z) = rz.split_at(h);
                for (((n, a), r), inner) in n.iter_mut().zip(&a[2 * h..]).zip(r).zip(&*inner) {
                    *n = tanh(a + r * inner);
                }
                states.extend(n.iter().zip(z).zip(before).map(|((n, z), before)| n + z * (before - n)));
            }
        }
        Ok(Trace { states, gates, batch })
    }

    /// Gradients of the weights from the gradient of the features, `[T·B, H]`.
    ///
    /// # Errors
    /// [`EnafError::Tensor`] if the tensor library fails.
    pub fn backward(&self, x: Tensor<2>, trace: &Trace, features: &[f32]) -> Result<EncoderGradient, EnafError> {
        let h = self.hidden;
        let device = x.device();
        let rows = features.len() / h;
        let Some((recurrent, _)) = &self.recurrent else {
            let outputs = trace.features(h);
            let d: Vec<f32> = features.iter().zip(outputs).map(|(d, y)| d * (1.0 - y * y)).collect();
            return Ok(EncoderGradient {
                input_bias: column_sums(&d, h),
                input: numbers(x.transpose().matmul(matrix(d, [rows, h], &device)))?,
                recurrent: Vec::new(),
                recurrent_bias: Vec::new(),
            });
        };
        let batch = trace.batch;
        // Laid out anew once: a product with a transposed view is half as slow again, thirty times over.
        let back = matrix(numbers(recurrent.clone().transpose())?, [3 * h, h], &device);
        // Gradients at the gates' arguments: as the input sees them, and as the state sees them (n behind r).
        let mut at_input = vec![0.0; rows * 3 * h];
        let mut at_state = vec![0.0; rows * 3 * h];
        let mut carry = vec![0.0; batch * h];
        for step in (0..rows / batch).rev() {
            for b in 0..batch {
                let row = step * batch + b;
                let (r, rest) = trace.gates[row * 4 * h..(row + 1) * 4 * h].split_at(h);
                let (z, rest) = rest.split_at(h);
                let (n, inner) = rest.split_at(h);
                let before = &trace.states[row * h..(row + 1) * h];
                let d = &features[row * h..(row + 1) * h];
                let carry = &mut carry[b * h..(b + 1) * h];
                let (di_r, rest) = at_input[row * 3 * h..(row + 1) * 3 * h].split_at_mut(h);
                let (di_z, di_n) = rest.split_at_mut(h);
                let (ds_r, rest) = at_state[row * 3 * h..(row + 1) * 3 * h].split_at_mut(h);
                let (ds_z, ds_n) = rest.split_at_mut(h);
                for i in 0..h {
                    let dh = d[i] + carry[i];
                    let dn = dh * (1.0 - z[i]) * (1.0 - n[i] * n[i]);
                    let dz = dh * (before[i] - n[i]) * z[i] * (1.0 - z[i]);
                    let dr = dn * inner[i] * r[i] * (1.0 - r[i]);
                    (di_r[i], di_z[i], di_n[i]) = (dr, dz, dn);
                    (ds_r[i], ds_z[i], ds_n[i]) = (dr, dz, dn * r[i]);
                    carry[i] = dh * z[i];
                }
            }
            if step > 0 {
                let rows = step * batch * 3 * h..(step + 1) * batch * 3 * h;
                let through = numbers(matrix(at_state[rows].to_vec(), [batch, 3 * h], &device).matmul(back.clone()))?;
                for (carry, through) in carry.iter_mut().zip(through) {
                    *carry += through;
                }
            }
        }
        let before = matrix(trace.states[..rows * h].to_vec(), [rows, h], &device);
        Ok(EncoderGradient {
            input_bias: column_sums(&at_input, 3 * h),
            recurrent_bias: column_sums(&at_state, 3 * h).split_off(2 * h),
            input: numbers(x.transpose().matmul(matrix(at_input, [rows, 3 * h], &device)))?,
            recurrent: numbers(before.transpose().matmul(matrix(at_state, [rows, 3 * h], &device)))?,
        })
    }
}

fn column_sums(values: &[f32], columns: usize) -> Vec<f32> {
    let mut sums = vec![0.0; columns];
    for row in values.chunks_exact(columns) {
        for (sum, x) in sums.iter_mut().zip(row) {
            *sum += x;
        }
    }
    sums
}

/// tanh by the 13/6 rational fit that Eigen uses, a few units in the last place from exact. It needs no library call,
/// so a loop of it becomes vector code, and every machine computes the same bits.
#[inline]
pub(crate) fn tanh(x: f32) -> f32 {
    let x = x.clamp(-7.905_311, 7.905_311);
    let s = x * x;
    let p = -2.760_768_5e-16_f32;
    let p = p * s + 2.000_188e-13;
    let p = p * s - 8.604_672e-11;
    let p = p * s + 5.122_297_1e-8;
    let p = p * s + 1.485_722_3e-5;
    let p = p * s + 6.372_619_3e-4;
    let p = p * s + 4.893_524_6e-3;
    let q = 1.198_258_4e-6_f32;
    let q = q * s + 1.185_347_1e-4;
    let q = q * s + 2.268_434_6e-3;
    let q = q * s + 4.893_525e-3;
    x * p / q
}

#[inline]
fn sigmoid(x: f32) -> f32 {
    0.5 + 0.5 * tanh(0.5 * x)
}
