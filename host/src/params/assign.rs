//! `P1=0.05`: single values put into a set, or into a parameter file.

use std::path::Path;
use std::str::FromStr;

use sarah_protocol::params::{ParamError, ParamSet, SPECS, Spec};
use thiserror::Error;

use crate::bake::rewritten;
use crate::run::{Origin, ParamFileError, load_param_set, param_set_text, read_text, write_atomic};

/// One parameter and its new value.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Assignment {
    /// Place in [`SPECS`].
    pub index: usize,
    /// The value, in the parameter's unit; within its range.
    pub value: f32,
}

/// Why an assignment is refused.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum AssignError {
    /// Not of that form.
    #[error("{0:?} is no assignment: write SYMBOL=VALUE, for instance P1=0.05")]
    Form(String),
    /// No such parameter.
    #[error("there is no parameter {0:?}: give one of {symbols}", symbols = symbols())]
    Symbol(String),
    /// No number, not finite, out of range.
    #[error("{symbol} = {value} is {problem}: set it to a number from {min} to {max} {unit}")]
    Value {
        /// The parameter.
        symbol: &'static str,
        /// As written.
        value: String,
        /// What is wrong with it.
        problem: &'static str,
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
        /// Unit.
        unit: &'static str,
    },
    /// The same parameter again.
    #[error("{0} is given twice: give every parameter once")]
    Twice(&'static str),
    /// The set as a whole.
    #[error("the robot would refuse this set: {0}")]
    Set(#[from] ParamError),
}

fn symbols() -> String {
    SPECS.each_ref().map(|spec| spec.symbol).join(" ")
}

/// The place of a parameter by its name in Table I, in either case.
pub fn place(symbol: &str) -> Result<usize, AssignError> {
    let place = SPECS.iter().position(|spec| spec.symbol.eq_ignore_ascii_case(symbol));
    place.ok_or_else(|| AssignError::Symbol(symbol.into()))
}

impl FromStr for Assignment {
    type Err = AssignError;

    fn from_str(text: &str) -> Result<Assignment, AssignError> {
        let (symbol, value) = text.split_once('=').ok_or_else(|| AssignError::Form(text.into()))?;
        let index = place(symbol.trim())?;
        let value = number(value.trim(), &SPECS[index])?;
        Ok(Assignment { index, value })
    }
}

fn number(text: &str, spec: &Spec) -> Result<f32, AssignError> {
    let problem = match text.parse::<f32>() {
        Ok(value) if !value.is_finite() => "not finite",
        Ok(value) if (spec.min..=spec.max).contains(&value) => return Ok(value),
        Ok(_) => "out of range",
        Err(_) => "no number",
    };
    let (symbol, min, max, unit) = (spec.symbol, spec.min, spec.max, spec.unit);
    Err(AssignError::Value { symbol, value: text.into(), problem, min, max, unit })
}

/// The set with these values in it.
pub fn assign(set: &ParamSet, assignments: &[Assignment]) -> Result<ParamSet, AssignError> {
    let mut values = *set.values();
    for (number, Assignment { index, value }) in assignments.iter().enumerate() {
        if assignments[..number].iter().any(|before| before.index == *index) {
            return Err(AssignError::Twice(SPECS[*index].symbol));
        }
        values[*index] = *value;
    }
    Ok(ParamSet::new(values)?)
}

/// Writes a set into a parameter file that exists, whole or not at all. Comments and order stay; `[origin]` says that
/// the numbers were set by hand, for the set is no longer what its agent found.
pub fn write_into(path: &Path, set: &ParamSet) -> Result<(), ParamFileError> {
    let (_, origin) = load_param_set(path)?;
    let origin = origin.unwrap_or_default();
    let by_hand = match &origin.agent {
        Some(agent) if agent.ends_with(BY_HAND) => agent.clone(),
        Some(agent) => format!("{agent}, then {BY_HAND}"),
        None => BY_HAND.into(),
    };
    let origin = Origin { agent: Some(by_hand), ..origin };
    let text = rewritten(&read_text(path)?, set, &origin).unwrap_or_else(|| param_set_text(set, Some(&origin)));
    Ok(write_atomic(path, text.as_bytes())?)
}

const BY_HAND: &str = "by hand";

#[cfg(test)]
mod tests {
    use sarah_firmware::default_params;

    use super::*;

    #[test]
    fn every_mistake_says_what_is_allowed() {
        for (text, parts) in [
            ("P1", "write SYMBOL=VALUE"),
            ("P9=1", "one of P1 P2 P3 H1 H2 H3 H4 H5 V1 V2 V3 V4 V5"),
            ("P1=0.91", "P1 = 0.91 is out of range: set it to a number from 0.02 to 0.9 m/s"),
            ("P1=fast", "P1 = fast is no number"),
            ("P1=nan", "P1 = nan is not finite"),
            ("P1=", "P1 =  is no number"),
        ] {
            let error = text.parse::<Assignment>().unwrap_err().to_string();
            assert!(error.contains(parts), "{error}");
            assert_eq!(error.lines().count(), 1);
        }
        let twice = ["h2=4", "H2 = 5"].map(|text| text.parse().unwrap());
        assert_eq!(assign(&default_params(), &twice), Err(AssignError::Twice("H2")));
    }

    #[test]
    fn only_what_is_assigned_changes() {
        let both = ["p1=0.5", "V5=4"].map(|text| text.parse().unwrap());
        let before = default_params();
        let after = assign(&before, &both).unwrap();
        let changed: Vec<usize> = (0..13).filter(|i| before.values()[*i] != after.values()[*i]).collect();
        assert_eq!(changed, [0, 12]);
        assert_eq!(after.values()[0], 0.5);
    }

    #[test]
    fn a_file_keeps_its_comments_and_says_that_it_was_edited() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("my.toml");
        let text = param_set_text(&default_params(), None);
        let text = format!("# mine\n{}", text.replacen(" # m/s, kick", " # careful: m/s, kick", 1));
        write_atomic(&path, text.as_bytes()).unwrap();
        for value in ["P1=0.5", "P1=0.25"] {
            let set = assign(&load_param_set(&path).unwrap().0, &[value.parse().unwrap()]).unwrap();
            write_into(&path, &set).unwrap();
        }
        let text = read_text(&path).unwrap();
        assert!(text.starts_with("# mine\n") && text.contains("P1 = 0.25 # careful:"), "{text}");
        assert_eq!(text.matches("by hand").count(), 1, "{text}");
        assert_eq!(load_param_set(&path).unwrap().0.values()[0], 0.25);
    }

    proptest::proptest! {
        #[test]
        fn reading_an_assignment_is_total(text in ".{0,40}") {
            let _ = text.parse::<Assignment>();
        }
    }
}
