//! A mistake is one line that says what to do, and leaves nothing behind.

use std::fs;
use std::path::Path;

use crate::place::*;

#[test]
fn a_configuration_with_a_mistake_is_refused_and_nothing_is_made() {
    let place = Place::new();
    let scenario = place.file("bad-scenario.toml", &SCENARIO.replace("settle_s", "setle_s"));
    let scenario = format!("scenario = {scenario:?}");
    for (content, parts) in [
        ("episodes = = 3", vec!["line 1", "--print-config"]),
        ("\nepisods = 3", vec!["line 2", "episods", "--print-config"]),
        ("[enaf]\nhiden = 3", vec!["line 2", "hiden"]),
        ("[enaf]\ngamma = nan", vec!["gamma", "must be"]),
        ("grid_impulses_n_s = [nan]", vec!["grid_impulses_n_s", "must be"]),
        ("episodes = 0", vec!["episodes", "1 to"]),
        ("episodes = -1", vec!["line 1", "-1"]),
        ("methods = [\"enaf\", \"sarsa\"]", vec!["line 1", "sarsa"]),
        ("scenario = \"psuh-grid\"", vec!["psuh-grid", "push-grid"]),
        (&scenario, vec!["bad-scenario.toml", "line 3", "setle_s"]),
        ("[robot]\nlpg_rate_hz = 7", vec!["lpg_rate_hz = 7", "100 to 10000"]),
        ("[robot.energy]\ncompute_w = nan", vec!["compute_w", "NaN"]),
        ("[robot.sensors]\naccel_noise_m_s2 = nan", vec!["accel_noise_m_s2"]),
    ] {
        let file = place.file("mine.toml", content);
        refused(&["train", "--config", &file, "--out", text(&place.run())], &parts);
        assert!(!place.run().exists(), "{content}");
    }
    refused(
        &["train", "--config", text(&place.path("none.toml")), "--out", text(&place.run())],
        &["none.toml", "check"],
    );
    refused(&["train", "--seeds", "0", "--out", text(&place.run())], &["seeds", "1 to 1000"]);
    assert!(!place.run().exists());
}

#[test]
fn a_parameter_file_with_a_mistake_is_refused() {
    let place = Place::new();
    let good = include_str!("../../../default-params.toml");
    let line = good.lines().find(|line| line.starts_with("P1 ")).expect("P1");
    for (content, parts) in [
        (good.replace(line, "P1 = 99.0"), vec!["mine.toml", "P1 = 99", "out of range", "set it to"]),
        (good.replace(line, "P1 = nan"), vec!["mine.toml", "P1 = nan", "not finite"]),
        (good.replace(line, ""), vec!["mine.toml", "P1 is missing", "add it"]),
        (good.replace(line, "P1 = ="), vec!["mine.toml:", "not valid TOML"]),
        (format!("{good}\nP9 = 1.0\n"), vec!["mine.toml", "P9", "remove it"]),
        (String::new(), vec!["mine.toml", "P1 is missing"]),
    ] {
        let file = place.file("mine.toml", &content);
        refused(&["evaluate", "--params", &file], &parts);
    }
    refused(&["evaluate", "--params", text(&place.path("none.toml"))], &["none.toml", "check the path"]);
    refused(&["evaluate", "--params", text(place.folder.path())], &["cannot read"]);
}

#[test]
fn a_scenario_with_a_mistake_is_refused() {
    let place = Place::new();
    for (content, parts) in [
        ("pushes = [[", vec!["mine.toml", "line 1"]),
        ("duration_s = 3.0\nforce = 3", vec!["mine.toml", "line 2", "force"]),
        ("duration_s = nan\ndrop_m = 0.0\nsettle_s = 0.0", vec!["duration_s", "NaN"]),
        ("duration_s = 3.0\ndrop_m = 9.0\nsettle_s = 0.0", vec!["drop_m = 9", "0 to 1"]),
    ] {
        let file = place.file("mine.toml", content);
        refused(&["evaluate", "--scenario", &file], &parts);
    }
    refused(&["evaluate", "--scenario", "psuh-grid"], &["psuh-grid", "push-grid", "stand"]);
    refused(&["evaluate", "--impulse", "nan"], &["impulse_n_s", "NaN"]);
    refused(&["evaluate", "--directions", "0"], &["directions", "1 to 3600"]);
    refused(&["evaluate", "--lpg-rate", "7"], &["lpg_rate_hz = 7", "100 to 10000"]);
}

#[test]
fn a_folder_that_cannot_be_used_is_refused_and_left_alone() {
    let place = Place::new();
    let tiny = place.path("tiny.toml");
    let train = |out: &Path, parts: &[&str]| refused(&["train", "--config", text(&tiny), "--out", text(out)], parts);
    let precious = place.path("precious");
    fs::create_dir(&precious).expect("creates");
    fs::write(precious.join("thesis.doc"), "mine").expect("writes");
    train(&precious, &["precious", "not empty", "--out", "--resume"]);
    assert_eq!(files(&precious).len(), 1);
    place.file("file", "mine");
    train(&place.path("file"), &["file", "choose another path"]);
    train(&place.path("file/run"), &["file/run", "choose another path"]);
    assert_eq!(fs::read(place.path("file")).expect("reads"), b"mine");

    for folder in [place.run(), precious.clone()] {
        refused(&["train", "--resume", text(&folder)], &["holds no run", "sarah train --out"]);
        refused(&["report", text(&folder)], &["holds no run", "sarah train --out"]);
    }
    assert!(!place.run().exists());
    assert_eq!(files(&precious).len(), 1);
}
