//! What the chips log: defmt frames out of their RAM, as a probe reads them, and `defmt-print` to make words of them.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};

use samc21::Width;
use sarah_sim::emulated::{Emulated, NAMES};

use super::EmulateError;

/// SEGGER's control block: one channel up.
const BLOCK: &str = "_SEGGER_RTT";
/// Offsets in it: buffer, size, the chip's place, the probe's place.
const BUFFER: u32 = 28;
const SIZE: u32 = 32;
const WRITE: u32 = 36;
const READ: u32 = 40;

/// The logs of the chips.
pub struct Logs(Vec<Log>);

struct Log {
    chip: usize,
    block: u32,
    decoder: Child,
    input: Option<ChildStdin>,
}

impl Logs {
    /// Starts a decoder for each chip; `images` is where their ELFs lie.
    pub fn start(images: &Path, world: &Emulated) -> Result<Logs, EmulateError> {
        let mut logs = vec![];
        for (chip, name) in NAMES.into_iter().enumerate() {
            // An image without a log has nothing to show.
            let Some(block) = world.images().get(chip).variables.address(BLOCK) else { continue };
            let mut decoder = Command::new("defmt-print")
                .arg("-e")
                .arg(images.join(name))
                .arg("stdin")
                .stdin(Stdio::piped())
                .stdout(Stdio::piped())
                .spawn()
                .map_err(EmulateError::Decoder)?;
            let input = decoder.stdin.take();
            if let Some(output) = decoder.stdout.take() {
                std::thread::spawn(move || {
                    BufReader::new(output).lines().map_while(Result::ok).for_each(|line| println!("[{name}] {line}"));
                });
            }
            logs.push(Log { chip, block, decoder, input });
        }
        Ok(Logs(logs))
    }

    /// Takes what is new out of the chips' RAM.
    pub fn collect(&mut self, world: &mut Emulated) -> Result<(), EmulateError> {
        for log in &mut self.0 {
            let chip = &mut world.chips_mut()[log.chip];
            let word = |offset| chip.peek(log.block + offset, Width::Word).unwrap_or(0);
            let (buffer, size, write, mut read) = (word(BUFFER), word(SIZE), word(WRITE), word(READ));
            // Before the image has set the block up there is nothing that could be a buffer.
            if size == 0 || size > 0x8000 || write >= size || read >= size || write == read {
                continue;
            }
            let mut bytes = vec![];
            while read != write {
                bytes.push(chip.peek(buffer + read, Width::Byte).unwrap_or(0) as u8);
                read = (read + 1) % size;
            }
            chip.sram_mut().write(log.block + READ, Width::Word, read);
            if let Some(input) = &mut log.input {
                input.write_all(&bytes).map_err(EmulateError::Decoder)?;
            }
        }
        Ok(())
    }
}

impl Drop for Logs {
    fn drop(&mut self) {
        for log in &mut self.0 {
            // The decoder ends with its input.
            drop(log.input.take());
            let _ = log.decoder.wait();
        }
    }
}
