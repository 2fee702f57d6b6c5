//! An image that runs with its logs in view: OpenOCD carries the bytes (RTT) to a TCP port, `defmt-print` turns them
//! into words. probe-rs does both itself.

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::process::{Child, Command, Stdio};

use super::tool::Tool;
use super::{FlashError, Job, attached, missing};

const DECODER: &str = "defmt-print";
const DECODER_HINT: &str = "`cargo install defmt-print --version 1.2.0 --locked`, or use --tool probe-rs";

pub(super) fn run(job: &Job, tool: Tool) -> Result<(), FlashError> {
    match tool {
        Tool::Openocd => openocd(job),
        Tool::ProbeRs => {
            let status = tool.run(job, 0).status().map_err(|error| missing(tool.program(), tool.hint(), &error))?;
            let why = "see its message above".to_owned();
            if status.success() { Ok(()) } else { Err(FlashError::Tool { program: tool.program(), why }) }
        }
    }
}

fn openocd(job: &Job) -> Result<(), FlashError> {
    let tool = Tool::Openocd;
    // Before anything is written: logs were asked for.
    decoder(&["--version"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .map_err(|error| missing(DECODER, DECODER_HINT, &error))?;
    let port = free_port().ok_or(FlashError::Tool { program: tool.program(), why: "no free TCP port".into() })?;
    let mut command = tool.run(job, port);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    let child = command.spawn().map_err(|error| missing(tool.program(), tool.hint(), &error))?;
    let mut server = Server(child);
    let mut said = String::new();
    let stderr = server.0.stderr.take().map(BufReader::new);
    let mut lines = stderr.into_iter().flat_map(BufRead::lines).map_while(Result::ok);
    let ready = format!("Listening on port {port} for rtt connections");
    if !lines.by_ref().any(|line| {
        said.push_str(&line);
        said.push('\n');
        line.contains(&ready)
    }) {
        return Err(tool.explain(job, &said, &attached()));
    }
    // OpenOCD goes on talking; a full pipe would stop it.
    std::thread::spawn(move || lines.for_each(drop));
    eprintln!("running; its logs, until Ctrl-C:");
    let elf = job.elf.display().to_string();
    let port = port.to_string();
    let status = decoder(&["-e", &elf, "tcp", "--host", "127.0.0.1", "--port", &port]).status();
    let status = status.map_err(|error| missing(DECODER, DECODER_HINT, &error))?;
    let why = format!("{DECODER} ended with {status}: was the image built from this source?");
    if status.success() { Ok(()) } else { Err(FlashError::Tool { program: DECODER, why }) }
}

fn decoder(arguments: &[&str]) -> Command {
    let mut command = Command::new(DECODER);
    command.args(arguments);
    command
}

fn free_port() -> Option<u16> {
    TcpListener::bind(("127.0.0.1", 0)).ok()?.local_addr().ok().map(|address| address.port())
}

/// Ends with whoever started it.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
