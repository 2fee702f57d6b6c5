//! `params.toml`: a parameter set that people read, edit and pass on.
//!
//! ```toml
//! [origin]
//! agent = "enaf"
//!
//! [parameters]
//! P1 = 0.0909 # m/s, kick speed (0.05 to 0.9)
//! ```
//!
//! Reading is strict: a missing, unknown or impossible parameter is refused with one line that names the file, the
//! key, what is allowed and what to do. Parameters move a machine that can hurt itself.

use serde::{Deserialize, Serialize};
use std::fmt::Write;
use toml::{Table, Value};

/// What one parameter may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParamSpec<'a> {
    /// Its name in Table I, for instance `P1`.
    pub symbol: &'a str,
    /// Its unit, empty if it has none.
    pub unit: &'a str,
    /// What it does, in a few words.
    pub what: &'a str,
    /// The smallest allowed value.
    pub min: f32,
    /// The largest allowed value.
    pub max: f32,
}

/// Where a parameter set came from. All of it is optional, none of it changes what the set does.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// The run that made it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Its seed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The source revision.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub revision: Option<String>,
    /// The agent that found it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub agent: Option<String>,
}

/// Why a parameter file is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ParamsError {
    /// Not TOML.
    #[error("{file}:{line}: not valid TOML ({why}): correct that line")]
    Malformed {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// What the parser says.
        why: String,
    },
    /// A table or key that does not belong there.
    #[error("{file}: unknown key \"{key}\": remove it; known are {known}")]
    Unknown {
        /// The file.
        file: String,
        /// The key.
        key: String,
        /// What may stand there.
        known: String,
    },
    /// A parameter is not given.
    #[error("{file}: {key} is missing from [parameters]: add it, {min} to {max} {unit}")]
    Missing {
        /// The file.
        file: String,
        /// The parameter.
        key: String,
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
        /// Unit.
        unit: String,
    },
    /// A value that is no number, not finite or out of range.
    #[error("{file}: {key} = {value} is {problem}: set it to a number from {min} to {max} {unit}")]
    Value {
        /// The file.
        file: String,
        /// The parameter.
        key: String,
        /// The value, as written.
        value: String,
        /// What is wrong with it.
        problem: &'static str,
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
        /// Unit.
        unit: String,
    },
    /// The `[origin]` table holds something else than text and a seed.
    #[error("{file}: [origin] {why}: correct or remove it")]
    Origin {
        /// The file.
        file: String,
        /// What is wrong with it.
        why: String,
    },
}

/// The text of a parameter file. `values` in the order of `specs`.
pub fn write_params(specs: &[ParamSpec<'_>], values: &[f32], origin: Option<&Origin>) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail; the results are dropped for that reason throughout.
    if let Some(origin) = origin.and_then(|origin| toml::to_string(origin).ok()).filter(|text| !text.is_empty()) {
        let _ = writeln!(text, "[origin]\n{origin}");
    }
    text.push_str("[parameters]\n");
    for (spec, value) in specs.iter().zip(values) {
        let unit = if spec.unit.is_empty() { String::new() } else { format!("{}, ", spec.unit) };
        let _ = writeln!(text, "{} = {value:?} # {unit}{} ({} to {})", spec.symbol, spec.what, spec.min, spec.max);
    }
    text
}

/// Reads a parameter file; `file` is its name for messages. Returns the values in the order of `specs`.
pub fn read_params(text: &str, file: &str, specs: &[ParamSpec<'_>]) -> Result<(Vec<f32>, Option<Origin>), ParamsError> {
    let mut document: Table = text.parse().map_err(|error: toml::de::Error| ParamsError::Malformed {
        file: file.into(),
        line: error.span().map_or(1, |span| 1 + text[..span.start.min(text.len())].matches('\n').count()),
        why: error.message().split_whitespace().collect::<Vec<_>>().join(" "),
    })?;
    let unknown = |key: &str, known: String| ParamsError::Unknown { file: file.into(), key: key.into(), known };
    let origin = match document.remove("origin") {
        None => None,
        Some(table) => Some(table.try_into().map_err(|error: toml::de::Error| ParamsError::Origin {
            file: file.into(),
            why: error.message().split_whitespace().collect::<Vec<_>>().join(" "),
        })?),
    };
    let mut parameters = match document.remove("parameters") {
        Some(Value::Table(table)) => table,
        _ => Table::new(),
    };
    if let Some(key) = document.keys().next() {
        return Err(unknown(key, "[parameters] and [origin]".into()));
    }
    let mut values = Vec::with_capacity(specs.len());
    for spec in specs {
        let value = parameters.remove(spec.symbol).ok_or_else(|| ParamsError::Missing {
            file: file.into(),
            key: spec.symbol.into(),
            min: spec.min,
            max: spec.max,
            unit: spec.unit.into(),
        })?;
        values.push(number(&value, spec).map_err(|problem| ParamsError::Value {
            file: file.into(),
            key: spec.symbol.into(),
            value: value.to_string().split_whitespace().collect::<Vec<_>>().join(" "),
            problem,
            min: spec.min,
            max: spec.max,
            unit: spec.unit.into(),
        })?);
    }
    match parameters.keys().next() {
        Some(key) => {
            let known: Vec<_> = specs.iter().map(|spec| spec.symbol).collect();
            Err(unknown(key, known.join(" ")))
        }
        None => Ok((values, origin)),
    }
}

fn number(value: &Value, spec: &ParamSpec<'_>) -> Result<f32, &'static str> {
    let number = match value {
        Value::Float(number) => *number as f32,
        Value::Integer(number) => *number as f32,
        _ => return Err("no number"),
    };
    match number {
        number if !number.is_finite() => Err("not finite"),
        number if !(spec.min..=spec.max).contains(&number) => Err("out of range"),
        number => Ok(number),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPECS: [ParamSpec<'_>; 2] = [
        ParamSpec { symbol: "P1", unit: "m/s", what: "kick speed", min: 0.05, max: 0.9 },
        ParamSpec { symbol: "H1", unit: "", what: "lean weight", min: -8.0, max: 8.0 },
    ];

    fn refusal(text: &str) -> String {
        let error = read_params(text, "my.toml", &SPECS).unwrap_err().to_string();
        assert_eq!(error.lines().count(), 1, "{error}");
        error
    }

    #[test]
    fn reads_as_written() {
        let origin =
            Origin { seed: Some(7), agent: Some("enaf".into()), run: Some("runs/\"a\"".into()), revision: None };
        let text = write_params(&SPECS, &[0.0909, -4.0], Some(&origin));
        assert!(text.contains("P1 = 0.0909 # m/s, kick speed (0.05 to 0.9)"), "{text}");
        assert_eq!(read_params(&text, "my.toml", &SPECS), Ok((vec![0.0909, -4.0], Some(origin))));
    }

    #[test]
    fn integers_are_numbers_too() {
        assert_eq!(read_params("[parameters]\nP1 = 0.1\nH1 = 4", "", &SPECS), Ok((vec![0.1, 4.0], None)));
    }

    #[test]
    fn every_mistake_is_one_line_with_file_and_remedy() {
        for (text, parts) in [
            ("[parameters]\nP1 = 0.1\nH1 = =", vec!["my.toml:3", "not valid TOML"]),
            ("[parameters]\nP1 = 0.1\nP1 = 0.2\nH1 = 1", vec!["my.toml:3", "not valid TOML"]),
            ("[parameters]\nP1 = 0.1", vec!["my.toml: H1 is missing", "-8 to 8"]),
            ("", vec!["P1 is missing"]),
            ("[parameters]\nP1 = 0.1\nH1 = 1\nH9 = 2", vec!["unknown key \"H9\"", "known are P1 H1"]),
            ("[extra]\n[parameters]\nP1 = 0.1\nH1 = 1", vec!["unknown key \"extra\"", "[origin]"]),
            ("[parameters]\nP1 = nan\nH1 = 1", vec!["P1 = nan is not finite", "0.05 to 0.9 m/s"]),
            ("[parameters]\nP1 = -inf\nH1 = 1", vec!["not finite"]),
            ("[parameters]\nP1 = 0.91\nH1 = 1", vec!["P1 = 0.91 is out of range", "0.05 to 0.9 m/s"]),
            ("[parameters]\nP1 = \"fast\"\nH1 = 1", vec!["P1 = \"fast\" is no number"]),
            ("[origin]\nseed = \"x\"\n[parameters]\nP1 = 0.1\nH1 = 1", vec!["[origin]", "correct or remove"]),
        ] {
            let error = refusal(text);
            for part in parts {
                assert!(error.contains(part), "{error:?} lacks {part:?}");
            }
        }
    }

    proptest::proptest! {
        #[test]
        fn every_value_in_range_survives_the_file_exactly(p in 0.05_f32..=0.9, h in -8.0_f32..=8.0) {
            let text = write_params(&SPECS, &[p, h], None);
            proptest::prop_assert_eq!(read_params(&text, "", &SPECS), Ok((vec![p, h], None)));
        }

        #[test]
        fn reading_is_total(text in ".{0,200}") {
            let _ = read_params(&text, "", &SPECS);
        }
    }
}
