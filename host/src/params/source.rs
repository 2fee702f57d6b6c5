//! Where a set comes from.

use std::convert::Infallible;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use sarah_protocol::host::Which;
use sarah_protocol::params::ParamSet;

use crate::run::{Layout, ParamFileError, RunError, load_param_set};

/// A set by name.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Source {
    /// Built into the firmware that this host was built with.
    Default,
    /// One of the robot's.
    Robot(Which),
    /// A parameter file, or the folder of a run.
    Path(PathBuf),
}

impl FromStr for Source {
    type Err = Infallible;

    /// Names stand before paths: a file called `stored` is `./stored`.
    fn from_str(text: &str) -> Result<Source, Infallible> {
        Ok(match text {
            "default" => Source::Default,
            "applied" => Source::Robot(Which::Applied),
            "staged" => Source::Robot(Which::Staged),
            "stored" => Source::Robot(Which::Stored),
            path => Source::Path(path.into()),
        })
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Source::Default => f.write_str("default"),
            Source::Robot(which) => f.write_str(name(*which)),
            Source::Path(path) => write!(f, "{}", path.display()),
        }
    }
}

/// The name of one of the robot's sets.
pub const fn name(which: Which) -> &'static str {
    match which {
        Which::Applied => "applied",
        Which::Staged => "staged",
        Which::Stored => "stored",
    }
}

/// The set of a parameter file, or of a run's folder.
pub fn load(path: &Path) -> Result<ParamSet, ParamFileError> {
    if !path.is_dir() {
        return Ok(load_param_set(path)?.0);
    }
    let file = Layout::new(path).params();
    match file.exists() {
        true => Ok(load_param_set(&file)?.0),
        false => Err(RunError::Unfinished(path.to_path_buf()).into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{param_set_text, write_atomic};

    fn source(text: &str) -> Source {
        match text.parse() {
            Ok(source) => source,
            Err(never) => match never {},
        }
    }

    #[test]
    fn names_are_names_and_the_rest_is_a_path() {
        for name in ["default", "applied", "staged", "stored"] {
            assert!(!matches!(source(name), Source::Path(_)));
            assert_eq!(source(name).to_string(), name);
        }
        assert_eq!(source("./stored"), Source::Path("./stored".into()));
    }

    #[test]
    fn a_run_folder_stands_for_its_set() {
        let folder = tempfile::tempdir().unwrap();
        assert!(load(folder.path()).unwrap_err().to_string().contains("not finished"));
        let file = folder.path().join("params.toml");
        write_atomic(&file, param_set_text(&ParamSet::table_ii(), None).as_bytes()).unwrap();
        assert_eq!(load(folder.path()).unwrap(), ParamSet::table_ii());
        assert_eq!(load(&file).unwrap(), ParamSet::table_ii());
    }
}
