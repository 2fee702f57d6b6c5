//! Parameter files as the project's own parameter set.

use super::{Origin, ParamSpec, ParamsError, RunError, read_params, read_text, write_params};
use sarah_protocol::params::{ParamError, ParamSet, SPECS};
use std::path::Path;

/// A parameter file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ParamFileError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] RunError),
    /// What it says is refused.
    #[error(transparent)]
    Refused(#[from] ParamsError),
    /// The set as a whole is refused by the rule that the robot applies.
    #[error("{file}: the robot would refuse this set ({why}): correct it")]
    Set {
        /// The file.
        file: String,
        /// Which rule.
        why: ParamError,
    },
}

/// The parameters of Table I, in order, as files know them.
pub fn param_specs() -> [ParamSpec<'static>; SPECS.len()] {
    SPECS.each_ref().map(|spec| ParamSpec {
        symbol: spec.symbol,
        unit: spec.unit,
        what: spec.meaning,
        min: spec.min,
        max: spec.max,
    })
}

/// Reads a parameter file.
pub fn load_param_set(path: &Path) -> Result<(ParamSet, Option<Origin>), ParamFileError> {
    let file = path.display().to_string();
    let (values, origin) = read_params(&read_text(path)?, &file, &param_specs())?;
    // One value per spec is what `read_params` returns; a missing one is refused before.
    let raw = std::array::from_fn(|index| values.get(index).copied().unwrap_or(f32::NAN));
    let set = ParamSet::new(raw).map_err(|why| ParamFileError::Set { file, why })?;
    Ok((set, origin))
}

/// The text of a parameter file for a set.
pub fn param_set_text(set: &ParamSet, origin: Option<&Origin>) -> String {
    write_params(&param_specs(), set.values(), origin)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_ii_survives_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("params.toml");
        let set = ParamSet::table_ii();
        crate::run::write_atomic(&path, param_set_text(&set, None).as_bytes()).unwrap();
        assert_eq!(load_param_set(&path).unwrap().0.values(), set.values());
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = load_param_set(Path::new("no/such/params.toml")).unwrap_err().to_string();
        assert!(error.contains("no/such/params.toml") && error.contains("check the path"), "{error}");
    }
}
