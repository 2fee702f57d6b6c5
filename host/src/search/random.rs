//! Random search: most episodes try fresh points, the rest try the best of them again, since one episode says little.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{Search, SearchError};

/// Fraction of the budget spent on fresh points.
const FRESH: f32 = 0.7;
/// Fraction of the fresh points that is tried again.
const ELITE: f32 = 0.1;

/// Random search over the action cube with a known budget.
#[derive(Clone, Debug)]
pub struct RandomSearch {
    points: Vec<Vec<f32>>,
    rewards: Vec<f32>,
    start: Vec<f32>,
}

impl RandomSearch {
    /// A search of `budget` episodes, continued from the rewards of its first ones.
    pub fn new(start: &[f32], budget: usize, seed: u64, rewards: Vec<f32>) -> RandomSearch {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let fresh = ((budget as f32 * FRESH) as usize).max(1);
        let points = (0..fresh).map(|_| start.iter().map(|_| rng.random_range(-1.0..=1.0)).collect()).collect();
        RandomSearch { points, rewards, start: start.to_vec() }
    }

    /// Indices of the best fresh points, best first, by their first reward.
    fn elite(&self) -> Vec<usize> {
        let seen = self.rewards.len().min(self.points.len());
        let mut order: Vec<usize> = (0..seen).collect();
        order.sort_by(|a, b| self.rewards[*b].total_cmp(&self.rewards[*a]));
        order.truncate(((self.points.len() as f32 * ELITE) as usize).max(3));
        order
    }

    fn tried_again(&self) -> &[f32] {
        self.rewards.get(self.points.len()..).unwrap_or(&[])
    }
}

impl Search for RandomSearch {
    fn ask(&mut self) -> Result<Vec<f32>, SearchError> {
        let episode = self.rewards.len();
        if let Some(point) = self.points.get(episode) {
            return Ok(point.clone());
        }
        let elite = self.elite();
        Ok(self.points[elite[(episode - self.points.len()) % elite.len()]].clone())
    }

    fn tell(&mut self, reward: f32) -> Result<(), SearchError> {
        self.rewards.push(reward);
        Ok(())
    }

    fn recommend(&mut self) -> Result<Vec<f32>, SearchError> {
        let elite = self.elite();
        let mean = |rank: usize| {
            let again = self.tried_again().iter().skip(rank).step_by(elite.len());
            let (sum, n) = again.fold((self.rewards[elite[rank]], 1.0), |(sum, n), reward| (sum + reward, n + 1.0));
            sum / n
        };
        let best = (0..elite.len()).max_by(|a, b| mean(*a).total_cmp(&mean(*b)));
        Ok(best.map_or_else(|| self.start.clone(), |rank| self.points[elite[rank]].clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_point_on_repeated_trials_is_recommended_and_the_journal_resumes_exactly() {
        let reward = |x: &[f32]| 1.0 - x.iter().map(|u| u * u).sum::<f32>();
        let mut search = RandomSearch::new(&[0.9, 0.9], 100, 3, vec![]);
        assert_eq!(search.recommend().unwrap(), [0.9, 0.9]);
        let mut journal = vec![];
        for _ in 0..100 {
            assert_eq!(RandomSearch::new(&[0.9, 0.9], 100, 3, journal.clone()).ask().unwrap(), search.ask().unwrap());
            let x = search.ask().unwrap();
            journal.push(reward(&x));
            search.tell(reward(&x)).unwrap();
        }
        assert!(reward(&search.recommend().unwrap()) > 0.8);
    }
}
