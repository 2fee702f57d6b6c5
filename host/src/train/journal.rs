//! What a session leaves on disk as it goes: a row per episode, and a checkpoint that a kill cannot spoil.

use std::path::{Path, PathBuf};

use sarah_protocol::params::{ParamSet, SPECS};
use serde::{Deserialize, Serialize};

use super::TrainError;
use crate::enaf::{EnafError, EpisodeLog};
use crate::report::columns;
use crate::run::{MetricsCsv, write_atomic};
use crate::task::action::Scope;

/// Version of the checkpoint's layout.
const FORMAT: u32 = 1;

#[derive(Serialize, Deserialize)]
struct Checkpoint {
    format: u32,
    episodes: u32,
    metrics_bytes: u64,
    /// Episodes that the simulation spoilt.
    broken: u32,
    learner: Vec<u8>,
}

/// The journal of one session.
pub struct Journal {
    scope: Scope,
    metrics: MetricsCsv,
    checkpoint: PathBuf,
    episodes: u32,
    broken: u32,
}

/// One episode, as the metrics have it.
pub struct Row {
    /// Reward.
    pub reward: f32,
    /// Ended by a fall.
    pub fell: bool,
    /// Explored.
    pub noisy: bool,
    /// Decisions made.
    pub decisions: usize,
    /// Loss, gradient norm, V and exploration width, of a learner that has them.
    pub learning: Option<[f64; 4]>,
}

impl From<&EpisodeLog> for Row {
    fn from(log: &EpisodeLog) -> Row {
        Row {
            reward: log.reward_mean,
            fell: log.fell,
            noisy: log.noisy,
            decisions: log.decisions,
            learning: Some([log.loss, log.grad_norm, log.value_mean, log.sigma].map(f64::from)),
        }
    }
}

impl Journal {
    /// Begins a session's journal in `folder`, or takes it up; with the learner as it was saved last.
    pub fn open(scope: Scope, folder: &Path) -> Result<(Journal, Option<Vec<u8>>), TrainError> {
        let checkpoint = folder.join("checkpoint.bin");
        let saved = match std::fs::read(&checkpoint) {
            Ok(bytes) => Some(decode(&checkpoint, &bytes)?),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => None,
            Err(error) => return Err(TrainError::Read { path: checkpoint, source: error }),
        };
        let names = columns_of(scope);
        let metrics = MetricsCsv::open(
            &folder.join("metrics.csv"),
            &names.iter().map(String::as_str).collect::<Vec<_>>(),
            saved.as_ref().map(|saved| saved.metrics_bytes),
        )?;
        let (episodes, broken) = saved.as_ref().map_or((0, 0), |saved| (saved.episodes, saved.broken));
        Ok((Journal { scope, metrics, checkpoint, episodes, broken }, saved.map(|saved| saved.learner)))
    }

    /// Episodes done.
    pub fn episodes(&self) -> u32 {
        self.episodes
    }

    /// Episodes that were spoilt.
    pub fn broken(&self) -> u32 {
        self.broken
    }

    /// Counts spoilt episodes.
    pub fn spoilt(&mut self, episodes: u32) {
        self.broken += episodes;
    }

    /// One more episode, which ran (about) `set`.
    pub fn append(&mut self, row: &Row, set: &ParamSet) -> Result<(), TrainError> {
        let mut fields = vec![
            Some(f64::from(self.episodes)),
            Some(f64::from(self.episodes + 1) * 30.0),
            Some(f64::from(row.reward)),
            Some(f64::from(u8::from(row.noisy))),
            Some(f64::from(u8::from(row.fell))),
            Some(row.decisions as f64),
        ];
        match row.learning {
            Some(learning) => fields.extend(learning.map(Some)),
            None => fields.extend([None; 4]),
        }
        fields.extend(set.values()[self.scope.range()].iter().map(|value| Some(f64::from(*value))));
        self.metrics.append(fields)?;
        self.episodes += 1;
        Ok(())
    }

    /// Makes everything so far outlive a kill.
    pub fn save(&mut self, learner: Vec<u8>) -> Result<(), TrainError> {
        self.metrics.sync()?;
        let checkpoint = Checkpoint {
            format: FORMAT,
            episodes: self.episodes,
            metrics_bytes: self.metrics.len_bytes(),
            broken: self.broken,
            learner,
        };
        let bytes = postcard::to_stdvec(&checkpoint).map_err(EnafError::from)?;
        Ok(write_atomic(&self.checkpoint, &bytes)?)
    }

    /// A file beside the checkpoint.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.checkpoint.with_file_name(name)
    }

    /// The error of a learner that does not load.
    pub fn unusable(&self, why: impl ToString) -> TrainError {
        TrainError::Learner { path: self.checkpoint.clone(), why: why.to_string() }
    }
}

fn columns_of(scope: Scope) -> Vec<String> {
    let fixed = [
        columns::EPISODE,
        columns::TIME_S,
        columns::REWARD,
        columns::NOISY,
        "fell",
        "decisions",
        "loss",
        "grad_norm",
        "value",
        "sigma",
    ];
    fixed.iter().copied().chain(SPECS[scope.range()].iter().map(|spec| spec.symbol)).map(String::from).collect()
}

fn decode(path: &Path, bytes: &[u8]) -> Result<Checkpoint, TrainError> {
    let damaged = || TrainError::Checkpoint { path: path.to_path_buf(), expected: FORMAT };
    let (format, _): (u32, _) = postcard::take_from_bytes(bytes).map_err(|_| damaged())?;
    if format != FORMAT {
        return Err(damaged());
    }
    postcard::from_bytes(bytes).map_err(|_| damaged())
}
