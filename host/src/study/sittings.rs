//! When and by which source a study was worked on: its wall time is the sum of its sittings.

use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::StudyError;
use crate::run::{Layout, Revision, RunError, read_text, utc_now, write_atomic};

/// One process that worked on a study, from its start to the last unit that it saved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sitting {
    /// Git revision of the source, if known.
    pub revision: Option<String>,
    /// Whether the source had uncommitted changes, if known.
    pub dirty: Option<bool>,
    /// When it began, UTC, RFC 3339.
    pub started: String,
    /// Worlds at a time.
    pub cores: usize,
    /// Wall time, s.
    pub wall_s: f64,
    /// Units saved.
    pub units: u64,
}

impl Sitting {
    /// Begins now.
    pub fn begin() -> Sitting {
        let Revision { revision, dirty } = Revision::of(Path::new(env!("CARGO_MANIFEST_DIR")));
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        Sitting { revision, dirty, started: utc_now(), cores, wall_s: 0.0, units: 0 }
    }
}

/// All sittings of a study.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sittings {
    /// Those before.
    earlier: Vec<Sitting>,
    /// The present or last one.
    last: Option<Sitting>,
}

fn path(layout: &Layout) -> PathBuf {
    layout.root().join("sittings.json")
}

impl Sittings {
    /// Those of a study folder.
    pub fn read(layout: &Layout) -> Result<Sittings, StudyError> {
        let path = path(layout);
        if !path.is_file() {
            return Ok(Sittings::default());
        }
        Ok(serde_json::from_str(&read_text(&path)?).map_err(|error| RunError::damaged(&path, error))?)
    }

    /// Those of a study folder, all of them past.
    pub fn open(layout: &Layout) -> Result<Sittings, StudyError> {
        let mut sittings = Sittings::read(layout)?;
        sittings.earlier.extend(sittings.last.take());
        Ok(sittings)
    }

    /// One more unit is saved, `since` the sitting began.
    pub fn record(&mut self, layout: &Layout, sitting: &Sitting, since: Duration) -> Result<(), StudyError> {
        let units = self.last.as_ref().map_or(0, |last| last.units) + 1;
        self.last = Some(Sitting { wall_s: since.as_secs_f64(), units, ..sitting.clone() });
        let path = path(layout);
        let json = serde_json::to_vec_pretty(self).map_err(|error| RunError::damaged(&path, error))?;
        Ok(write_atomic(&path, &json)?)
    }

    /// All of them in order.
    pub fn all(&self) -> impl Iterator<Item = &Sitting> {
        self.earlier.iter().chain(&self.last)
    }

    /// Wall time of all, s.
    pub fn wall_s(&self) -> f64 {
        self.all().map(|sitting| sitting.wall_s).sum()
    }

    /// Revisions of the source, without repetition; one that had uncommitted changes says so.
    pub fn revisions(&self) -> Vec<String> {
        let mut revisions: Vec<String> = vec![];
        for sitting in self.all() {
            let changed = if sitting.dirty == Some(true) { " with uncommitted changes" } else { "" };
            let revision = format!("{}{changed}", sitting.revision.as_deref().unwrap_or("unknown"));
            if !revisions.contains(&revision) {
                revisions.push(revision);
            }
        }
        revisions
    }
}
