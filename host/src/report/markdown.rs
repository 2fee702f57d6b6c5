//! `report.md`.

use super::table::{Table, comparison, number};
use super::{NamedFigure, RunReport, Verdict};
use crate::stats::mean;
use sarah_protocol::params::SPECS;
use sarah_sim::energy::{PAPER_MIXED_H, PAPER_STANDBY_H};
use std::fmt::Write;

/// The report as Markdown. `config` is the text of `config.toml`; figures are embedded by relative path, so they
/// must lie in `figures/` beside the report.
pub fn markdown(report: &RunReport, config: &str, figures: &[NamedFigure]) -> String {
    let mut text = String::from("# Report\n\n");
    let embed = |text: &mut String, wanted: &dyn Fn(&str) -> bool| {
        for figure in figures.iter().filter(|figure| wanted(&figure.name)) {
            // Writing to a string cannot fail; so throughout.
            let _ = writeln!(text, "![{0}](figures/{1}.png)\n\n*{0}*\n", figure.caption, figure.name);
        }
    };
    embed(&mut text, &|name| name == "robot");
    for evaluation in &report.evaluations {
        let _ = writeln!(text, "## {}\n\n{}", evaluation.title, comparison(evaluation).markdown());
        rewards(&mut text, evaluation);
    }
    if !report.evaluations.is_empty() {
        text.push_str(
            "Survival counts all episodes, with the Wilson interval; steps, drift, time until quiet and energy are \
             medians of those survived. All controllers met the same pushes. Invalid episodes (numbers that are not \
             finite, a solver blow-up) are not counted as survived and not averaged in.\n\n",
        );
    }
    embed(&mut text, &|name| name.starts_with("survival"));
    sessions(&mut text, report);
    embed(&mut text, &|name| name.starts_with("fig7"));
    parameters(&mut text, report);
    embed(&mut text, &|name| name.starts_with("fig6"));
    if report.episode.is_some() {
        text.push_str("## An episode\n\n");
    }
    embed(&mut text, &|name| name.starts_with("fig8") || name.starts_with("fig9"));
    origin(&mut text, report, config);
    text
}

fn rewards(text: &mut String, evaluation: &super::Evaluation) {
    let mut table =
        Table::new(["controller", "reward, paper (eq. 5)", "reward, gated", "autonomy, mixed (h)", "standby (h)"]);
    for summary in evaluation.controllers.iter().map(|one| &one.summary) {
        table.row([
            summary.controller.clone(),
            number(summary.reward_paper, 4),
            number(summary.reward_gated, 4),
            number(summary.autonomy.map(|autonomy| autonomy.mixed_h), 1),
            number(summary.autonomy.map(|autonomy| autonomy.standby_h), 1),
        ]);
    }
    let paper = [PAPER_MIXED_H, PAPER_STANDBY_H].map(|hours| number(Some(hours), 1));
    let [mixed, standby] = paper;
    table.row(["paper (estimate)".into(), "–".into(), "–".into(), mixed, standby]);
    let _ = writeln!(text, "{}", table.markdown());
}

fn sessions(text: &mut String, report: &RunReport) {
    if report.sessions.is_empty() {
        return;
    }
    let mut table =
        Table::new(["session", "learner", "seeds", "reward at start", "trained", "paired difference", "verdict"]);
    for session in &report.sessions {
        for learner in &session.learners {
            let difference = learner.difference.map_or("–".into(), |difference| {
                format!("{:+.4} ({:+.4} to {:+.4})", difference.estimate, difference.low, difference.high)
            });
            let verdict = match learner.verdict() {
                Verdict::Learned => "learned",
                Verdict::Undecided => "no difference shown",
                Verdict::Worse => "worse than its start",
            };
            table.row([
                format!(
                    "{} ({}, {} episodes, {} reward)",
                    session.session, session.what, session.episodes, session.reward
                ),
                learner.learner.clone(),
                format!("{} × {}", learner.seeds, learner.evaluated / learner.seeds.max(1)),
                number(learner.start, 4),
                number(learner.trained, 4),
                difference.replace('-', "−"),
                verdict.into(),
            ]);
        }
    }
    let _ = writeln!(text, "## What each session learned\n\n{}", table.markdown());
    text.push_str(
        "Rewards are interquartile means over all seeds and evaluation episodes (seeds × episodes); differences are \
         means of pairs on common pushes with a 95 % bootstrap interval that draws seeds and pushes. A session \
         learned if that interval lies above zero.\n\n",
    );
    for session in &report.sessions {
        let of = |verdict: Verdict| {
            let names = session.learners.iter().filter(|learner| learner.verdict() == verdict);
            names.map(|learner| learner.learner.as_str()).collect::<Vec<_>>().join("; ")
        };
        let _ = match (of(Verdict::Learned), of(Verdict::Worse)) {
            (learned, worse) if learned.is_empty() && worse.is_empty() => {
                writeln!(text, "- Session {}: no learner was shown to beat its start.", session.session)
            }
            (learned, worse) => writeln!(
                text,
                "- Session {}: learned: {}{}.",
                session.session,
                if learned.is_empty() { "none" } else { &learned },
                if worse.is_empty() { String::new() } else { format!("; worse than its start: {worse}") },
            ),
        };
    }
    text.push('\n');
}

fn parameters(text: &mut String, report: &RunReport) {
    if report.parameters.is_empty() {
        return;
    }
    let mut table =
        Table::new(["parameter", "what", "unit", "start", "trained, mean over seeds", "chosen", "paper, Table II"]);
    for row in &report.parameters {
        let average = mean(&row.trained);
        let spread = average.and_then(|average| {
            let squares: f64 = row.trained.iter().map(|value| (value - average).powi(2)).sum();
            (row.trained.len() > 1).then(|| (squares / (row.trained.len() - 1) as f64).sqrt())
        });
        let paper = SPECS.iter().find(|spec| spec.symbol == row.symbol);
        table.row([
            row.symbol.clone(),
            row.what.clone(),
            row.unit.clone(),
            number(Some(row.start), 4),
            format!("{} ± {}", number(average, 4), number(spread, 4)),
            number(Some(row.chosen), 4),
            paper.map_or("–".into(), |spec| format!("{:.2} ± {:.2}", spec.table_ii, spec.table_ii_spread)),
        ]);
    }
    let _ = writeln!(text, "## Parameters, beside Table II\n\n{}", table.markdown());
    text.push_str(
        "The paper gives no units, and its robot is another one: its column is for the record, the numbers are not \
         comparable. ± is the standard deviation over seeds.\n\n",
    );
}

fn origin(text: &mut String, report: &RunReport, config: &str) {
    let info = &report.info;
    let revision = match (&info.revision, info.dirty) {
        (Some(revision), Some(true)) => format!("`{revision}`, with uncommitted changes"),
        (Some(revision), _) => format!("`{revision}`"),
        (None, _) => "unknown".into(),
    };
    let seeds: Vec<String> = info.seeds.iter().map(u64::to_string).collect();
    // The program's own path says nothing to others.
    let command: Vec<&str> = info.command.iter().skip(1).map(String::as_str).collect();
    let _ = writeln!(
        text,
        "## Origin\n\nRevision {revision}; version {}; seeds {}; begun {}.\n\nTo reproduce, at that revision:\n\n```sh\n\
         cargo sarah {}\n```\n\nConfiguration, as resolved:\n\n```toml\n{}\n```",
        info.version,
        seeds.join(", "),
        info.started,
        command.join(" "),
        config.trim_end(),
    );
}

#[cfg(test)]
mod tests {
    use super::super::{ControllerReport, Evaluation, LearnerReport, ParameterRow, SessionReport, draw_figures};
    use super::*;
    use crate::run::{FORMAT, RunInfo};

    fn report() -> RunReport {
        let learner = |name: &str, gain: f64| {
            let rewards = |gain: f64| -> Vec<Vec<Option<f64>>> {
                (0..5).map(|_| (0..50).map(|reward| Some(f64::from(reward) + gain)).collect()).collect()
            };
            LearnerReport::new(name, &rewards(0.0), &rewards(gain), 1).unwrap()
        };
        RunReport {
            info: RunInfo {
                format: FORMAT,
                version: "0.1.0".into(),
                revision: Some("abc".into()),
                dirty: Some(true),
                seeds: vec![1, 2],
                command: vec!["/somewhere/sarah".into(), "train".into(), "--quick".into()],
                started: "2020-01-01T00:00:00Z".into(),
            },
            evaluations: vec![Evaluation {
                title: "push-grid, 24 N·s".into(),
                controllers: vec![ControllerReport::new("trained", "push-grid", &[])],
            }],
            sessions: vec![SessionReport {
                session: 1,
                what: "LPG1, P1–P3".into(),
                episodes: 60,
                reward: "gated".into(),
                learners: vec![learner("eNAF", 1.0), learner("eNAF, paper's form", 0.0)],
            }],
            parameters: vec![ParameterRow {
                symbol: "P1".into(),
                unit: "m/s".into(),
                what: "kick".into(),
                start: 0.5,
                trained: vec![0.1, 0.2],
                chosen: 0.15,
            }],
            episode: None,
        }
    }

    #[test]
    fn says_who_learned_and_how_to_do_it_again() {
        let report = report();
        let text = markdown(&report, "episodes = 60\n", &draw_figures(&report, &[]));
        for part in [
            "## push-grid, 24 N·s",
            "figures/survival.png",
            "Session 1: learned: eNAF.",
            "no difference shown",
            "+1.0000",
            "0.1500 ± 0.0707",
            "1.81 ± 0.05",
            "with uncommitted changes",
            "cargo sarah train --quick",
            "episodes = 60",
        ] {
            assert!(text.contains(part), "lacks {part:?}:\n{text}");
        }
        assert!(!text.contains("NaN") && !text.contains("/somewhere"));
    }

    #[test]
    fn survives_the_file() {
        let json = serde_json::to_string(&report()).unwrap();
        assert_eq!(serde_json::from_str::<RunReport>(&json).unwrap(), report());
    }
}
