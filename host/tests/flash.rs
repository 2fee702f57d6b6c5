//! `sarah flash`: the exact command, and plain words for whatever goes wrong.
//!
//! OpenOCD is played by a script that says what the real one says; where the real one is installed, a board that is not
//! plugged in is asked of it as well. Nothing here has seen a board.

#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use tempfile::TempDir;

/// The first 20 bytes of an Arm ELF.
const IMAGE: &[u8] = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0\x02\0\x28\0";
const MAP: &str = "[probes]\nknee = \"ATML1\"\nhip = \"ATML2\"\nabductor = \"ATML3\"\ncoordinator = \"ATML4\"\n";

struct Bench(TempDir);

impl Bench {
    /// Four images, no tool.
    fn new() -> Bench {
        let bench = Bench(tempfile::tempdir().expect("a folder"));
        fs::create_dir(bench.path("bin")).expect("creates");
        for node in ["knee", "hip", "abductor", "coordinator"] {
            fs::write(bench.path(node), IMAGE).expect("writes");
        }
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// A tool that notes its arguments, says `words` and ends with `code`.
    fn tool(&self, name: &str, words: &str, code: i32) -> &Bench {
        let log = self.path("calls");
        let script = format!(
            "#!/bin/sh\nprintf '%s\\n' \"$*\" >> '{}'\ncat >&2 <<'WORDS'\n{words}\nWORDS\nexit {code}\n",
            log.display()
        );
        let path = self.path("bin").join(name);
        fs::write(&path, script).expect("writes");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("sets");
        self
    }

    fn calls(&self) -> Vec<String> {
        fs::read_to_string(self.path("calls")).unwrap_or_default().lines().map(str::to_owned).collect()
    }

    fn sarah(&self, arguments: &[&str]) -> Output {
        let path = format!("{}:/usr/bin:/bin", self.path("bin").display());
        self.sarah_on(&path, arguments)
    }

    fn sarah_on(&self, path: &str, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sarah"));
        command.arg("flash").args(arguments).args(["--images", "."]).current_dir(self.0.path());
        command.env("PATH", path).stdin(Stdio::null()).output().expect("starts")
    }

    fn refused(&self, arguments: &[&str], parts: &[&str]) {
        check(&self.sarah(arguments), parts);
    }
}

fn check(output: &Output, parts: &[&str]) {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success());
    assert_eq!(stderr.lines().count(), 1, "{stderr}");
    for part in parts {
        assert!(stderr.contains(part), "{stderr:?} lacks {part:?}");
    }
}

#[test]
fn the_exact_command_is_printed_and_nothing_is_run() {
    let bench = Bench::new();
    bench.tool("openocd", "", 1);
    let output = bench.sarah(&["--node", "knee", "--probe", "ATML1", "--dry-run"]);
    let stdout = String::from_utf8(output.stdout).expect("UTF-8");
    assert_eq!(
        stdout,
        "openocd -f board/atmel_samc21_xplained_pro.cfg -c 'gdb_port disabled; tcl_port disabled; telnet_port disabled' \
         -c 'adapter serial ATML1' -c init -c 'set did [read_memory 0x41002018 32 1]; \
         if {($did & 0xffff00ff) != 0x11010000} {error \"wrong chip DID $did\"}' \
         -c 'program {./knee} verify reset exit'\n"
    );
    assert!(bench.calls().is_empty());
    let output = bench.sarah(&["--node", "hip", "--tool", "probe-rs", "--probe", "ATML2", "--dry-run"]);
    let stdout = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(stdout.starts_with("probe-rs download --non-interactive --verify --chip ATSAMC21J18A"), "{stdout}");
    assert!(stdout.ends_with("--probe 03eb:2111:ATML2 ./hip\n"), "{stdout}");
}

#[test]
fn all_four_go_each_onto_its_own_board_and_a_failure_stops() {
    let bench = Bench::new();
    bench.tool("openocd", "** Verified OK **", 0);
    fs::write(bench.path("boards.toml"), MAP).expect("writes");
    let output = bench.sarah(&["--all"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stdout).matches("written and verified").count(), 4);
    for (call, (node, serial)) in
        bench.calls().iter().zip([("knee", 1), ("hip", 2), ("abductor", 3), ("coordinator", 4)])
    {
        assert!(call.contains(&format!("adapter serial ATML{serial}")) && call.contains(node), "{call}");
    }
    // One node takes its board from the map too.
    bench.sarah(&["--node", "abductor"]);
    assert!(bench.calls()[4].contains("adapter serial ATML3"));
    bench.tool("openocd", "** Verify Failed **", 1);
    bench.refused(&["--all"], &["verify failed"]);
    assert_eq!(bench.calls().len(), 6, "stopped at the first failure");
}

#[test]
fn every_failure_of_the_tool_is_said_in_plain_words() {
    let bench = Bench::new();
    let knee = ["--node", "knee", "--probe", "ATML1"];
    let cases: [(&str, &[&str]); 8] = [
        (
            "Error: unable to find a matching CMSIS-DAP device\n** OpenOCD init failed **",
            &["no board found", "ATML1", "plug"],
        ),
        ("Error: libusb_open() failed with LIBUSB_ERROR_ACCESS", &["may not be opened", "udev"]),
        ("wrong chip DID 0x10010300", &["no ATSAMC21J18A", "0x10010300", "nothing was written"]),
        ("wrong chip DID 268501760", &["no ATSAMC21J18A", "0x10010300"]),
        ("Error: Couldn't find part corresponding to DID 10810019", &["no ATSAMC21J18A", "0x10810019"]),
        (
            "Error: failed erasing sectors 0 to 3\n** Programming Failed **",
            &["writing the flash failed", "erasing sectors"],
        ),
        ("Error: checksum mismatch\n** Verify Failed **", &["verify failed", "flash again"]),
        ("Error: Error connecting DP: cannot read IDR", &["chip does not", "cannot read IDR"]),
    ];
    for (words, parts) in cases {
        bench.tool("openocd", words, 1);
        bench.refused(&knee, parts);
    }
    bench.tool("openocd", "Error: something new", 1);
    bench.refused(&knee, &["openocd failed", "something new"]);
}

#[test]
fn a_missing_tool_image_or_map_is_named_with_its_remedy() {
    let bench = Bench::new();
    let none = bench.path("bin");
    let none = none.to_str().expect("UTF-8");
    check(
        &bench.sarah_on(none, &["--node", "knee", "--probe", "A1"]),
        &["openocd is not installed", "apt-get install"],
    );
    let probe_rs = ["--node", "knee", "--probe", "A1", "--tool", "probe-rs"];
    check(&bench.sarah_on(none, &probe_rs), &["probe-rs is not installed", "cargo install"]);
    check(&bench.sarah_on(none, &["--node", "knee", "--run"]), &["defmt-print is not installed", "cargo install"]);
    bench.tool("openocd", "", 0);
    fs::remove_file(bench.path("knee")).expect("removes");
    bench.refused(&["--node", "knee"], &["knee is not there", "cargo firmware"]);
    fs::write(bench.path("knee"), "#!/bin/sh").expect("writes");
    bench.refused(&["--node", "knee"], &["no ELF file", "cargo firmware"]);
    bench.refused(&["--all"], &["boards.toml", "check the path"]);
    bench.refused(&["--node", "hip", "--probe", "A}; shutdown"], &["no probe serial number"]);
    for (map, parts) in [
        (MAP.replace("ATML2", "ATML1"), ["two nodes", "ATML1"]),
        (MAP.replace("hip", "hp"), ["no node is called hp", "known are"]),
        (MAP.replace("hip = \"ATML2\"\n", ""), ["hip is missing", "[probes]"]),
        ("[probe]".into(), ["boards.toml", "probe"]),
    ] {
        fs::write(bench.path("boards.toml"), map).expect("writes");
        bench.refused(&["--all"], &parts);
    }
    assert!(bench.calls().is_empty());
}

#[test]
fn a_running_image_has_its_logs_decoded_and_the_server_is_stopped() {
    let bench = Bench::new();
    bench.tool("defmt-print", "", 0);
    let server = "#!/bin/sh\necho $$ > pid\nport=$(printf '%s' \"$*\" | sed 's/.*rtt server start \\([0-9]*\\) .*/\\1/')\n\
        echo \"Info : Listening on port $port for rtt connections\" >&2\nexec sleep 600\n";
    let path = bench.path("bin/openocd");
    fs::write(&path, server).expect("writes");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("sets");
    let output = bench.sarah(&["--elf", "knee", "--run"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let calls = bench.calls();
    assert_eq!(calls.len(), 2, "{calls:?}");
    assert!(calls[1].starts_with("-e knee tcp --host 127.0.0.1 --port "), "{calls:?}");
    let pid = fs::read_to_string(bench.path("pid")).expect("reads");
    assert!(!PathBuf::from(format!("/proc/{}", pid.trim())).exists(), "OpenOCD is still there");
    // It never gets that far: its words, not a wait without end.
    bench.tool("openocd", "Error: unable to find a matching CMSIS-DAP device", 1);
    bench.refused(&["--elf", "knee", "--run"], &["no board found"]);
}

#[test]
fn the_real_openocd_knows_the_board_and_says_that_none_is_there() {
    let Ok(version) = Command::new("openocd").arg("--version").output() else {
        println!("openocd is not installed: not asked");
        return;
    };
    assert!(version.status.success());
    let bench = Bench::new();
    bench.refused(&["--node", "knee", "--probe", "NOSUCHBOARD1"], &["no board found with probe NOSUCHBOARD1"]);
}
