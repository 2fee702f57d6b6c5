//! The robot's three parameter sets, as far as it told: applied, staged and stored are different things.

use sarah_protocol::host::{ParamsReport, Which};
use sarah_protocol::params::{COUNT, RawParams};

/// The sets are asked for again this often, µs: the robot does not tell when another host stages or stores one.
const AGAIN_US: u64 = 2_000_000;
/// No more than one question in this time, µs.
const PAUSE_US: u64 = 100_000;
const ALL: [Which; 3] = [Which::Applied, Which::Staged, Which::Stored];

/// A set and its generation.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Known {
    /// Its generation; 0 for the stored set, which has none.
    pub(super) generation: u32,
    /// Its values, unchecked.
    pub(super) values: RawParams,
}

/// What is known of the three.
#[derive(Clone, Debug, Default)]
pub(super) struct Sets {
    known: [Option<Known>; 3],
    asked_us: [Option<u64>; 3],
    told: [bool; 3],
    last_us: Option<u64>,
}

impl Sets {
    /// The robot's answer.
    pub(super) fn learn(&mut self, report: &ParamsReport) {
        let index = place(report.which);
        self.told[index] = true;
        self.known[index] = report.params.map(|values| Known { generation: report.generation, values });
    }

    /// Ask for all three at the next chance.
    pub(super) fn outdated(&mut self) {
        self.asked_us = [None; 3];
    }

    /// The set to ask for now, if it is time.
    pub(super) fn due(&mut self, now_us: u64) -> Option<Which> {
        if self.last_us.is_some_and(|last| now_us.saturating_sub(last) < PAUSE_US) {
            return None;
        }
        let index =
            self.asked_us.iter().position(|asked| asked.is_none_or(|at| now_us.saturating_sub(at) >= AGAIN_US))?;
        self.asked_us[index] = Some(now_us);
        self.last_us = Some(now_us);
        ALL.get(index).copied()
    }

    /// One of the sets, if there is one.
    pub(super) fn get(&self, which: Which) -> Option<&Known> {
        self.known[place(which)].as_ref()
    }

    /// Whether the robot has told of this set at all.
    pub(super) fn told(&self, which: Which) -> bool {
        self.told[place(which)]
    }

    /// How many parameters differ between the applied set and another; `None` if one of them is not there.
    pub(super) fn differing(&self, which: Which) -> Option<usize> {
        let (applied, other) = (self.get(Which::Applied)?, self.get(which)?);
        Some((0..COUNT).filter(|index| applied.values[*index] != other.values[*index]).count())
    }
}

const fn place(which: Which) -> usize {
    match which {
        Which::Applied => 0,
        Which::Staged => 1,
        Which::Stored => 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_three_are_asked_for_one_after_the_other_and_again() {
        let mut sets = Sets::default();
        let asked: Vec<_> = (0..40).map(|tick| sets.due(tick * 60_000)).collect();
        let order: Vec<_> = asked.iter().flatten().copied().collect();
        assert_eq!(order[..4], [Which::Applied, Which::Staged, Which::Stored, Which::Applied]);
        assert!(order.len() <= 6, "{order:?}");
        sets.outdated();
        assert_eq!(sets.due(40 * 60_000), Some(Which::Applied));
    }

    #[test]
    fn an_empty_answer_is_an_answer() {
        let mut sets = Sets::default();
        assert!(!sets.told(Which::Staged));
        sets.learn(&ParamsReport { which: Which::Staged, generation: 0, params: None });
        assert!(sets.told(Which::Staged));
        assert_eq!(sets.differing(Which::Staged), None);
        for (which, value) in [(Which::Applied, 1.0), (Which::Stored, 2.0)] {
            let mut values = [1.0; COUNT];
            values[3] = value;
            sets.learn(&ParamsReport { which, generation: 0, params: Some(values) });
        }
        assert_eq!(sets.differing(Which::Stored), Some(1));
    }
}
