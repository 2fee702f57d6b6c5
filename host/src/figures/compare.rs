//! Controllers beside each other: survival by direction, survival with intervals.

use super::Figure;
use super::svg::{Anchor, BOLD, Sheet, Stroke, Text, width_of};
use super::theme::{self, AXIS, GRID, INK, LARGE, MUTED, NORMAL, SMALL};
use crate::stats::{Proportion, wilson};
use serde::{Deserialize, Serialize};

/// Survival of one controller by direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PolarSeries {
    /// The controller.
    pub label: String,
    /// Directions (degrees from forward to the left) and survival there (0 to 1).
    pub points: Vec<(f32, f64)>,
}

/// Survival by direction of the push, seen from above, forward up: the further out, the more episodes survived.
pub fn survival_polar(title: &str, series: &[PolarSeries]) -> Figure {
    let mut sheet = Sheet::new(760.0, 520.0);
    let (centre, radius) = ([290.0, 274.0], 196.0);
    sheet.text([20.0, 30.0], title, Text::new(LARGE + 2.0).bold());
    let at = |degrees: f64, fraction: f64| {
        let angle = degrees.to_radians();
        [centre[0] - radius * fraction * angle.sin(), centre[1] - radius * fraction * angle.cos()]
    };
    for ring in [1.0, 0.75, 0.5, 0.25] {
        let color = if ring == 1.0 { AXIS } else { GRID };
        sheet.circle(centre, radius * ring, "none", Some(Stroke::new(color, 1.0)));
    }
    for spoke in 0..8 {
        let degrees = f64::from(spoke) * 45.0;
        sheet.line(centre, at(degrees, 1.0), Stroke::new(GRID, 1.0));
        let name = match spoke {
            0 => "forward",
            2 => "left",
            4 => "backward",
            6 => "right",
            _ => continue,
        };
        let [x, y] = at(degrees, 1.0);
        let (anchor, x, y) = match spoke {
            2 => (Anchor::End, x - 10.0, y + 4.0),
            6 => (Anchor::Start, x + 10.0, y + 4.0),
            4 => (Anchor::Middle, x, y + 22.0),
            _ => (Anchor::Middle, x, y - 11.0),
        };
        sheet.text([x, y], name, Text::new(NORMAL).anchor(anchor));
    }
    // Inner rings are labelled where the eye finds them first, the outer one outside, clear of the data.
    for (ring, label) in [(1.07, "100 %"), (0.5, "50 %")] {
        let [x, y] = at(-22.5, ring);
        let anchor = if ring > 1.0 { Anchor::Start } else { Anchor::Middle };
        sheet.text([x, y + 4.0], label, Text::new(SMALL - 1.0).color(MUTED).anchor(anchor));
    }
    // The first series is the one the figure is about: it is drawn last, on top.
    for (index, one) in series.iter().enumerate().rev() {
        let color = theme::series(index);
        let mut points: Vec<_> = one.points.iter().filter(|point| point.1.is_finite()).copied().collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let outline: Vec<_> = points.iter().map(|&(degrees, survival)| at(degrees.into(), survival)).collect();
        // Only one fill: several on top of each other are no colour of the legend.
        let fill = if index == 0 { 0.08 } else { 0.0 };
        sheet.polygon(&outline, color, fill, Some(Stroke::new(color, 2.2)));
        for point in outline {
            sheet.circle(point, 3.2, color, Some(Stroke::new("#ffffff", 1.0)));
        }
    }
    for (index, one) in series.iter().enumerate() {
        let y = 104.0 + index as f64 * 46.0;
        let fractions: Vec<f64> = one.points.iter().map(|point| point.1).collect();
        let worst = fractions.iter().copied().filter(|value| value.is_finite()).reduce(f64::min);
        let overall = crate::stats::mean(&fractions);
        sheet.line([566.0, y - 4.0], [586.0, y - 4.0], Stroke::new(theme::series(index), 3.5));
        sheet.text([594.0, y], &one.label, Text::new(NORMAL).bold());
        if let (Some(overall), Some(worst)) = (overall, worst) {
            let text = format!("{:.0} %, worst direction {:.0} %", overall * 100.0, worst * 100.0);
            sheet.text([594.0, y + 17.0], &text, Text::new(SMALL - 0.5).color(MUTED));
        }
    }
    sheet.finish()
}

/// Survival of one controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BarRow {
    /// The controller.
    pub label: String,
    /// How often it survived.
    pub survival: Proportion,
}

/// Survival with 95 % Wilson intervals, one bar per controller.
pub fn survival_bars(title: &str, rows: &[BarRow]) -> Figure {
    let row_height = 46.0;
    let widest = rows.iter().map(|row| width_of(&row.label, NORMAL) * BOLD).fold(0.0, f64::max);
    let (left, right, top) = ((widest + 28.0).clamp(140.0, 320.0), 600.0, 58.0);
    let bottom = top + rows.len() as f64 * row_height;
    let mut sheet = Sheet::new(760.0, bottom + 58.0);
    sheet.text([20.0, 30.0], title, Text::new(LARGE + 2.0).bold());
    let px = |fraction: f64| left + fraction * (right - left);
    for tick in 0..=4 {
        let fraction = f64::from(tick) / 4.0;
        sheet.line([px(fraction), top], [px(fraction), bottom], Stroke::new(GRID, 1.0));
        let label = Text::new(SMALL).color(MUTED).anchor(Anchor::Middle);
        sheet.text([px(fraction), bottom + 18.0], &format!("{:.0}", fraction * 100.0), label);
    }
    let axis = Text::new(NORMAL).anchor(Anchor::Middle);
    sheet.text([(left + right) / 2.0, bottom + 40.0], "survived episodes (%), with 95 % Wilson interval", axis);
    for (index, row) in rows.iter().enumerate() {
        let middle = top + (index as f64 + 0.5) * row_height;
        sheet.text([left - 12.0, middle + 4.5], &row.label, Text::new(NORMAL).bold().anchor(Anchor::End));
        let Some(interval) = wilson(row.survival) else { continue };
        sheet.rect([left, middle - 12.0], [px(interval.estimate) - left, 24.0], theme::series(index), 0.85);
        let whisker = Stroke::new(INK, 1.6);
        sheet.line([px(interval.low), middle], [px(interval.high), middle], whisker);
        for end in [interval.low, interval.high] {
            sheet.line([px(end), middle - 5.0], [px(end), middle + 5.0], whisker);
        }
        let Proportion { count, of } = row.survival;
        let text = format!("{:.0} %", interval.estimate * 100.0);
        sheet.text([right + 22.0, middle + 5.0], &text, Text::new(LARGE).bold());
        sheet.text([right + 76.0, middle + 5.0], &format!("{count} of {of}"), Text::new(SMALL).color(MUTED));
    }
    sheet.line([left, top], [left, bottom], Stroke::new(AXIS, 1.0));
    sheet.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forward_is_up_and_left_is_left() {
        let points = vec![(0.0, 1.0), (90.0, 1.0), (180.0, 1.0), (270.0, 1.0)];
        let svg = survival_polar("", &[PolarSeries { label: "x".into(), points }]).svg;
        assert!(svg.contains("<polygon points=\"290,78 94,274 290,470 486,274\""), "{svg}");
    }

    #[test]
    fn a_controller_without_episodes_has_no_bar() {
        let rows = [BarRow { label: "none".into(), survival: Proportion { count: 0, of: 0 } }];
        assert!(!survival_bars("", &rows).svg.contains("NaN"));
    }
}
