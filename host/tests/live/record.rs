//! A robot recorded until it is enough.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::bench::{Bench, wait};
use crate::training::sarah;
use crate::tty::signal;

/// The recordings in the folder, by name.
fn recordings(folder: &std::path::Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(|path| is_recording(path)).collect();
    files.sort();
    files
}

fn is_recording(path: &std::path::Path) -> bool {
    path.extension().is_some_and(|end| end == "mcap")
}

#[test]
fn a_recording_without_an_end_is_split_into_files_that_each_replay() {
    let bench = Bench::new();
    let folder = bench.path("recordings");
    let mut record = sarah(&["record", "--link", &bench.target(), "--split", "0.05"]);
    let child = record.current_dir(bench.path("")).spawn().expect("starts");
    let began = Instant::now();
    wait("three parts", || recordings(&folder).len() == 3);
    assert!(began.elapsed() > Duration::from_secs(5), "three seconds each");
    std::thread::sleep(Duration::from_millis(500));
    signal(&child, "INT");
    let output = child.wait_with_output().expect("ends");
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}");
    let files = recordings(&folder);
    assert!(files.len() == 3 && said.contains("3 files"), "{said}");
    for file in files {
        let name = file.display().to_string();
        assert!(said.contains(&file.file_name().expect("a name").to_string_lossy().into_owned()), "{said}");
        let output = sarah(&["replay", &name]).output().expect("ends");
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success() && !said.contains("cut off"), "{name}: {said}");
        assert!(said.contains(" telemetry frames; at 100 Hz not every IMU sample is in one"), "{name}: {said}");
    }
}

#[test]
fn a_part_that_cannot_be_begun_ends_the_recording_and_the_parts_so_far_are_whole() {
    let bench = Bench::new();
    let out = bench.path("out");
    let chosen = out.join("walk.mcap").display().to_string();
    let child = sarah(&["record", "--link", &bench.target(), "--split", "0.05", "--out", &chosen]).spawn();
    let child = child.expect("starts");
    wait("the first part", || recordings(&out).len() == 1);
    // The folder is moved away, and a file put in its place.
    std::fs::rename(&out, bench.path("moved")).expect("renames");
    std::fs::write(&out, "no folder").expect("writes");
    let output = child.wait_with_output().expect("ends");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("kept, each readable by itself: "), "{said}");
    assert!(said.lines().last().is_some_and(|line| line.starts_with("sarah: cannot ")), "{said}");
    let files = recordings(&bench.path("moved"));
    let output = sarah(&["replay", &files[0].display().to_string()]).output().expect("ends");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && files.len() == 1 && !said.contains("cut off"), "{said}");
}

#[test]
fn a_simulated_robot_is_recorded_in_one_piece() {
    let output = sarah(&["record", "--link", "sim", "--split", "10"]).output().expect("ends");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && said.contains("--split is for a robot on a port"), "{said}");
    assert!(said.contains("leave --split out"), "{said}");
}
