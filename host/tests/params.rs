//! `sarah params bake`: a run's set becomes the firmware's, and the file stays the file.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

const GOOD: &str = include_str!("../../default-params.toml");

fn bake(from: &Path, into: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sarah"));
    command.args(["params", "bake"]).arg(from).arg("--into").arg(into).stdin(Stdio::null());
    command.output().expect("starts")
}

/// The good file with P1 and V5 changed, without comments or origin.
fn trained() -> String {
    let table: toml::Table = GOOD.parse().expect("TOML");
    let mut text = String::from("[origin]\nrun = \"train-7\"\nseed = 7\nagent = \"enaf\"\n[parameters]\n");
    for (symbol, value) in table["parameters"].as_table().expect("a table") {
        let value = match symbol.as_str() {
            "P1" => "0.5".to_owned(),
            "V5" => "4.25".to_owned(),
            _ => value.to_string(),
        };
        text.push_str(&format!("{symbol} = {value}\n"));
    }
    text
}

fn words(output: &Output) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

fn refused(output: &Output, parts: &[&str]) {
    let (_, stderr) = words(output);
    assert!(!output.status.success());
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    for part in parts {
        assert!(stderr.contains(part), "{stderr:?} lacks {part:?}");
    }
}

#[test]
fn numbers_and_origin_change_and_everything_else_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, into) = (folder.path().join("train-7"), folder.path().join("default-params.toml"));
    fs::create_dir(&run).expect("creates");
    fs::write(run.join("params.toml"), trained()).expect("writes");
    fs::write(&into, GOOD).expect("writes");
    let output = bake(&run, &into);
    let (stdout, stderr) = words(&output);
    assert!(output.status.success(), "{stderr}");
    assert!(stdout.contains("P1: 0.0") && stdout.contains("-> 0.5") && stdout.contains("2 changed"), "{stdout}");

    let now = fs::read_to_string(&into).expect("reads");
    let parameters = |text: &str| text[text.find("[parameters]").expect("there")..].to_owned();
    let expected: Vec<String> = parameters(GOOD)
        .lines()
        .map(|line| match line.split(" =").next() {
            Some(symbol @ ("P1" | "V5")) => {
                let comment = &line[line.find('#').expect("a comment")..];
                format!("{symbol} = {} {comment}", if symbol == "P1" { "0.5" } else { "4.25" })
            }
            _ => line.to_owned(),
        })
        .collect();
    assert_eq!(parameters(&now).lines().collect::<Vec<_>>(), expected);
    let header = |text: &str| text[..text.find("[origin]").expect("there")].to_owned();
    assert_eq!(header(&now), header(GOOD));
    let origin = "[origin]\nrun = \"train-7\"\nseed = 7\nagent = \"enaf\"\n\n[parameters]\n";
    assert!(now.contains(origin), "{now}");
    assert_eq!(fs::read_dir(folder.path()).expect("reads").count(), 2, "nothing else is left behind");

    // Again: the same file.
    let again = bake(&run, &into);
    assert!(words(&again).0.contains("0 changed"));
    assert_eq!(fs::read_to_string(&into).expect("reads"), now);
}

#[test]
fn a_file_without_origin_is_recorded_by_its_name_and_a_new_file_is_complete() {
    let folder = tempfile::tempdir().expect("a folder");
    let (from, into) = (folder.path().join("mine.toml"), folder.path().join("new.toml"));
    let trained = trained();
    fs::write(&from, &trained[trained.find("[parameters]").expect("there")..]).expect("writes");
    assert!(bake(&from, &into).status.success());
    let text = fs::read_to_string(&into).expect("reads");
    assert!(text.starts_with("# The set the firmware is built with") && text.contains("run = \"mine.toml\""), "{text}");
    let (one, other): (toml::Table, toml::Table) = (text.parse().expect("TOML"), trained.parse().expect("TOML"));
    assert_eq!(one["parameters"], other["parameters"]);
}

#[test]
fn what_the_robot_would_refuse_is_not_baked() {
    let folder = tempfile::tempdir().expect("a folder");
    let (from, into) = (folder.path().join("mine.toml"), folder.path().join("default-params.toml"));
    fs::write(&into, GOOD).expect("writes");
    fs::write(&from, trained().replace("P1 = 0.5", "P1 = 99.0")).expect("writes");
    refused(&bake(&from, &into), &["mine.toml", "P1 = 99", "out of range"]);
    refused(&bake(folder.path(), &into), &["not finished", "--resume"]);
    refused(&bake(&folder.path().join("none.toml"), &into), &["none.toml", "check the path"]);
    fs::write(&from, trained()).expect("writes");
    // A file that is no parameter file is not replaced by one.
    let precious = folder.path().join("Cargo.toml");
    fs::write(&precious, "[package]\n").expect("writes");
    refused(&bake(&from, &precious), &["Cargo.toml", "unknown key", "package"]);
    assert_eq!(fs::read_to_string(&precious).expect("reads"), "[package]\n");
    assert_eq!(fs::read_to_string(&into).expect("reads"), GOOD);
}
