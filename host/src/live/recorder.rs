//! Everything heard, on disk, by a thread of its own: a slow disk delays nobody, and a full one ends the recording, not
//! the training.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use sarah_protocol::session::{LinkStats, News};

use crate::link::live::{Heard, Link, What};
use crate::recording::pose::Pose;
use crate::recording::{self, About, RecordingError};
use crate::run::RunError;
use crate::task::odometry::Estimate;
use crate::train::TrainError;

/// What was heard is on disk after this long, even if nothing more is heard.
const KEEP: Duration = Duration::from_secs(1);
/// How the link is goes into the recording this often, µs.
const LINK_US: u64 = 1_000_000;
/// Items that wait for a slow disk: half a minute of telemetry. What is beyond is not recorded.
const WAITING: usize = 4_096;

enum Item {
    Heard(Heard, Option<Estimate>),
    Link { at_us: u64, stats: LinkStats, up: bool, reconnects: u32 },
}

/// A recording under way, or what became of it.
pub struct Recorder {
    items: Option<SyncSender<Item>>,
    thread: Option<JoinHandle<Result<(), RecordingError>>>,
    link_us: u64,
    dropped: u64,
}

impl Recorder {
    /// Begins the next recording in `folder`: `1.mcap`, `2.mcap`, …
    pub fn start(folder: &Path, link: &Link) -> Result<Recorder, TrainError> {
        std::fs::create_dir_all(folder).map_err(RunError::io("create", folder))?;
        let about = About::now(link.now_us()).with("link", format!("serial:{}", link.health().port));
        let mut recording = recording::Recorder::create(&next(folder), about)?;
        let (items, to_write) = sync_channel(WAITING);
        let thread = std::thread::spawn(move || {
            write(&mut recording, &to_write)?;
            recording.finish().map(|_| ())
        });
        Ok(Recorder { items: Some(items), thread: Some(thread), link_us: 0, dropped: 0 })
    }

    /// Takes what was heard, and where the trunk is; never waits. Once the recording has failed: why, and from then on
    /// nothing is recorded.
    pub fn heard(&mut self, heard: Heard, trunk: Option<Estimate>, link: &Link) -> Option<TrainError> {
        let at_us = heard.at_us;
        if at_us >= self.link_us + LINK_US {
            self.link_us = at_us;
            let health = link.health();
            self.send(Item::Link { at_us, stats: health.stats, up: health.up, reconnects: health.reconnects });
        }
        self.send(Item::Heard(heard, trunk));
        self.thread.as_ref().is_some_and(JoinHandle::is_finished).then(|| self.finish().err()).flatten()
    }

    fn send(&mut self, item: Item) {
        if let Some(items) = &self.items
            && let Err(TrySendError::Full(_)) = items.try_send(item)
        {
            self.dropped += 1;
        }
    }

    /// Items that a slow disk had no time for.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Ends the recording.
    pub fn finish(&mut self) -> Result<(), TrainError> {
        self.items = None;
        let thread = self.thread.take().and_then(|thread| thread.join().ok());
        Ok(thread.unwrap_or(Ok(()))?)
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // Whoever wants to know how it ended calls `finish`.
        let _ = self.finish();
    }
}

fn write(recording: &mut recording::Recorder, items: &Receiver<Item>) -> Result<(), RecordingError> {
    loop {
        match items.recv_timeout(KEEP) {
            Ok(Item::Heard(heard, trunk)) => {
                recording.hear(&heard, trunk.and_then(|trunk| place(&heard, &trunk)).as_ref())?;
            }
            Ok(Item::Link { at_us, stats, up, reconnects }) => recording.link(at_us, &stats, up, reconnects)?,
            Err(RecvTimeoutError::Timeout) => recording.keep()?,
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
    }
}

/// Where the trunk is, as a recording has it.
fn place(heard: &Heard, estimate: &Estimate) -> Option<Pose> {
    match &heard.what {
        What::News(News::Telemetry(frame)) => Some(Pose::estimated(estimate.pose.position_m, estimate.yaw_rad, frame)),
        _ => None,
    }
}

/// The first number that is free.
fn next(folder: &Path) -> PathBuf {
    let path = |number: u32| folder.join(format!("{number}.mcap"));
    path((1..u32::MAX).find(|number| !path(*number).exists()).unwrap_or(u32::MAX))
}
