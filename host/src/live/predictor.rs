//! The predictor: an observation in, an action out, at once; whole episodes to the learner.

use std::sync::{Arc, Mutex};

use super::seam::{Act, Seen};
use crate::enaf::{Actor, EnafError, End, Played};

/// Where the learner leaves its newest weights, and the predictor finds them.
#[derive(Clone, Debug, Default)]
pub struct Weights(Arc<Mutex<Option<Vec<f32>>>>);

impl Weights {
    /// Leaves weights; those that nobody fetched are replaced.
    pub fn leave(&self, weights: &[f32]) {
        *self.slot() = Some(weights.to_vec());
    }

    /// The newest weights, if there are any since the last call.
    pub fn fetch(&self) -> Option<Vec<f32>> {
        self.slot().take()
    }

    fn slot(&self) -> std::sync::MutexGuard<'_, Option<Vec<f32>>> {
        // A panic while the lock was held leaves a whole vector or none.
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

/// What a message led to.
#[derive(Clone, PartialEq, Debug)]
pub enum Answer {
    /// An action for the collector.
    Act(Act),
    /// A whole episode for the learner.
    Played(Box<Played>),
    /// Nothing.
    Nothing,
}

/// Acts for one session.
pub struct Predictor {
    actor: Actor,
    weights: Weights,
    /// The attempt under way.
    attempt: Option<u32>,
}

impl Predictor {
    /// A predictor that takes its weights over from `weights` as they come.
    pub fn new(actor: Actor, weights: Weights) -> Predictor {
        Predictor { actor, weights, attempt: None }
    }

    /// Answers the collector. What belongs to no episode under way is ignored.
    pub fn on(&mut self, seen: &Seen) -> Result<Answer, EnafError> {
        match seen {
            Seen::Began { attempt, observation, .. } => {
                self.attempt = Some(*attempt);
                self.actor.begin();
                self.act(*attempt, observation)
            }
            Seen::Went { attempt, observation, reward, end } if self.attempt == Some(*attempt) => {
                self.actor.earned(*reward)?;
                match end {
                    None => self.act(*attempt, observation),
                    Some(end) => {
                        self.attempt = None;
                        Ok(Answer::Played(Box::new(self.actor.end(observation, *end == End::Fall)?)))
                    }
                }
            }
            Seen::Spoilt { attempt } if self.attempt == Some(*attempt) => {
                self.attempt = None;
                Ok(Answer::Nothing)
            }
            _ => Ok(Answer::Nothing),
        }
    }

    fn act(&mut self, attempt: u32, observation: &[f32]) -> Result<Answer, EnafError> {
        if let Some(weights) = self.weights.fetch() {
            self.actor.exchange(&weights);
        }
        let decision = self.actor.decisions();
        Ok(Answer::Act(Act { attempt, decision, action: self.actor.decide(observation)? }))
    }
}
