//! The report of a study: tables and figures from what is saved, and from nothing else.

use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

use super::StudyError;
use super::plan::Plan;
use super::sittings::Sittings;
use super::unit::{Unit, load_training};
use super::{compare, pages_evaluation, pages_training};
use crate::report::NamedFigure;
use crate::run::{Layout, RunError, read_text, write_atomic};

/// What a study comes to.
pub struct Pages {
    /// Markdown, between title and origin.
    pub body: String,
    /// The main table as plain text.
    pub headline: String,
    /// What a document shows of it: one table, Markdown.
    pub brief: String,
    /// CSV by name.
    pub tables: Vec<(&'static str, String)>,
    /// Figures, each with its name.
    pub figures: Vec<NamedFigure>,
    /// Parameter files by name.
    pub sets: Vec<(String, String)>,
}

/// Rows as CSV, with every digit; holes are empty.
pub fn csv<T: Serialize>(rows: &[T]) -> String {
    let mut writer = csv::Writer::from_writer(vec![]);
    for row in rows {
        // Rows are flat and go to memory: nothing can fail.
        let _ = writer.serialize(row);
    }
    writer.into_inner().ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default()
}

/// The plan of a study folder.
pub fn read_plan(layout: &Layout) -> Result<Plan, StudyError> {
    let path = layout.config();
    if !layout.info().is_file() || !path.is_file() {
        return Err(StudyError::NoStudy(layout.root().to_path_buf()));
    }
    toml::from_str(&read_text(&path)?).map_err(|_| StudyError::NoStudy(layout.root().to_path_buf()))
}

/// Writes tables, figures and report of a study folder, prints its main table, and returns what a document shows of it.
pub fn write(layout: &Layout, plan: &Plan) -> Result<String, StudyError> {
    let sittings = Sittings::read(layout)?;
    let pages = match plan {
        Plan::Evaluation(of) => pages_evaluation::pages(of, &compare::load_cells(plan, of, layout)?),
        Plan::Training(of) => {
            let revision = sittings.revisions().join(", then ");
            pages_training::pages(of, &load_training(plan, of, layout)?, &revision)?
        }
    };
    let (tables, sets) = (layout.root().join("tables"), layout.root().join("params"));
    let figures = layout.figures();
    let folders = [&tables, &figures].into_iter().chain((!pages.sets.is_empty()).then_some(&sets));
    for folder in folders {
        std::fs::create_dir_all(folder).map_err(RunError::io("create", folder))?;
    }
    for (name, text) in &pages.tables {
        write_atomic(&tables.join(format!("{name}.csv")), text.as_bytes())?;
    }
    write_atomic(&tables.join("tables.md"), pages.body.as_bytes())?;
    for figure in &pages.figures {
        figure.figure.save(&figures, &figure.name)?;
    }
    for (name, text) in &pages.sets {
        write_atomic(&sets.join(format!("{name}.toml")), text.as_bytes())?;
    }
    let text = markdown(layout, plan, &pages, &sittings);
    write_atomic(&layout.report(), text.as_bytes())?;
    println!("{}\n\n{}", plan.title(), pages.headline);
    println!("report: {}", layout.report().display());
    let revisions: Vec<String> = sittings.revisions().iter().map(|revision| short(revision)).collect();
    Ok(format!("{}\n*{}: {}, revision {}.*", pages.brief, plan.title(), origin(&sittings), revisions.join(", then ")))
}

fn markdown(layout: &Layout, plan: &Plan, pages: &Pages, sittings: &Sittings) -> String {
    let mut text = format!("# {}\n\n", plan.title());
    let units = Unit::all(plan);
    let done = units.iter().filter(|unit| unit.done(plan, layout)).count();
    // Writing to a string cannot fail; so throughout.
    if done < units.len() {
        let _ = writeln!(text, "**Not finished: {done} of {} units are done.**\n", units.len());
    }
    text.push_str(&pages.body);
    if !pages.figures.is_empty() {
        text.push_str("\n## Figures\n\n");
    }
    for NamedFigure { name, caption, .. } in &pages.figures {
        let _ = writeln!(text, "![{caption}](figures/{name}.png)\n\n*{caption}*\n");
    }
    let _ = writeln!(text, "\n## Seeds\n\n{}\n", split(plan));
    let _ = writeln!(
        text,
        "## Origin\n\nRevision {}; {} sitting(s), together {}. `config.toml` is the study as resolved, `tables/` has every \
         number, `evaluated/` every episode.",
        sittings.revisions().join(", then "),
        sittings.all().count(),
        origin(sittings),
    );
    text
}

/// A revision as people write it, with what is said after it.
fn short(revision: &str) -> String {
    let hash = revision.chars().take_while(char::is_ascii_hexdigit).count();
    revision.chars().take(hash.min(7)).chain(revision.chars().skip(hash)).collect()
}

/// How long it took, on what.
fn origin(sittings: &Sittings) -> String {
    let cores = sittings.all().map(|sitting| sitting.cores).max().unwrap_or(0);
    format!("{} on {cores} core(s)", duration(sittings.wall_s()))
}

/// Who sees which seeds.
fn split(plan: &Plan) -> String {
    let judged = "Nobody is judged on what anything was trained, validated or tuned on: training and tuning take seeds \
                  below 2^44, validation of sessions from 2^59, judging by `sarah train` from 2^60";
    match plan {
        Plan::Evaluation(plan) => format!(
            "{judged}; the pushes and sensor errors here are those of seed 2^61 + {}, the same for every arm, and \
             robots that differ from episode to episode are drawn from 2^62 + {}·2^20 on, the same for every arm and \
             impulse.",
            plan.seed, plan.seed
        ),
        Plan::Training(plan) => format!(
            "{judged}; arms trained here with seeds {} to {}, and are judged on the pushes and sensor errors of seed \
             2^61 + {}, the same for every arm and seed.",
            plan.seed,
            plan.seed + plan.seeds - 1,
            plan.seed
        ),
    }
}

fn duration(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    match seconds {
        0..120 => format!("{seconds} s"),
        120..7200 => format!("{} min", seconds.div_ceil(60)),
        _ => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

/// Writes the report of a study folder again; what a document shows of it.
pub fn again(folder: &Path) -> Result<String, StudyError> {
    let layout = Layout::new(folder);
    let plan = read_plan(&layout)?;
    write(&layout, &plan)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_has_names_every_digit_and_holes() {
        #[derive(Serialize)]
        struct Row {
            arm: &'static str,
            survival: Option<f64>,
        }
        let rows = [Row { arm: "a", survival: Some(1.0 / 3.0) }, Row { arm: "b", survival: None }];
        assert_eq!(csv(&rows), "arm,survival\na,0.3333333333333333\nb,\n");
    }

    #[test]
    fn a_revision_is_cut_to_seven_digits_and_keeps_its_remark() {
        let hash = "dec46cd5a958f5fc2283a72f8895585e0766659f";
        assert_eq!(short(hash), "dec46cd");
        assert_eq!(short(&format!("{hash} with uncommitted changes")), "dec46cd with uncommitted changes");
        assert_eq!(short("unknown"), "unknown");
    }

    #[test]
    fn durations_are_as_people_say_them() {
        assert_eq!([59.6, 121.0, 7380.0].map(duration), ["60 s", "3 min", "2 h 3 min"]);
    }
}
