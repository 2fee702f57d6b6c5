//! What the first session of a run begins with.

use std::path::PathBuf;

use sarah_firmware::default_params;
use sarah_protocol::params::ParamSet;
use serde::{Deserialize, Serialize};

use crate::params::source;
use crate::run::ParamFileError;

/// A set by its name, or the file that has it.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum Start {
    /// `table-ii`: the paper's Table II in our units.
    #[default]
    TableIi,
    /// `default`: the set built into the firmware.
    Default,
    /// A parameter file, or the folder of a run. Names stand before paths: a file called `default` is `./default`.
    Path(PathBuf),
}

impl Start {
    /// The set itself, read if it lies in a file.
    pub fn load(&self) -> Result<ParamSet, ParamFileError> {
        match self {
            Start::TableIi => Ok(ParamSet::table_ii()),
            Start::Default => Ok(default_params()),
            Start::Path(path) => source::load(path),
        }
    }
}

impl From<String> for Start {
    fn from(name: String) -> Start {
        match name.as_str() {
            "table-ii" => Start::TableIi,
            "default" => Start::Default,
            _ => Start::Path(name.into()),
        }
    }
}

impl From<Start> for String {
    fn from(start: Start) -> String {
        match start {
            Start::TableIi => "table-ii".into(),
            Start::Default => "default".into(),
            Start::Path(path) => path.to_string_lossy().into_owned(),
        }
    }
}
