//! Writing files so that a reader never meets half of one.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The path names a directory.
    #[error("cannot write {}: it is a directory; name a file", .0.display())]
    IsDirectory(PathBuf),
    /// The path names a device, a pipe or the like.
    #[error("cannot write {}: it is there already, and is not a file", .0.display())]
    NotAFile(PathBuf),
    /// The directory to write into is not there.
    #[error("cannot write {}: there is no directory {}", .path.display(), .directory.display())]
    NoDirectory {
        /// The file asked for.
        path: PathBuf,
        /// Its directory.
        directory: PathBuf,
    },
    /// The disk said no.
    #[error("cannot write {}", .path.display())]
    Io {
        /// The file asked for.
        path: PathBuf,
        /// What the system reported.
        source: io::Error,
    },
}

/// The directory that a path lies in; `.` for a bare name.
#[must_use]
pub fn directory_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_path_buf(),
        _ => PathBuf::from("."),
    }
}

/// Says early, before any calculation, whether a file could be written there.
///
/// # Errors
/// When the path is a directory or lies in none.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    if path.is_dir() || path.file_name().is_none() {
        return Err(WriteError::IsDirectory(path.to_path_buf()));
    }
    if path.exists() && !path.is_file() {
        return Err(WriteError::NotAFile(path.to_path_buf()));
    }
    let directory = directory_of(path);
    if !directory.is_dir() {
        return Err(WriteError::NoDirectory { path: path.to_path_buf(), directory });
    }
    Ok(())
}

/// Writes the whole content or leaves what was there: a temporary file in the same directory,
/// synced, then renamed.
///
/// # Errors
/// Names the file and what the system reported.
pub fn write_whole(path: &Path, content: &[u8]) -> Result<(), WriteError> {
    check_writable(path)?;
    // Through a link, whose name goes on to stand for the same file.
    let linked = if path.is_symlink() { fs::canonicalize(path).ok() } else { None };
    let path = linked.as_deref().unwrap_or(path);
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let temporary = directory_of(path).join(format!(".{name}.{}.tmp", std::process::id()));
    unfinished(Some(temporary.clone()));
    let result = write_and_rename(&temporary, path, content);
    unfinished(None);
    if result.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    result.map_err(|source| WriteError::Io { path: path.to_path_buf(), source })
}

/// The temporary file that is being written.
static UNFINISHED: Mutex<Option<PathBuf>> = Mutex::new(None);

fn unfinished(file: Option<PathBuf>) {
    *UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner) = file;
}

/// From now on, who stops this process from the keyboard or asks it to end finds no temporary file left behind. The exit status is
/// then what a shell gives to a process that such a signal ended.
#[cfg(unix)]
pub fn leave_nothing_behind() {
    use tokio::signal::unix::{SignalKind, signal};
    let wait = || -> io::Result<i32> {
        tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(async {
            let (mut interrupt, mut terminate) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
            Ok(tokio::select! { _ = interrupt.recv() => 130, _ = terminate.recv() => 143 })
        })
    };
    std::thread::spawn(move || {
        let Ok(status) = wait() else { return };
        // Held to the end, so that nobody begins another file.
        let file = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(file) = &*file {
            let _ = fs::remove_file(file);
        }
        std::process::exit(status);
    });
}

/// From now on, who stops this process from the keyboard finds no temporary file left behind.
#[cfg(not(unix))]
pub fn leave_nothing_behind() {}

fn write_and_rename(temporary: &Path, path: &Path, content: &[u8]) -> io::Result<()> {
    let mut file = File::create(temporary)?;
    file.write_all(content)?;
    file.sync_all()?;
    fs::rename(temporary, path)?;
    // The new name must survive a power cut too; where directories cannot be synced it is moot.
    if let Ok(directory) = File::open(directory_of(path)) {
        let _ = directory.sync_all();
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_a_file_and_leaves_nothing_else_behind() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("out.csv");
        write_whole(&path, b"first").unwrap();
        write_whole(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_goes_on_to_stand_for_the_file_that_is_written() {
        let directory = tempfile::tempdir().unwrap();
        let (file, link) = (directory.path().join("file.toml"), directory.path().join("link.toml"));
        fs::write(&file, "first").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_whole(&link, b"second").unwrap();
        assert!(link.is_symlink() && fs::read(&file).unwrap() == b"second");
    }

    #[test]
    fn a_directory_and_a_missing_directory_are_named() {
        let directory = tempfile::tempdir().unwrap();
        let error = write_whole(directory.path(), b"x").unwrap_err().to_string();
        assert!(error.contains("is a directory"), "{error}");
        let error = write_whole(&directory.path().join("no/such/out.csv"), b"x").unwrap_err().to_string();
        assert!(error.contains("there is no directory"), "{error}");
    }
}
