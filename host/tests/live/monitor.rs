//! The dashboard on a terminal: however it ends, the terminal is as it was.

use std::time::{Duration, Instant};

use crate::bench::Bench;
use crate::training::sarah;
use crate::tty::{Tty, signal};

/// What a terminal is sent to show another screen, and to show its own again.
const OTHER_SCREEN: &str = "\x1b[?1049h";
const OWN_SCREEN: &str = "\x1b[?1049l";
const SHOW_CURSOR: &str = "\x1b[?25h";

#[test]
fn the_monitor_gives_the_terminal_back_when_it_is_told_to_end_as_when_it_is_quit() {
    let bench = Bench::new();
    for way in ["q", "TERM", "HUP", "INT"] {
        let mut tty = Tty::new();
        let mode = tty.mode();
        let mut child = tty.start(&mut sarah(&["monitor", "--link", &bench.target()]));
        tty.wait(OTHER_SCREEN);
        // In the middle of what it does: something of the robot is shown.
        tty.wait("Factor");
        assert_ne!(tty.mode(), mode, "a dashboard reads single keys");
        match way {
            "q" => tty.press("q"),
            name => signal(&child, name),
        }
        let status = tty.end(&mut child);
        let shown = tty.shown();
        assert!(status.success(), "{way}: {status}: {shown:?}");
        assert_eq!(tty.mode(), mode, "{way}");
        let after = shown.rsplit(OTHER_SCREEN).next().unwrap_or_default();
        assert!(after.contains(OWN_SCREEN) && after.contains(SHOW_CURSOR), "{way}: {shown:?}");
        assert!(shown.trim_end().ends_with("10 s from now."), "{way}: {shown:?}");
    }
}

#[test]
fn the_monitor_ends_with_its_terminal_and_leaves_the_robot_to_others() {
    let bench = Bench::new();
    for hung_up in [true, false] {
        let mut tty = Tty::new();
        let mut child = tty.start(&mut sarah(&["monitor", "--link", &bench.target()]));
        tty.wait("Factor");
        drop(tty);
        // Of its own terminal's end a process is told; of another's it only notices.
        if hung_up {
            signal(&child, "HUP");
        }
        let began = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().expect("waits") {
                break status;
            }
            if began.elapsed() > Duration::from_secs(10) {
                child.kill().expect("kills");
                panic!("it goes on without a terminal, told {hung_up}");
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        // In order, and neither by a signal nor by a panic: told, with success; else with the terminal's error.
        assert!(matches!(status.code(), Some(0 | 1)), "told {hung_up}: {status}");
        let get = sarah(&["params", "get", "P1", "--link", &bench.target()]).output().expect("ends");
        assert!(get.status.success(), "{}", String::from_utf8_lossy(&get.stderr));
    }
}
