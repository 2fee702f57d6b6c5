//! Everything heard, on disk, by a thread of its own: a slow disk delays nobody.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sarah_protocol::session::News;

use crate::link::live::{Heard, Link, What};
use crate::recording::pose::Pose;
use crate::recording::{self, About, RecordingError};
use crate::run::RunError;
use crate::task::odometry::Estimate;
use crate::train::TrainError;

/// What is recorded must be on disk after this long.
const KEEP: Duration = Duration::from_secs(1);

type Item = (Heard, Option<Estimate>);

/// A recording under way.
pub struct Recorder {
    items: Option<Sender<Item>>,
    thread: Option<JoinHandle<Result<(), RecordingError>>>,
}

impl Recorder {
    /// Begins the next recording in `folder`: `1.mcap`, `2.mcap`, …
    pub fn start(folder: &Path, link: &Link) -> Result<Recorder, TrainError> {
        std::fs::create_dir_all(folder).map_err(RunError::io("create", folder))?;
        let about = About::now(link.now_us()).with("link", &format!("serial:{}", link.health().port));
        let mut recording = recording::Recorder::create(&next(folder), about)?;
        let (items, to_write) = channel();
        let thread = std::thread::spawn(move || {
            write(&mut recording, &to_write)?;
            recording.finish().map(|_| ())
        });
        Ok(Recorder { items: Some(items), thread: Some(thread) })
    }

    /// Takes what was heard, and where the trunk is. Fails if the recording failed, which is no reason to move on.
    pub fn heard(&mut self, heard: Heard, trunk: Option<Estimate>) -> Result<(), TrainError> {
        let sent = self.items.as_ref().is_some_and(|items| items.send((heard, trunk)).is_ok());
        if sent { Ok(()) } else { self.finish() }
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
    let mut kept = Instant::now();
    while let Ok((heard, trunk)) = items.recv() {
        recording.hear(&heard, trunk.and_then(|trunk| place(&heard, &trunk)).as_ref())?;
        if kept.elapsed() > KEEP {
            kept = Instant::now();
            recording.keep()?;
        }
    }
    Ok(())
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
