//! Whole files or none.

use super::RunError;
use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

/// Prefix of the temporary files; what a killed process left behind is removed when its run is resumed.
pub(super) const TEMP_PREFIX: &str = ".sarah-";

/// Replaces `path` by `bytes` so that a reader, a crash or a power cut sees the old file or the new one.
///
/// The bytes go to a temporary file in the same folder (a rename is atomic only within one file system), reach the
/// disk, and only then take the name.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    let failed = || RunError::io("write", path);
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMP_PREFIX).suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The usual mode, less the umask, instead of the private one of temporary files.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(folder).map_err(|error| failed()(error))?;
    file.write_all(bytes).map_err(|error| failed()(error))?;
    file.as_file().sync_all().map_err(|error| failed()(error))?;
    file.persist(path).map_err(|error| failed()(error.error))?;
    // The new name is in the folder; without this it may be lost in a power cut.
    #[cfg(unix)]
    File::open(folder).and_then(|folder| folder.sync_all()).map_err(|error| failed()(error))?;
    Ok(())
}

/// Reads a text file, or says which one is missing.
pub fn read_text(path: &Path) -> Result<String, RunError> {
    fs::read_to_string(path).map_err(RunError::io("read", path))
}

/// The bytes of a file that must be there.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>, RunError> {
    fs::read(path).map_err(RunError::io("read", path))
}

/// Removes what a killed [`write_atomic`] left in `folder`.
pub(super) fn remove_leftovers(folder: &Path) -> Result<(), RunError> {
    for entry in fs::read_dir(folder).map_err(RunError::io("read", folder))? {
        let entry = entry.map_err(RunError::io("read", folder))?;
        if is_leftover(&entry.file_name()) {
            fs::remove_file(entry.path()).map_err(RunError::io("remove", &entry.path()))?;
        }
    }
    Ok(())
}

/// Whether a file name is that of an unfinished atomic write.
pub(super) fn is_leftover(name: &std::ffi::OsStr) -> bool {
    name.to_str().is_some_and(|name| name.starts_with(TEMP_PREFIX) && name.ends_with(".tmp"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_a_file_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("params.toml");
        write_atomic(&path, b"old and longer").unwrap();
        write_atomic(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_missing_folder_is_an_error_that_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let error = write_atomic(&folder.path().join("no/such/file"), b"x").unwrap_err();
        assert!(error.to_string().contains("no/such/file"), "{error}");
    }
}
