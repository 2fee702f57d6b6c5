use super::*;

fn load(name: &str) -> Scenario {
    Scenario::load(name).unwrap()
}

#[test]
fn every_embedded_scenario_is_valid() {
    for (name, _) in EMBEDDED {
        load(name);
    }
}

#[test]
fn paper_is_a_10_cm_drop_and_one_push_at_2_s() {
    let episode = load("paper").episode(1, 0);
    assert_eq!((episode.drop_m, episode.settle_s, episode.pushes.len()), (0.10, 1.0, 1));
    assert_eq!(episode.pushes[0].at_s, 2.0);
    assert!(episode.duration_s >= 5.0);
}

#[test]
fn grid_directions_are_exact_and_repeats_differ_only_in_time_and_seed() {
    let scenario = load("push-grid").with(&Overrides { repeats: Some(3), ..Default::default() }).unwrap();
    assert_eq!(scenario.episodes(), Some(72));
    let first = scenario.episode(5, 6);
    let second = scenario.episode(5, 30);
    assert_eq!((first.direction, second.direction), (Some(6), Some(6)));
    assert_eq!(first.pushes[0].direction_deg, 90.0);
    assert_eq!(second.pushes[0].direction_deg, 90.0);
    assert_eq!(first.pushes[0].at_s, 1.5);
    assert!((1.5..1.7).contains(&second.pushes[0].at_s));
    assert_ne!(first.seed, second.seed);
    assert_eq!(first.duration_s, 6.5);
}

#[test]
fn stand_has_no_push() {
    assert!(load("stand").episode(1, 0).pushes.is_empty());
}

#[test]
fn training_pushes_stay_in_their_ranges_and_in_order() {
    for index in 0..200 {
        let pushes = load("train").episode(9, index).pushes;
        assert!((5..=7).contains(&pushes.len()), "{}", pushes.len());
        for pair in pushes.windows(2) {
            assert!((3.99..=6.01).contains(&(pair[1].at_s - pair[0].at_s)));
        }
        for push in pushes {
            assert!((12.0..=24.0).contains(&push.impulse_n_s) && (0.0..=360.0).contains(&push.direction_deg));
            assert!(push.at_s + push.duration_s <= 31.0);
        }
    }
}

#[test]
fn expansion_depends_on_seed_and_index_alone() {
    let scenario = load("train");
    assert_eq!(scenario.episode(3, 4), scenario.episode(3, 4));
    assert_ne!(scenario.episode(3, 4).pushes, scenario.episode(3, 5).pushes);
    assert_ne!(scenario.episode(3, 4).pushes, scenario.episode(4, 4).pushes);
    assert_ne!(scenario.episode(3, 4).seed, scenario.episode(4, 3).seed);
}

#[test]
fn a_push_delivers_its_impulse_over_whole_steps() {
    for at_s in [1.5, 1.6337, 2.0] {
        let push = Push { at_s, impulse_n_s: 24.0, direction_deg: 180.0, duration_s: 0.1, height_m: 0.0 };
        let dt_s = f64::from(0.002f32);
        let total: f64 = (0..2000).map(|step| f64::from(push.force_n(step as f64 * dt_s)[0]) * dt_s).sum();
        assert!((total + 24.0).abs() < 0.5, "{total}");
    }
}

#[test]
fn overrides_replace_strength_directions_and_repeats() {
    let overrides = Overrides { impulse_n_s: Some(27.0), directions: Some(8), repeats: Some(2), ..Default::default() };
    let scenario = load("push-grid").with(&overrides).unwrap();
    assert_eq!(scenario.episodes(), Some(16));
    assert_eq!(scenario.episode(1, 1).pushes[0].direction_deg, 45.0);
    assert_eq!(load("train").with(&overrides).unwrap().episode(1, 0).pushes[0].impulse_n_s, 27.0);
    let bad = Overrides { impulse_n_s: Some(f32::NAN), ..Default::default() };
    assert!(load("push-grid").with(&bad).is_err());
}

#[test]
fn overrides_replace_length_and_height_of_every_kind_of_push_and_keep_the_rest() {
    let overrides = Overrides { duration_s: Some(0.3), height_m: Some(-0.2), ..Default::default() };
    for name in ["paper", "push-grid", "train"] {
        let (own, shaped) = (load(name).episode(3, 1), load(name).with(&overrides).unwrap().episode(3, 1));
        assert!(!own.pushes.is_empty() && own.pushes.len() == shaped.pushes.len(), "{name}");
        for (own, shaped) in own.pushes.iter().zip(shaped.pushes) {
            assert_eq!(shaped, Push { duration_s: 0.3, height_m: -0.2, ..*own }, "{name}");
        }
    }
    for (overrides, complaint) in [
        (Overrides { duration_s: Some(0.0), ..Default::default() }, "pushes.duration_s = 0 is out of range"),
        (Overrides { duration_s: Some(f32::NAN), ..Default::default() }, "pushes.duration_s"),
        (Overrides { height_m: Some(0.6), ..Default::default() }, "pushes.height_m = 0.6"),
    ] {
        let error = load("push-grid").with(&overrides).unwrap_err().to_string();
        assert!(error.contains(complaint), "{error} lacks {complaint}");
    }
}

#[test]
fn unknown_keys_nan_negative_and_backward_ranges_are_refused_by_name() {
    let head = "duration_s = 5.0\ndrop_m = 0.1\nsettle_s = 1.0\n";
    let grid = "[pushes.grid]\nat_s = 1.5\ndirections = 24\n";
    let random = "[pushes.random]\nfirst_s = [1.0, 2.0]\nimpulse_n_s = [12.0, 24.0]\n";
    for (text, complaint) in [
        (format!("{head}wind = 3"), "wind"),
        (format!("{head}{grid}impulse_n_s = nan"), "pushes.grid.impulse_n_s"),
        (format!("{head}{grid}impulse_n_s = -3.0"), "pushes.grid.impulse_n_s"),
        (format!("{head}{grid}impulse_n_s = 3.0\nreps = 2"), "reps"),
        (format!("{head}{random}gap_s = [3.0, 2.0]"), "backwards"),
        (format!("{head}{random}gap_s = [0.0, 2.0]"), "pushes.random.gap_s"),
        (head.replace("drop_m = 0.1", "drop_m = inf"), "drop_m"),
    ] {
        let error = Scenario::parse("test", &text).unwrap_err().to_string();
        assert!(error.contains(complaint), "{error} lacks {complaint}");
    }
}

#[test]
fn an_unknown_name_lists_the_known_ones() {
    assert!(Scenario::load("psuh-grid").unwrap_err().to_string().contains("push-grid"));
}
