//! Tables, for the terminal and for Markdown, from the same cells.

use super::Evaluation;
use crate::metrics::Summary;
use std::fmt::Write;

/// A table of text. The first column is words, the others are numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Table {
    pub head: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new<const N: usize>(head: [&str; N]) -> Self {
        Self { head: head.map(String::from).to_vec(), rows: Vec::new() }
    }

    pub(crate) fn row<const N: usize>(&mut self, cells: [String; N]) {
        self.rows.push(cells.to_vec());
    }

    /// Without the columns that say nothing: those named in `same` whose rows are all alike, and those that are all empty.
    pub(crate) fn terse(&self, same: &[&str]) -> Self {
        let says = |column: &usize| {
            let cells = || self.rows.iter().filter_map(|row| row.get(*column));
            let alike = cells().all(|cell| Some(cell) == cells().next());
            !(alike && same.contains(&self.head[*column].as_str()) || cells().all(|cell| cell == NONE))
        };
        let columns: Vec<usize> = (0..self.head.len()).filter(says).collect();
        let of = |cells: &Vec<String>| columns.iter().filter_map(|column| cells.get(*column).cloned()).collect();
        Self { head: of(&self.head), rows: self.rows.iter().map(of).collect() }
    }

    pub(crate) fn markdown(&self) -> String {
        let line = |cells: &[String]| {
            let cells: Vec<_> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let rule = self.head.iter().enumerate().map(|(column, _)| if column == 0 { "---|" } else { "---:|" });
        let rule: String = rule.collect();
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("{}|{rule}\n{rows}", line(&self.head))
    }

    /// Aligned columns, two spaces apart.
    pub(crate) fn text(&self) -> String {
        let width = |column: usize| {
            let cells = self.rows.iter().chain([&self.head]).filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.head.len()).map(width).collect();
        let line = |cells: &[String]| {
            let mut text = String::new();
            for (column, (cell, &width)) in cells.iter().zip(&widths).enumerate() {
                // Writing to a string cannot fail.
                let _ = match column {
                    0 => write!(text, "{cell:<width$}"),
                    _ => write!(text, "  {cell:>width$}"),
                };
            }
            text.trim_end().to_owned() + "\n"
        };
        let rule = "─".repeat(widths.iter().sum::<usize>() + 2 * widths.len().saturating_sub(1));
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("{}{rule}\n{rows}", line(&self.head))
    }
}

/// The comparison of an evaluation, cell by cell.
pub(super) fn comparison(evaluation: &Evaluation) -> Table {
    let mut table = Table::new([
        "controller",
        "survived",
        "95 % interval",
        "steps/s",
        "drift in 3 s (cm)",
        "quiet after (s)",
        "energy (J)",
        "worst direction",
    ]);
    for Summary {
        controller,
        survived,
        episodes,
        survival,
        survival_ci: [low, high],
        invalid,
        steps_per_s,
        drift_3s_m,
        settle_s,
        energy_j,
        worst_direction_deg,
        ..
    } in evaluation.controllers.iter().map(|one| &one.summary)
    {
        let spoilt = if *invalid > 0 { format!(", {invalid} invalid") } else { String::new() };
        table.row([
            controller.clone(),
            format!("{:.1} % ({survived}/{episodes}{spoilt})", survival * 100.0),
            format!("{:.1} – {:.1} %", low * 100.0, high * 100.0),
            number(steps_per_s.median, 2),
            number(drift_3s_m.median.map(|metres| metres * 100.0), 1),
            number(settle_s.median, 2),
            number(energy_j.median, 0),
            worst_direction_deg.map_or(NONE.into(), |degrees| format!("{degrees:.0}°")),
        ]);
    }
    table
}

/// The headline as plain aligned text, for the end of `sarah train`.
pub fn headline(evaluation: &Evaluation) -> String {
    format!("{}\n\n{}", evaluation.title, comparison(evaluation).text())
}

const NONE: &str = "–";

/// A number, or a dash where there is none.
pub(crate) fn number(value: Option<f64>, decimals: usize) -> String {
    value.filter(|value| value.is_finite()).map_or(NONE.into(), |value| format!("{value:.decimals$}"))
}

#[cfg(test)]
mod tests {
    use super::super::ControllerReport;
    use super::*;

    #[test]
    fn the_headline_is_aligned_and_has_dashes_where_nothing_was_measured() {
        let controllers = ["trained", "braked"].map(|name| ControllerReport::new(name, "push-grid", &[])).to_vec();
        let text = headline(&Evaluation { title: "push-grid, 24 N·s".into(), controllers });
        assert!(text.starts_with("push-grid, 24 N·s\n\ncontroller"), "{text}");
        let widths: Vec<_> = text.lines().skip(2).map(|line| line.chars().count()).collect();
        assert!(widths.iter().all(|&width| width == widths[0]), "{text}");
        assert!(text.contains("0/0") && text.contains('–') && !text.contains("NaN"));
    }

    #[test]
    fn a_terse_table_has_no_column_that_says_nothing() {
        let mut table = Table::new(["session", "arm", "start", "modulation"]);
        for arm in ["a", "b"] {
            table.row(["knee".into(), arm.into(), "0.2".into(), number(None, 3)]);
        }
        assert_eq!(table.terse(&["session"]).head, ["arm", "start"]);
        table.row(["hip".into(), "c".into(), "0.2".into(), number(Some(0.1), 3)]);
        assert_eq!(table.terse(&["session"]), table);
    }
}
