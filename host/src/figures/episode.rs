//! Figures 8 and 9: one episode over time.

use super::Figure;
use super::axes::{Panel, range};
use super::svg::{Anchor, Sheet, Stroke, Text, width_of};
use super::theme::{self, LARGE, MUTED, PUSH, SMALL, SPAN};
use crate::metrics::Trace;
use serde::{Deserialize, Serialize};

/// The push of an episode.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Push {
    /// When, s.
    pub at_s: f32,
    /// Where to, degrees from forward to the left.
    pub direction_deg: f32,
    /// How hard, N·s.
    pub impulse_n_s: f32,
}

const LEFT: f64 = 76.0;
const WIDTH: f64 = 664.0;
/// A foot that carries less than this is in the air, N: the limit at which the LPGs call a foot loaded.
const LOADED_N: f32 = 15.0;

/// Trunk x, y and z over time, with the push, the steps and which foot carries (figure 8).
pub fn trunk(title: &str, trace: &Trace, push: Option<Push>) -> Figure {
    let mut sheet = Sheet::new(760.0, 552.0);
    sheet.text([20.0, 30.0], title, Text::new(LARGE + 2.0).bold());
    let caption = Text::new(SMALL).color(MUTED).anchor(Anchor::End);
    sheet.text([740.0, 30.0], "shaded: one foot swings, the other carries", caption);
    let time = times(trace);
    let x_range = span(&time);
    let names = [("x  forward", "x (cm)"), ("y  left", "y (cm)"), ("z  height", "z (cm)")];
    let panels: Vec<Panel> = (0..3)
        .map(|axis| {
            let values = trace.samples.iter().map(|sample| f64::from(sample.trunk_m[axis]) * 100.0);
            Panel {
                origin: [LEFT, 66.0 + axis as f64 * 136.0],
                size: [WIDTH, 106.0],
                x: x_range,
                y: range(values, 4.0),
            }
        })
        .collect();
    let feet_top = 66.0 + 3.0 * 136.0 - 8.0;
    let steps = air_spans(trace);
    for panel in &panels {
        for &(_, from, to) in &steps {
            let (from, to) = (panel.px(from), panel.px(to));
            sheet.rect([from, panel.origin[1]], [to - from, panel.size[1]], SPAN, 1.0);
        }
    }
    for (axis, panel) in panels.iter().enumerate() {
        panel.frame(&mut sheet, "", None, names[axis].1);
        panel.zero(&mut sheet);
        sheet.text([LEFT, panel.origin[1] - 7.0], names[axis].0, Text::new(SMALL + 1.0).bold());
        let values: Vec<f64> = trace.samples.iter().map(|sample| f64::from(sample.trunk_m[axis]) * 100.0).collect();
        sheet.polyline(&panel.points(&time, &values), Stroke::new(theme::series(axis), 2.0));
    }
    mark_push(&mut sheet, &panels, names[0].0, push);
    // Which foot carries, as in gait diagrams: a bar while it does.
    let feet = Panel { origin: [LEFT, feet_top], size: [WIDTH, 34.0], x: x_range, y: [0.0, 2.0] };
    for (row, name) in [(0, "left foot"), (1, "right foot")] {
        let y = feet_top + 5.0 + f64::from(row) * 15.0;
        sheet.text([LEFT - 8.0, y + 9.0], name, Text::new(SMALL - 1.0).color(MUTED).anchor(Anchor::End));
        let mut from = x_range[0];
        for &(_, lift, touch) in steps.iter().filter(|step| step.0 == row as usize) {
            sheet.rect([feet.px(from), y], [(feet.px(lift) - feet.px(from)).max(0.0), 10.0], MUTED, 0.75);
            from = touch;
        }
        sheet.rect([feet.px(from), y], [(feet.px(x_range[1]) - feet.px(from)).max(0.0), 10.0], MUTED, 0.75);
    }
    time_axis(&mut sheet, &feet);
    sheet.finish()
}

/// Accelerometer and gyro over time (figure 9).
pub fn imu(title: &str, trace: &Trace, push: Option<Push>) -> Figure {
    let mut sheet = Sheet::new(760.0, 508.0);
    sheet.text([20.0, 30.0], title, Text::new(LARGE + 2.0).bold());
    let time = times(trace);
    let axes = ["x  forward", "y  left", "z  up"];
    let legend: Vec<_> =
        axes.iter().enumerate().map(|(axis, name)| (*name, Stroke::new(theme::series(axis), 3.0))).collect();
    let mut panels = Vec::new();
    for (row, (name, unit)) in [("Accelerometer", "m/s²"), ("Gyro", "rad/s")].into_iter().enumerate() {
        let values = |axis: usize| -> Vec<f64> {
            let of =
                |sample: &crate::metrics::TraceSample| if row == 0 { sample.accel_m_s2 } else { sample.gyro_rad_s };
            trace.samples.iter().map(|sample| f64::from(of(sample)[axis])).collect()
        };
        let panel = Panel {
            origin: [LEFT, 66.0 + row as f64 * 206.0],
            size: [WIDTH, 168.0],
            x: span(&time),
            y: range((0..3).flat_map(values), 0.5),
        };
        panel.frame(&mut sheet, "", None, unit);
        panel.zero(&mut sheet);
        sheet.text([LEFT, panel.origin[1] - 8.0], name, Text::new(SMALL + 1.0).bold());
        for axis in 0..3 {
            sheet.polyline(&panel.points(&time, &values(axis)), Stroke::new(theme::series(axis), 1.4).opacity(0.9));
        }
        panels.push(panel);
    }
    sheet.legend([480.0, 30.0], legend);
    mark_push(&mut sheet, &panels, "Accelerometer", push);
    time_axis(&mut sheet, &panels[1]);
    sheet.finish()
}

fn times(trace: &Trace) -> Vec<f64> {
    trace.samples.iter().map(|sample| f64::from(sample.t_s)).collect()
}

fn span(time: &[f64]) -> [f64; 2] {
    match (time.first(), time.last()) {
        (Some(&first), Some(&last)) if last > first => [first, last],
        _ => [0.0, 1.0],
    }
}

/// Swing phases: which foot (0 left, 1 right), from when, to when (s). Both feet in the air is a drop, not a step;
/// contacts that break for less than three hundredths of a second are chatter.
fn air_spans(trace: &Trace) -> Vec<(usize, f64, f64)> {
    let mut spans = Vec::new();
    for foot in 0..2 {
        let mut since = None;
        for sample in &trace.samples {
            let force = |foot: usize| sample.pads_n[2 * foot] + sample.pads_n[2 * foot + 1];
            let swings = force(foot) < LOADED_N && force(1 - foot) >= LOADED_N;
            let now = f64::from(sample.t_s);
            match (swings, since) {
                (true, None) => since = Some(now),
                (false, Some(from)) => {
                    spans.push((foot, from, now));
                    since = None;
                }
                _ => {}
            }
        }
    }
    spans.retain(|&(_, from, to)| to - from >= 0.03);
    spans
}

fn mark_push(sheet: &mut Sheet, panels: &[Panel], title: &str, push: Option<Push>) {
    let (Some(push), Some(first)) = (push, panels.first()) else { return };
    for panel in panels {
        let x = panel.px(push.at_s.into());
        sheet.line([x, panel.origin[1]], [x, panel.bottom()], Stroke::new(PUSH, 1.4).dash("4 3"));
    }
    let label = format!("push {:.0} N·s, {:.0}°", push.impulse_n_s, push.direction_deg);
    let style = Text::new(SMALL).color(PUSH).bold();
    // On its line, unless it would run into the panel's title there or out of the panel.
    let half = width_of(&label, SMALL) / 2.0 + 4.0;
    let least = first.origin[0] + width_of(title, SMALL + 1.0) + 16.0 + half;
    let x = first.px(push.at_s.into()).max(least).min(first.right() - half);
    sheet.text([x, first.origin[1] - 7.0], &label, style.anchor(Anchor::Middle));
}

/// Tick labels and title of the shared time axis, below the lowest panel.
fn time_axis(sheet: &mut Sheet, lowest: &Panel) {
    for tick in super::axes::ticks(lowest.x, 8.0) {
        let label = format!("{}", (tick * 100.0).round() / 100.0);
        let at = [lowest.px(tick), lowest.bottom() + 20.0];
        sheet.text(at, &label, Text::new(SMALL).color(MUTED).anchor(Anchor::Middle));
    }
    let middle = [lowest.origin[0] + lowest.size[0] / 2.0, lowest.bottom() + 40.0];
    sheet.text(middle, "time (s)", Text::new(theme::NORMAL).anchor(Anchor::Middle));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::TraceSample;

    #[test]
    fn a_swing_is_one_foot_in_the_air_while_the_other_carries() {
        let sample = |t_s: f32, left: f32, right: f32| TraceSample {
            t_s,
            pads_n: [left, left, right, right],
            ..TraceSample::default()
        };
        let samples = vec![
            sample(0.0, 0.0, 0.0),
            sample(0.1, 80.0, 80.0),
            sample(0.2, 0.0, 160.0),
            sample(0.3, 0.0, 160.0),
            sample(0.4, 80.0, 80.0),
            sample(0.5, 80.0, 80.0),
        ];
        let spans = air_spans(&Trace { samples });
        assert_eq!(spans.len(), 1);
        assert_eq!(spans[0].0, 0);
        assert!((spans[0].1 - 0.2).abs() < 1e-6 && (spans[0].2 - 0.4).abs() < 1e-6);
    }

    #[test]
    fn an_empty_trace_draws_empty_axes() {
        assert!(!trunk("", &Trace::default(), None).svg.contains("NaN"));
        assert!(!imu("", &Trace::default(), None).svg.contains("NaN"));
    }
}
