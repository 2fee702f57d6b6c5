//! The learner: whole episodes in, weights out, in a thread of its own; and the session's journal on disk.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use sarah_protocol::params::ParamSet;

use super::predictor::Weights;
use crate::enaf::{EpisodeLog, Played, Trainer};
use crate::task::action::{self, Scope};
use crate::train::TrainError;
use crate::train::journal::{Journal, Row};

/// What is done for one session.
pub struct Learning {
    /// Acts and learns.
    pub trainer: Trainer,
    /// What stays on disk.
    pub journal: Journal,
    /// What is trained.
    pub scope: Scope,
    /// The set it started from.
    pub base: ParamSet,
}

/// A session's learner at work.
pub struct Learner {
    episodes: Option<Sender<(Played, u32)>>,
    learned: Receiver<EpisodeLog>,
    thread: Option<JoinHandle<Result<Learning, TrainError>>>,
}

impl Learner {
    /// Starts learning; new weights are left in `weights` as soon as a decision's worth of gradient steps is done.
    pub fn start(mut learning: Learning, weights: Weights) -> Learner {
        let (episodes, to_learn) = channel::<(Played, u32)>();
        let (said, learned) = channel();
        let thread = std::thread::spawn(move || {
            while let Ok((played, spoilt)) = to_learn.recv() {
                learning.journal.spoilt(spoilt);
                let log = learn(&mut learning, played, &weights)?;
                // Nobody listens when the run is being ended; the journal has it.
                let _ = said.send(log);
            }
            Ok(learning)
        });
        Learner { episodes: Some(episodes), learned, thread: Some(thread) }
    }

    /// Hands an episode over; `spoilt` were of no use since the last one. Never waits.
    pub fn learn(&self, played: Played, spoilt: u32) {
        if let Some(episodes) = &self.episodes {
            // A learner that failed says so in `finish`.
            let _ = episodes.send((played, spoilt));
        }
    }

    /// The next episode that has been learned from and saved, if there is one.
    pub fn learned(&self) -> Option<EpisodeLog> {
        self.learned.try_recv().ok()
    }

    /// No more episodes will come.
    pub fn close(&mut self) {
        self.episodes = None;
    }

    /// Whether everything handed over has been learned from, after [`Learner::close`]; or it failed.
    /// [`Learner::finish`] tells which.
    pub fn over(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Waits for what was handed over to be learned from and saved.
    pub fn finish(mut self) -> Result<Learning, TrainError> {
        self.close();
        let thread = self.thread.take().map(JoinHandle::join);
        thread.and_then(Result::ok).unwrap_or(Err(TrainError::Stopped))
    }
}

fn learn(learning: &mut Learning, played: Played, weights: &Weights) -> Result<EpisodeLog, TrainError> {
    let Learning { trainer, journal, scope, base } = learning;
    let mut log = trainer.store(played);
    let (due, depth) = (trainer.due(), trainer.config().depth.max(1));
    let mut done = 0;
    while let Some(step) = trainer.update()? {
        log.learned(&step, due);
        done += 1;
        if done % depth == 0 {
            weights.leave(trainer.weights());
        }
    }
    weights.leave(trainer.weights());
    journal.append(&Row::from(&log), &action::decode(base, *scope, &log.mu_mean))?;
    // An episode takes half a minute of a robot's life: each one is saved.
    journal.save(trainer.save()?)?;
    Ok(log)
}
