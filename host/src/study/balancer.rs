//! Who balances in an evaluation study: which of the known sets, how far towards another, with what shifted.

use std::collections::BTreeMap;
use std::path::Path;

use sarah_firmware::default_params;
use sarah_protocol::params::{ParamSet, SPECS};
use serde::{Deserialize, Serialize};

use super::StudyError;
use super::file::{ControllerArm, ControllerName, Toward};
use crate::evaluate::Controller;
use crate::run::load_param_set;

/// A controller with its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Balancer {
    /// Its name.
    pub name: String,
    /// The constant set; without one the brakes stay on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub set: Option<Vec<f32>>,
    /// Another for the seconds that follow one with a step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stepping: Option<Vec<f32>>,
}

impl Balancer {
    /// Of an arm as it is written: its set, then the way towards another, then shifts.
    pub fn of(arm: &ControllerArm) -> Result<Balancer, StudyError> {
        let part = format!("arm {}", arm.name);
        let known = known(arm.controller, arm.params.as_deref(), &part)?;
        let Some(own) = known else {
            if arm.toward.is_none() && arm.shift.is_empty() && arm.shift_stepping.is_empty() {
                return Ok(Balancer { name: arm.name.clone(), set: None, stepping: None });
            }
            let why = "has no parameters to change: remove toward, shift and shift_stepping".into();
            return Err(StudyError::Part { part, why });
        };
        let between = match &arm.toward {
            None => own.values().to_vec(),
            Some(toward) => approached(&own, toward, &arm.name)?,
        };
        let resting = shifted(between, &arm.name, "shift", &arm.shift)?;
        let stepping = match arm.shift_stepping.is_empty() {
            true => None,
            false => Some(shifted(resting.clone(), &arm.name, "shift_stepping", &arm.shift_stepping)?),
        };
        Ok(Balancer { name: arm.name.clone(), set: Some(resting), stepping })
    }

    /// The controller itself.
    pub fn controller(&self) -> Result<Controller, StudyError> {
        let wrong = |why: String| StudyError::Part { part: format!("arm {}", self.name), why };
        let set = |values: &Vec<f32>| {
            let raw = values.as_slice().try_into().map_err(|_| wrong("has not 13 parameters".into()))?;
            ParamSet::new(raw).map_err(|why| wrong(why.to_string()))
        };
        Ok(match (&self.set, &self.stepping) {
            (None, _) => Controller::Braked,
            (Some(values), None) => Controller::Constants(set(values)?),
            (Some(resting), Some(stepping)) => Controller::TwoSets { resting: set(resting)?, stepping: set(stepping)? },
        })
    }
}

/// The set of a controller or of a file; brakes have none.
fn known(
    controller: Option<ControllerName>,
    params: Option<&Path>,
    part: &str,
) -> Result<Option<ParamSet>, StudyError> {
    Ok(match (controller, params) {
        (Some(ControllerName::Default), None) => Some(default_params()),
        (Some(ControllerName::TableIi), None) => Some(ParamSet::table_ii()),
        (Some(ControllerName::Braked), None) => None,
        (None, Some(path)) if path.is_dir() => Some(load_param_set(&path.join("params.toml"))?.0),
        (None, Some(path)) => Some(load_param_set(path)?.0),
        _ => {
            let why = "give either controller (default, braked, table-ii) or params (a file or a run folder)".into();
            return Err(StudyError::Part { part: part.into(), why });
        }
    })
}

/// On the straight line between two sets.
fn approached(own: &ParamSet, toward: &Toward, arm: &str) -> Result<Vec<f32>, StudyError> {
    let part = format!("arm {arm}, toward");
    let Some(other) = known(toward.controller, toward.params.as_deref(), &part)? else {
        return Err(StudyError::Part { part, why: "brakes have no parameters: name another controller".into() });
    };
    if !(0.0..=1.0).contains(&toward.share) {
        let why = format!("share {}: give 0 (its own set) to 1 (the other)", toward.share);
        return Err(StudyError::Part { part, why });
    }
    let pairs = own.values().iter().zip(other.values());
    // What is rounded stays between the two, and so within the limits.
    let between = |(own, other): (&f32, &f32)| {
        (own * (1.0 - toward.share) + other * toward.share).clamp(own.min(*other), own.max(*other))
    };
    Ok(pairs.map(between).collect())
}

/// `values` with shifts; errors name the arm and the key.
fn shifted(mut values: Vec<f32>, arm: &str, key: &str, shifts: &BTreeMap<String, f32>) -> Result<Vec<f32>, StudyError> {
    for (symbol, share) in shifts {
        let wrong = |why: String| StudyError::Part { part: format!("arm {arm}, {key}.{symbol}"), why };
        let found = SPECS.iter().zip(&mut values).find(|(spec, _)| spec.symbol == symbol);
        let Some((spec, value)) = found else { return Err(wrong("no parameter is called that; P1 to V5 are".into())) };
        if !(-1.0..=1.0).contains(share) {
            return Err(wrong(format!("{share}: give -1 to 1, a share of the width of its limits")));
        }
        *value = (*value + share * (spec.max - spec.min)).clamp(spec.min, spec.max);
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(arm: &str) -> Result<Vec<f32>, String> {
        let arm: ControllerArm = toml::from_str(arm).unwrap();
        Balancer::of(&arm).map(|balancer| balancer.set.unwrap()).map_err(|error| error.to_string())
    }

    #[test]
    fn a_shift_moves_what_it_names_and_ends_at_the_limits() {
        let plain = resolved("name = 'a'\ncontroller = 'default'").unwrap();
        assert_eq!(plain, default_params().values());
        let shifted = resolved("name = 'a'\ncontroller = 'default'\nshift.P1 = 0.25\nshift.H5 = 1.0").unwrap();
        for (index, (spec, (plain, shifted))) in SPECS.iter().zip(plain.iter().zip(&shifted)).enumerate() {
            let expected = match spec.symbol {
                "P1" => plain + 0.25 * (spec.max - spec.min),
                "H5" => spec.max,
                _ => *plain,
            };
            assert_eq!(*shifted, expected, "parameter {index}");
        }
    }

    #[test]
    fn a_shift_of_nothing_or_by_nonsense_is_refused_by_name() {
        for (shift, says) in [("Q1 = 0.1", "shift.Q1"), ("P1 = 2.0", "-1 to 1"), ("P1 = nan", "-1 to 1")] {
            let error = resolved(&format!("name = 'a'\ncontroller = 'default'\nshift.{shift}")).unwrap_err();
            assert!(error.contains("arm a") && error.contains(says), "{error}");
        }
        let braked = toml::from_str("name = 'a'\ncontroller = 'braked'\nshift.P1 = 0.1").unwrap();
        assert!(Balancer::of(&braked).unwrap_err().to_string().contains("remove toward, shift"));
    }

    #[test]
    fn an_arm_may_lie_between_two_sets() {
        let at = |share: f32| {
            let arm = format!(
                "name = 'a'\ncontroller = 'table-ii'\ntoward = {{ controller = 'default', share = {share:?} }}"
            );
            resolved(&arm).unwrap()
        };
        let (from, to) = (ParamSet::table_ii(), default_params());
        assert_eq!(at(0.0), from.values());
        assert_eq!(at(1.0), to.values());
        for ((from, to), between) in from.values().iter().zip(to.values()).zip(at(0.25)) {
            assert!((between - (0.75 * from + 0.25 * to)).abs() < 1e-6, "{from} {to} {between}");
        }
        let shifted = resolved(
            "name = 'a'\ncontroller = 'table-ii'\ntoward = { controller = 'default', share = 1.0 }\nshift.H5 = -1.0",
        );
        assert_eq!(shifted.unwrap()[7], SPECS[7].min);
    }

    #[test]
    fn a_way_to_nowhere_is_refused() {
        for (toward, says) in [
            ("controller = 'default', share = 1.5", "0 (its own set) to 1"),
            ("controller = 'default', share = nan", "0 (its own set) to 1"),
            ("controller = 'braked', share = 0.5", "brakes have no parameters"),
            ("share = 0.5", "give either controller"),
        ] {
            let error = resolved(&format!("name = 'a'\ncontroller = 'default'\ntoward = {{ {toward} }}")).unwrap_err();
            assert!(error.contains("arm a, toward") && error.contains(says), "{error}");
        }
    }
}
