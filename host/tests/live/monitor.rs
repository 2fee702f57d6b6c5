//! The dashboard on a terminal: however it ends, the terminal is as it was.

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
