//! The thirteen parameters in force, and what is staged and stored beside them.

use ratatui::text::Line;
use sarah_protocol::host::Which;
use sarah_protocol::params::SPECS;

use super::super::attention::Level;
use super::super::sets::Known;
use super::super::state::Dashboard;
use super::super::text::{cut, duration, slider, value};
use super::super::view::{DIM, style};

/// From this width on staged and stored values have columns of their own.
const COLUMNS: usize = 62;
/// Widest unit of [`SPECS`].
const UNIT: usize = 11;
/// Widest scale.
const SCALE: usize = 12;
/// Less of a meaning than this means nothing.
const SHORTEST: usize = 15;

pub(super) fn lines(dashboard: &Dashboard, now_us: u64, width: usize, rows: usize) -> Vec<Line<'static>> {
    let known = |which| dashboard.sets.get(which);
    let (staged, stored) = (known(Which::Staged), known(Which::Stored));
    let room = rows.saturating_sub(SPECS.len());
    let Some(applied) = known(Which::Applied) else {
        let mut lines = sets(dashboard, now_us, width, room);
        lines.push(Line::styled(" values not read yet", DIM));
        return lines;
    };
    // Columns for the other sets are worth their room only if they are not all the same.
    let others = [staged, stored].iter().any(|set| set.is_some_and(|set| set.values != applied.values));
    let columns = others && width >= COLUMNS;
    let heading = columns && room > 1;
    let mut lines = sets(dashboard, now_us, width, room - usize::from(heading));
    if heading {
        lines.push(Line::styled(format!("     {:>8} {:>8} {:>8}", "applied", "staged", "stored"), DIM));
    }
    for (index, spec) in SPECS.iter().enumerate() {
        let now = applied.values[index];
        let mut line = format!(" {:<3} {:>8}", spec.symbol, value(now));
        if columns {
            line += &format!(" {:>8} {:>8}", other(staged, index, now), other(stored, index, now));
        }
        line += &format!(" {:<UNIT$} ", spec.unit);
        let place = (now - spec.min) / (spec.max - spec.min);
        let scale = width.saturating_sub(line.chars().count() + 2).min(SCALE);
        line += &slider(place, scale);
        let differs = |set: Option<&Known>| set.is_some_and(|set| set.values[index] != now);
        line += if differs(staged) || differs(stored) { " ≠" } else { "  " };
        let room = width.saturating_sub(line.chars().count());
        if room > SHORTEST {
            line += &cut(&format!(" {}", spec.meaning), room);
        }
        lines.push(Line::raw(line));
    }
    lines
}

/// A value of another set; an equals sign where it is the applied one.
fn other(set: Option<&Known>, index: usize, applied: f32) -> String {
    match set.map(|set| set.values[index]) {
        None => String::new(),
        Some(same) if same == applied => "=".into(),
        Some(differs) => value(differs),
    }
}

/// Applied is not staged is not stored: in as many lines as there are.
fn sets(dashboard: &Dashboard, now_us: u64, width: usize, rows: usize) -> Vec<Line<'static>> {
    let (generation, age, stale) = match &dashboard.telemetry {
        Some((at, telemetry)) => {
            let age_us = (u64::from(telemetry.generation_age_ms) * 1000).saturating_add(now_us.saturating_sub(*at));
            (telemetry.generation.to_string(), format!("for {}", duration(age_us)), telemetry.stale)
        }
        None => ("?".into(), String::new(), false),
    };
    let level = style(if stale { Level::Notice } else { Level::Calm });
    let (staged, stored) = (dashboard.sets.get(Which::Staged), dashboard.sets.differing(Which::Stored));
    if rows < 2 {
        let staged = staged.map_or("-".into(), |staged| staged.generation.to_string());
        let stored = stored.map_or("?", |count| if count == 0 { "=" } else { "≠" });
        let stale = if stale { " STALE" } else { "" };
        return vec![Line::styled(format!(" applied {generation}{stale}, staged {staged}, stored {stored}"), level)];
    }
    let outdated = |known: &Known| dashboard.telemetry.is_some_and(|(_, last)| last.generation != known.generation);
    let note = match stale {
        true => ", STALE",
        false if dashboard.sets.get(Which::Applied).is_some_and(outdated) => ", reading",
        false => "",
    };
    let applied = Line::styled(format!(" applied generation {generation} {age}{note}"), level);
    let staged = match staged {
        Some(staged) => format!("generation {}, not in force yet", staged.generation),
        None if dashboard.sets.told(Which::Staged) => "nothing".into(),
        None => "?".into(),
    };
    let stored = match stored {
        None => "?".into(),
        Some(0) => "the same as applied".into(),
        Some(count) => format!("differs in {count} of 13 (≠)"),
    };
    if rows < 3 {
        return vec![applied, Line::raw(cut(&format!(" staged  {staged}; stored {stored}"), width))];
    }
    let keep = if stored.contains('≠') { "; `sarah params commit` keeps the applied set" } else { "" };
    let stored = format!(" stored  {stored}");
    // Half a hint is none.
    let keep = if stored.chars().count() + keep.len() <= width { keep } else { "" };
    vec![applied, Line::raw(format!(" staged  {staged}")), Line::raw(stored + keep)]
}
