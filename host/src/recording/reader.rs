//! Reads what a replay needs out of a recording, also out of one whose end is missing.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::McapError;
use mcap::read::{ChunkFlattener, Options};
use mcap::records::Record;
use sarah_protocol::frame::Deframer;
use sarah_protocol::host::{Report, ToHost};
use sarah_protocol::telemetry::Telemetry;

use super::error::RecordingError;
use super::recorder::{CONTROL, RAW, SCHEMA, schema_text};
use super::schemas::data_of;

/// A recording, as far as it can be computed again.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    /// What it says of itself.
    pub about: BTreeMap<String, String>,
    /// Telemetry, in order.
    pub telemetry: Vec<Telemetry>,
    /// The tape of the control code, see [`super::tape`]; empty if the robot was not simulated.
    pub tape: Vec<u8>,
    /// Messages on all topics.
    pub messages: u64,
    /// It was ended properly. If not, up to a second is missing.
    pub complete: bool,
}

impl Recording {
    /// Reads a file.
    pub fn read(path: &Path) -> Result<Recording, RecordingError> {
        let bytes = std::fs::read(path).map_err(RecordingError::io("read", path))?;
        let unfit = |why: String| RecordingError::Unfit { path: path.to_path_buf(), why };
        // A killed process leaves no magic number at the end.
        let records = ChunkFlattener::new_with_options(&bytes, Options::IgnoreEndMagic.into());
        let records = records.map_err(|error| unfit(error.to_string()))?;
        let mut recording = Recording::default();
        let mut topics = BTreeMap::new();
        for record in records {
            match record {
                Ok(Record::Metadata(about)) if about.name == "sarah" => {
                    recording.about = about.metadata;
                    recording.check_schema(path)?;
                }
                Ok(Record::Channel(channel)) => {
                    topics.insert(channel.id, channel.topic);
                }
                Ok(Record::Message { header, data }) => {
                    recording.messages += 1;
                    let topic = topics.get(&header.channel_id).map_or("", String::as_str);
                    recording.take(topic, &data).map_err(unfit)?;
                }
                Ok(Record::DataEnd(_)) => recording.complete = true,
                Ok(_) => {}
                Err(McapError::UnexpectedEof | McapError::UnexpectedEoc | McapError::BadChunkLength { .. }) => break,
                Err(error) => return Err(unfit(error.to_string())),
            }
        }
        match recording.about.is_empty() {
            true => Err(unfit("it does not say that this program wrote it".into())),
            false => Ok(recording),
        }
    }

    fn check_schema(&self, path: &Path) -> Result<(), RecordingError> {
        let of = |name: &str| self.about.get(name).cloned().unwrap_or_default();
        let (recorded, ours) = (of(SCHEMA), schema_text());
        match recorded == ours {
            true => Ok(()),
            false => Err(RecordingError::Schema { path: PathBuf::from(path), recorded, ours, program: of("program") }),
        }
    }

    fn take(&mut self, topic: &str, message: &[u8]) -> Result<(), String> {
        match topic {
            RAW => {
                let frame = data_of(message).ok_or_else(|| format!("a message on {RAW} does not decode"))?;
                if let Some(ToHost::Report(Report::Telemetry(telemetry))) = unframe(frame)? {
                    self.telemetry.push(telemetry);
                }
            }
            CONTROL => {
                let entries = data_of(message).ok_or_else(|| format!("a message on {CONTROL} does not decode"))?;
                self.tape.extend_from_slice(entries);
            }
            _ => {}
        }
        Ok(())
    }
}

fn unframe(frame: &[u8]) -> Result<Option<ToHost>, String> {
    let mut deframer: Deframer = Deframer::new();
    for byte in frame {
        match deframer.push(*byte) {
            None => {}
            Some(Ok(packet)) => return ToHost::decode(&packet).map(Some).map_err(|error| error.to_string()),
            Some(Err(error)) => return Err(error.to_string()),
        }
    }
    Ok(None)
}
