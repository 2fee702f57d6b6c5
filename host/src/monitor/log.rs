//! The last things that happened, oldest first.

use std::collections::VecDeque;

/// Lines kept.
const LINES: usize = 200;

/// One line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Entry {
    /// Time since the link was opened, µs; of the last repetition.
    pub(super) at_us: u64,
    /// What happened.
    pub(super) text: String,
    /// How often in a row.
    pub(super) times: u32,
}

/// The log.
#[derive(Clone, Debug, Default)]
pub(super) struct Log {
    entries: VecDeque<Entry>,
}

impl Log {
    /// Something happened; the same thing again only counts up.
    pub(super) fn push(&mut self, at_us: u64, text: impl Into<String>) {
        let text = text.into();
        if let Some(last) = self.entries.back_mut().filter(|last| last.text == text) {
            last.at_us = at_us;
            last.times = last.times.saturating_add(1);
            return;
        }
        self.entries.push_back(Entry { at_us, text, times: 1 });
        while self.entries.len() > LINES {
            self.entries.pop_front();
        }
    }

    /// The newest `count`, oldest first.
    pub(super) fn newest(&self, count: usize) -> impl Iterator<Item = &Entry> {
        self.entries.iter().skip(self.entries.len().saturating_sub(count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repetitions_are_counted_and_old_lines_go() {
        let mut log = Log::default();
        for at_us in 0..3 {
            log.push(at_us, "the same");
        }
        assert_eq!(log.newest(9).collect::<Vec<_>>(), [&Entry { at_us: 2, text: "the same".into(), times: 3 }]);
        for index in 0..2 * LINES as u64 {
            log.push(index, index.to_string());
        }
        assert_eq!(log.newest(usize::MAX).count(), LINES);
        assert_eq!(log.newest(1).next().unwrap().text, "399");
    }
}
