//! What a training study says, row by row.

use serde::Serialize;

use super::compare::BOOTSTRAP_SEED;
use super::plan::TrainingPlan;
use super::unit::{ArmData, SessionData};
use crate::metrics::{EpisodeResult, Outcome};
use crate::stats::{Interval, Statistic, bootstrap, bootstrap_crossed, improvement, iqm, mean};
use crate::task::reward::RewardForm;

/// Episodes in the mean that has to stay.
pub const WINDOW: usize = 10;
/// Share of the final reward that it has to reach.
pub const SHARE: f64 = 0.9;

/// The first episode, counted from 1, from which the mean reward of the [`WINDOW`] episodes that end there stays at
/// least [`SHARE`] of `last` until the end; `None` if even the last of them is below, or there are too few.
pub fn episodes_to_stability(rewards: &[f64], last: f64) -> Option<usize> {
    let means: Vec<f64> = rewards.windows(WINDOW).filter_map(mean).collect();
    let unstable = means.iter().rposition(|mean| *mean < SHARE * last);
    let first = unstable.map_or(0, |index| index + 1);
    (first < means.len()).then_some(first + WINDOW)
}

/// The mean reward of the last [`WINDOW`] episodes, or of all if there are fewer.
fn last_window(rewards: &[f64]) -> Option<f64> {
    mean(&rewards[rewards.len().saturating_sub(WINDOW)..])
}

/// One seed of an arm after a session.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs, reason = "the names are those of the columns")]
pub struct SeedRow {
    pub session: String,
    pub arm: String,
    pub seed: u64,
    pub judged: Option<f64>,
    pub survived: u32,
    pub of: u32,
    pub invalid: u32,
    pub episodes_to_stability: Option<usize>,
    pub broken: u32,
}

/// An arm after a session, over its seeds.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(missing_docs, reason = "the names are those of the columns")]
pub struct ArmRow {
    pub session: String,
    pub arm: String,
    pub seeds: u32,
    /// Mean judged reward of what the arm begins with.
    pub start: Option<f64>,
    /// IQM over seeds of the mean judged reward.
    pub judged: Option<f64>,
    pub judged_low: Option<f64>,
    pub judged_high: Option<f64>,
    /// Mean over seeds and pushes of what the session added to what it began with, on the same pushes.
    pub gain: Option<f64>,
    pub gain_low: Option<f64>,
    pub gain_high: Option<f64>,
    /// Mean of what the agent earned beyond its own average set held constant, on the same pushes; of agents whose
    /// action depends on the state.
    pub modulation: Option<f64>,
    pub modulation_low: Option<f64>,
    pub modulation_high: Option<f64>,
    /// Episodes of all seeds that were survived, and of how many.
    pub survived: u32,
    pub of: u32,
    /// Probability that a seed of this arm is better than one of the first arm.
    pub improvement: Option<f64>,
    pub improvement_low: Option<f64>,
    pub improvement_high: Option<f64>,
    /// IQM over seeds; a seed that never became stable counts with all its episodes, so this is a lower bound then.
    pub stability_iqm: Option<f64>,
    pub stability_low: Option<f64>,
    pub stability_high: Option<f64>,
    /// Seeds that became stable.
    pub stable: u32,
}

/// Judged rewards of valid episodes, in the form that was trained.
fn rewards(results: &[EpisodeResult], form: RewardForm) -> Vec<f64> {
    let valid = results.iter().filter(|result| result.outcome.is_valid());
    valid.map(|result| result.reward(form).into()).collect()
}

/// Judged rewards less those of `before`, push by push; a hole where one is not valid.
fn differences(after: &[EpisodeResult], before: &[EpisodeResult], form: RewardForm) -> Vec<Option<f64>> {
    let valid = |result: &EpisodeResult| result.outcome.is_valid().then(|| f64::from(result.reward(form)));
    after.iter().zip(before).map(|(after, before)| Some(valid(after)? - valid(before)?)).collect()
}

/// Mean over all seeds and pushes with its interval.
fn mean_difference(seeds: &[Vec<Option<f64>>]) -> Option<Interval> {
    bootstrap_crossed(seeds, Statistic::Mean, BOOTSTRAP_SEED)
}

/// Rows of every seed and of every arm, session by session.
pub fn rows(plan: &TrainingPlan, arms: &[ArmData]) -> (Vec<SeedRow>, Vec<ArmRow>) {
    let (mut seeds, mut summaries) = (vec![], vec![]);
    for (index, session) in plan.sessions.iter().enumerate() {
        let mut reference: Vec<f64> = vec![];
        for (number, arm) in arms.iter().enumerate() {
            let rows = seed_rows(arm, index, session.name());
            let judged: Vec<f64> = rows.iter().filter_map(|row| row.judged).collect();
            if number == 0 {
                reference.clone_from(&judged);
            }
            summaries.push(arm_row(plan, arm, index, &rows, &judged, (number > 0).then_some(&reference)));
            seeds.extend(rows);
        }
    }
    (seeds, summaries)
}

fn seed_rows(arm: &ArmData, index: usize, session: &str) -> Vec<SeedRow> {
    let of_session = || arm.chains.iter().filter_map(|(seed, sessions)| Some((*seed, sessions.get(index)?)));
    let finals: Vec<f64> = of_session().filter_map(|(_, data)| last_window(&data.rewards)).collect();
    let last = iqm(&finals);
    let row = |(seed, data): (u64, &SessionData)| SeedRow {
        session: session.into(),
        arm: arm.arm.name.clone(),
        seed,
        judged: mean(&rewards(&data.judged, arm.arm.config.reward)),
        survived: data.judged.iter().filter(|one| one.outcome == Outcome::Survived).count() as u32,
        of: data.judged.len() as u32,
        invalid: data.judged.iter().filter(|one| !one.outcome.is_valid()).count() as u32,
        episodes_to_stability: last.and_then(|last| episodes_to_stability(&data.rewards, last)),
        broken: data.broken,
    };
    of_session().map(row).collect()
}

fn arm_row(
    plan: &TrainingPlan,
    arm: &ArmData,
    index: usize,
    rows: &[SeedRow],
    judged: &[f64],
    reference: Option<&Vec<f64>>,
) -> ArmRow {
    let of_seeds = |values: &[f64]| bootstrap(values, Statistic::Iqm, BOOTSTRAP_SEED);
    let interval = of_seeds(judged);
    let better = reference.and_then(|reference| improvement(judged, reference, BOOTSTRAP_SEED));
    let form = arm.arm.config.reward;
    let sessions = || arm.chains.iter().filter_map(|(_, sessions)| sessions.get(index));
    let gained = |sessions: &Vec<SessionData>| {
        let before = index.checked_sub(1).map_or(&arm.start[..], |before| sessions[before].handed_on());
        sessions.get(index).map(|data| differences(&data.judged, before, form))
    };
    let gain = mean_difference(&arm.chains.iter().filter_map(|(_, sessions)| gained(sessions)).collect::<Vec<_>>());
    let modulation =
        mean_difference(&sessions().map(|data| differences(&data.judged, &data.held, form)).collect::<Vec<_>>());
    let budget = |row: &SeedRow| row.episodes_to_stability.map_or(f64::from(plan.episodes), |episodes| episodes as f64);
    let stability = of_seeds(&rows.iter().map(budget).collect::<Vec<_>>());
    let [low, high] = [|interval: Interval| interval.low, |interval: Interval| interval.high];
    let estimate = |interval: Interval| interval.estimate;
    ArmRow {
        session: plan.sessions[index].name().into(),
        arm: arm.arm.name.clone(),
        seeds: rows.len() as u32,
        start: mean(&rewards(&arm.start, arm.arm.config.reward)),
        judged: interval.map(estimate),
        judged_low: interval.map(low),
        judged_high: interval.map(high),
        gain: gain.map(estimate),
        gain_low: gain.map(low),
        gain_high: gain.map(high),
        modulation: modulation.map(estimate),
        modulation_low: modulation.map(low),
        modulation_high: modulation.map(high),
        survived: rows.iter().map(|row| row.survived).sum(),
        of: rows.iter().map(|row| row.of).sum(),
        improvement: better.map(estimate),
        improvement_low: better.map(low),
        improvement_high: better.map(high),
        stability_iqm: stability.map(estimate),
        stability_low: stability.map(low),
        stability_high: stability.map(high),
        stable: rows.iter().filter(|row| row.episodes_to_stability.is_some()).count() as u32,
    }
}

/// The seed of an arm that is judged in the middle after its last session, and the set that it hands on: what to expect,
/// not what luck once gave. `None` while no seed is finished.
pub fn median_seed<'a>(arm: &'a ArmData) -> Option<(u64, &'a [f32])> {
    let form = arm.arm.config.reward;
    let ranked = arm.chains.iter().filter_map(|(seed, sessions)| sessions.last().map(|last| (*seed, last)));
    let mut ranked: Vec<(f64, u64, &[f32])> = ranked
        .filter_map(|(seed, last)| Some((mean(&rewards(last.handed_on(), form))?, seed, last.set.as_slice())))
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    ranked.get(ranked.len().saturating_sub(1) / 2).map(|(_, seed, set)| (*seed, *set))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::plan::Learner;
    use crate::train::TrainConfig;

    #[test]
    fn stability_is_the_first_window_from_which_all_stay_high() {
        // 20 low, then 30 high: the window that ends with episode 29 has 9 of 10 high and is the first at 0.9.
        let mut rewards = [vec![0.0; 20], vec![1.0; 30]].concat();
        assert_eq!(episodes_to_stability(&rewards, 1.0), Some(29));
        // Two bad episodes late leave 0.8 until the window has passed the first of them, at episode 50 (of 0.9).
        rewards[39] = 0.0;
        rewards[40] = 0.0;
        assert_eq!(episodes_to_stability(&rewards, 1.0), Some(50));
        assert_eq!(episodes_to_stability(&rewards[..49], 1.0), None);
        assert_eq!(episodes_to_stability(&[1.0; 10], 1.0), Some(10));
        assert_eq!(episodes_to_stability(&[1.0; 9], 1.0), None);
    }

    fn result(reward_gated: f32, outcome: Outcome) -> EpisodeResult {
        EpisodeResult {
            direction_deg: None,
            impulse_n_s: 18.0,
            seed: 1,
            outcome,
            steps: 0,
            steps_per_s: None,
            drift_3s_m: None,
            settle_s: None,
            energy_j: crate::metrics::EnergyJ::default(),
            reward_paper: 0.0,
            reward_gated,
        }
    }

    #[test]
    fn the_median_seed_is_neither_the_best_nor_the_worst() {
        let learner = Learner { name: "enaf".into(), config: TrainConfig::default() };
        let judged = |reward: f32| {
            vec![SessionData {
                rewards: vec![],
                noisy: vec![],
                broken: 0,
                set: vec![reward],
                judged: vec![result(reward, Outcome::Survived)],
                held: vec![],
                handed_on: vec![],
            }]
        };
        let chains = [(1, 0.5), (2, 0.125), (3, 0.25), (4, 0.75)].map(|(seed, reward)| (seed, judged(reward)));
        let mut arm = ArmData { arm: &learner, start: vec![], chains: chains.to_vec() };
        // Of an even number the lower of the two in the middle.
        assert_eq!(median_seed(&arm), Some((3, &[0.25][..])));
        arm.chains.pop();
        assert_eq!(median_seed(&arm), Some((3, &[0.25][..])));
        arm.chains.clear();
        assert_eq!(median_seed(&arm), None);
    }

    #[test]
    fn differences_pair_push_by_push_and_leave_holes_where_the_simulation_failed() {
        let (survived, spoilt) = (Outcome::Survived, Outcome::NonFinite { at_s: 1.0 });
        let after = [result(0.75, survived), result(0.5, survived), result(0.0, spoilt)];
        let before = [result(0.5, survived), result(0.25, spoilt), result(0.5, survived)];
        assert_eq!(differences(&after, &before, RewardForm::Gated), [Some(0.25), None, None]);
        assert_eq!(differences(&after, &[], RewardForm::Gated), []);
    }
}
