//! One row a group: where its values lie, or where its estimate is.

use super::Figure;
use super::axes::{at_least_three, range};
use super::svg::{Anchor, BOLD, Sheet, Stroke, Text, width_of};
use super::theme::{self, AXIS, GRID, INK, LARGE, MUTED, NORMAL, SMALL};
use crate::stats::{Interval, percentile};

/// A group of values.
#[derive(Debug, Clone, PartialEq)]
pub struct SpreadRow {
    /// The group.
    pub label: String,
    /// Rows of one series have one colour.
    pub series: usize,
    /// Its values, in any order.
    pub values: Vec<f64>,
}

/// An estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct IntervalRow {
    /// What is estimated.
    pub label: String,
    /// Rows of one series have one colour.
    pub series: usize,
    /// With its interval.
    pub interval: Interval,
}

const HEIGHT: f64 = 26.0;
const RIGHT: f64 = 724.0;
const TOP: f64 = 54.0;

/// Rows of labels on the left, an axis below, and where a value lies between.
struct Frame {
    left: f64,
    x: [f64; 2],
}

impl Frame {
    fn draw(title: &str, x_title: &str, labels: &[&str], x: [f64; 2]) -> (Sheet, Frame) {
        let widest = labels.iter().map(|label| width_of(label, NORMAL) * BOLD).fold(0.0, f64::max);
        let frame = Frame { left: (widest + 28.0).clamp(120.0, 380.0), x };
        let bottom = TOP + labels.len() as f64 * HEIGHT;
        let mut sheet = Sheet::new(760.0, bottom + 58.0);
        sheet.text([20.0, 30.0], title, Text::new(LARGE + 2.0).bold());
        for tick in at_least_three(x, 6.0) {
            let at = frame.px(tick);
            sheet.line([at, TOP], [at, bottom], Stroke::new(GRID, 1.0));
            // Six digits hide what binary fractions add.
            let text = format!("{}", (tick * 1e6).round() / 1e6).replace('-', "\u{2212}");
            sheet.text([at, bottom + 18.0], &text, Text::new(SMALL).color(MUTED).anchor(Anchor::Middle));
        }
        if x[0] < 0.0 && x[1] > 0.0 {
            sheet.line([frame.px(0.0), TOP], [frame.px(0.0), bottom], Stroke::new(AXIS, 1.0));
        }
        let middle = [(frame.left + RIGHT) / 2.0, bottom + 40.0];
        sheet.text(middle, x_title, Text::new(NORMAL).anchor(Anchor::Middle));
        for (index, label) in labels.iter().enumerate() {
            let style = Text::new(NORMAL).anchor(Anchor::End);
            sheet.text([frame.left - 12.0, frame.py(index) + 4.5], label, style);
        }
        (sheet, frame)
    }

    fn px(&self, value: f64) -> f64 {
        self.left + (value - self.x[0]) / (self.x[1] - self.x[0]) * (RIGHT - self.left)
    }

    fn py(&self, row: usize) -> f64 {
        TOP + (row as f64 + 0.5) * HEIGHT
    }
}

/// Where values lie: a line from the 5th to the 95th percentile, a bar over the middle half, the median across it.
pub fn spreads(title: &str, x_title: &str, rows: &[SpreadRow]) -> Figure {
    let shown = rows.iter().flat_map(|row| [5.0, 95.0].map(|percent| percentile(&row.values, percent)));
    let x = range(shown.flatten().chain([0.0]), 0.0);
    let labels: Vec<&str> = rows.iter().map(|row| row.label.as_str()).collect();
    let (mut sheet, frame) = Frame::draw(title, x_title, &labels, [0.0_f64.max(x[0]), x[1]]);
    for (index, row) in rows.iter().enumerate() {
        let (y, color) = (frame.py(index), theme::series(row.series));
        let quantiles = [5.0, 25.0, 50.0, 75.0, 95.0].map(|percent| percentile(&row.values, percent));
        let [Some(p5), Some(p25), Some(p50), Some(p75), Some(p95)] = quantiles else {
            sheet.text([frame.left + 8.0, y + 4.0], "none", Text::new(SMALL).color(MUTED));
            continue;
        };
        let [p5, p25, p50, p75, p95] = [p5, p25, p50, p75, p95].map(|value| frame.px(value));
        sheet.line([p5, y], [p95, y], Stroke::new(color, 1.6));
        sheet.rect([p25, y - 7.0], [(p75 - p25).max(1.0), 14.0], color, 0.55);
        sheet.line([p50, y - 9.0], [p50, y + 9.0], Stroke::new(INK, 2.2));
    }
    sheet.text([740.0, 30.0], "5 – 25 – median – 75 – 95 %", Text::new(SMALL).color(MUTED).anchor(Anchor::End));
    sheet.finish()
}

/// Estimates with their intervals.
pub fn intervals(title: &str, x_title: &str, rows: &[IntervalRow]) -> Figure {
    let ends = rows.iter().flat_map(|row| [row.interval.low, row.interval.high]);
    let labels: Vec<&str> = rows.iter().map(|row| row.label.as_str()).collect();
    let (mut sheet, frame) = Frame::draw(title, x_title, &labels, range(ends, 1e-3));
    for (index, row) in rows.iter().enumerate() {
        let (y, color) = (frame.py(index), theme::series(row.series));
        let Interval { low, estimate, high } = row.interval;
        sheet.line([frame.px(low), y], [frame.px(high), y], Stroke::new(color, 2.2));
        for end in [low, high] {
            sheet.line([frame.px(end), y - 5.0], [frame.px(end), y + 5.0], Stroke::new(color, 2.2));
        }
        sheet.circle([frame.px(estimate), y], 4.5, color, None);
    }
    sheet.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_without_values_says_so_and_equal_values_are_drawn() {
        let row = |label: &str, values: Vec<f64>| SpreadRow { label: label.into(), series: 0, values };
        let svg = spreads("Drift", "cm", &[row("none here", vec![]), row("one", vec![3.0])]).svg;
        assert!(svg.contains(">none<") && !svg.contains("NaN") && svg.matches("stroke-width=\"2.2\"").count() == 1);
        assert!(!spreads("Drift", "cm", &[]).svg.contains("NaN"));
    }

    #[test]
    fn an_estimate_is_a_dot_within_its_interval() {
        let interval = Interval { low: -0.1, estimate: 0.0, high: 0.1 };
        let svg = intervals("Gain", "reward", &[IntervalRow { label: "arm".into(), series: 1, interval }]).svg;
        assert!(svg.contains("<circle") && svg.contains(theme::series(1)) && !svg.contains("NaN"));
    }
}
