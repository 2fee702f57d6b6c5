//! The board map: which probe sits on which node's board.
//!
//! ```toml
//! [probes]
//! knee = "ATML2130021800000001"
//! hip = "ATML2130021800000002"
//! abductor = "ATML2130021800000003"
//! coordinator = "ATML2130021800000004"
//! ```

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::{FlashError, Node};
use crate::run::read_text;

/// Where the map is looked for.
pub const BOARDS_FILE: &str = "boards.toml";

/// A board map that was read.
#[derive(Clone, PartialEq, Eq, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Boards {
    probes: BTreeMap<String, String>,
}

impl Boards {
    /// Reads a map, and refuses one that names a node nobody knows or one board twice.
    pub fn load(path: &Path) -> Result<Boards, FlashError> {
        let file = path.display().to_string();
        let refuse = |why: String| FlashError::Boards { file: file.clone(), why };
        let boards: Boards = toml::from_str(&read_text(path)?)
            .map_err(|error| refuse(error.message().split_whitespace().collect::<Vec<_>>().join(" ")))?;
        for (name, serial) in &boards.probes {
            if Node::ALL.iter().all(|node| node.name() != name) {
                return Err(refuse(format!("no node is called {name}: known are knee, hip, abductor, coordinator")));
            }
            if boards.probes.iter().any(|(other, same)| other != name && same == serial) {
                return Err(refuse(format!("two nodes have the probe {serial}: each board has its own")));
            }
        }
        Ok(boards)
    }

    /// The probe on a node's board.
    pub fn probe(&self, node: Node, path: &Path) -> Result<&str, FlashError> {
        self.probes.get(node.name()).map(String::as_str).ok_or_else(|| FlashError::Boards {
            file: path.display().to_string(),
            why: format!("{node} is missing: add `{node} = \"serial\"` under [probes]"),
        })
    }
}
