//! An MCAP file that is readable up to the last second, whatever happens to the process or the disk.
//!
//! Messages gather in a chunk in memory; once a second (of the recording) it goes to the file as a whole. So the file is at any time a
//! sequence of whole chunks with at most the last one cut off, and the first brings every topic with its schema.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Seek, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use foxglove::Encode;
use mcap::records::{MessageHeader, Metadata};
use mcap::{WriteOptions, Writer};

use super::error::RecordingError;

/// Longest time a message stays in memory: by the recording's clock, and in real time by the wall's too. Simulated time
/// knows no wall, or equal recordings would be cut into chunks differently.
const FLUSH: Duration = Duration::from_secs(1);

/// A topic for messages of one type.
#[derive(Debug)]
pub(super) struct Topic<T> {
    id: u16,
    sequence: u32,
    kind: PhantomData<fn(&T)>,
}

/// A file being written.
pub(super) struct McapFile<W: Write + Seek = File> {
    path: PathBuf,
    writer: Writer<BufWriter<W>>,
    buffer: Vec<u8>,
    real_time: bool,
    flushed: Instant,
    flushed_ns: u64,
    messages: u64,
}

impl McapFile {
    /// A new file; one that exists is refused. Makes its folder.
    pub(super) fn create(path: &Path) -> Result<McapFile, RecordingError> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(RecordingError::io("make the folder of", path))?;
        }
        let file = OpenOptions::new().write(true).create_new(true).open(path);
        McapFile::over(path, file.map_err(RecordingError::io("create", path))?)
    }
}

impl<W: Write + Seek> McapFile<W> {
    /// Into something already open.
    pub(super) fn over(path: &Path, file: W) -> Result<McapFile<W>, RecordingError> {
        let library = concat!("sarah ", env!("CARGO_PKG_VERSION"));
        // Without seeking, a chunk is written only when it is whole.
        let options = WriteOptions::new().compression(None).library(library).disable_seeking(true);
        Ok(McapFile {
            path: path.to_path_buf(),
            writer: options.create(BufWriter::new(file)).map_err(RecordingError::writing(path))?,
            buffer: vec![],
            real_time: false,
            flushed: Instant::now(),
            flushed_ns: 0,
            messages: 0,
        })
    }

    /// The recording's clock is the wall's.
    pub(super) fn in_real_time(&mut self) {
        self.real_time = true;
    }

    /// Declares a topic.
    pub(super) fn topic<T: Encode>(
        &mut self,
        name: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Result<Topic<T>, RecordingError> {
        let failed = RecordingError::writing(&self.path);
        let declared = (|| {
            let schema = match T::get_schema() {
                Some(schema) => self.writer.add_schema(&schema.name, &schema.encoding, &schema.data)?,
                None => 0,
            };
            self.writer.add_channel(schema, name, &T::get_message_encoding(), metadata)
        })();
        Ok(Topic { id: declared.map_err(failed)?, sequence: 0, kind: PhantomData })
    }

    /// Writes a message that was heard at `at_ns`, ns since 1970, or since power-up of a simulated robot.
    pub(super) fn write<T: Encode>(
        &mut self,
        topic: &mut Topic<T>,
        at_ns: u64,
        message: &T,
    ) -> Result<(), RecordingError> {
        self.buffer.clear();
        let encoded = message.encode(&mut self.buffer).map_err(|error| std::io::Error::other(error.to_string()));
        encoded.map_err(RecordingError::io("encode a message for", &self.path))?;
        topic.sequence = topic.sequence.wrapping_add(1);
        let header =
            MessageHeader { channel_id: topic.id, sequence: topic.sequence, log_time: at_ns, publish_time: at_ns };
        self.writer.write_to_known_channel(&header, &self.buffer).map_err(RecordingError::writing(&self.path))?;
        self.messages += 1;
        if self.messages == 1 {
            self.flushed_ns = at_ns;
        }
        if at_ns.abs_diff(self.flushed_ns) >= FLUSH.as_nanos() as u64 {
            self.flushed_ns = at_ns;
            return self.flush();
        }
        self.keep()
    }

    /// Writes out what waits, if it has waited for a second of real time. Call it also when there is nothing to write.
    pub(super) fn keep(&mut self) -> Result<(), RecordingError> {
        if self.real_time && self.flushed.elapsed() >= FLUSH { self.flush() } else { Ok(()) }
    }

    /// Writes out what waits.
    pub(super) fn flush(&mut self) -> Result<(), RecordingError> {
        self.flushed = Instant::now();
        self.writer.flush().map_err(RecordingError::writing(&self.path))
    }

    /// Names and values that hold for the whole file.
    pub(super) fn about(&mut self, metadata: BTreeMap<String, String>) -> Result<(), RecordingError> {
        let record = Metadata { name: "sarah".into(), metadata };
        self.writer.write_metadata(&record).map_err(RecordingError::writing(&self.path))
    }

    /// Messages so far.
    pub(super) fn messages(&self) -> u64 {
        self.messages
    }

    /// Writes the index, with which tools find their way in long files.
    pub(super) fn finish(mut self) -> Result<(), RecordingError> {
        self.writer.finish().map_err(RecordingError::writing(&self.path))?;
        let mut file = self.writer.into_inner();
        file.flush().map_err(RecordingError::io("write", &self.path))
    }
}
