//! Small drawings made of characters, and numbers as people read them.

/// Eighths of a character, from nothing to full, growing from the left.
const EIGHTHS: [char; 9] = [' ', '▏', '▎', '▍', '▌', '▋', '▊', '▉', '█'];
/// Eighths of a character, growing from below.
const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// A bar of `width` characters filled to `fraction` (0 to 1; anything else counts as the nearer end), with a mark at
/// `mark` where the bar does not cover it.
pub(super) fn bar(fraction: f32, width: usize, mark: Option<f32>) -> String {
    let eighths = (clean(fraction) * (width * 8) as f32).round() as usize;
    let at = mark.map(|mark| cell(mark, width));
    let cells = (0..width).map(|index| match eighths.saturating_sub(index * 8).min(8) {
        0 if at == Some(index) => '┊',
        0 => '·',
        filled => EIGHTHS[filled],
    });
    cells.collect()
}

/// A scale of `width` characters with one point on it, for a value within a range.
pub(super) fn slider(fraction: f32, width: usize) -> String {
    let at = cell(fraction, width);
    (0..width).map(|index| if index == at { '●' } else { '─' }).collect()
}

/// The newest `width` values as columns of `height` characters, from the top row down; `full` is the value of a full
/// column. Where there are rows enough a dotted line marks `level`.
pub(super) fn chart(
    values: impl DoubleEndedIterator<Item = f32>,
    full: f32,
    level: f32,
    width: usize,
    height: usize,
) -> Vec<String> {
    let mut newest: Vec<f32> = values.rev().take(width).collect();
    newest.reverse();
    let blank = width - newest.len();
    let marked = (height > 1).then(|| height - 1 - (clean(level / full) * height as f32) as usize % height);
    let row = |row: usize| {
        let below = (height - 1 - row) * 8;
        let empty = if marked == Some(row) { '┄' } else { ' ' };
        let column = |value: &f32| match (clean(value / full) * (height * 8) as f32).ceil() as usize {
            // A value that is there is seen.
            filled if filled.max(1) > below => LEVELS[(filled.max(1) - below).min(8) - 1],
            _ => empty,
        };
        std::iter::repeat_n(empty, blank).chain(newest.iter().map(column)).collect()
    };
    (0..height).map(row).collect()
}

fn cell(fraction: f32, width: usize) -> usize {
    (clean(fraction) * width.saturating_sub(1) as f32).round() as usize
}

/// 0 to 1; what is no number counts as 0.
fn clean(fraction: f32) -> f32 {
    if fraction.is_nan() { 0.0 } else { fraction.clamp(0.0, 1.0) }
}

/// Breaks at spaces into lines of at most `width` characters; a longer word stands alone and is cut by the screen.
pub(super) fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![];
    let mut line = String::new();
    for word in text.split_whitespace() {
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > width {
            lines.push(std::mem::take(&mut line));
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    if !line.is_empty() {
        lines.push(line);
    }
    lines
}

/// At most `width` characters; what is cut off shows.
pub(super) fn cut(text: &str, width: usize) -> String {
    match text.chars().count() > width {
        true => text.chars().take(width.saturating_sub(1)).chain(['…']).collect(),
        false => text.to_owned(),
    }
}

/// A duration in at most six characters or so: `0.4 s`, `12 s`, `3 min`, `2.5 h`.
pub(super) fn duration(us: u64) -> String {
    let s = us as f64 * 1e-6;
    match s {
        _ if s < 9.95 => format!("{s:.1} s"),
        _ if s < 119.5 => format!("{s:.0} s"),
        _ if s < 7200.0 => format!("{:.0} min", s / 60.0),
        _ => format!("{:.1} h", s / 3600.0),
    }
}

/// A parameter's value: four decimals, as parameter files have them.
pub(super) fn value(value: f32) -> String {
    format!("{value:.4}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_fills_by_eighths_and_shows_its_mark_where_it_is_empty() {
        assert_eq!(bar(0.5, 4, None), "██··");
        assert_eq!(bar(0.28, 4, Some(0.99)), "█▏·┊");
        assert_eq!(bar(f32::NAN, 2, None), "··");
        assert_eq!(bar(7.0, 2, None), "██");
        assert_eq!(bar(0.5, 0, Some(0.5)), "");
    }

    #[test]
    fn a_slider_shows_where_in_its_range_a_value_stands() {
        assert_eq!(slider(0.0, 5), "●────");
        assert_eq!(slider(1.0, 5), "────●");
        assert_eq!(slider(f32::NAN, 0), "");
    }

    #[test]
    fn the_newest_value_stands_on_the_right() {
        assert_eq!(chart([0.0, 1.0].into_iter(), 1.0, 0.5, 4, 1), ["  ▁█"]);
        assert_eq!(chart([9.0, 0.0, 1.0].into_iter(), 1.0, 0.5, 2, 1), ["▁█"]);
        assert_eq!(chart([0.0, 0.6, f32::NAN].into_iter(), 1.0, 0.5, 4, 2), ["┄┄▂┄", " ▁█▁"]);
        assert_eq!(chart([1.0].into_iter(), 1.0, 0.5, 0, 1), [""]);
        assert!(chart([1.0].into_iter(), 1.0, 0.5, 3, 0).is_empty());
    }

    #[test]
    fn lines_break_at_spaces() {
        assert_eq!(wrap("a bc  def", 4), ["a bc", "def"]);
        assert_eq!(wrap("longer than", 3), ["longer", "than"]);
        assert!(wrap(" ", 3).is_empty());
    }

    #[test]
    fn durations_stay_short() {
        let all = [400_000, 12_000_000, 200_000_000, 9_000_000_000].map(duration);
        assert_eq!(all, ["0.4 s", "12 s", "3 min", "2.5 h"]);
    }
}
