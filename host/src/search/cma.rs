//! CMA-ES over the action cube, by the `cmaes` crate, turned inside out: it asks, we tell.

use std::cell::RefCell;

use cmaes::{CMAESOptions, DVector, Mode};

use super::{Search, SearchError};

/// Cost of leaving the cube, reward per squared action unit.
const OUTSIDE: f64 = 0.1;

/// CMA-ES from a start point.
#[derive(Clone, Debug)]
pub struct CmaEs {
    start: Vec<f64>,
    sigma: f64,
    seed: u64,
    rewards: Vec<f32>,
    /// Proposals of the generation under way.
    batch: Vec<Vec<f64>>,
    mean: Vec<f64>,
}

impl CmaEs {
    /// A search from `start` with the initial standard deviation `sigma`, continued from the rewards of its first episodes.
    pub fn new(start: &[f32], sigma: f64, seed: u64, rewards: Vec<f32>) -> CmaEs {
        let start: Vec<f64> = start.iter().map(|x| f64::from(*x)).collect();
        let mut search = CmaEs { mean: start.clone(), start, sigma, seed, rewards, batch: vec![] };
        search.replay();
        search
    }

    /// Runs the algorithm over the journal up to the first generation that is not complete: its proposals are the ones
    /// to evaluate, the mean before it is the recommendation.
    fn replay(&mut self) {
        let asked = RefCell::new(vec![]);
        let rewards = &self.rewards;
        let objective = |x: &DVector<f64>| {
            let outside: f64 = x.iter().map(|u| (u.abs() - 1.0).max(0.0).powi(2)).sum();
            let index = asked.borrow().len();
            asked.borrow_mut().push(x.iter().copied().collect::<Vec<f64>>());
            rewards.get(index).map_or(0.0, |reward| f64::from(*reward) - OUTSIDE * outside)
        };
        // No convergence test: the budget of episodes ends the search.
        let options = CMAESOptions::new(self.start.clone(), self.sigma)
            .mode(Mode::Maximize)
            .seed(self.seed)
            .tol_fun(0.0)
            .tol_fun_rel(0.0)
            .tol_fun_hist(0.0)
            .tol_x(0.0)
            .tol_stagnation(usize::MAX);
        let Ok(mut cma) = options.build(objective) else { return };
        loop {
            let (before, mean) = (asked.borrow().len(), cma.mean().iter().copied().collect());
            let stopped = cma.next().is_some();
            let after = asked.borrow().len();
            if after > rewards.len() || stopped || after == before {
                self.mean = mean;
                self.batch = asked.borrow()[before..].to_vec();
                return;
            }
        }
    }

    fn population(&self) -> usize {
        self.batch.len().max(1)
    }
}

fn in_cube(x: &[f64]) -> Vec<f32> {
    x.iter().map(|u| u.clamp(-1.0, 1.0) as f32).collect()
}

impl Search for CmaEs {
    fn ask(&mut self) -> Result<Vec<f32>, SearchError> {
        let within = self.rewards.len() % self.population();
        Ok(self.batch.get(within).map_or_else(|| in_cube(&self.mean), |x| in_cube(x)))
    }

    fn tell(&mut self, reward: f32) -> Result<(), SearchError> {
        self.rewards.push(reward);
        if self.rewards.len().is_multiple_of(self.population()) {
            self.replay();
        }
        Ok(())
    }

    fn recommend(&mut self) -> Result<Vec<f32>, SearchError> {
        Ok(in_cube(&self.mean))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGMA: f64 = 0.4;

    fn reward(x: &[f32]) -> f32 {
        1.0 - x.iter().zip([0.3, -0.5, 0.7]).map(|(a, b)| (a - b) * (a - b)).sum::<f32>()
    }

    #[test]
    fn it_finds_the_optimum_of_a_bowl_from_the_cube_s_middle() {
        let mut search = CmaEs::new(&[0.0; 3], SIGMA, 1, vec![]);
        for _ in 0..210 {
            let x = search.ask().unwrap();
            search.tell(reward(&x)).unwrap();
        }
        let found = search.recommend().unwrap();
        assert!(reward(&found) > 0.99, "{found:?}");
    }

    #[test]
    fn going_on_from_the_journal_proposes_what_would_have_come() {
        let mut whole = CmaEs::new(&[0.0; 3], SIGMA, 5, vec![]);
        let mut journal = vec![];
        for episode in 0..60 {
            let mut resumed = CmaEs::new(&[0.0; 3], SIGMA, 5, journal.clone());
            let x = whole.ask().unwrap();
            assert_eq!(resumed.ask().unwrap(), x, "episode {episode}");
            journal.push(reward(&x));
            whole.tell(reward(&x)).unwrap();
        }
        assert_eq!(CmaEs::new(&[0.0; 3], SIGMA, 5, journal).recommend().unwrap(), whole.recommend().unwrap());
    }
}
