//! What runs and evaluations say.

use std::fs;

use crate::place::*;

#[test]
fn evaluate_json_is_one_object_with_its_keys_in_order() {
    let place = Place::new();
    let params = place.file("mine.toml", include_str!("../../../default-params.toml"));
    let output =
        run(&["evaluate", "--params", &params, "--impulse", "10", "--directions", "3", "--seed", "7", "--json"]);
    assert!(output.status.success());
    let stdout = String::from_utf8(output.stdout).expect("UTF-8");
    assert_eq!(stdout.lines().count(), 1, "{stdout}");
    let object: serde_json::Value = serde_json::from_str(&stdout).expect("JSON");
    let keys = [
        "controller",
        "scenario",
        "episodes",
        "survived",
        "survival",
        "survival_ci",
        "steps_per_s",
        "drift_3s_m",
        "settle_s",
        "energy_j",
        "worst_direction_deg",
    ];
    // The parsed object forgets the order, the text does not.
    let at: Vec<usize> = keys.iter().map(|key| stdout.find(&format!("\"{key}\":")).expect(key)).collect();
    assert!(at.is_sorted() && at[0] == 1, "{stdout}");
    let before_last = &stdout[..at[keys.len() - 1]];
    let inner = ["median", "p5", "p95"].iter().map(|key| before_last.matches(&format!("\"{key}\":")).count());
    assert_eq!(before_last.matches("\":").count(), keys.len() - 1 + inner.sum::<usize>(), "{stdout}");
    assert_eq!(object["episodes"], 3);
    assert_eq!(object["scenario"], "push-grid");
    assert!(object["steps_per_s"].get("p5").is_some() && object["drift_3s_m"].get("p95").is_some());
}

#[test]
fn evaluating_twice_says_the_same_and_the_title_once() {
    let evaluate = || run(&["evaluate", "--controller", "braked", "--impulse", "10", "--directions", "2"]);
    let (one, other) = (evaluate(), evaluate());
    assert!(one.status.success());
    assert_eq!(one.stdout, other.stdout);
    let stdout = String::from_utf8(one.stdout).expect("UTF-8");
    assert_eq!(stdout.matches("push-grid, 2 episodes, seed 7").count(), 1, "{stdout}");
}

#[test]
fn a_report_can_be_written_again_and_says_the_same() {
    let place = copy_of_whole();
    fs::remove_dir_all(place.run().join("figures")).expect("removes");
    fs::remove_file(place.run().join("report.md")).expect("removes");
    let output = run(&["report", text(&place.run())]);
    assert!(output.status.success());
    assert!(files(&place.run()) == *whole());
    let stdout = String::from_utf8_lossy(&output.stdout);
    assert_eq!(stdout.matches("push-grid, 70").count(), 1, "{stdout}");
}

#[test]
fn a_printed_configuration_is_a_configuration() {
    let place = Place::new();
    let output = run(&["train", "--print-config"]);
    assert!(output.status.success());
    let file = place.file("mine.toml", &String::from_utf8(output.stdout.clone()).expect("UTF-8"));
    assert_eq!(run(&["train", "--config", &file, "--print-config"]).stdout, output.stdout);
}
