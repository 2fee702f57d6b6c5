//! The folder itself: where things lie, beginning a run, going on with one, and who may write it.

use super::atomic::{is_leftover, remove_leftovers};
use super::{FORMAT, RunError, RunInfo, read_text, write_atomic};
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const LOCK: &str = ".lock";
/// A process that was just killed may hold its lock for a moment longer: whoever resumes at once shall not be refused.
const LOCK_PATIENCE: Duration = Duration::from_secs(1);

/// Where the files of a run lie. Only names: nothing is read or written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    root: PathBuf,
}

impl Layout {
    /// The layout below `root`.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }
    /// The run folder.
    pub fn root(&self) -> &Path {
        &self.root
    }
    /// The resolved configuration.
    pub fn config(&self) -> PathBuf {
        self.root.join("config.toml")
    }
    /// Revision, version, seeds, command line.
    pub fn info(&self) -> PathBuf {
        self.root.join("run.json")
    }
    /// The trained parameter set.
    pub fn params(&self) -> PathBuf {
        self.root.join("params.toml")
    }
    /// The numbers behind the report.
    pub fn evaluation(&self) -> PathBuf {
        self.root.join("evaluation.json")
    }
    /// The report.
    pub fn report(&self) -> PathBuf {
        self.root.join("report.md")
    }
    /// Figures, each as SVG and PNG.
    pub fn figures(&self) -> PathBuf {
        self.root.join("figures")
    }
    /// One training session of one seed by one method.
    pub fn session(&self, method: &str, seed: u64, session: u8) -> PathBuf {
        self.root.join(method).join(format!("seed-{seed}")).join(format!("session-{session}"))
    }
    /// The metrics of a session, one row per episode.
    pub fn metrics(&self, method: &str, seed: u64, session: u8) -> PathBuf {
        self.session(method, seed, session).join("metrics.csv")
    }
    /// The TensorBoard folder of a session; TensorBoard shows each as one run.
    pub fn tensorboard(&self, method: &str, seed: u64, session: u8) -> PathBuf {
        self.root.join("tensorboard").join(format!("{method}-seed-{seed}-session-{session}"))
    }
    /// Results of evaluations, kept so that a resumed run need not repeat them.
    pub fn evaluated(&self, what: &str) -> PathBuf {
        self.root.join("evaluated").join(format!("{what}.json"))
    }
    /// Reads `run.json`, and refuses a run of another format.
    pub fn read_info(&self) -> Result<RunInfo, RunError> {
        let path = self.info();
        if !path.is_file() {
            return Err(RunError::NoRun(self.root.clone()));
        }
        let info: RunInfo =
            serde_json::from_str(&read_text(&path)?).map_err(|error| RunError::damaged(&path, error))?;
        if info.format != FORMAT {
            return Err(RunError::Format { path, found: info.format, known: FORMAT, version: info.version });
        }
        Ok(info)
    }
}

/// A run folder held for writing. Dropping it lets others have it.
#[derive(Debug)]
pub struct RunFolder {
    layout: Layout,
    // Held, never read: the operating system releases it when the process ends, however it ends.
    _lock: File,
}

impl RunFolder {
    /// Begins a run in a new or empty folder: writes the resolved configuration, then `run.json`.
    ///
    /// A folder in which a run was killed before it had begun counts as empty.
    pub fn create(root: &Path, config: &str, info: &RunInfo) -> Result<Self, RunError> {
        fs::create_dir_all(root).map_err(RunError::io("create", root))?;
        let layout = Layout::new(root);
        let begun = |name: &std::ffi::OsStr| name != LOCK && name != "config.toml" && !is_leftover(name);
        for entry in fs::read_dir(root).map_err(RunError::io("read", root))? {
            if begun(&entry.map_err(RunError::io("read", root))?.file_name()) {
                return Err(RunError::NotEmpty(root.to_path_buf()));
            }
        }
        let lock = lock(root)?;
        if layout.info().exists() {
            // Somebody began a run here between the look above and the lock.
            return Err(RunError::NotEmpty(root.to_path_buf()));
        }
        remove_leftovers(root)?;
        let info = serde_json::to_string_pretty(info).map_err(|error| RunError::damaged(&layout.info(), error))?;
        write_atomic(&layout.config(), config.as_bytes())?;
        write_atomic(&layout.info(), (info + "\n").as_bytes())?;
        Ok(Self { layout, _lock: lock })
    }

    /// Goes on with a run that has begun.
    pub fn resume(root: &Path) -> Result<(Self, RunInfo), RunError> {
        let layout = Layout::new(root);
        if !layout.info().is_file() {
            return Err(RunError::NoRun(root.to_path_buf()));
        }
        let lock = lock(root)?;
        let info = layout.read_info()?;
        remove_leftovers_below(root)?;
        Ok((Self { layout, _lock: lock }, info))
    }

    /// Where the files lie.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Creates the folder of a session, if need be, and returns it.
    pub fn session(&self, method: &str, seed: u64, session: u8) -> Result<PathBuf, RunError> {
        make(self.layout.session(method, seed, session))
    }

    /// Creates the figures folder, if need be, and returns it.
    pub fn figures(&self) -> Result<PathBuf, RunError> {
        make(self.layout.figures())
    }

    /// Writes the TensorBoard events of a session from its metrics.
    pub fn write_tensorboard(&self, method: &str, seed: u64, session: u8, events: &[u8]) -> Result<(), RunError> {
        write_atomic(&make(self.layout.tensorboard(method, seed, session))?.join(super::EVENTS_FILE), events)
    }

    /// Keeps the results of an evaluation.
    pub fn write_evaluated(&self, what: &str, json: &[u8]) -> Result<(), RunError> {
        make(self.layout.root().join("evaluated"))?;
        write_atomic(&self.layout.evaluated(what), json)
    }
}

fn make(folder: PathBuf) -> Result<PathBuf, RunError> {
    fs::create_dir_all(&folder).map_err(RunError::io("create", &folder))?;
    Ok(folder)
}

fn lock(root: &Path) -> Result<File, RunError> {
    let path = root.join(LOCK);
    let file =
        File::options().create(true).truncate(false).write(true).open(&path).map_err(RunError::io("write", &path))?;
    let began = Instant::now();
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(file),
            Err(TryLockError::WouldBlock) if began.elapsed() < LOCK_PATIENCE => std::thread::sleep(LOCK_PATIENCE / 20),
            Err(TryLockError::WouldBlock) => return Err(RunError::Locked(root.to_path_buf())),
            Err(TryLockError::Error(error)) => return Err(RunError::io("lock", &path)(error)),
        }
    }
}

fn remove_leftovers_below(folder: &Path) -> Result<(), RunError> {
    remove_leftovers(folder)?;
    for entry in fs::read_dir(folder).map_err(RunError::io("read", folder))? {
        let entry = entry.map_err(RunError::io("read", folder))?;
        // Not through symbolic links: what lies behind them is not ours to clean.
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            remove_leftovers_below(&entry.path())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info() -> RunInfo {
        RunInfo {
            format: FORMAT,
            version: "0.1.0".into(),
            revision: None,
            dirty: None,
            seeds: vec![1, 2],
            command: vec!["sarah".into(), "train".into()],
            started: "2020-01-01T00:00:00Z".into(),
        }
    }

    #[test]
    fn a_run_can_be_resumed_with_what_it_began_with() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("a/b");
        let run = RunFolder::create(&root, "x = 1\n", &info()).unwrap();
        let session = run.session("enaf", 1, 2).unwrap();
        assert!(session.ends_with("enaf/seed-1/session-2"));
        fs::write(session.join(".sarah-abc.tmp"), "half").unwrap();
        drop(run);
        let (run, read) = RunFolder::resume(&root).unwrap();
        assert_eq!(read, info());
        assert_eq!(fs::read_to_string(run.layout().config()).unwrap(), "x = 1\n");
        assert!(!session.join(".sarah-abc.tmp").exists(), "leftovers of a killed run are removed");
    }

    #[test]
    fn a_non_empty_folder_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("thesis.doc"), "precious").unwrap();
        let error = RunFolder::create(folder.path(), "", &info()).unwrap_err();
        assert!(matches!(error, RunError::NotEmpty(_)), "{error}");
        assert!(error.to_string().contains("--resume"));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing was written");
    }

    #[test]
    fn a_run_killed_before_it_began_can_be_begun_again() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("config.toml"), "x = 1").unwrap();
        fs::write(folder.path().join(".lock"), "").unwrap();
        RunFolder::create(folder.path(), "x = 2", &info()).unwrap();
    }

    #[test]
    fn two_processes_cannot_write_one_run() {
        let folder = tempfile::tempdir().unwrap();
        let run = RunFolder::create(folder.path(), "", &info()).unwrap();
        assert!(matches!(RunFolder::resume(folder.path()).unwrap_err(), RunError::Locked(_)));
        drop(run);
        RunFolder::resume(folder.path()).unwrap();
    }

    #[test]
    fn what_is_no_run_cannot_be_resumed() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(RunFolder::resume(folder.path()).unwrap_err(), RunError::NoRun(_)));
        assert!(matches!(RunFolder::resume(Path::new("/no/such/run")).unwrap_err(), RunError::NoRun(_)));
    }

    #[test]
    fn a_run_of_another_format_is_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        drop(RunFolder::create(folder.path(), "", &RunInfo { format: 99, ..info() }).unwrap());
        let error = RunFolder::resume(folder.path()).unwrap_err();
        assert!(error.to_string().contains("format 99"), "{error}");
    }
}
