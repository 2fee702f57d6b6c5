//! A whole run on a robot: killed, resumed, unplugged; and what it leaves.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::bench::{Bench, wait};

/// Episodes of three decisions, one push in each.
const SCENARIO: &str = "duration_s = 4.0\ndrop_m = 0.02\nsettle_s = 1.0\n\
    [pushes.random]\nfirst_s = [1.2, 1.5]\ngap_s = [9.0, 10.0]\nimpulse_n_s = [2.0, 4.0]\n";

pub fn sarah(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sarah"));
    command.env("GIT_DIR", "/no/such/repository").args(arguments);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn config(bench: &Bench, episodes: u32) -> String {
    let scenario = bench.path("scenario.toml");
    let text = format!("seed = 3\nepisodes = {episodes}\nscenario = {scenario:?}\n[enaf]\nwarm_up_episodes = 1\n");
    let path = bench.path("config.toml");
    std::fs::write(&path, text).expect("writes");
    path.display().to_string()
}

fn start(bench: &Bench, episodes: u32) -> Child {
    let (config, out) = (config(bench, episodes), bench.path("run").display().to_string());
    let arguments = ["train", "--link", &bench.target(), "--arm", "--config", &config, "--out", &out];
    sarah(&arguments).spawn().expect("starts")
}

fn end(child: Child) -> String {
    let output = child.wait_with_output().expect("ends");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    format!("{said}{}", String::from_utf8_lossy(&output.stdout))
}

fn rows(run: &Path, session: u8) -> usize {
    let path = run.join(format!("enaf/seed-3/session-{session}/metrics.csv"));
    std::fs::read_to_string(path).map_or(0, |text| text.lines().count().saturating_sub(1))
}

#[test]
fn a_run_on_a_robot_leaves_the_folder_that_a_simulated_one_leaves() {
    let bench = Bench::of(SCENARIO);
    let said = end(start(&bench, 2));
    let run = bench.path("run");
    for file in ["config.toml", "params.toml", "report.md", "evaluation.json", "run.json", "recordings/1.mcap"] {
        assert!(run.join(file).metadata().is_ok_and(|file| file.len() > 0), "{file} is missing: {said}");
    }
    for session in 1..=3 {
        assert_eq!(rows(&run, session), 2, "session {session}");
    }
    // The robot is left with what was learned.
    let text = std::fs::read_to_string(run.join("params.toml")).expect("reads");
    let p1: f32 = text
        .lines()
        .find_map(|line| line.strip_prefix("P1 = "))
        .and_then(|rest| rest.split_whitespace().next()?.parse().ok())
        .expect("P1");
    assert_eq!(bench.applied().1.values()[0], p1, "{said}");
    assert!(bench.armed(), "it balances on");
}

#[test]
fn a_killed_trainer_leaves_the_robot_balancing_and_can_be_resumed() {
    let bench = Bench::of(SCENARIO);
    let mut child = start(&bench, 3);
    let run = bench.path("run");
    wait("two episodes", || rows(&run, 1) >= 2);
    bench.wait("the robot to move", Bench::armed);
    child.kill().expect("kills");
    child.wait().expect("ends");
    // What was committed with its last breath takes force at a cycle boundary.
    std::thread::sleep(Duration::from_millis(500));
    let (generation, _) = bench.applied();
    std::thread::sleep(Duration::from_secs(1));
    assert!(bench.armed() && bench.applied().0 == generation, "it goes on with the last set");
    let out = run.display().to_string();
    let said = end(sarah(&["train", "--resume", &out, "--arm"]).spawn().expect("starts"));
    assert_eq!([1, 2, 3].map(|session| rows(&run, session)), [3, 3, 3], "{said}");
    assert!(run.join("recordings/2.mcap").exists());
}

#[test]
fn training_goes_on_after_the_cable_was_pulled() {
    let bench = Bench::of(SCENARIO);
    let child = start(&bench, 2);
    let run = bench.path("run");
    wait("an episode", || rows(&run, 1) >= 1);
    bench.unplug();
    std::thread::sleep(Duration::from_secs(1));
    bench.plug();
    let said = end(child);
    assert!(said.contains("the link is down") && said.contains("the link is up"), "{said}");
    assert_eq!([1, 2, 3].map(|session| rows(&run, session)), [2, 2, 2], "{said}");
}

#[test]
fn without_a_port_or_with_another_s_nothing_is_begun() {
    let bench = Bench::new();
    let out = bench.path("run").display().to_string();
    let nothing = sarah(&["train", "--link", "serial:/dev/no-such-port", "--out", &out]).output().expect("ends");
    let said = String::from_utf8_lossy(&nothing.stderr).into_owned();
    assert!(!nothing.status.success() && said.contains("no port /dev/no-such-port"), "{said}");
    assert!(!bench.path("run").exists(), "nothing half-begun");
}
