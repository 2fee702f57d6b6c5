//! What must hold to the last digit, or nearly.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::enaf::agent::Agent;
use crate::enaf::encoder::tanh;
use crate::enaf::learner::{Learner, lambda_returns};
use crate::enaf::model::{Network, Part, Shape};
use crate::enaf::replay::{Batch, Episode, Replay};
use crate::enaf::{EnafConfig, Form};

fn shape(form: Form, recurrent: bool) -> Shape {
    let config = EnafConfig { hidden: Some(6), recurrent, ..EnafConfig::for_form(form) };
    Shape::new(&config, 3, 2)
}

fn random(rng: &mut Pcg64Mcg, n: usize) -> Vec<f32> {
    (0..n).map(|_| rng.random_range(-1.0..1.0)).collect()
}

/// Weights that are large enough everywhere for every part to matter.
fn lively_weights(shape: &Shape, rng: &mut Pcg64Mcg) -> Vec<f32> {
    let mut weights = shape.initial_weights(&[0.2, -0.3], rng);
    for part in [Part::Head, Part::HeadBias, Part::InputBias, Part::RecurrentBias, Part::DenseBias, Part::NormShift] {
        weights[shape.part(part)].iter_mut().for_each(|w| *w += rng.random_range(-0.5..0.5));
    }
    weights
}

fn episode(rng: &mut Pcg64Mcg, shape: &Shape, decisions: usize, fell: bool) -> Episode {
    Episode {
        inputs: random(rng, (decisions + 1) * shape.input()),
        actions: random(rng, decisions * shape.action),
        rewards: random(rng, decisions),
        fell,
    }
}

fn near(a: &[f32], b: &[f32], tolerance: f32) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance)
}

#[test]
fn acting_step_by_step_and_unrolling_a_batch_give_the_same_v() {
    for recurrent in [true, false] {
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let shape = shape(Form::Paper, recurrent);
        let network = Network::new(&shape, &lively_weights(&shape, &mut rng), false);
        let episodes = [episode(&mut rng, &shape, 7, true), episode(&mut rng, &shape, 4, false)];
        let batch = Batch::new(&[&episodes[0], &episodes[1]], 30, shape.input(), shape.action);
        let unrolled = network.values(&batch.inputs, batch.episodes).unwrap();

        // One agent acts both episodes in turn: nothing may cross from the first to the second.
        let mut agent = Agent::new(network);
        for (column, episode) in episodes.iter().enumerate() {
            agent.reset();
            for (step, input) in episode.inputs.chunks_exact(shape.input()).enumerate() {
                let (observation, previous) = input.split_at(shape.observation);
                let value = agent.act(observation, previous).unwrap().value;
                assert!((value - unrolled[step * 2 + column]).abs() < 1e-6, "step {step} of episode {column}");
            }
        }
    }
}

#[test]
fn the_gradient_is_that_of_finite_differences() {
    for (form, recurrent, gate) in [
        (Form::Paper, true, false),
        (Form::Paper, false, false),
        (Form::ConstantsFirst, true, false),
        (Form::ConstantsFirst, true, true),
    ] {
        let mut rng = Pcg64Mcg::seed_from_u64(2);
        let shape = shape(form, recurrent);
        let weights = lively_weights(&shape, &mut rng);
        let (batch, steps) = (2, 4);
        let inputs = random(&mut rng, steps * batch * shape.input());
        let actions = random(&mut rng, steps * batch * shape.action);
        let slope = random(&mut rng, steps * batch);
        let differentiate = |weights: &[f32]| {
            Network::new(&shape, weights, gate).differentiate(&inputs, &actions, batch, |_| slope.clone()).unwrap()
        };
        let sum = |weights: &[f32]| -> f64 {
            differentiate(weights).0.iter().zip(&slope).map(|(q, s)| f64::from(q * s)).sum()
        };
        let (_, gradient) = differentiate(&weights);
        // The largest entries of each part: there the difference stands clear of rounding.
        for part in [
            Part::Input,
            Part::InputBias,
            Part::Recurrent,
            Part::RecurrentBias,
            Part::Dense,
            Part::DenseBias,
            Part::NormScale,
            Part::NormShift,
            Part::Head,
            Part::HeadBias,
            Part::Constants,
        ] {
            let mut indices: Vec<usize> = shape.part(part).collect();
            indices.sort_by(|&a, &b| gradient[b].abs().total_cmp(&gradient[a].abs()));
            for &i in indices.iter().take(6) {
                let step = 2e-3;
                let mut moved = weights.clone();
                moved[i] = weights[i] + step;
                let above = sum(&moved);
                moved[i] = weights[i] - step;
                let below = sum(&moved);
                let numeric = ((above - below) / f64::from(2.0 * step)) as f32;
                let allowed = 2e-3 + 0.02 * numeric.abs();
                assert!(
                    (gradient[i] - numeric).abs() < allowed,
                    "{form:?} gate {gate} {part:?}: {} but {numeric}",
                    gradient[i]
                );
            }
        }
    }
}

#[test]
fn q_is_highest_at_mu_and_falls_off_as_the_lower_triangle_says() {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let shape = shape(Form::Paper, true);
    let weights = lively_weights(&shape, &mut rng);
    let network = Network::new(&shape, &weights, false);
    let input = random(&mut rng, shape.input());
    let (value, mu) = network.decide(&input, &mut vec![0.0; shape.hidden]).unwrap();
    let q = |u: &[f32]| network.differentiate(&input, u, 1, |_| vec![1.0]).unwrap().0[0];
    assert!((q(&mu) - value).abs() < 1e-6);

    // P = L Lᵀ read off from three unit displacements must be positive definite.
    let fall = |d: [f32; 2]| -2.0 * (q(&[mu[0] + d[0], mu[1] + d[1]]) - value);
    let (a, b, both) = (fall([1.0, 0.0]), fall([0.0, 1.0]), fall([1.0, 1.0]));
    let off_diagonal = (both - a - b) / 2.0;
    assert!(a > 0.0 && b > 0.0 && a * b - off_diagonal * off_diagonal > 0.0);
    // And a quadratic: twice as far costs four times as much.
    assert!((fall([2.0, 2.0]) - 4.0 * both).abs() < 1e-3 * both.abs().max(1.0));
}

#[test]
fn a_time_out_is_bootstrapped_and_a_fall_is_not() {
    let shape = shape(Form::Paper, true);
    let make = |fell| Episode {
        inputs: vec![0.0; 3 * shape.input()],
        actions: vec![0.0; 2 * shape.action],
        rewards: vec![1.0, 2.0],
        fell,
    };
    let (time_out, fall) = (make(false), make(true));
    let batch = Batch::new(&[&time_out, &fall], 30, shape.input(), shape.action);
    // V of both episodes, step by step.
    let values = [0.0, 0.0, 10.0, 20.0, 30.0, 40.0];
    let one_step = lambda_returns(&batch, &values, 0.5, 0.0);
    assert_eq!(one_step, [1.0 + 0.5 * 10.0, 1.0 + 0.5 * 20.0, 2.0 + 0.5 * 30.0, 2.0]);
    let monte_carlo = lambda_returns(&batch, &values, 0.5, 1.0);
    assert_eq!(monte_carlo, [1.0 + 0.5 * 17.0, 1.0 + 0.5 * 2.0, 17.0, 2.0]);
}

#[test]
fn trimming_an_unroll_before_a_fall_bootstraps_at_the_cut() {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let shape = shape(Form::Paper, true);
    let episode = episode(&mut rng, &shape, 5, true);
    let batch = Batch::new(&[&episode], 3, shape.input(), shape.action);
    assert_eq!((batch.steps, batch.fell[0]), (3, false));
    let targets = lambda_returns(&batch, &[0.0, 0.0, 0.0, 8.0], 0.5, 0.0);
    assert_eq!(targets[2], episode.rewards[2] + 4.0);
}

#[test]
fn padding_changes_nothing() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let config = EnafConfig { hidden: Some(6), ..EnafConfig::default() };
    let shape = shape(Form::ConstantsFirst, true);
    let weights = lively_weights(&shape, &mut rng);
    let short = episode(&mut rng, &shape, 3, true);
    let mut padded = Batch::new(&[&short], 30, shape.input(), shape.action);
    let exact = padded.clone();
    // Four steps of nonsense behind the end.
    padded.steps += 4;
    padded.inputs.extend(random(&mut rng, 4 * shape.input()));
    padded.actions.extend(random(&mut rng, 4 * shape.action));
    padded.rewards.extend([7.0; 4]);
    padded.mask.extend([0.0; 4]);
    let mut learners = [Learner::new(shape.clone(), vec![weights.clone()]), Learner::new(shape, vec![weights])];
    let a = learners[0].step(&exact, &config, false).unwrap();
    let b = learners[1].step(&padded, &config, false).unwrap();
    assert!((a.loss - b.loss).abs() < 1e-6 && (a.grad_norm - b.grad_norm).abs() < 1e-5);
    assert!(near(learners[0].weights(), learners[1].weights(), 1e-4));
}

#[test]
fn the_fitted_tanh_is_tanh() {
    for k in -2000..=2000 {
        let x = k as f32 * 0.005;
        assert!((tanh(x) - x.tanh()).abs() < 3e-7, "{x}");
    }
    assert!(tanh(f32::NAN).is_nan() && tanh(f32::INFINITY) <= 1.0 && tanh(-1e30) >= -1.0);
}

#[test]
fn a_piece_is_a_run_of_one_episode_s_decisions_and_falls_only_at_its_end() {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let shape = shape(Form::Paper, true);
    let mut replay = Replay::new(10, Pcg64Mcg::seed_from_u64(5));
    assert_eq!(replay.draw_pieces(3, 4, shape.input(), shape.action), None);
    let stored = [episode(&mut rng, &shape, 7, true), episode(&mut rng, &shape, 2, false)];
    stored.iter().for_each(|episode| replay.push(episode.clone()));
    let batch = replay.draw_pieces(200, 4, shape.input(), shape.action).unwrap();
    let mut begun = std::collections::BTreeSet::new();
    for column in 0..200 {
        let length = batch.lengths[column];
        let rewards: Vec<f32> = (0..length).map(|step| batch.rewards[step * 200 + column]).collect();
        let found = stored.iter().enumerate().find_map(|(number, episode)| {
            let at = episode.rewards.windows(length).position(|window| window == rewards)?;
            Some((number, at, episode))
        });
        let (number, at, episode) = found.expect("pieces are cut from what is stored");
        begun.insert((number, at));
        assert_eq!(length, 4.min(episode.rewards.len() - at));
        assert_eq!(batch.fell[column], episode.fell && at + length == episode.rewards.len());
        let last = (length * 200 + column) * shape.input();
        assert_eq!(
            batch.inputs[last..][..shape.input()],
            episode.inputs[(at + length) * shape.input()..][..shape.input()]
        );
    }
    assert_eq!(begun.len(), 9, "every decision begins some piece");
}
