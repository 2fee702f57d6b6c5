//! That it learns what it should.

use super::worlds::{Bandit, Memory};
use crate::enaf::{EnafConfig, Environment, Form, Trainer};

#[test]
fn constants_are_found_behind_noise_in_sixty_episodes() {
    let best = [0.5, -0.4, 0.1];
    // The bandit's observations are pure noise, so memory and depth could only learn stored episodes by heart.
    let config = EnafConfig { recurrent: false, depth: 2, ..EnafConfig::default() };
    for seed in 1..=3 {
        let mut world = Bandit::new(&best, 0.3, 30);
        let mut trainer = Trainer::new(&config, 2, &[0.0; 3], seed).unwrap();
        for _ in 0..60 {
            trainer.episode(&mut world).unwrap();
        }
        let found = trainer.mean_action();
        let miss = found.iter().zip(&best).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt();
        println!("seed {seed}: {found:?}, {miss:.3} away");
        assert!(miss < 0.15, "seed {seed}: {found:?} is {miss} away");
    }
}

/// Mean reward of the trained policy over both cues.
fn after_training_on_the_cue(recurrent: bool) -> f32 {
    let config = EnafConfig {
        recurrent,
        hidden: Some(16),
        horizon: 5,
        depth: 4,
        learning_rate: Some(3e-3),
        ..EnafConfig::for_form(Form::Paper)
    };
    let mut trainer = Trainer::new(&config, 2, &[0.0], 1).unwrap();
    let mut world = Memory::new(5);
    for _ in 0..250 {
        trainer.episode(&mut world).unwrap();
    }
    let mut policy = trainer.policy();
    let mut total = 0.0;
    for cue in 0..2 {
        policy.reset();
        let mut observation = world.reset(cue).unwrap();
        for _ in 0..5 {
            let outcome = world.decide(&policy.act(&observation).unwrap()).unwrap();
            total += outcome.reward;
            observation = outcome.observation;
        }
    }
    total / 8.0
}

#[test]
fn a_cue_seen_once_is_remembered_by_the_recurrent_network() {
    let (recurrent, feed_forward) = (after_training_on_the_cue(true), after_training_on_the_cue(false));
    println!("recurrent {recurrent:.3}, feed-forward {feed_forward:.3}");
    assert!(recurrent > feed_forward + 0.1, "recurrent {recurrent}, feed-forward {feed_forward}");
}
