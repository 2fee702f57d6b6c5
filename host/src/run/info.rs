//! Where a run came from: `run.json`.

use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

/// The version of the folder's layout. A run of another one is refused, not guessed at.
pub const FORMAT: u32 = 1;

/// Where a run came from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunInfo {
    /// Version of the folder's layout, [`FORMAT`].
    pub format: u32,
    /// Version of the program.
    pub version: String,
    /// Git revision of the source, if known.
    pub revision: Option<String>,
    /// Whether the source had uncommitted changes, if known.
    pub dirty: Option<bool>,
    /// The seeds of the run.
    pub seeds: Vec<u64>,
    /// The command line.
    pub command: Vec<String>,
    /// When it began, UTC, RFC 3339. For people: nothing is computed from it.
    pub started: String,
}

impl RunInfo {
    /// Collects what can be known now: version, command line, time, and the revision of the source in `source`.
    pub fn collect(seeds: Vec<u64>, source: &Path) -> Self {
        let Revision { revision, dirty } = Revision::of(source);
        Self {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION").into(),
            revision,
            dirty,
            seeds,
            command: std::env::args_os().map(|argument| argument.to_string_lossy().into_owned()).collect(),
            started: utc_now(),
        }
    }
}

/// The state of a source tree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Revision {
    /// The commit.
    pub revision: Option<String>,
    /// Whether there are uncommitted changes.
    pub dirty: Option<bool>,
}

impl Revision {
    /// Asks git, if there is one; a source without it is simply of unknown revision.
    pub fn of(source: &Path) -> Self {
        let git = |arguments: &[&str]| {
            let output = Command::new("git").arg("-C").arg(source).args(arguments).output().ok()?;
            output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
        };
        Self {
            revision: git(&["rev-parse", "--verify", "HEAD"]),
            dirty: git(&["status", "--porcelain", "--untracked-files=no"]).map(|changes| !changes.is_empty()),
        }
    }
}

/// The present time, UTC, RFC 3339, to the second.
pub fn utc_now() -> String {
    utc(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()))
}

/// Seconds since 1970 as RFC 3339 (civil date by Hinnant's days-from-civil, inverted).
fn utc(seconds: u64) -> String {
    let (days, of_day) = (seconds / 86_400 + 719_468, seconds % 86_400);
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let day_of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = if march_month < 10 { march_month + 3 } else { march_month - 9 };
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_civil() {
        assert_eq!(utc(0), "1970-01-01T00:00:00Z");
        assert_eq!(utc(951_782_399), "2000-02-28T23:59:59Z");
        assert_eq!(utc(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(utc(1_709_251_200), "2024-03-01T00:00:00Z");
        assert_eq!(utc(4_102_444_799), "2099-12-31T23:59:59Z");
    }

    #[test]
    fn a_source_without_git_has_no_revision() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Revision::of(&folder.path().join("none")), Revision { revision: None, dirty: None });
    }
}
