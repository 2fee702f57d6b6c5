//! What each session learned, and whether that is more than noise.

use crate::stats::{BootstrapError, Interval, Statistic, bootstrap_crossed, iqm};
use serde::{Deserialize, Serialize};

/// One training session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SessionReport {
    /// 1 to 3.
    pub session: u8,
    /// What was trained, for instance `LPG1, P1–P3`.
    pub what: String,
    /// Training episodes of each learner and seed.
    pub episodes: u32,
    /// Which reward was evaluated: `gated` or `paper`.
    pub reward: String,
    /// The learners, ours first, all from the same start, all with the same number of episodes.
    pub learners: Vec<LearnerReport>,
}

/// What a learner made of a session, over seeds, on common pushes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LearnerReport {
    /// The learner: `eNAF`, `eNAF, paper's form`, `CMA-ES`, `random`.
    pub learner: String,
    /// Seeds.
    pub seeds: u32,
    /// Evaluation episodes of all seeds together.
    pub evaluated: u32,
    /// Interquartile mean reward before.
    pub start: Option<f64>,
    /// Interquartile mean reward after.
    pub trained: Option<f64>,
    /// Mean paired difference with its 95 % interval, seeds and pushes drawn.
    pub difference: Option<Interval>,
}

/// Whether a session learned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Better than its start: the interval lies above zero.
    Learned,
    /// Not told apart from its start.
    Undecided,
    /// Worse than its start: the interval lies below zero.
    Worse,
}

impl LearnerReport {
    /// Compares rewards after and before training: for each seed, one reward per evaluation episode, both on the
    /// same pushes; `None` where the simulation failed. `rng_seed` seeds the bootstrap.
    pub fn new(
        learner: &str,
        before: &[Vec<Option<f64>>],
        after: &[Vec<Option<f64>>],
        rng_seed: u64,
    ) -> Result<Self, BootstrapError> {
        let [all_before, all_after] =
            [before, after].map(|seeds| seeds.iter().flatten().flatten().copied().collect::<Vec<f64>>());
        let paired = before.len() == after.len() && before.iter().zip(after).all(|(b, a)| b.len() == a.len());
        if !paired {
            return Err(BootstrapError::Unpaired { after: all_after.len(), before: all_before.len() });
        }
        let differences: Vec<Vec<Option<f64>>> = after
            .iter()
            .zip(before)
            .map(|(a, b)| a.iter().zip(b).map(|(a, b)| Some((*a)? - (*b)?)).collect())
            .collect();
        Ok(Self {
            learner: learner.into(),
            seeds: after.len() as u32,
            evaluated: all_after.len() as u32,
            start: iqm(&all_before),
            trained: iqm(&all_after),
            difference: bootstrap_crossed(&differences, Statistic::Mean, rng_seed),
        })
    }

    /// Whether it learned.
    pub fn verdict(&self) -> Verdict {
        match self.difference {
            Some(difference) if difference.low > 0.0 => Verdict::Learned,
            Some(difference) if difference.high < 0.0 => Verdict::Worse,
            _ => Verdict::Undecided,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_of_every_seed_is_learning_and_no_gain_is_not() {
        let before: Vec<Vec<Option<f64>>> =
            (0..5).map(|seed| (0..50).map(|i| Some(f64::from(i * 7 % 50 + seed))).collect()).collect();
        let gained: Vec<Vec<Option<f64>>> =
            before.iter().map(|seed| seed.iter().map(|reward| Some((*reward)? + 1.0)).collect()).collect();
        let verdict = |after: &[Vec<Option<f64>>]| LearnerReport::new("eNAF", &before, after, 1).unwrap().verdict();
        assert_eq!(verdict(&gained), Verdict::Learned);
        assert_eq!(verdict(&before), Verdict::Undecided);
        assert!(LearnerReport::new("eNAF", &before, &gained[1..], 1).is_err());
        // An episode that the simulation failed counts on neither side.
        let mut holed = before.clone();
        holed[0][0] = None;
        let report = LearnerReport::new("eNAF", &before, &holed, 1).unwrap();
        assert_eq!(report.evaluated, 249);
        assert_eq!(report.difference.map(|difference| difference.estimate), Some(0.0));
    }
}
