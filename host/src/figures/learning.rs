//! Figures 6 and 7: what training did, episode by episode.

use super::axes::{Panel, range};
use super::svg::{Sheet, Stroke, Text};
use super::theme::{self, INK, LARGE, MUTED, SMALL};
use super::{Figure, svg::Anchor};
use crate::stats::{mean, percentile};
use serde::{Deserialize, Serialize};

/// A quantity over episodes, one line per seed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Episodes.
    pub episodes: Vec<f64>,
    /// For each seed, a value for each episode; NaN where there is none.
    pub runs: Vec<Vec<f64>>,
}

impl Curve {
    /// A statistic across seeds, for each episode; NaN where no seed has a value.
    fn across(&self, statistic: impl Fn(&[f64]) -> Option<f64>) -> Vec<f64> {
        (0..self.episodes.len())
            .map(|at| {
                let values = self.runs.iter().filter_map(|run| run.get(at).copied()).filter(|value| value.is_finite());
                statistic(&values.collect::<Vec<_>>()).unwrap_or(f64::NAN)
            })
            .collect()
    }

    /// The same curve, each value the mean of up to `window` episodes that end there: what noise hides, this shows.
    pub fn smoothed(&self, window: usize) -> Self {
        let smooth = |run: &Vec<f64>| {
            (0..run.len())
                .map(|at| {
                    let recent = run[(at + 1).saturating_sub(window)..=at].iter().filter(|value| value.is_finite());
                    mean(&recent.copied().collect::<Vec<_>>()).unwrap_or(f64::NAN)
                })
                .collect()
        };
        Self { episodes: self.episodes.clone(), runs: self.runs.iter().map(smooth).collect() }
    }

    fn draw(
        &self,
        sheet: &mut Sheet,
        panel: &Panel,
        [low, middle, high]: [&[f64]; 3],
        color: &'static str,
        dashed: bool,
    ) {
        let band: Vec<[f64; 2]> = panel
            .points(&self.episodes, high)
            .into_iter()
            .chain(panel.points(&self.episodes, low).into_iter().rev())
            .filter(|point| point[1].is_finite())
            .collect();
        if self.runs.len() > 1 {
            sheet.polygon(&band, color, 0.15, None);
        }
        let stroke = Stroke::new(color, 2.2);
        sheet.polyline(&panel.points(&self.episodes, middle), if dashed { stroke.dash("6 5") } else { stroke });
    }
}

/// One trained parameter over episodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterCurve {
    /// Its name in Table I.
    pub symbol: String,
    /// Its unit, empty if it has none.
    pub unit: String,
    /// What it does, in a few words.
    pub what: String,
    /// Its values.
    pub curve: Curve,
}

/// Parameters over episodes, one panel each (figure 6): every seed thin, their mean thick, in a band from the least
/// to the greatest.
pub fn parameters(title: &str, parameters: &[ParameterCurve]) -> Figure {
    let panel_height = 118.0;
    let mut sheet = Sheet::new(760.0, 66.0 + parameters.len() as f64 * (panel_height + 36.0) + 34.0);
    sheet.text([20.0, 30.0], title, Text::new(LARGE + 2.0).bold());
    let caption = Text::new(SMALL).color(MUTED).anchor(Anchor::End);
    sheet.text([740.0, 30.0], "thin: seeds · thick: their mean · band: least to greatest", caption);
    let episodes = range(parameters.iter().flat_map(|one| one.curve.episodes.iter().copied()), 1.0);
    let last = episodes_end(parameters.iter().map(|one| &one.curve)).unwrap_or(episodes[1]);
    for (index, parameter) in parameters.iter().enumerate() {
        let curve = &parameter.curve;
        let values = curve.runs.iter().flatten().copied();
        let panel = Panel {
            origin: [76.0, 70.0 + index as f64 * (panel_height + 36.0)],
            size: [664.0, panel_height],
            x: [0.0, last.max(1.0)],
            y: range(values, 0.0),
        };
        let x_title = (index + 1 == parameters.len()).then_some("episode");
        let unit = if parameter.unit.is_empty() {
            parameter.symbol.clone()
        } else {
            format!("{} ({})", parameter.symbol, parameter.unit)
        };
        panel.frame(&mut sheet, "", x_title, &unit);
        let name = format!("{}  {}", parameter.symbol, parameter.what);
        sheet.text([panel.origin[0], panel.origin[1] - 8.0], &name, Text::new(SMALL + 1.0).bold());
        let color = theme::series(index);
        let [least, middle, greatest] = [
            curve.across(|values| percentile(values, 0.0)),
            curve.across(mean),
            curve.across(|values| percentile(values, 100.0)),
        ];
        for run in &curve.runs {
            sheet.polyline(&panel.points(&curve.episodes, run), Stroke::new(color, 1.0).opacity(0.45));
        }
        curve.draw(&mut sheet, &panel, [&least, &middle, &greatest], color, false);
    }
    sheet.finish()
}

/// Reward over episodes of one agent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RewardSeries {
    /// The agent, for instance `eNAF` or `paper's form`.
    pub label: String,
    /// Its reward in episodes with exploration noise.
    pub noisy: Curve,
    /// Its reward in episodes without.
    pub noise_free: Curve,
}

/// Reward over episodes (figure 7): median over seeds in a band of the middle half; solid without exploration noise,
/// dashed with. `y_title` says which reward.
pub fn rewards(title: &str, y_title: &str, series: &[RewardSeries]) -> Figure {
    let mut sheet = Sheet::new(760.0, 430.0);
    sheet.text([20.0, 30.0], title, Text::new(LARGE + 2.0).bold());
    let colored: Vec<_> = series.iter().enumerate().map(|(index, one)| (theme::series(index), one)).collect();
    let x =
        sheet.legend([76.0, 58.0], colored.iter().map(|(color, one)| (one.label.as_str(), Stroke::new(color, 3.0))));
    let kinds = [("no exploration noise", Stroke::new(INK, 2.0)), ("with", Stroke::new(INK, 2.0).dash("6 5"))];
    let kinds: Vec<_> =
        kinds.into_iter().take(if series.iter().any(|one| !one.noisy.runs.is_empty()) { 2 } else { 1 }).collect();
    sheet.legend([x + 10.0, 58.0], kinds);
    sheet.text(
        [740.0, 30.0],
        "median over seeds · band: middle half",
        Text::new(SMALL).color(MUTED).anchor(Anchor::End),
    );
    let curves = || series.iter().flat_map(|one| [&one.noise_free, &one.noisy]);
    let middle_half =
        |curve: &Curve| [25.0, 50.0, 75.0].map(|percent| curve.across(|values| percentile(values, percent)));
    let panel = Panel {
        origin: [76.0, 78.0],
        size: [664.0, 296.0],
        x: [0.0, episodes_end(curves()).unwrap_or(1.0).max(1.0)],
        y: range(curves().flat_map(middle_half).flatten(), 0.05),
    };
    panel.frame(&mut sheet, "", Some("episode"), y_title);
    panel.zero(&mut sheet);
    for (color, one) in colored {
        for (curve, dashed) in [(&one.noisy, true), (&one.noise_free, false)] {
            let [low, middle, high] = middle_half(curve);
            curve.draw(&mut sheet, &panel, [&low, &middle, &high], color, dashed);
        }
    }
    sheet.finish()
}

fn episodes_end<'a>(curves: impl Iterator<Item = &'a Curve>) -> Option<f64> {
    curves.flat_map(|curve| curve.episodes.iter().copied()).filter(|value| value.is_finite()).reduce(f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_without_seeds_draws_empty_axes() {
        let svg = rewards("Reward", "reward", &[]).svg;
        assert!(svg.contains("episode") && !svg.contains("NaN"));
    }

    #[test]
    fn holes_are_gaps_not_zeros() {
        let curve = Curve { episodes: vec![0.0, 1.0, 2.0], runs: vec![vec![1.0, f64::NAN, 3.0]] };
        assert!(curve.across(crate::stats::median)[1].is_nan());
        assert_eq!(curve.smoothed(2).runs[0], vec![1.0, 1.0, 3.0]);
    }
}
