//! Every example that `--help` shows is run, so that none promises what the command does not do.
//!
//! It is run as it stands there, by a shell, in a folder laid out like this repository with a finished run and a finished
//! study in it. What is otherwise than for its reader:
//!
//! - A serial port is the pseudo-terminal of a simulated robot; so is `--link serial`, the only board plugged in. There is
//!   no board to flash: OpenOCD and defmt-print are scripts.
//! - [`SHORTER`]: less of the same where it would take minutes.
//! - MuJoCo is not installed for this: `.ci/mujoco` does, and runs the robot in it.
//! - What takes hours, or goes on until Ctrl-C, is ended from outside once it has shown that it does what it says
//!   ([`Shop::until`]). That it also comes to a good end is not shown here.
//!
//! `help`: the examples. `shop`: the folder. The robot and the terminal are those of the tests in `live`.

#![cfg(unix)]

#[path = "../live/bench.rs"]
#[allow(dead_code)]
mod bench;
mod help;
mod shop;
#[path = "../live/tty.rs"]
#[allow(dead_code)]
mod tty;

use std::fs;
use std::net::TcpListener;
use std::sync::{Mutex, MutexGuard, PoisonError};

use bench::Bench;
use help::{examples, verbs};
use shop::Shop;
use tty::Tty;

/// What is shortened: in an example that begins so, these words by those.
const SHORTER: [(&str, &str, &str); 6] = [
    ("sarah bench latency", "--tries 10000", "--tries 20"),
    ("sarah bench flood", "--seconds 20", "--seconds 1"),
    ("sarah bench soak --minutes 30", "--minutes 30", "--minutes 0.2"),
    ("sarah bench soak --minutes 180", "--minutes 180", "--minutes 2"),
    ("sarah emulate --compare", "--seconds 30", "--seconds 3"),
    ("sarah emulate --cycles", "--seconds 60", "--seconds 3"),
];

/// The verbs whose examples are run below.
const TRIED: [&str; 11] =
    ["train", "evaluate", "params", "monitor", "record", "replay", "flash", "emulate", "bench", "study", "report"];

/// One at a time: robots are in real time, and the others take every core.
fn alone() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    ONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The example with fewer repetitions, if it is one of those.
fn shorter(example: &str) -> String {
    let rule = SHORTER.iter().find(|(begins, ..)| example.starts_with(begins));
    rule.map_or_else(
        || example.into(),
        |(_, long, short)| {
            assert!(example.contains(long), "{example} has no {long}");
            example.replace(long, short)
        },
    )
}

/// The example with its robot's port in place of the one it names.
fn on(bench: &Bench, example: &str) -> String {
    let words = example.split(' ').collect::<Vec<_>>();
    let is_link = |at: usize| at > 0 && words[at - 1] == "--link" && words[at].starts_with("serial");
    let word = |(at, word): (usize, &&str)| if is_link(at) { bench.target() } else { (*word).to_owned() };
    words.iter().enumerate().map(word).collect::<Vec<_>>().join(" ")
}

#[test]
fn no_verb_is_without_examples_and_none_is_left_out() {
    assert_eq!(verbs(&[]), TRIED);
    for verb in TRIED {
        let found = examples(verb);
        assert!(!found.is_empty(), "{verb} has no examples");
        for example in found {
            assert!(example.starts_with(&format!("sarah {verb}")), "{example}");
        }
    }
    for (begins, ..) in SHORTER {
        let shortened = TRIED.iter().flat_map(|verb| examples(verb)).filter(|example| example.starts_with(begins));
        assert!(shortened.count() > 0, "no example begins with {begins}: take it out");
    }
}

#[test]
fn examples_of_train_begin_to_learn() {
    let _alone = alone();
    let (shop, bench) = (Shop::new(), Bench::new());
    for example in examples("train") {
        for command in example.split(" && ").map(str::trim) {
            // A run's folder is used once, unless it is gone on with.
            for folder in ["runs/train-1", "runs/quick-1", "runs/robot-1"] {
                if !command.contains("--resume") && !command.contains("--out") {
                    let _ = fs::remove_dir_all(shop.path(folder));
                }
            }
            let (real, rows) = (on(&bench, command), shop.rows());
            if command.contains("--print-config") {
                shop.whole(&real);
            } else if command.contains("--arm") || command.contains("robot-1") {
                // The seconds that an episode takes are no simulated ones.
                let armed = || bench.armed() || command.contains("--resume");
                shop.until(&real, || armed() && shop.path("runs/robot-1/recordings").exists());
            } else if command.contains("--link") {
                shop.until(&real, || shop.said().contains("type a + Enter to arm"));
            } else {
                shop.until(&real, || shop.rows() > rows + 1);
            }
        }
    }
}

#[test]
fn examples_of_evaluate_params_and_report_run_to_their_end() {
    let _alone = alone();
    let (shop, bench) = (Shop::with_run(), Bench::new());
    for example in ["evaluate", "params", "report"].into_iter().flat_map(examples) {
        // Another simulator is another program; `.ci/mujoco` installs this one and runs it.
        if example.contains("--plant") {
            continue;
        }
        shop.whole(&on(&bench, &example));
        assert!(!shop.said().is_empty(), "{example}");
    }
}

#[test]
fn examples_of_monitor_show_the_robot_until_they_are_quit() {
    let _alone = alone();
    let (shop, bench) = (Shop::new(), Bench::new());
    for example in examples("monitor") {
        let real = on(&bench, &example);
        if example.contains('>') {
            let lines = || fs::read_to_string(shop.path("log")).map_or(0, |text| text.matches("Factor").count());
            shop.until(&real, || lines() > 1);
            continue;
        }
        let mut tty = Tty::new();
        let mut child = tty.start(&mut shop.command(&real));
        tty.wait("Factor");
        tty.press("q");
        assert!(tty.end(&mut child).success(), "{example}: {}", tty.shown());
    }
}

#[test]
fn examples_of_record_and_replay_run_to_their_end_or_to_ctrl_c() {
    let _alone = alone();
    let (shop, bench) = (Shop::with_images(), Bench::new());
    for example in ["record", "replay"].into_iter().flat_map(examples) {
        let real = on(&bench, &example);
        match real == example {
            true => shop.whole(&real),
            false => shop.until(&real, || shop.said().contains(" telemetry frames, ")),
        }
    }
}

#[test]
fn examples_of_flash_run_to_their_end_with_a_tool_that_is_none() {
    let _alone = alone();
    let shop = Shop::with_images();
    for example in examples("flash") {
        // Only `--all` needs to know which board is which.
        let map = "[probes]\nknee = \"ATML1\"\nhip = \"ATML2\"\nabductor = \"ATML3\"\ncoordinator = \"ATML4\"\n";
        match example.contains("--boards") {
            true => fs::write(shop.path("boards.toml"), map).expect("writes"),
            false => drop(fs::remove_file(shop.path("boards.toml"))),
        }
        shop.whole(&example);
        let shown = if example.contains("--dry-run") { "openocd -f" } else { "" };
        assert!(shop.said().contains(shown), "{example}: {}", shop.said());
    }
    let calls = fs::read_to_string(shop.path("openocd.calls")).expect("reads");
    assert!(calls.lines().count() >= 7, "one board, one by its probe, four, one with logs: {calls}");
}

#[test]
fn examples_of_emulate_and_bench_run_shortened_or_until_they_serve() {
    let _alone = alone();
    let shop = Shop::with_images();
    for example in ["emulate", "bench"].into_iter().flat_map(examples) {
        // The port of an example may be another program's here.
        let free = TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a free port");
        let real = shorter(&example).replace("--gdb 3333", &format!("--gdb {}", free.port()));
        if example.contains("--gdb") {
            shop.until(&real, || shop.said().contains("waits for GDB"));
        } else if example == "sarah emulate" {
            shop.until(&real, || shop.said().contains("host link: /dev/pts/") && shop.said().contains("x real time"));
        } else {
            shop.whole(&real);
        }
    }
}

#[test]
fn examples_of_study_begin_to_answer_and_report_what_is_there() {
    let _alone = alone();
    let shop = Shop::new();
    for example in examples("study") {
        if example.contains("push-map") {
            let cells = || fs::read_dir(shop.path("runs/study-push-map/evaluated")).map_or(0, Iterator::count);
            shop.until(&example, || cells() > 0 || shop.said().contains(" episodes, about "));
        } else if example.contains("sessions.toml") {
            shop.until(&example, || shop.rows() > 1);
            // The report is of a study that was finished, under the name that the example has.
            fs::remove_dir_all(shop.path("runs/sessions")).expect("removes");
            shop.whole("sarah study run tests/studies/check/small.toml --out runs/sessions");
        } else {
            shop.whole(&example);
        }
    }
}
