//! Writes what a robot tells into a recording.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Seek, Write};
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use foxglove::messages::{FrameTransforms, JointStates, Log, SceneUpdate, Timestamp};
use sarah_protocol::host::{Report, ToHost, VERSION};
use sarah_protocol::schema::schema_hash;
use sarah_protocol::session::{LinkStats, News};
use sarah_protocol::telemetry::Telemetry;

use super::description::Description;
use super::error::RecordingError;
use super::file::{McapFile, Topic};
use super::pose::Pose;
use super::scene::{self, Scene};
use super::schemas::{Attitude, Control, Gait, Generation, Imu, Link, Pads, Params, Raw, State};
use super::words;
use crate::link::live::{Heard, What};

/// Between two sets of transforms, ns: eyes need no more, and they are the largest message.
const TRANSFORMS_NS: u64 = 20_000_000;

/// What a recording says of itself.
#[derive(Clone, Debug, Default)]
pub struct About {
    /// The time of `at_us = 0`, ns since 1970; 0 for a simulated robot, whose time is its own.
    pub start_ns: u64,
    /// When the recording begins on that clock, µs: a later part of a long one does so late.
    pub begins_us: u64,
    /// Names and values: where the robot is, the scenario, the seed.
    pub values: BTreeMap<String, String>,
}

impl About {
    /// Of a robot whose link's clock stands at `now_us` at this moment.
    pub fn now(now_us: u64) -> About {
        let now_ns = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
        About { start_ns: now_ns.saturating_sub(now_us.saturating_mul(1000)), ..About::default() }
    }

    /// With a value more.
    pub fn with(mut self, name: &str, value: impl Into<String>) -> About {
        self.values.insert(name.into(), value.into());
        self
    }
}

/// A recording being written.
pub struct Recorder<W: Write + Seek = File> {
    file: McapFile<W>,
    topics: Topics,
    scene: Scene,
    start_ns: u64,
    transforms_at_ns: Option<u64>,
    dropped: u32,
    telemetry: u64,
}

struct Topics {
    transforms: Topic<FrameTransforms>,
    robot: Topic<SceneUpdate>,
    description: Topic<Description>,
    joints: Topic<JointStates>,
    imu: Topic<Imu>,
    pads: Topic<Pads>,
    attitude: Topic<Attitude>,
    gait: Topic<Gait>,
    state: Topic<State>,
    generation: Topic<Generation>,
    params: Topic<Params>,
    link: Topic<Link>,
    log: Topic<Log>,
    raw: Topic<Raw>,
    control: Topic<Control>,
}

/// Topic of the robot's messages as they were sent.
pub(super) const RAW: &str = "/raw";
/// Topic of the control code's inputs and outputs.
pub(super) const CONTROL: &str = "/control";
/// Channel metadata: which build's bytes these are.
pub(super) const SCHEMA: &str = "schema_hash";

/// The schema hash as it stands in a file.
pub(super) fn schema_text() -> String {
    format!("{:#010x}", schema_hash())
}

impl Recorder {
    /// Into a new file. One that exists is refused.
    pub fn create(path: &Path, about: About) -> Result<Recorder, RecordingError> {
        Recorder::with(McapFile::create(path)?, about)
    }
}

impl<W: Write + Seek> Recorder<W> {
    /// Into something already open; `path` is for messages.
    pub fn over(path: &Path, file: W, about: About) -> Result<Recorder<W>, RecordingError> {
        Recorder::with(McapFile::over(path, file)?, about)
    }

    fn with(mut file: McapFile<W>, about: About) -> Result<Recorder<W>, RecordingError> {
        let About { start_ns, begins_us, mut values } = about;
        let program = concat!("sarah ", env!("CARGO_PKG_VERSION"));
        for (name, value) in
            [("program", program.to_owned()), ("protocol", VERSION.to_string()), (SCHEMA, schema_text())]
        {
            values.insert(name.into(), value);
        }
        if start_ns != 0 {
            file.in_real_time();
        }
        file.about(values)?;
        let topics = Topics::declare(&mut file)?;
        let mut recorder =
            Recorder { file, topics, scene: Scene::new()?, start_ns, transforms_at_ns: None, dropped: 0, telemetry: 0 };
        let at_ns = recorder.at_ns(begins_us);
        let look = recorder.scene.look(timestamp(at_ns));
        recorder.file.write(&mut recorder.topics.robot, at_ns, &look)?;
        let description = recorder.scene.description();
        recorder.file.write(&mut recorder.topics.description, at_ns, &description)?;
        // From here on the file says what it is, even if nothing ever comes.
        recorder.file.flush()?;
        Ok(recorder)
    }

    /// Writes what was heard. `trunk` is where the trunk is in the world, if that is known: the simulator's truth, or
    /// odometry.
    pub fn hear(&mut self, heard: &Heard, trunk: Option<&Pose>) -> Result<(), RecordingError> {
        let at_ns = self.at_ns(heard.at_us);
        if let What::News(news) = &heard.what {
            if let Some(message) = as_sent(news) {
                self.raw(at_ns, &message)?;
            }
            match news {
                News::Telemetry(telemetry) => self.hear_telemetry(at_ns, telemetry, trunk)?,
                News::Params(report) => self.file.write(&mut self.topics.params, at_ns, &report.into())?,
                _ => {}
            }
        }
        match words::line(&heard.what) {
            Some((level, message)) => {
                let log = Log {
                    timestamp: Some(timestamp(at_ns)),
                    level: level as i32,
                    message,
                    name: "robot".into(),
                    ..Log::default()
                };
                self.file.write(&mut self.topics.log, at_ns, &log)
            }
            None => Ok(()),
        }
    }

    fn hear_telemetry(
        &mut self,
        at_ns: u64,
        telemetry: &Telemetry,
        trunk: Option<&Pose>,
    ) -> Result<(), RecordingError> {
        let Recorder { file, topics, scene, .. } = self;
        let at = timestamp(at_ns);
        file.write(&mut topics.imu, at_ns, &telemetry.into())?;
        file.write(&mut topics.pads, at_ns, &telemetry.into())?;
        file.write(&mut topics.attitude, at_ns, &telemetry.into())?;
        file.write(&mut topics.gait, at_ns, &telemetry.into())?;
        file.write(&mut topics.state, at_ns, &telemetry.into())?;
        file.write(&mut topics.generation, at_ns, &telemetry.into())?;
        file.write(&mut topics.joints, at_ns, &scene::joints(at, telemetry))?;
        if self.transforms_at_ns.is_none_or(|last| at_ns.abs_diff(last) >= TRANSFORMS_NS) {
            self.transforms_at_ns = Some(at_ns);
            file.write(&mut topics.transforms, at_ns, &scene.transforms(at, telemetry, trunk))?;
        }
        self.dropped = telemetry.dropped;
        self.telemetry += 1;
        Ok(())
    }

    fn raw(&mut self, at_ns: u64, message: &ToHost) -> Result<(), RecordingError> {
        // Every message of the robot fits a frame: it came in one.
        match message.encode(0, 0) {
            Some(frame) => self.file.write(&mut self.topics.raw, at_ns, &Raw::new(&frame)),
            None => Ok(()),
        }
    }

    /// Writes how good the link is; once a second is enough.
    pub fn link(&mut self, at_us: u64, stats: &LinkStats, up: bool, reconnects: u32) -> Result<(), RecordingError> {
        let at_ns = self.at_ns(at_us);
        let link = Link::new(stats, up, reconnects, self.dropped);
        self.file.write(&mut self.topics.link, at_ns, &link)
    }

    /// Writes whole entries of a [`super::tape::Tape`].
    pub fn control(&mut self, at_us: u64, entries: Vec<u8>) -> Result<(), RecordingError> {
        let at_ns = self.at_ns(at_us);
        self.file.write(&mut self.topics.control, at_ns, &Control::new(entries))
    }

    /// Call it when nothing was heard for a while: what waits goes to the file within a second.
    pub fn keep(&mut self) -> Result<(), RecordingError> {
        self.file.keep()
    }

    /// Telemetry frames so far.
    pub fn telemetry(&self) -> u64 {
        self.telemetry
    }

    /// Ends the recording; the messages in it.
    pub fn finish(self) -> Result<u64, RecordingError> {
        let messages = self.file.messages();
        self.file.finish()?;
        Ok(messages)
    }

    fn at_ns(&self, at_us: u64) -> u64 {
        self.start_ns.saturating_add(at_us.saturating_mul(1000))
    }
}

impl Topics {
    fn declare<W: Write + Seek>(file: &mut McapFile<W>) -> Result<Topics, RecordingError> {
        let plain = BTreeMap::new();
        let bytes = |format: &str| {
            BTreeMap::from([("format".to_owned(), format.to_owned()), (SCHEMA.to_owned(), schema_text())])
        };
        Ok(Topics {
            transforms: file.topic("/tf", &plain)?,
            robot: file.topic("/robot", &plain)?,
            description: file.topic("/robot_description", &plain)?,
            joints: file.topic("/joints", &plain)?,
            imu: file.topic("/imu", &plain)?,
            pads: file.topic("/pads", &plain)?,
            attitude: file.topic("/attitude", &plain)?,
            gait: file.topic("/gait", &plain)?,
            state: file.topic("/state", &plain)?,
            generation: file.topic("/generation", &plain)?,
            params: file.topic("/params", &plain)?,
            link: file.topic("/link", &plain)?,
            log: file.topic("/log", &plain)?,
            raw: file.topic(RAW, &bytes("one serial frame: COBS, CRC-32, postcard of sarah_protocol::host"))?,
            control: file.topic(CONTROL, &bytes("postcard of sarah::recording::tape::Entry, one after the other"))?,
        })
    }
}

/// The message of the robot behind this news, if it is one whole message.
fn as_sent(news: &News) -> Option<ToHost> {
    Some(match *news {
        News::Connected(robot) => ToHost::Hello(robot),
        News::Telemetry(telemetry) => ToHost::Report(Report::Telemetry(telemetry)),
        News::Event { time_us, event } => ToHost::Report(Report::Event { time_us, event }),
        News::Params(report) => ToHost::Report(Report::Params(report)),
        _ => return None,
    })
}

fn timestamp(at_ns: u64) -> Timestamp {
    let seconds = u32::try_from(at_ns / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new_checked(seconds, (at_ns % 1_000_000_000) as u32).unwrap_or(Timestamp::MAX)
}
