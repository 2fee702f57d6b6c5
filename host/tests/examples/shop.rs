//! A folder laid out like this repository, and commands run in it by a shell, as a reader of `--help` would.

use std::fs::{self, File};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::tty::signal;

/// Longest wait for an example's end, or for what it is to show first: seconds, unless the machine has other things to do.
const PATIENCE: Duration = Duration::from_secs(300);
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// A run that takes seconds.
const TINY: &str = "seeds = 1\nepisodes = 2\nmethods = [\"enaf\"]\nscenario = \"tiny-scenario.toml\"\njudged_episodes = 2\n\
    validation_episodes = 2\ngrid_impulses_n_s = [70.0]\ngrid_repeats = 1\n[enaf]\nwarm_up_episodes = 1\n";
const TINY_SCENARIO: &str = "duration_s = 4.0\ndrop_m = 0.02\nsettle_s = 1.0\n\
    [pushes.random]\nfirst_s = [1.5, 2.5]\ngap_s = [4.0, 5.0]\nimpulse_n_s = [12.0, 30.0]\n";

/// OpenOCD's words for a board that was written, and a server of logs that goes on.
const OPENOCD: &str = "#!/bin/sh\necho \"$*\" >> openocd.calls\ncase \"$*\" in\n*'rtt server start'*)\n\
    port=$(printf '%s' \"$*\" | sed 's/.*rtt server start \\([0-9]*\\) .*/\\1/')\n\
    echo \"Info : Listening on port $port for rtt connections\" >&2\nexec sleep 60;;\nesac\n\
    echo '** Verified OK **' >&2\n";

pub struct Shop {
    folder: TempDir,
}

impl Shop {
    /// Studies, the set that firmware is built with, and tools for boards that are none.
    pub fn new() -> Shop {
        let shop = Shop { folder: tempfile::tempdir().expect("a folder") };
        for folder in ["bin", "runs", "tests"] {
            fs::create_dir_all(shop.path(folder)).expect("creates");
        }
        symlink(Path::new(ROOT).join("tests/studies"), shop.path("tests/studies")).expect("links");
        let set = Path::new(ROOT).join("default-params.toml");
        for name in ["default-params.toml", "my-params.toml"] {
            fs::copy(&set, shop.path(name)).expect("copies");
        }
        symlink(env!("CARGO_BIN_EXE_sarah"), shop.path("bin/sarah")).expect("links");
        for (name, script) in [("openocd", OPENOCD), ("defmt-print", "#!/bin/sh\necho 'INFO up'\n")] {
            fs::write(shop.path("bin").join(name), script).expect("writes");
            fs::set_permissions(shop.path("bin").join(name), fs::Permissions::from_mode(0o755)).expect("sets");
        }
        shop
    }

    /// With a finished run in `runs/train-1`.
    pub fn with_run() -> Shop {
        let shop = Shop::new();
        fs::write(shop.path("tiny.toml"), TINY).expect("writes");
        fs::write(shop.path("tiny-scenario.toml"), TINY_SCENARIO).expect("writes");
        shop.whole("sarah train --config tiny.toml --out runs/train-1");
        shop
    }

    /// With the images of this source where `cargo firmware` puts them.
    pub fn with_images() -> Shop {
        let shop = Shop::new();
        fs::create_dir_all(shop.path("target/thumbv6m-none-eabi")).expect("creates");
        symlink(images(), shop.path("target/thumbv6m-none-eabi/firmware")).expect("links");
        shop
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The command by a shell, so that `>` does what it does; its words go to the file `said`.
    pub fn command(&self, command: &str) -> Command {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("exec {command}")]).current_dir(self.folder.path());
        let path = format!("{}:{}", self.path("bin").display(), std::env::var("PATH").unwrap_or_default());
        shell.env("PATH", path).env("GIT_DIR", "/no/such/repository").stdin(Stdio::null());
        shell
    }

    fn start(&self, command: &str) -> Running<'_> {
        let said = File::create(self.path("said")).expect("creates");
        let mut shell = self.command(command);
        shell.stdout(said.try_clone().expect("clones")).stderr(said);
        Running { child: shell.spawn().expect("starts"), shop: self, command: command.into(), began: Instant::now() }
    }

    /// What the last command has said.
    pub fn said(&self) -> String {
        fs::read(self.path("said")).map_or_else(|_| String::new(), |bytes| String::from_utf8_lossy(&bytes).into_owned())
    }

    /// Runs a command to its end, which must be a good one.
    pub fn whole(&self, command: &str) {
        let status = self.start(command).end();
        assert!(status.success(), "{command}: {status}\n{}", self.said());
    }

    /// Runs a command until `holds`, then tells it to end. SIGTERM does what Ctrl-C does, and unlike SIGINT is not ignored
    /// where the tests themselves run in the background of a script.
    pub fn until(&self, command: &str, holds: impl Fn() -> bool) {
        let mut running = self.start(command);
        running.wait(holds);
        signal(&running.child, "TERM");
        let status = running.end();
        // Whoever has something to tidy up ends by itself, the others by the signal.
        let told = status.success() || status.signal() == Some(15);
        assert!(told && !self.said().contains("panicked"), "{command}: {status}\n{}", self.said());
    }

    /// Lines of all metrics of all runs.
    pub fn rows(&self) -> usize {
        let mut folders = vec![self.path("runs")];
        let mut rows = 0;
        while let Some(folder) = folders.pop() {
            for path in fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path()) {
                if path.is_dir() {
                    folders.push(path);
                } else if path.ends_with("metrics.csv") {
                    rows += fs::read_to_string(path).map_or(0, |text| text.lines().count());
                }
            }
        }
        rows
    }
}

struct Running<'a> {
    child: Child,
    shop: &'a Shop,
    command: String,
    began: Instant,
}

impl Running<'_> {
    fn wait(&mut self, holds: impl Fn() -> bool) {
        while !holds() {
            let ended = self.child.try_wait().expect("waits");
            assert!(ended.is_none(), "{} ended by itself: {}", self.command, self.shop.said());
            self.patience();
        }
    }

    fn end(&mut self) -> ExitStatus {
        loop {
            if let Some(status) = self.child.try_wait().expect("waits") {
                return status;
            }
            self.patience();
        }
    }

    fn patience(&mut self) {
        if self.began.elapsed() > PATIENCE {
            let _ = self.child.kill();
            panic!("{} takes too long: {}", self.command, self.shop.said());
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The images of this source: built when the first test asks for them, where `cargo firmware` puts them.
fn images() -> &'static Path {
    static IMAGES: OnceLock<PathBuf> = OnceLock::new();
    IMAGES.get_or_init(|| {
        // Its `tmp` is where cargo puts what tests make.
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("a target folder");
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut build = Command::new(cargo);
        build.args(["firmware", "--quiet", "--locked", "--target-dir"]).arg(target).current_dir(ROOT);
        let built = build.output().expect("cargo starts");
        assert!(built.status.success(), "cargo firmware: {}", String::from_utf8_lossy(&built.stderr));
        target.join("thumbv6m-none-eabi/firmware")
    })
}
