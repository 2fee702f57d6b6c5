//! Folders to run in, the uninterrupted run to compare with, and how a refusal looks.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use tempfile::TempDir;

/// Short episodes with one hard push each: everything happens, nothing takes long.
pub const SCENARIO: &str = "duration_s = 5.0\ndrop_m = 0.02\nsettle_s = 1.0\n\
    [pushes.random]\nfirst_s = [1.5, 2.5]\ngap_s = [4.0, 5.0]\nimpulse_n_s = [12.0, 30.0]\n";

pub fn config(scenario: &Path) -> String {
    format!(
        "seed = 3\nseeds = 1\nepisodes = 3\nmethods = [\"enaf\", \"cma-es\"]\nscenario = {:?}\njudged_episodes = 2\nvalidation_episodes = 2\n\
         grid_impulses_n_s = [70.0]\ngrid_repeats = 1\ncheckpoint_every = 1\n[enaf]\nwarm_up_episodes = 1\n",
        text(scenario)
    )
}

pub fn sarah(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sarah"));
    // A commit made while the tests run must not tell two runs apart.
    command.env("GIT_DIR", "/no/such/repository").args(arguments).stdin(Stdio::null());
    command
}

pub fn run(arguments: &[&str]) -> Output {
    sarah(arguments).output().expect("starts")
}

pub fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// The one line that a refusal consists of; progress before it does not count.
pub fn refusal(output: &Output) -> String {
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(matches!(output.status.code(), Some(code) if code != 0), "{:?}: {stderr}", output.status);
    assert!(!stderr.contains("panicked"), "{stderr}");
    let last = stderr.lines().last().unwrap_or_default().to_owned();
    assert!(last.starts_with("sarah: "), "{stderr}");
    assert_eq!(stderr.matches("sarah: ").count(), 1, "{stderr}");
    last
}

/// Refused before anything was done: the line is all there is.
pub fn refused(arguments: &[&str], parts: &[&str]) {
    let output = run(arguments);
    let line = refusal(&output);
    assert_eq!(String::from_utf8_lossy(&output.stderr).lines().count(), 1, "{line}");
    assert!(output.stdout.is_empty());
    contains(&line, parts);
}

pub fn contains(line: &str, parts: &[&str]) {
    for part in parts {
        assert!(line.contains(part), "{line:?} lacks {part:?}");
    }
}

/// A folder with the tiny configuration in it, and where a run named `run` would be.
pub struct Place {
    pub folder: TempDir,
}

impl Place {
    pub fn new() -> Place {
        let place = Place { folder: tempfile::tempdir().expect("a folder") };
        fs::write(place.path("tiny.toml"), config(shared_scenario())).expect("writes");
        place
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn file(&self, name: &str, content: &str) -> String {
        let path = self.path(name);
        fs::write(&path, content).expect("writes");
        text(&path).to_owned()
    }

    pub fn run(&self) -> PathBuf {
        self.path("run")
    }

    pub fn train(&self) -> Command {
        sarah(&["train", "--config", text(&self.path("tiny.toml")), "--out", text(&self.run())])
    }

    pub fn resume(&self) -> Output {
        run(&["train", "--resume", text(&self.run())])
    }

    pub fn finish(&self) {
        let output = self.resume();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

/// One scenario file for all runs, so that their configurations are equal.
pub fn shared_scenario() -> &'static Path {
    static FILE: OnceLock<PathBuf> = OnceLock::new();
    FILE.get_or_init(|| {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("cli-scenario.toml");
        fs::write(&path, SCENARIO).expect("writes");
        path
    })
}

/// The files of the uninterrupted run, made once.
pub fn whole() -> &'static BTreeMap<String, Vec<u8>> {
    static RUN: OnceLock<BTreeMap<String, Vec<u8>>> = OnceLock::new();
    RUN.get_or_init(|| {
        let place = Place::new();
        let output = place.train().output().expect("starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        files(&place.run())
    })
}

/// A copy of the uninterrupted run to do something to.
pub fn copy_of_whole() -> Place {
    let place = Place::new();
    for (name, content) in whole() {
        let path = place.run().join(name);
        fs::create_dir_all(path.parent().expect("below the run")).expect("creates");
        fs::write(path, content).expect("writes");
    }
    place
}

pub fn files(root: &Path) -> BTreeMap<String, Vec<u8>> {
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
pub fn same_as_whole(place: &Place) {
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
