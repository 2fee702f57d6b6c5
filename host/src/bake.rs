//! Baking: a parameter set becomes the one the firmware is built with.
//!
//! The file keeps its comments and order; only the numbers change, and `[origin]` as a whole, for whatever stood there
//! told of the old numbers. A file that is not there yet is written in the same style.

use std::path::{Path, PathBuf};

use sarah_protocol::params::{ParamSet, SPECS};

use crate::run::{
    Layout, Origin, ParamFileError, RunError, load_param_set, param_set_text, param_specs, read_params, read_text,
    write_atomic,
};

const HEADER: &str = "# The set the firmware is built with: what an armed robot balances on if its memory is empty.\n\
    # Read at build time by firmware/build.rs.\n\n";

/// What was baked.
#[derive(Debug, Clone, PartialEq)]
pub struct Baked {
    /// The file the set was taken from.
    pub from: PathBuf,
    /// Symbol, value before (none in a new file) and after, of every parameter that changed.
    pub changed: Vec<(&'static str, Option<f32>, f32)>,
}

/// Takes the set of a run's folder or a parameter file into `into`, whole or not at all.
pub fn bake(source: &Path, into: &Path) -> Result<Baked, ParamFileError> {
    let from = if source.is_dir() { Layout::new(source).params() } else { source.to_path_buf() };
    if source.is_dir() && !from.exists() {
        return Err(RunError::Unfinished(source.to_path_buf()).into());
    }
    let (set, origin) = load_param_set(&from)?;
    let mut origin = origin.unwrap_or_default();
    // A file without an origin is at least known by its name.
    let name = source.file_name().map(|name| name.to_string_lossy().into_owned());
    origin.run = origin.run.or(name);
    let old = match into.exists() {
        true => Some((read_text(into)?, load_param_set(into)?.0)),
        false => None,
    };
    let edited = old.as_ref().and_then(|(text, _)| rewritten(text, &set, &origin));
    let text = edited.unwrap_or_else(|| format!("{HEADER}{}", param_set_text(&set, Some(&origin))));
    write_atomic(into, text.as_bytes())?;
    let before = |index: usize| old.as_ref().map(|(_, old)| old.values()[index]);
    let changed = SPECS.iter().zip(set.values()).enumerate();
    let changed = changed.map(|(index, (spec, value))| (spec.symbol, before(index), *value));
    Ok(Baked { from, changed: changed.filter(|(_, before, after)| *before != Some(*after)).collect() })
}

/// The text of a parameter file with another set in it, its comments and order kept. `None` if it is not written line by
/// line, as this project writes such files.
pub(crate) fn rewritten(old: &str, set: &ParamSet, origin: &Origin) -> Option<String> {
    let text = edited(old, set, origin);
    // What was edited by lines is only kept if it reads as the set.
    let (values, _) = read_params(&text, "", &param_specs()).ok()?;
    (values == set.values()).then_some(text)
}

/// The old text with new numbers and a new origin.
fn edited(old: &str, set: &ParamSet, origin: &Origin) -> String {
    let mut text = String::new();
    let mut section = String::new();
    let origin = format!("[origin]\n{}\n", toml::to_string(origin).unwrap_or_default());
    let had_origin = old.lines().any(|line| line.trim() == "[origin]");
    for line in old.lines() {
        if line.trim_start().starts_with('[') {
            section = line.trim().to_owned();
            if section == "[origin]" || (section == "[parameters]" && !had_origin) {
                text.push_str(&origin);
            }
        }
        if section == "[origin]" {
            continue;
        }
        let key = line.split('=').next().unwrap_or_default().trim();
        let value = SPECS.iter().position(|spec| spec.symbol == key).map(|index| set.values()[index]);
        match value.filter(|_| section == "[parameters]") {
            Some(value) => {
                let comment = line.find('#').map_or(String::new(), |at| format!(" {}", &line[at..]));
                text.push_str(&format!("{key} = {value:?}{comment}\n"));
            }
            None => text.push_str(&format!("{line}\n")),
        }
    }
    text
}
