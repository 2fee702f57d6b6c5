//! A terminal that a command runs on: what is shown, what is typed, and the mode the command leaves it in.

use std::fs::OpenOptions;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use sarah::emulate::terminal::Terminal;

/// Longest wait for anything: robots run in real time, and other work may leave them a tenth of a core.
pub const PATIENCE: Duration = Duration::from_secs(60);

pub struct Tty {
    terminal: Terminal,
    shown: Vec<u8>,
}

impl Tty {
    /// A terminal as a shell has it, 120 columns wide.
    pub fn new() -> Tty {
        let tty = Tty { terminal: Terminal::new().expect("a pseudo-terminal"), shown: vec![] };
        tty.stty(&["sane", "rows", "40", "cols", "120"]);
        tty
    }

    /// Its mode, in `stty`'s own words.
    pub fn mode(&self) -> String {
        self.stty(&["-g"])
    }

    fn stty(&self, arguments: &[&str]) -> String {
        let output = Command::new("stty").arg("-F").arg(self.terminal.path()).args(arguments).output().expect("starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("UTF-8")
    }

    /// Starts a command on it.
    pub fn start(&self, command: &mut Command) -> Child {
        let end = || {
            let file = OpenOptions::new().read(true).write(true).open(self.terminal.path()).expect("opens");
            Stdio::from(file)
        };
        command.stdin(end()).stdout(end()).stderr(end()).env("TERM", "xterm").spawn().expect("starts")
    }

    /// Presses keys.
    pub fn press(&mut self, keys: &str) {
        self.shown.extend(self.terminal.exchange(keys.as_bytes()).expect("exchanges"));
    }

    /// Everything shown until now, escape sequences and all.
    pub fn shown(&mut self) -> String {
        loop {
            let more = self.terminal.exchange(&[]).expect("exchanges");
            if more.is_empty() {
                return String::from_utf8_lossy(&self.shown).into_owned();
            }
            self.shown.extend(more);
        }
    }

    /// Waits until `text` is shown.
    pub fn wait(&mut self, text: &str) {
        let began = Instant::now();
        while !self.shown().contains(text) {
            assert!(began.elapsed() < PATIENCE, "waited in vain for {text:?} in {:?}", self.shown());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits for the command's end, reading what it shows.
    pub fn end(&mut self, child: &mut Child) -> ExitStatus {
        let began = Instant::now();
        loop {
            let shown = self.shown();
            if let Some(status) = child.try_wait().expect("waits") {
                return status;
            }
            assert!(began.elapsed() < PATIENCE, "it does not end: {shown:?}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// Sends a signal, by its name without SIG.
pub fn signal(child: &Child, name: &str) {
    let sent = Command::new("sh").args(["-c", &format!("kill -{name} {}", child.id())]).status().expect("starts");
    assert!(sent.success());
}
