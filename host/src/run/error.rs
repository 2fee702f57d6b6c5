//! What can go wrong with a run folder, each said in one line with what to do next.

use std::io;
use std::path::{Path, PathBuf};

/// A problem with the files of a run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The folder for a new run already holds something.
    #[error("{} is not empty: choose another folder with --out, or go on with that run by --resume {}", .0.display(), .0.display())]
    NotEmpty(PathBuf),
    /// The folder to resume or report on is no run.
    #[error("{} holds no run (run.json is missing): start one with `sarah train --out {}`", .0.display(), .0.display())]
    NoRun(PathBuf),
    /// The run to report on has no results yet.
    #[error("{} is not finished (evaluation.json is missing): finish it by `sarah train --resume {}`", .0.display(), .0.display())]
    Unfinished(PathBuf),
    /// Another process writes this run.
    #[error("{} is in use by another process: wait for it, or choose another folder with --out", .0.display())]
    Locked(PathBuf),
    /// The run was written by an incompatible version.
    #[error(
        "{} is of run format {found}, this program knows format {known}: use the version that made it ({version}), or start a new run",
        .path.display()
    )]
    Format {
        /// The file that says so.
        path: PathBuf,
        /// The format found.
        found: u32,
        /// The format this program writes.
        known: u32,
        /// The program version that made the run.
        version: String,
    },
    /// The operating system refused.
    #[error("cannot {doing} {}: {source}; {}", .path.display(), hint(.source))]
    Io {
        /// What was being done, as a verb.
        doing: &'static str,
        /// To which file or folder.
        path: PathBuf,
        /// Why it failed.
        source: io::Error,
    },
    /// A file of the run does not hold what it should.
    #[error("{} is damaged ({why}): restore it from a copy, or start a new run", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
}

impl RunError {
    /// Wraps an I/O error; use as `.map_err(RunError::io("write", path))`.
    pub fn io(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_path_buf();
        move |source| Self::Io { doing, path, source }
    }

    /// A file whose content is wrong.
    pub fn damaged(path: &Path, why: impl ToString) -> Self {
        // One line, whatever the parser underneath says.
        let why = why.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        Self::Damaged { path: path.to_path_buf(), why }
    }
}

/// What to do about an I/O error.
fn hint(error: &io::Error) -> &'static str {
    use io::ErrorKind as K;
    match error.kind() {
        K::StorageFull | K::QuotaExceeded => "free some space there, or choose another folder with --out",
        K::FileTooLarge => "raise the limit on the size of files (ulimit -f), or choose another folder with --out",
        K::PermissionDenied | K::ReadOnlyFilesystem => "choose a folder you may write with --out",
        K::NotFound => "check the path",
        K::NotADirectory | K::AlreadyExists => "something that is no folder is in the way: choose another path",
        K::IsADirectory => "a folder is in the way: choose another path",
        _ => "check the disk and the path, then try again",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_one_line_that_says_what_to_do() {
        let error = RunError::io("write", Path::new("runs/a/params.toml"))(io::ErrorKind::StorageFull.into());
        let text = error.to_string();
        assert!(text.contains("runs/a/params.toml") && text.contains("free some space"), "{text}");
        assert_eq!(text.lines().count(), 1);
    }
}
