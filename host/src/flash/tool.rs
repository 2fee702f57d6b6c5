//! The two programs that can flash, their command lines, and what their messages mean.

use std::process::Command;

use clap::ValueEnum;

use super::{FlashError, Job, Probe};

/// A program that flashes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum Tool {
    /// OpenOCD 0.12 or newer.
    Openocd,
    /// probe-rs with our chip description.
    ProbeRs,
}

/// In OpenOCD's own scripts.
const BOARD: &str = "board/atmel_samc21_xplained_pro.cfg";
/// DSU.DID is at 0x4100_2018; die and revision (bits 8 to 15) may differ (data sheet, "DSU").
const CHECK: &str = "set did [read_memory 0x41002018 32 1]; \
    if {($did & 0xffff00ff) != 0x11010000} {error \"wrong chip DID $did\"}";
const CHIP: &str = "ATSAMC21J18A";
const DESCRIPTION: &str = "firmware/probe-rs/ATSAMC21J18A.yaml";
/// USB vendor and product of the Xplained Pro's probe.
const EDBG: &str = "03eb:2111";
/// Where the control block of the logs may lie: all of the SRAM.
const RTT: &str = "rtt setup 0x20000000 0x8000 {SEGGER RTT}";

impl Tool {
    pub(super) const fn program(self) -> &'static str {
        match self {
            Tool::Openocd => "openocd",
            Tool::ProbeRs => "probe-rs",
        }
    }

    pub(super) const fn hint(self) -> &'static str {
        match self {
            Tool::Openocd => {
                "`apt-get install openocd` (Debian, Ubuntu), `brew install open-ocd`, or use --tool probe-rs"
            }
            Tool::ProbeRs => "`cargo install probe-rs-tools --locked`, or use --tool openocd",
        }
    }

    /// Writes, verifies, resets, ends.
    pub fn flash(self, job: &Job) -> Command {
        match self {
            Tool::Openocd => openocd(job, &[&format!("program {{{}}} verify reset exit", job.elf.display())]),
            Tool::ProbeRs => probe_rs("download", job),
        }
    }

    /// Writes, verifies, resets and stays, with the raw logs on a TCP port (OpenOCD) or decoded (probe-rs).
    pub fn run(self, job: &Job, port: u16) -> Command {
        match self {
            Tool::Openocd => {
                let program = format!("program {{{}}} verify", job.elf.display());
                let server = format!("rtt server start {port} 0");
                // The image needs a moment to set up what the server looks for.
                openocd(job, &[&program, "reset run", "sleep 200", RTT, "rtt start", &server])
            }
            Tool::ProbeRs => probe_rs("run", job),
        }
    }

    /// What a failure means.
    pub(super) fn explain(self, job: &Job, said: &str, attached: &[Probe]) -> FlashError {
        let has = |words: &str| said.contains(words);
        let last = || said.lines().rev().find(|line| line.contains("Error") || line.contains("error"));
        let last = last().or(said.lines().last()).unwrap_or("it said nothing").trim().to_owned();
        if let Some((_, found)) = said.split_once("wrong chip DID ") {
            return FlashError::WrongChip { found: hex(found) };
        }
        if let Some((_, found)) = said.split_once("part corresponding to DID ") {
            return FlashError::WrongChip { found: hex(&format!("0x{found}")) };
        }
        if has("LIBUSB_ERROR_ACCESS") || has("Access denied") || has("Permission denied") {
            return FlashError::Permission;
        }
        if has("unable to find a matching CMSIS-DAP device") || has("No connected probes") || has("Probe not found") {
            let wanted = job.probe.as_ref().map_or(String::new(), |serial| format!(" with probe {serial}"));
            let serials: Vec<&str> = attached.iter().map(|probe| probe.serial.as_str()).collect();
            let attached =
                if serials.is_empty() { String::new() } else { format!("; there is {}", serials.join(", ")) };
            return FlashError::NoProbe { wanted, attached };
        }
        if has("** Verify Failed **") || has("erification failed") {
            return FlashError::Verify;
        }
        if has("** Programming Failed **") {
            return FlashError::Write(last);
        }
        if has("Can't find board/") {
            return FlashError::Tool {
                program: self.program(),
                why: format!("{last}; it is too old, 0.12 knows the board"),
            };
        }
        if has("** Unable to reset target **") || has("Error connecting DP") || has("cannot read IDR") {
            return FlashError::NoChip(last);
        }
        FlashError::Tool { program: self.program(), why: last }
    }
}

fn openocd(job: &Job, then: &[&str]) -> Command {
    let mut command = Command::new("openocd");
    command.args(["-f", BOARD, "-c", "gdb_port disabled; tcl_port disabled; telnet_port disabled"]);
    if let Some(serial) = &job.probe {
        command.args(["-c", &format!("adapter serial {serial}")]);
    }
    for script in ["init", CHECK].iter().chain(then) {
        command.args(["-c", script]);
    }
    command
}

fn probe_rs(verb: &str, job: &Job) -> Command {
    let mut command = Command::new("probe-rs");
    command.args([verb, "--non-interactive", "--verify", "--chip", CHIP, "--chip-description-path", DESCRIPTION]);
    if let Some(serial) = &job.probe {
        command.args(["--probe", &format!("{EDBG}:{serial}")]);
    }
    command.arg(&job.elf);
    command
}

/// The number at the start of `text`, as eight hexadecimal digits.
fn hex(text: &str) -> String {
    let word: String = text.chars().take_while(|c| c.is_ascii_alphanumeric()).collect();
    let number = match word.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).ok(),
        None => word.parse().ok(),
    };
    number.map_or(word, |number| format!("{number:#010x}"))
}
