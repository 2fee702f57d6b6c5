//! Whatever interrupts a run, resuming it ends as if nothing had.

use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::place::*;

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
