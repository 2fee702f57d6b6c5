//! A panel with axes: from units to pixels.

use super::svg::{Anchor, Sheet, Stroke, Text};
use super::theme::{AXIS, GRID, INK, LARGE, MUTED, NORMAL, SMALL};

/// A panel on a sheet, with the ranges it shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Panel {
    pub origin: [f64; 2],
    pub size: [f64; 2],
    pub x: [f64; 2],
    pub y: [f64; 2],
}

impl Panel {
    pub(super) fn px(&self, x: f64) -> f64 {
        self.origin[0] + (x - self.x[0]) / (self.x[1] - self.x[0]) * self.size[0]
    }
    pub(super) fn py(&self, y: f64) -> f64 {
        self.origin[1] + self.size[1] * (1.0 - (y - self.y[0]) / (self.y[1] - self.y[0]))
    }
    pub(super) fn at(&self, x: f64, y: f64) -> [f64; 2] {
        [self.px(x), self.py(y)]
    }
    pub(super) fn right(&self) -> f64 {
        self.origin[0] + self.size[0]
    }
    pub(super) fn bottom(&self) -> f64 {
        self.origin[1] + self.size[1]
    }

    pub(super) fn points(&self, x: &[f64], y: &[f64]) -> Vec<[f64; 2]> {
        x.iter().zip(y).map(|(&x, &y)| self.at(x, y)).collect()
    }

    /// Grid, axes, tick labels and titles. Without `x_title` the panel shares the x axis of one below it.
    pub(super) fn frame(&self, sheet: &mut Sheet, title: &str, x_title: Option<&str>, y_title: &str) {
        let rows = (self.size[1] / 34.0).clamp(2.0, 8.0);
        let columns = (self.size[0] / 80.0).clamp(2.0, 10.0);
        let y_ticks = at_least_three(self.y, rows);
        for &y in &y_ticks {
            let at = self.py(y);
            sheet.line([self.origin[0], at], [self.right(), at], Stroke::new(GRID, 1.0));
            let label = Text::new(SMALL).color(MUTED).anchor(Anchor::End);
            sheet.text([self.origin[0] - 7.0, at + 4.0], &tick_label(y, &y_ticks), label);
        }
        let x_ticks = ticks(self.x, columns);
        for &x in &x_ticks {
            let at = self.px(x);
            sheet.line([at, self.bottom()], [at, self.bottom() + 4.0], Stroke::new(AXIS, 1.0));
            if x_title.is_some() {
                let label = Text::new(SMALL).color(MUTED).anchor(Anchor::Middle);
                sheet.text([at, self.bottom() + 18.0], &tick_label(x, &x_ticks), label);
            }
        }
        sheet.line([self.origin[0], self.bottom()], [self.right(), self.bottom()], Stroke::new(AXIS, 1.0));
        if let Some(x_title) = x_title {
            let middle = self.origin[0] + self.size[0] / 2.0;
            let style = Text::new(NORMAL).color(INK).anchor(Anchor::Middle);
            sheet.text([middle, self.bottom() + 38.0], x_title, style);
        }
        let middle = [self.origin[0] - 50.0, self.origin[1] + self.size[1] / 2.0];
        sheet.text(middle, y_title, Text::new(NORMAL).anchor(Anchor::Middle).upright());
        if !title.is_empty() {
            sheet.text([self.origin[0], self.origin[1] - 10.0], title, Text::new(LARGE).bold());
        }
    }

    /// The zero line, where zero is in sight.
    pub(super) fn zero(&self, sheet: &mut Sheet) {
        if self.y[0] < 0.0 && self.y[1] > 0.0 {
            sheet.line([self.origin[0], self.py(0.0)], [self.right(), self.py(0.0)], Stroke::new(AXIS, 1.0));
        }
    }
}

/// The range of finite values with some air; `least` is the smallest range shown, so that noise does not look like
/// an event.
pub(super) fn range(values: impl IntoIterator<Item = f64>, least: f64) -> [f64; 2] {
    let finite = values.into_iter().filter(|value| value.is_finite());
    let [low, high] =
        finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
    if low > high {
        return [0.0, least.max(1.0)];
    }
    let (middle, half) = ((low + high) / 2.0, ((high - low) / 2.0 * 1.08).max(least / 2.0).max(1e-9));
    [middle - half, middle + half]
}

/// About `wanted` round numbers within a range: multiples of 1, 2 or 5 times a power of ten.
pub(super) fn ticks([low, high]: [f64; 2], wanted: f64) -> Vec<f64> {
    let rough = (high - low) / wanted;
    if !rough.is_finite() || rough <= 0.0 {
        return vec![];
    }
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|&step| step >= rough * 0.999);
    let step = step.unwrap_or(rough);
    let slack = 1e-9;
    let (first, last) = ((low / step - slack).ceil() as i64, (high / step + slack).floor() as i64);
    (first..=last).map(|i| i as f64 * step).collect()
}

/// As [`ticks`], but with at least three: two or one do not tell a scale.
pub(super) fn at_least_three(range: [f64; 2], wanted: f64) -> Vec<f64> {
    // Up to a factor of ten finer than asked for, steps reach three in any range.
    let finer = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0].map(|factor| ticks(range, wanted * factor));
    finer.into_iter().find(|ticks| ticks.len() >= 3).unwrap_or_default()
}

/// A tick's label, with as many decimals as the distance between ticks asks for.
fn tick_label(value: f64, ticks: &[f64]) -> String {
    let step = ticks.windows(2).map(|pair| pair[1] - pair[0]).next().unwrap_or(1.0);
    let decimals = (-(step.log10() + 1e-9).floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    let zero = text.trim_start_matches('-').chars().all(|letter| letter == '0' || letter == '.');
    // A real minus sign, as wide as a digit.
    if zero { text.replace('-', "") } else { text.replace('-', "\u{2212}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within() {
        assert_eq!(ticks([0.0, 1.0], 5.0), vec![0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]);
        assert_eq!(ticks([-3.0, 17.0], 4.0), vec![0.0, 5.0, 10.0, 15.0]);
        assert!(ticks([1.0, 1.0], 4.0).is_empty());
    }

    #[test]
    fn labels_have_the_decimals_they_need() {
        let ticks = ticks([-0.1, 0.1], 4.0);
        let labels: Vec<_> = ticks.iter().map(|&tick| tick_label(tick, &ticks)).collect();
        assert_eq!(labels, ["−0.10", "−0.05", "0.00", "0.05", "0.10"]);
        let labels: Vec<_> = [83.0, 84.0].iter().map(|&tick| tick_label(tick, &[83.0, 84.0])).collect();
        assert_eq!(labels, ["83", "84"]);
        assert_eq!(tick_label(0.1, &super::ticks([0.0, 0.5], 5.0)), "0.1");
    }

    #[test]
    fn every_range_has_three_ticks() {
        for range in [[-12.6, 8.1], [82.5, 87.6], [1.04, 2.86], [-0.3, 0.2], [0.0, 1e-9], [-7.0, 1e6]] {
            assert!(at_least_three(range, 3.1).len() >= 3, "{range:?}");
        }
        assert!(at_least_three([0.0, 0.0], 3.0).is_empty());
    }

    #[test]
    fn a_range_of_nothing_is_still_a_range() {
        assert_eq!(range([f64::NAN], 0.0), [0.0, 1.0]);
        assert_eq!(range([2.0, 2.0], 1.0), [1.5, 2.5]);
    }
}
