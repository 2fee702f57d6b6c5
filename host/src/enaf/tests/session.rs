//! A session as a whole: resuming, determinism, exploration, errors.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use super::worlds::{Bandit, Scripted};
use crate::enaf::noise::Noise;
use crate::enaf::{EnafConfig, EnafError, Form, NoiseConfig, Trainer};

fn small(form: Form) -> EnafConfig {
    EnafConfig { hidden: Some(8), horizon: 6, warm_up_episodes: Some(2), ..EnafConfig::for_form(form) }
}

fn train(trainer: &mut Trainer, episodes: usize) {
    let mut world = Bandit::new(&[0.4, -0.2], 0.3, 6);
    for _ in 0..episodes {
        trainer.episode(&mut world).unwrap();
    }
}

#[test]
fn a_resumed_session_is_byte_for_byte_the_uninterrupted_one() {
    for config in
        [small(Form::Paper), EnafConfig { twin: true, residual_after: Some(6), ..small(Form::ConstantsFirst) }]
    {
        for stop in [1, 5] {
            let mut whole = Trainer::new(&config, 2, &[0.0, 0.0], 7).unwrap();
            train(&mut whole, stop);
            let mut resumed = Trainer::load(&config, &whole.save().unwrap()).unwrap();
            train(&mut whole, 5);
            train(&mut resumed, 5);
            assert_eq!(whole.save().unwrap(), resumed.save().unwrap());
        }
    }
}

#[test]
fn equal_seeds_give_equal_bits_on_any_thread_beside_any_other() {
    let session = |seed| {
        let mut trainer = Trainer::new(&small(Form::Paper), 2, &[0.0, 0.0], seed).unwrap();
        train(&mut trainer, 6);
        trainer.save().unwrap()
    };
    let alone = session(1);
    let together = std::thread::scope(|scope| {
        let threads = [1, 2, 1].map(|seed| scope.spawn(move || session(seed)));
        threads.map(|thread| thread.join().unwrap())
    });
    assert_eq!(alone, together[0]);
    assert_eq!(alone, together[2]);
    assert_ne!(alone, together[1]);
}

#[test]
fn a_checkpoint_of_another_version_kind_or_session_is_refused_by_name() {
    let config = small(Form::Paper);
    let bytes = Trainer::new(&config, 2, &[0.0], 1).unwrap().save().unwrap();
    let mut newer = bytes.clone();
    newer[4] += 1;
    assert!(matches!(Trainer::load(&config, &newer), Err(EnafError::CheckpointVersion { found: 2, expected: 1 })));
    assert!(matches!(Trainer::load(&config, b"PK\x03\x04..."), Err(EnafError::NotACheckpoint)));
    assert!(matches!(Trainer::load(&config, &bytes[..bytes.len() / 2]), Err(EnafError::Codec(_))));
    let other = EnafConfig { depth: 5, ..config };
    assert!(matches!(Trainer::load(&other, &bytes), Err(EnafError::CheckpointMismatch(_))));
}

#[test]
fn a_reward_that_is_not_a_number_stops_with_its_name() {
    let mut trainer = Trainer::new(&small(Form::Paper), 2, &[0.0], 1).unwrap();
    let mut world = Scripted { reward: f32::NAN, falls_at: 3, step: 0 };
    let error = trainer.episode(&mut world).unwrap_err();
    assert_eq!(error.to_string(), "episode 0, decision 0: reward is not finite");
}

#[test]
fn learning_that_overflows_stops_with_the_quantity_and_the_update() {
    // Huber's straight line is steep enough here for a huge but finite reward to overflow the loss.
    let config = EnafConfig { huber_delta: 100.0, ..small(Form::Paper) };
    let mut trainer = Trainer::new(&config, 2, &[0.0], 1).unwrap();
    let mut world = Scripted { reward: f32::MAX, falls_at: 9, step: 0 };
    trainer.episode(&mut world).unwrap();
    let error = trainer.episode(&mut world).unwrap_err();
    assert!(matches!(error, EnafError::LearningNotFinite { update: 0, .. }), "{error}");
}

#[test]
fn a_fall_ends_the_episode_and_a_long_one_times_out_at_the_horizon() {
    let mut trainer = Trainer::new(&small(Form::Paper), 2, &[0.0], 1).unwrap();
    let log = trainer.episode(&mut Scripted { reward: 1.0, falls_at: 3, step: 0 }).unwrap();
    assert_eq!((log.decisions, log.fell, log.reward_mean), (3, true, 0.5));
    let log = trainer.episode(&mut Scripted { reward: 1.0, falls_at: 99, step: 0 }).unwrap();
    assert_eq!((log.decisions, log.fell, log.reward_mean), (6, false, 1.0));
}

#[test]
fn a_world_of_the_wrong_size_is_refused_by_name() {
    let mut trainer = Trainer::new(&small(Form::Paper), 5, &[0.0], 1).unwrap();
    let error = trainer.episode(&mut Scripted { reward: 1.0, falls_at: 3, step: 0 }).unwrap_err();
    assert_eq!(error.to_string(), "observation: expected 5 numbers, got 2");
}

#[test]
fn training_depth_is_the_number_of_gradient_steps_per_decision() {
    let config = EnafConfig { depth: 3, ..small(Form::Paper) };
    let mut trainer = Trainer::new(&config, 2, &[0.0, 0.0], 1).unwrap();
    let mut world = Bandit::new(&[0.0, 0.0], 0.0, 6);
    // The two episodes of the warm-up are made up for after the second.
    let updates: Vec<u64> = (0..3).map(|_| trainer.episode(&mut world).unwrap().updates).collect();
    assert_eq!(updates, [0, 36, 54]);
}

#[test]
fn the_coin_leaves_about_half_of_the_episodes_without_noise_and_noise_decays() {
    let config = EnafConfig {
        warm_up_episodes: Some(3),
        noise: NoiseConfig { decay_episodes: 50.0, ..NoiseConfig::default() },
        ..EnafConfig::default()
    };
    let mut noise = Noise::new(&config, 2, Pcg64Mcg::seed_from_u64(3));
    let mut quiet = 0;
    let mut widths = Vec::new();
    for episode in 0..200 {
        noise.begin(episode);
        assert!(noise.noisy() || episode >= 3, "the warm-up always explores");
        let all: Vec<f32> = (0..30).flat_map(|_| noise.draw()).collect();
        assert_eq!(noise.noisy(), all.iter().any(|&x| x != 0.0));
        quiet += usize::from(!noise.noisy());
        widths.push(noise.width());
    }
    assert!((70..130).contains(&quiet), "{quiet}");
    assert!((widths[3] - 0.3).abs() < 1e-6 && widths[199] < 0.01);
}

#[test]
fn an_unknown_word_in_the_configuration_is_refused() {
    let config: EnafConfig = toml::from_str("form = \"paper\"\nnoise.coin = 0.25").unwrap();
    assert_eq!((config.lambda(), config.learning_rate(), config.offset_sigma()), (0.0, 1e-3, 0.0));
    assert_eq!(config.noise.coin, 0.25);
    assert!(toml::from_str::<EnafConfig>("gama = 0.9").is_err());
    let again: EnafConfig = toml::from_str(&toml::to_string(&config.resolved()).unwrap()).unwrap();
    assert_eq!(again, config.resolved());
    let wrong = EnafConfig { gamma: 1.5, ..config };
    assert_eq!(wrong.validate().unwrap_err().to_string(), "configuration: `gamma` must be in [0, 1)");
}
