//! One coordinator per store: an operating-system lock on a file beside it, which vanishes
//! with its process however that ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use super::StoreError;

/// Held as long as it lives. The file itself stays: removing it would let a third process
/// lock a file that the second no longer sees.
#[derive(Debug)]
pub(super) struct Lock {
    _file: File,
}

/// `journal.db` -> `journal.db.lock`.
fn lock_path(store: &Path) -> PathBuf {
    let mut name = store.as_os_str().to_owned();
    name.push(".lock");
    PathBuf::from(name)
}

impl Lock {
    /// Takes the lock of `store`, or says who holds it. `asked` is the store's path as the
    /// user wrote it.
    pub(super) fn take(store: &Path, asked: &Path) -> Result<Self, StoreError> {
        let path = lock_path(store);
        let failed = |doing| {
            let path = path.clone();
            move |source: io::Error| match source.kind() {
                io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                    StoreError::Denied { path: asked.to_owned(), detail: format!("{}: {source}", path.display()) }
                }
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                    StoreError::Full { path: asked.to_owned(), detail: format!("{}: {source}", path.display()) }
                }
                _ => StoreError::File { path, doing, source },
            }
        };
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(failed("opening the lock file"))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(StoreError::InUse { path: asked.to_owned(), owner: owner(&mut file), lock: path.clone() });
            }
            Err(TryLockError::Error(source)) => return Err(failed("locking the lock file")(source)),
        }
        write_owner(&mut file).map_err(failed("writing the lock file"))?;
        Ok(Self { _file: file })
    }
}

fn write_owner(file: &mut File) -> io::Result<()> {
    file.set_len(0)?;
    file.rewind()?;
    writeln!(file, "{}", std::process::id())
}

/// Who wrote the lock file. Its owner may be between locking and writing, and some systems
/// forbid reading a locked file.
fn owner(file: &mut File) -> String {
    let mut text = String::new();
    let read = file.take(32).read_to_string(&mut text);
    match (read, text.trim().parse::<u32>()) {
        (Ok(_), Ok(pid)) => format!("process {pid}"),
        _ => "another process".to_owned(),
    }
}
