//! Median time of one gradient step and of one decision, at the size the design sets a number for:
//! 16 episodes of 30 decisions, 24 observations, 5 actions, 64 units.

use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use sarah::enaf::agent::Agent;
use sarah::enaf::learner::Learner;
use sarah::enaf::model::{Network, Shape};
use sarah::enaf::replay::{Episode, Replay};
use sarah::enaf::{EnafConfig, EnafError, Form};

fn main() -> Result<(), EnafError> {
    let (observation, action, steps) = (24, 5, 30);
    let repeats = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(200);
    for form in [Form::Paper, Form::ConstantsFirst] {
        let config = EnafConfig {
            hidden: Some(64),
            batch_episodes: 16,
            recurrent: true,
            previous_action: Some(false),
            ..EnafConfig::for_form(form)
        };
        let shape = Shape::new(&config, observation, action);
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let mut replay = Replay::new(64, Pcg64Mcg::seed_from_u64(2));
        let mut random = |n: usize| (0..n).map(|_| rng.random_range(-1.0..1.0)).collect::<Vec<f32>>();
        for _ in 0..64 {
            replay.push(Episode {
                inputs: random((steps + 1) * shape.input()),
                actions: random(steps * action),
                rewards: random(steps),
                fell: false,
            });
        }
        let (input, previous) = (random(observation), random(action));
        let weights = shape.initial_weights(&vec![0.0; action], &mut rng);
        let mut learner = Learner::new(shape.clone(), vec![weights]);
        let mut times = Vec::new();
        for _ in 0..repeats {
            let start = Instant::now();
            if let Some(batch) = replay.draw(16, steps, shape.input(), action) {
                learner.step(&batch, &config, false)?;
            }
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let mut agent = Agent::new(Network::new(&shape, learner.weights(), false));
        let mut acts = Vec::new();
        for _ in 0..repeats {
            let start = Instant::now();
            std::hint::black_box(agent.act(&input, &previous)?);
            acts.push(start.elapsed().as_secs_f64() * 1e6);
        }
        println!("{form:?}: gradient step {:.2} ms, decision {:.0} µs (medians)", median(times), median(acts));
    }
    Ok(())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
