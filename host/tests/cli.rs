//! The `sarah` command as its users meet it: a process with arguments, files and an exit code.
//!
//! Runs are compared byte for byte in everything that they computed: `config.toml`, `params.toml`, every
//! `metrics.csv` and `checkpoint.bin`, `evaluated/`, `tensorboard/` and `figures/`. Not compared between runs:
//! `run.json`, `evaluation.json` and `report.md`, which say when and by which command line a run began.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// Short episodes with one hard push each: everything happens, nothing takes long.
const SCENARIO: &str = "duration_s = 5.0\ndrop_m = 0.02\nsettle_s = 1.0\n\
    [pushes.random]\nfirst_s = [1.5, 2.5]\ngap_s = [4.0, 5.0]\nimpulse_n_s = [12.0, 30.0]\n";

fn config(scenario: &Path) -> String {
    format!(
        "seed = 3\nseeds = 1\nepisodes = 3\nmethods = [\"enaf\", \"cma-es\"]\nscenario = {:?}\njudged_episodes = 2\nvalidation_episodes = 2\n\
         grid_impulses_n_s = [70.0]\ngrid_repeats = 1\ncheckpoint_every = 1\n[enaf]\nwarm_up_episodes = 1\n",
        text(scenario)
    )
}

fn sarah(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sarah"));
    // A commit made while the tests run must not tell two runs apart.
    command.env("GIT_DIR", "/no/such/repository").args(arguments).stdin(Stdio::null());
    command
}

fn run(arguments: &[&str]) -> Output {
    sarah(arguments).output().expect("starts")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// The one line that a refusal consists of; progress before it does not count.
fn refusal(output: &Output) -> String {
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(matches!(output.status.code(), Some(code) if code != 0), "{:?}: {stderr}", output.status);
    assert!(!stderr.contains("panicked"), "{stderr}");
    let last = stderr.lines().last().unwrap_or_default().to_owned();
    assert!(last.starts_with("sarah: "), "{stderr}");
    assert_eq!(stderr.matches("sarah: ").count(), 1, "{stderr}");
    last
}

/// Refused before anything was done: the line is all there is.
fn refused(arguments: &[&str], parts: &[&str]) {
    let output = run(arguments);
    let line = refusal(&output);
    assert_eq!(String::from_utf8_lossy(&output.stderr).lines().count(), 1, "{line}");
    assert!(output.stdout.is_empty());
    contains(&line, parts);
}

fn contains(line: &str, parts: &[&str]) {
    for part in parts {
        assert!(line.contains(part), "{line:?} lacks {part:?}");
    }
}

/// A folder with the tiny configuration in it, and where a run named `run` would be.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Place {
        let place = Place { folder: tempfile::tempdir().expect("a folder") };
        fs::write(place.path("tiny.toml"), config(shared_scenario())).expect("writes");
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn file(&self, name: &str, content: &str) -> String {
        let path = self.path(name);
        fs::write(&path, content).expect("writes");
        text(&path).to_owned()
    }

    fn run(&self) -> PathBuf {
        self.path("run")
    }

    fn train(&self) -> Command {
        sarah(&["train", "--config", text(&self.path("tiny.toml")), "--out", text(&self.run())])
    }

    fn resume(&self) -> Output {
        run(&["train", "--resume", text(&self.run())])
    }

    fn finish(&self) {
        let output = self.resume();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

/// One scenario file for all runs, so that their configurations are equal.
fn shared_scenario() -> &'static Path {
    static FILE: OnceLock<PathBuf> = OnceLock::new();
    FILE.get_or_init(|| {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli-scenario.toml");
        fs::write(&path, SCENARIO).expect("writes");
        path
    })
}

/// The files of the uninterrupted run, made once.
fn whole() -> &'static BTreeMap<String, Vec<u8>> {
    static RUN: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    RUN.get_or_init(|| {
        let place = Place::new();
        let output = place.train().output().expect("starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        files(&place.run())
    })
}

/// A copy of the uninterrupted run to do something to.
fn copy_of_whole() -> Place {
    let place = Place::new();
    for (name, content) in whole() {
        let path = place.run().join(name);
        fs::create_dir_all(path.parent().expect("below the run")).expect("creates");
        fs::write(path, content).expect("writes");
    }
    place
}

fn files(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = text(path.strip_prefix(root).expect("below the root")).to_owned();
                found.insert(name, fs::read(&path).expect("reads"));
            }
        }
    }
    found
}

/// A run computed the same as the uninterrupted one, and left nothing else behind.
fn same_as_whole(place: &Place) {
    let (one, other) = (whole(), files(&place.run()));
    assert!(one.keys().eq(other.keys()), "{:?}\n{:?}", one.keys(), other.keys());
    for needed in ["params.toml", "evaluated/start.json", "enaf/seed-3/session-3/metrics.csv", "figures/robot.svg"] {
        assert!(one.contains_key(needed), "no {needed}");
    }
    assert_eq!(one.keys().filter(|name| name.starts_with("tensorboard/")).count(), 6);
    for (name, content) in one {
        let says_otherwise = ["run.json", "evaluation.json", "report.md"].contains(&name.as_str());
        assert!(says_otherwise || other[name] == *content, "{name} differs");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_twice() {
    let again = Place::new();
    assert!(again.train().output().expect("starts").status.success());
    same_as_whole(&again);
}

#[test]
fn killed_at_any_moment_and_resumed_it_ends_bit_identical() {
    let place = Place::new();
    // Each time the run gets a little further: its beginning, the middle of training, judging.
    let moments = [
        ("run.json", 0),
        ("enaf/seed-3/session-1/checkpoint.bin", 0),
        ("cma-es/seed-3/session-2/checkpoint.bin", 10),
        ("enaf/seed-3/session-3/checkpoint.bin", 40),
        ("evaluated/start.json", 5),
        ("evaluated/grid-70-enaf.json", 20),
    ];
    let mut kills = 0;
    for (index, (file, then_ms)) in moments.into_iter().enumerate() {
        let mut command = match index {
            0 => place.train(),
            _ => sarah(&["train", "--resume", text(&place.run())]),
        };
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts");
        let began = Instant::now();
        while !place.run().join(file).exists() && child.try_wait().expect("waits").is_none() {
            assert!(began.elapsed() < Duration::from_secs(60), "{file} never came");
            std::thread::sleep(Duration::from_millis(2));
        }
        std::thread::sleep(Duration::from_millis(then_ms));
        // SIGKILL: nothing can be tidied up.
        child.kill().expect("kills");
        kills += u32::from(!child.wait().expect("waits").success());
    }
    assert!(kills >= 5, "only {kills} of {} came in time", moments.len());
    place.finish();
    same_as_whole(&place);
    // Going on with a finished run changes nothing.
    place.finish();
    same_as_whole(&place);
}

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
    let good = include_str!("../../default-params.toml");
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

#[test]
fn a_run_in_use_or_unfinished_is_said_to_be() {
    let place = Place::new();
    let mut child = place.train().stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts");
    while !place.run().join("run.json").exists() {
        assert!(child.try_wait().expect("waits").is_none(), "ended without a run");
        std::thread::sleep(Duration::from_millis(2));
    }
    refused(&["train", "--resume", text(&place.run())], &["in use by another process"]);
    refused(&["report", text(&place.run())], &["not finished", "--resume"]);
    child.kill().expect("kills");
    child.wait().expect("waits");
}

#[test]
fn checkpoints_of_another_version_or_damaged_are_refused_and_kept() {
    let place = copy_of_whole();
    for method in ["enaf", "cma-es"] {
        let path = place.run().join(method).join("seed-3/session-2/checkpoint.bin");
        let good = fs::read(&path).expect("reads");
        let another_format = [&[99], &good[1..]].concat();
        let mut cases = vec![another_format, good[..good.len() / 2].to_vec(), good[..1].to_vec(), vec![]];
        if let Some(at) = good.windows(4).position(|window| window == b"eNAF") {
            let mut another_agent = good.clone();
            another_agent[at + 4] = 99;
            cases.push(another_agent);
        }
        for bad in cases {
            fs::write(&path, &bad).expect("writes");
            let line = refusal(&place.resume());
            contains(&line, &["checkpoint.bin", "version", "start a new run"]);
            assert!(fs::read(&path).expect("reads") == bad, "a refused file is left as it was");
        }
        fs::write(&path, good).expect("writes");
    }
    let info = place.run().join("run.json");
    let another = fs::read_to_string(&info).expect("reads").replace("\"format\": 1", "\"format\": 99");
    fs::write(&info, another).expect("writes");
    contains(&refusal(&place.resume()), &["run.json", "format 99", "start a new run"]);
    refused(&["report", text(&place.run())], &["run.json", "format 99"]);
}

#[test]
fn damaged_results_are_named_and_can_be_made_again() {
    let place = copy_of_whole();
    fs::write(place.run().join("evaluated/start.json"), "[{").expect("writes");
    contains(&refusal(&place.resume()), &["start.json", "delete it and resume"]);
    fs::remove_file(place.run().join("evaluated/start.json")).expect("removes");
    place.finish();
    same_as_whole(&place);
    fs::write(place.run().join("evaluation.json"), "{").expect("writes");
    refused(&["report", text(&place.run())], &["evaluation.json", "resume"]);
}

/// The kernel's own full disk behind the name of the metrics.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_one_line_and_resuming_with_space_ends_bit_identical() {
    let place = copy_of_whole();
    let session = place.run().join("enaf/seed-3/session-3");
    fs::remove_file(session.join("checkpoint.bin")).expect("removes");
    fs::remove_file(session.join("metrics.csv")).expect("removes");
    std::os::unix::fs::symlink("/dev/full", session.join("metrics.csv")).expect("links");
    contains(&refusal(&place.resume()), &["session-3/metrics.csv", "No space left", "free some space"]);
    fs::remove_file(session.join("metrics.csv")).expect("removes");
    place.finish();
    same_as_whole(&place);
}

/// Writes that fail in the middle of a file, by a limit on the size of files.
#[cfg(target_os = "linux")]
#[test]
fn a_write_that_fails_half_way_leaves_no_half_file() {
    let place = Place::new();
    let train = place.train();
    let output = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\""])
        .arg(train.get_program())
        .args(train.get_args())
        .env("GIT_DIR", "/no/such/repository")
        .output()
        .expect("starts");
    contains(&refusal(&output), &["cannot write", "ulimit -f"]);
    let left: Vec<String> = files(&place.run()).into_keys().collect();
    assert!(left.iter().all(|name| !name.contains(".sarah-")), "{left:?}");
    place.finish();
    same_as_whole(&place);
}

#[test]
fn evaluate_json_is_one_object_with_its_keys_in_order() {
    let place = Place::new();
    let params = place.file("mine.toml", include_str!("../../default-params.toml"));
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
