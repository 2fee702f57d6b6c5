//! An evaluation study as tables and figures.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::balancer::Balancer;
use super::compare::{CellData, CellRow, DifferenceRow, DirectionRow, Measure, differences};
use super::plan::EvaluationPlan;
use super::report::{Pages, csv};
use crate::figures::{PushMap, SpreadRow, push_map, spreads};
use crate::metrics::{EpisodeResult, Outcome, by_direction};
use crate::report::{NamedFigure, Table, number};

/// So many arms are shown cell by cell.
const FEW_ARMS: usize = 3;

/// Tables and figures of the cells that are saved.
pub fn pages(plan: &EvaluationPlan, data: &[CellData]) -> Pages {
    let rows: Vec<CellRow> = data.iter().map(CellRow::of).collect();
    let directions: Vec<DirectionRow> = data.iter().flat_map(DirectionRow::of).collect();
    let differences = differences(data);
    let (table, against) = (cells_table(&rows), differences_table(&differences));
    let mut body = format!("## What each arm did\n\n{}\n", table.markdown());
    body.push_str(
        "Survival counts all episodes, with its 95 % Wilson interval; steps, drift (3 s after the push) and time until \
         quiet are medians (and 95th percentiles) of those survived. The worst direction is the one with the lowest \
         survival, among equals the one with the greatest drift.\n",
    );
    if !differences.is_empty() {
        let _ = write!(
            body,
            "\n## Against {}, on common pushes\n\n{}\nMean paired differences with 95 % bootstrap intervals; those \
             that exclude zero are bold. Drift and time until quiet compare the pairs in which both survived.\n",
            plan.arms[0].name,
            against.markdown()
        );
    }
    Pages {
        body,
        headline: table.text(),
        brief: rewards(plan, &rows, &differences)
            .or_else(|| brief(plan, &rows))
            .unwrap_or_else(|| table.terse(&["condition"]))
            .markdown(),
        tables: vec![("cells", csv(&rows)), ("directions", csv(&directions)), ("differences", csv(&differences))],
        figures: figures(plan, data),
        sets: vec![],
    }
}

fn impulse(impulse_n_s: Option<f32>) -> String {
    impulse_n_s.map_or_else(|| "own".into(), |impulse| impulse.to_string())
}

/// Where there are many conditions or arms, survival alone, a row for each of them; `None` where there are few.
fn brief(plan: &EvaluationPlan, rows: &[CellRow]) -> Option<Table> {
    let by_condition = plan.conditions.len() > 1;
    if !by_condition && plan.arms.len() <= FEW_ARMS {
        return None;
    }
    let label = |row: &CellRow| if by_condition { row.condition.clone() } else { row.arm.clone() };
    let column = |row: &CellRow| {
        let impulse = row.impulse_n_s.map_or_else(String::new, |impulse| format!("{impulse} N·s"));
        match by_condition && plan.arms.len() > 1 {
            true => format!("{impulse} {}", row.arm).trim().to_owned(),
            false if impulse.is_empty() => "survived".into(),
            false => impulse,
        }
    };
    let (mut labels, mut columns): (Vec<String>, Vec<String>) = (vec![], vec![]);
    for row in rows {
        for (seen, new) in [(&mut labels, label(row)), (&mut columns, column(row))] {
            if !seen.contains(&new) {
                seen.push(new);
            }
        }
    }
    let head = if by_condition { "survived" } else { "arm" };
    let line = |one: &String| {
        let cell = |name: &String| {
            let found = rows.iter().find(|row| label(row) == *one && column(row) == *name);
            found.map_or_else(|| number(None, 0), |row| format!("{}/{}", row.survived, row.episodes))
        };
        [one.clone()].into_iter().chain(columns.iter().map(cell)).collect()
    };
    let rows = labels.iter().map(line).collect();
    Some(Table { head: [head.to_owned()].into_iter().chain(columns.iter().cloned()).collect(), rows })
}

/// Where many arms meet scenarios with pushes of their own: what the first one earns, and what every other earns more, both
/// means, so that they add up.
fn rewards(plan: &EvaluationPlan, rows: &[CellRow], differences: &[DifferenceRow]) -> Option<Table> {
    if plan.arms.len() <= FEW_ARMS || rows.iter().any(|row| row.impulse_n_s.is_some()) {
        return None;
    }
    let conditions = plan.conditions.iter().map(|condition| &condition.name);
    let head = ["reward".to_owned()].into_iter().chain(conditions.clone().cloned()).collect();
    let line = |(index, arm): (usize, &Balancer)| {
        let cell = |condition: &String| match index {
            0 => {
                let found = rows.iter().find(|row| row.arm == arm.name && row.condition == *condition);
                number(found.and_then(|row| row.reward_gated_mean), 3)
            }
            _ => {
                let found = differences
                    .iter()
                    .find(|row| row.arm == arm.name && row.condition == *condition && row.measure == Measure::Reward);
                found.map_or_else(|| number(None, 0), |row| difference(row, 1.0, 3))
            }
        };
        [arm.name.clone()].into_iter().chain(conditions.clone().map(cell)).collect()
    };
    Some(Table { head, rows: plan.arms.iter().enumerate().map(line).collect() })
}

/// A difference with its interval, bold where zero is outside.
fn difference(row: &DifferenceRow, scale: f64, decimals: usize) -> String {
    let [difference, low, high] = [row.difference, row.low, row.high].map(|value| value * scale);
    let text = format!("{difference:+.decimals$} ({low:+.decimals$} … {high:+.decimals$})");
    if row.low > 0.0 || row.high < 0.0 { format!("**{text}**") } else { text }
}

fn cells_table(rows: &[CellRow]) -> Table {
    let head = [
        "condition",
        "N·s",
        "arm",
        "survived",
        "95 % interval",
        "worst direction",
        "steps/s",
        "drift (cm)",
        "quiet after (s)",
    ];
    let mut table = Table::new(head);
    let pair = |median: Option<f64>, p95: Option<f64>, scale: f64, decimals: usize| match median {
        Some(_) => format!(
            "{} ({})",
            number(median.map(|value| value * scale), decimals),
            number(p95.map(|value| value * scale), decimals)
        ),
        None => number(None, 0),
    };
    for row in rows {
        let spoilt = if row.invalid > 0 { format!(", {} invalid", row.invalid) } else { String::new() };
        let restless = if row.never_settled > 0 { format!(", {} never", row.never_settled) } else { String::new() };
        let worst = row.worst_direction_deg.zip(row.worst_direction_survival);
        table.row([
            row.condition.clone(),
            impulse(row.impulse_n_s),
            row.arm.clone(),
            format!("{:.1} % ({}/{}{spoilt})", row.survival * 100.0, row.survived, row.episodes),
            format!("{:.1} – {:.1} %", row.survival_low * 100.0, row.survival_high * 100.0),
            worst.map_or(number(None, 0), |(degrees, survival)| format!("{:.0} % at {degrees:.0}°", survival * 100.0)),
            number(row.steps_per_s_median, 2),
            pair(row.drift_3s_m_median, row.drift_3s_m_p95, 100.0, 1),
            pair(row.settle_s_median, row.settle_s_p95, 1.0, 2) + &restless,
        ]);
    }
    table
}

fn differences_table(rows: &[DifferenceRow]) -> Table {
    let mut table =
        Table::new(["condition", "N·s", "arm", "survival (points)", "drift (cm)", "quiet after (s)", "reward"]);
    let key = |row: &DifferenceRow| (row.condition.clone(), row.impulse_n_s, row.arm.clone());
    let mut seen = vec![];
    for row in rows {
        if seen.contains(&key(row)) {
            continue;
        }
        seen.push(key(row));
        let cell = |measure: Measure, scale: f64, decimals: usize| {
            let found = rows.iter().find(|other| key(other) == key(row) && other.measure == measure);
            found.map_or(number(None, 0), |found| difference(found, scale, decimals))
        };
        table.row([
            row.condition.clone(),
            impulse(row.impulse_n_s),
            row.arm.clone(),
            cell(Measure::Survival, 100.0, 1),
            cell(Measure::Drift, 100.0, 2),
            cell(Measure::Settle, 1.0, 2),
            cell(Measure::Reward, 1.0, 3),
        ]);
    }
    table
}

fn figures(plan: &EvaluationPlan, data: &[CellData]) -> Vec<NamedFigure> {
    let mut figures = vec![];
    for (index, condition) in plan.conditions.iter().enumerate() {
        let cells: Vec<&CellData> = data.iter().filter(|data| data.cell.condition == index).collect();
        let maps: Vec<PushMap> =
            plan.arms.iter().enumerate().map(|(arm, one)| map_of(&one.name, arm, &cells)).collect();
        if maps.iter().any(|map| !map.cells.is_empty()) {
            figures.push(NamedFigure {
                name: format!("push-map-{}", condition.name),
                caption: format!("{}: survival by direction and strength of the push", condition.name),
                figure: push_map(&condition.name, &maps),
            });
        }
        let drift = |result: &EpisodeResult| result.drift_3s_m.map(|metres| f64::from(metres) * 100.0);
        let settle = |result: &EpisodeResult| result.settle_s.map(f64::from);
        type Value<'a> = &'a dyn Fn(&EpisodeResult) -> Option<f64>;
        let kinds: [(&str, &str, &str, Value); 2] = [
            ("drift", "Drift", "distance of the trunk 3 s after the push (cm), episodes survived", &drift),
            ("settle", "Time until quiet", "from the push (s), episodes survived", &settle),
        ];
        for (name, title, axis, value) in kinds {
            let rows: Vec<SpreadRow> = cells.iter().map(|data| spread(data, value)).collect();
            if rows.iter().any(|row| !row.values.is_empty()) {
                figures.push(NamedFigure {
                    name: format!("{name}-{}", condition.name),
                    caption: format!("{}: {}", condition.name, title.to_lowercase()),
                    figure: spreads(&format!("{title}, {}", condition.name), axis, &rows),
                });
            }
        }
    }
    figures
}

fn map_of(label: &str, arm: usize, cells: &[&CellData]) -> PushMap {
    let of_arm = cells.iter().filter(|data| data.cell.arm == arm);
    // A scenario's own impulse is that of its pushes; one that draws them has no map.
    let mut by_impulse: BTreeMap<u32, Vec<EpisodeResult>> = BTreeMap::new();
    for result in of_arm.flat_map(|data| &data.results).filter(|result| result.direction_deg.is_some()) {
        by_impulse.entry(result.impulse_n_s.max(0.0).to_bits()).or_default().push(result.clone());
    }
    let cells = by_impulse.into_iter().flat_map(|(bits, results)| {
        by_direction(&results).into_iter().filter_map(move |direction| {
            Some((f32::from_bits(bits), direction.direction_deg, direction.survival.fraction()?))
        })
    });
    PushMap { label: label.into(), cells: cells.collect() }
}

fn spread(data: &CellData, value: &dyn Fn(&EpisodeResult) -> Option<f64>) -> SpreadRow {
    let survived = data.results.iter().filter(|result| result.outcome == Outcome::Survived);
    SpreadRow {
        label: format!("{}, {} N·s", data.arm, impulse(data.cell.impulse_n_s)),
        series: data.cell.arm,
        values: survived.filter_map(value).collect(),
    }
}
