//! A study as its users meet it: a file, a folder, and whatever happens in between.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use sarah::study::document::Document;

use crate::place::*;

fn committed(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/studies").join(name)
}

fn committed_studies() -> Vec<PathBuf> {
    let files = fs::read_dir(committed("")).expect("a folder").map(|entry| entry.expect("an entry").path());
    files.filter(|file| file.extension().is_some_and(|extension| extension == "toml")).collect()
}

fn study(file: &Path, out: &Path) -> Command {
    sarah(&["study", "run", text(file), "--out", text(out)])
}

/// What was computed: not when, by which source, and in how many sittings.
fn computed(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = files(folder);
    for name in ["run.json", "sittings.json", "report.md", ".lock"] {
        files.remove(name);
    }
    files
}

/// Runs `file` in `out`, killing it whenever one of `moments` has come, until it is through.
fn killed_again_and_again(file: &Path, out: &Path, moments: &[&str]) {
    let mut kills = 0;
    for moment in moments {
        let mut child = study(file, out).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("starts");
        let began = Instant::now();
        while !out.join(moment).exists() && child.try_wait().expect("waits").is_none() {
            assert!(began.elapsed() < Duration::from_secs(60), "{moment} never came");
            std::thread::sleep(Duration::from_millis(2));
        }
        // SIGKILL: nothing can be tidied up.
        child.kill().expect("kills");
        kills += usize::from(!child.wait().expect("waits").success());
    }
    assert!(kills + 1 >= moments.len(), "only {kills} of {} came in time", moments.len());
    finished(file, out);
}

fn finished(file: &Path, out: &Path) -> String {
    let output = study(file, out).output().expect("starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

fn same(one: &Path, other: &Path) {
    let (one, other) = (computed(one), computed(other));
    assert!(one.keys().eq(other.keys()), "{:?}\n{:?}", one.keys(), other.keys());
    for (name, content) in &one {
        assert!(other[name] == *content, "{name} differs");
    }
}

#[test]
fn the_small_study_runs_is_taken_up_after_kills_and_ends_byte_identical() {
    let place = Place::new();
    let (whole, cut) = (place.path("whole"), place.path("cut"));
    let stdout = finished(&committed("check/small.toml"), &whole);
    assert!(stdout.contains("nominal") && stdout.contains("braked") && stdout.contains("report.md"), "{stdout}");
    let moments = ["run.json", "evaluated/default.nominal.12.json", "evaluated/default.drawn.18.json"];
    killed_again_and_again(&committed("check/small.toml"), &cut, &moments);
    same(&whole, &cut);
    for needed in
        ["tables/cells.csv", "tables/differences.csv", "figures/push-map-nominal.svg", "figures/drift-drawn.png"]
    {
        assert!(whole.join(needed).is_file(), "no {needed}");
    }
    let report = fs::read_to_string(whole.join("report.md")).expect("a report");
    contains(&report, &["Wilson", "## Against default", "2^61 + 1", "## Origin", "1 sitting(s)"]);

    // What the report is made of is the data alone.
    let before = computed(&whole);
    fs::remove_dir_all(whole.join("tables")).expect("removes");
    fs::remove_dir_all(whole.join("figures")).expect("removes");
    assert!(run(&["study", "report", text(&whole)]).status.success());
    assert!(computed(&whole) == before);

    // Another study does not mix with this one's data.
    let other = fs::read_to_string(committed("check/small.toml")).expect("reads").replace("= [18]", "= [21]");
    refusal_of(&place.file("other.toml", &other), &whole, &["another study", "--out"]);
}

/// A search that never leaves its start.
const HELD: &str = r#"read -r line; point=${line#*[}; while echo "[${point%%]*}]"; do read -r line || exit 0; done"#;

#[test]
fn a_training_study_is_taken_up_after_kills_and_ends_byte_identical() {
    let place = Place::new();
    let file = place.file(
        "learn.toml",
        &format!(
            "kind = \"training\"\ntitle = \"Tiny\"\nseeds = 2\nepisodes = 3\nsessions = [\"knee\", \"all\"]\njudged_episodes = 2\n\
             common.scenario = {:?}\ncommon.validation_episodes = 2\ncommon.checkpoint_every = 1\n\
             common.enaf.warm_up_episodes = 1\n[[arm]]\nname = \"enaf\"\n[[arm]]\nname = \"random\"\nmethod = \"random\"\n\
             [[arm]]\nname = \"mine\"\nmethod = \"external\"\nset.external = [\"sh\", \"-c\", '{HELD}']\n\
             [[arm]]\nname = \"drawn\"\nmethod = \"enaf-paper\"\nset.start = \"default\"\n\
             set.draw.robot.friction = [0.5, 1.0]\n",
            text(shared_scenario())
        ),
    );
    let (whole, cut) = (place.path("whole"), place.path("cut"));
    let stdout = finished(Path::new(&file), &whole);
    assert!(stdout.contains("better than enaf"), "{stdout}");
    let moments = [
        "arms/enaf/seed-1/session-1/checkpoint.bin",
        "arms/enaf/seed-2/session-2/checkpoint.bin",
        "evaluated/enaf.start.json",
    ];
    killed_again_and_again(Path::new(&file), &cut, &moments);
    same(&whole, &cut);
    for needed in [
        "tables/arms.csv",
        "tables/seeds.csv",
        "figures/learning-all-1.svg",
        "figures/judged-knee.png",
        "params/enaf.toml",
    ] {
        assert!(whole.join(needed).is_file(), "no {needed}");
    }
}

#[test]
fn every_committed_study_is_accepted() {
    for file in committed_studies() {
        // Sets and programs that they name are given from the top of the project.
        let mut command = sarah(&["study", "run", text(&file), "--print-config"]);
        let output = command.current_dir(committed("../..")).output().expect("starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}

#[test]
fn every_committed_study_has_its_place_in_the_results() {
    let name = |file: &PathBuf| file.file_stem().expect("a name").to_string_lossy().into_owned();
    let studies: Vec<String> = committed_studies().iter().map(name).collect();
    assert!(!studies.is_empty());
    Document::open(committed("../../docs/results.md"), &studies).expect("marks for each");
}

#[test]
fn two_studies_write_their_tables_into_a_document_and_nothing_else_of_it() {
    let place = Place::new();
    let study = |name: &str, arms: &str, impulses: &str| {
        place.file(
            name,
            &format!(
                "kind = \"evaluation\"\ntitle = \"T\"\n{arms}[common]\ndirections = 1\nrepeats = 1\n\
                 {impulses}\nset_scenario.end_after_push_s = 0.1\n"
            ),
        )
    };
    let one = study("one.toml", "[[arm]]\nname = \"held\"\ncontroller = \"braked\"\n", "impulses_n_s = [1]");
    let arms: String = (1..=4).map(|n| format!("[[arm]]\nname = \"a{n}\"\ncontroller = \"default\"\n")).collect();
    let many = study("many.toml", &arms, "impulses_n_s = [1]");
    // A set for the seconds after a step, on pushes that make none, is no other set.
    let own = study("own.toml", &format!("{arms}shift_stepping.H2 = -0.1\n"), "");
    let content = "Before.\n<!-- study one -->\n<!-- end of study -->\nBetween.\n<!-- study many -->\nold\n\
                   <!-- end of study -->\n<!-- study own -->\n<!-- end of study -->\n";
    let document = place.file("results.md", content);
    let out = place.path("out");
    let into = ["--out", text(&out), "--into", &document];
    let output = run(&[&["study", "run", &one, &many, &own], &into[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let written = fs::read_to_string(&document).unwrap();
    let parts = ["Before.\n", "| 1 | held | 100.0 % (1/1) |", "Between.\n", "| a4 | 1/1 |", "| a4 | +0.000", "*T: "];
    assert!(parts.iter().all(|part| written.contains(part)) && !written.contains("old"), "{written}");
    let again = run(&[
        "study",
        "report",
        text(&out.join("one")),
        text(&out.join("many")),
        text(&out.join("own")),
        "--into",
        &document,
    ]);
    assert!(again.status.success());
    assert_eq!(fs::read_to_string(&document).unwrap(), written);

    // Without a place for it nothing begins.
    let other = place.file("other.md", "nothing");
    refused(
        &["study", "run", &one, "--out", text(&place.run()), "--into", &other],
        &["other.md", "<!-- study one -->"],
    );
    assert!(!place.run().exists());
}

fn refusal_of(file: &str, out: &Path, parts: &[&str]) {
    refused(&["study", "run", file, "--out", text(out)], parts);
}

#[test]
fn a_study_with_a_mistake_is_one_line_and_leaves_nothing_behind() {
    let place = Place::new();
    let arm = "[[arm]]\nname = \"a\"\ncontroller = \"braked\"\n";
    let evaluation = "kind = \"evaluation\"\ntitle = \"t\"\n";
    let training = "kind = \"training\"\ntitle = \"t\"\nseeds = 1\nepisodes = 2\n";
    for (content, parts) in [
        ("kind = = 3".to_owned(), vec!["mine.toml", "line 1"]),
        ("title = \"t\"".into(), vec!["kind"]),
        ("kind = \"guess\"".into(), vec!["line 1", "guess", "training"]),
        (format!("{evaluation}sed = 3\n{arm}"), vec!["line 3", "sed", "tests/studies"]),
        (evaluation.into(), vec!["arm", "[[arm]]"]),
        (format!("{evaluation}seed = 1152921504606846976\n{arm}"), vec!["seed", "2^40"]),
        (format!("{evaluation}{arm}{arm}"), vec!["arm a", "twice"]),
        (format!("{evaluation}[[arm]]\nname = \"../a\"\ncontroller = \"braked\""), vec!["../a", "a to z"]),
        (format!("{evaluation}[[arm]]\nname = \"a\""), vec!["arm a", "controller", "params"]),
        (format!("{evaluation}[[arm]]\nname = \"a\"\nparams = \"none.toml\""), vec!["none.toml", "check"]),
        (format!("{evaluation}{arm}[common]\nimpulses_n_s = [nan]"), vec!["impulse_n_s"]),
        (format!("{evaluation}{arm}[common]\nimpulses_n_s = [3, 3.0]"), vec!["nominal", "repetition"]),
        (format!("{evaluation}{arm}[common]\nset.robot.paylod_kg = 3"), vec!["nominal", "paylod_kg"]),
        (format!("{evaluation}{arm}[common]\nset.robot.payload_kg = -3"), vec!["nominal", "payload_kg", "0 to 40"]),
        (format!("{evaluation}{arm}[common]\ndraw.robot.payload_kg = [0, 90]"), vec!["payload_kg = 90", "0 to 40"]),
        (format!("{evaluation}{arm}[common]\ndraw.robot.payload_kg = 3"), vec!["robot.payload_kg", "range"]),
        (format!("{evaluation}{arm}[common]\nscenario = \"psuh\""), vec!["psuh", "push-grid"]),
        (format!("{training}[[arm]]\nname = \"a\"\nset.enaf.recurent = false"), vec!["arm a", "recurent"]),
        (format!("{training}[[arm]]\nname = \"a\"\nset.enaf.depth = 1000"), vec!["arm a", "depth", "0 to 256"]),
        (format!("{training}[[arm]]\nname = \"a\"\nset.seed = 4"), vec!["arm a", "seed", "remove"]),
        (format!("{training}[[arm]]\nname = \"a\"\nmethod = \"sarsa\""), vec!["sarsa", "cma-es"]),
        (format!("{training}[[arm]]\nname = \"a\"\nmethod = \"external\""), vec!["external", "program"]),
        (
            format!("{training}[[arm]]\nname = \"a\"\nmethod = \"external\"\nset.external = [\"/no/such/search\"]"),
            vec!["/no/such/search", "installed"],
        ),
        (format!("{training}[[arm]]\nname = \"a\"\nset.draw.robot.slope = [0, 1]"), vec!["arm a", "slope"]),
        (format!("{training}sessions = []\n[[arm]]\nname = \"a\""), vec!["sessions", "knee"]),
    ] {
        let file = place.file("mine.toml", &content);
        refusal_of(&file, &place.run(), &parts);
        assert!(!place.run().exists(), "{content}");
    }
    refused(&["study", "report", text(&place.path("none"))], &["none", "no study", "sarah study run"]);
}
