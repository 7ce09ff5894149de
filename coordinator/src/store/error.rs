//! What can go wrong with a store, where, and what to do about it.

use std::io;
use std::path::{Path, PathBuf};

use sqlx::migrate::MigrateError;

/// Why the store did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The folder that should hold the file does not exist.
    #[error("store {}: there is no directory {}; create it, or choose another place for the store", path.display(), directory.display())]
    MissingDirectory {
        /// The store asked for.
        path: PathBuf,
        /// Its missing folder.
        directory: PathBuf,
    },
    /// Opened for reading only, and there is no such file.
    #[error("there is no store at {}; check the path, or start a coordinator with it", path.display())]
    Missing {
        /// The store asked for.
        path: PathBuf,
    },
    /// Another coordinator works with it.
    #[error("store {} is in use by {owner}: stop that coordinator, or give this one a store of its own (the lock is {})", path.display(), lock.display())]
    InUse {
        /// The store asked for.
        path: PathBuf,
        /// Its lock file.
        lock: PathBuf,
        /// `process 4711`, as it wrote into the lock file, or `another process`.
        owner: String,
    },
    /// The file has several names, and so two coordinators could work with it unseen.
    #[error("store {} is one of {names} names of the same file: open it by its own name, or copy it", path.display())]
    Linked {
        /// The store asked for.
        path: PathBuf,
        /// How many names it has.
        names: u64,
    },
    /// It belongs to another site.
    #[error("store {} belongs to site {found}, this coordinator serves {site}: name another store, or that site", path.display())]
    OtherSite {
        /// The store.
        path: PathBuf,
        /// Whose it is.
        found: String,
        /// Who asked.
        site: String,
    },
    /// Another coordinator has taken over.
    #[error("store {}: another coordinator leads now", path.display())]
    Deposed {
        /// The store.
        path: PathBuf,
    },
    /// The lease has run out before it could be renewed; nobody knows whether another has taken over.
    #[error("store {}: the lease could not be renewed in time", path.display())]
    Lapsed {
        /// The store.
        path: PathBuf,
    },
    /// Some other file, which was left as it is.
    #[error("{} is not a coordinator's store: {detail}; it was left untouched, choose another path", path.display())]
    NotAStore {
        /// The file.
        path: PathBuf,
        /// How that was seen.
        detail: String,
    },
    /// Written by a newer coordinator; it was left as it is.
    #[error("store {} has format {found}, this program knows up to {known}: use the newer coordinator, or another store", path.display())]
    Newer {
        /// The store.
        path: PathBuf,
        /// Its format.
        found: i64,
        /// The newest format known here.
        known: i64,
    },
    /// Written by an older coordinator, and opened for reading only.
    #[error("store {} has format {found}, this program reads {known}: start the coordinator with it once, which brings it up to date", path.display())]
    Older {
        /// The store.
        path: PathBuf,
        /// Its format.
        found: i64,
        /// The format read here.
        known: i64,
    },
    /// The file is cut off or overwritten, or holds what this program would never write.
    #[error("store {} is damaged: {detail}; restore it from a copy, or move it away and start with an empty one", path.display())]
    Damaged {
        /// The store.
        path: PathBuf,
        /// Where it was seen.
        detail: String,
    },
    /// The disk is full or fails. Nothing of the batch was kept; the store stays usable and
    /// takes the same batch once there is room.
    #[error("store {} cannot be written: {detail}; nothing was kept of what was being written, free some space on its disk", path.display())]
    Full {
        /// The store.
        path: PathBuf,
        /// What the disk answered.
        detail: String,
    },
    /// Files that this user may not use.
    #[error("store {} may not be opened or written: {detail}; check the permissions of the file and of its directory", path.display())]
    Denied {
        /// The store.
        path: PathBuf,
        /// What was refused.
        detail: String,
    },
    /// A record that the store would not be able to give back. Nothing of the batch was kept.
    #[error("{record} cannot be stored: {detail}")]
    Refused {
        /// Which record.
        record: String,
        /// What is wrong with it.
        detail: String,
    },
    /// A number or id that stands for something else already. Nothing of the batch was kept.
    #[error("{record} is in store {} already, with other contents: two coordinators number their decisions alike", path.display())]
    Conflict {
        /// The store.
        path: PathBuf,
        /// Which record.
        record: String,
    },
    /// An address of another kind.
    #[error("store {}: is no address that is known; a store is a file, or postgres://USER@HOST/DATABASE", path.display())]
    UnknownAddress {
        /// The store asked for.
        path: PathBuf,
    },
    /// Some other program has locked the file for longer than is waited for.
    #[error("store {}, {detail}: another program holds it; end that program (`fuser {}` shows which), or wait and try again", path.display(), path.display())]
    Busy {
        /// The store.
        path: PathBuf,
        /// What the database said.
        detail: String,
    },
    /// A server that nobody reaches.
    #[error("store {}, {detail}: no server answers there; is it running, is the address right, does a firewall let this machine through?", path.display())]
    Unreachable {
        /// The store.
        path: PathBuf,
        /// What the network said.
        detail: String,
    },
    /// Anything else the database reports.
    #[error("store {}, {detail}", path.display())]
    Database {
        /// The store.
        path: PathBuf,
        /// What was going on, and what the database said.
        detail: String,
    },
    /// Anything else the file system reports.
    #[error("store {}, {doing}", path.display())]
    File {
        /// The file concerned.
        path: PathBuf,
        /// What was going on.
        doing: &'static str,
        /// What the file system said.
        source: io::Error,
    },
}

/// SQLite's primary result codes that mean something to the user.
mod code {
    pub(super) const ERROR: u32 = 1;
    pub(super) const BUSY: u32 = 5;
    pub(super) const LOCKED: u32 = 6;
    pub(super) const READONLY: u32 = 8;
    pub(super) const IOERR: u32 = 10;
    pub(super) const CORRUPT: u32 = 11;
    pub(super) const FULL: u32 = 13;
    pub(super) const CANTOPEN: u32 = 14;
    pub(super) const NOTADB: u32 = 26;
}

impl StoreError {
    /// Whether the record itself is to blame: the store takes it at no other time either, but others it does.
    #[must_use]
    pub fn is_of_record(&self) -> bool {
        matches!(self, StoreError::Refused { .. } | StoreError::Conflict { .. })
    }

    /// Whether it is over when the server answers again: nothing in a configuration is to blame.
    #[must_use]
    pub fn is_of_the_moment(&self) -> bool {
        matches!(self, StoreError::Unreachable { .. })
    }

    /// What a database error met while `doing` something means to the user.
    pub(super) fn database(path: &Path, doing: &'static str, source: sqlx::Error) -> Self {
        let path = super::shown(path);
        let Some(error) = source.as_database_error() else {
            return match source {
                sqlx::Error::ColumnDecode { .. } | sqlx::Error::Decode(_) => Self::Damaged { path, detail: format!("{doing}: {source}") },
                sqlx::Error::Io(source) if super::server::is_address(&path) => {
                    Self::Unreachable { path, detail: format!("{doing}: {source}") }
                }
                sqlx::Error::PoolTimedOut if super::server::is_address(&path) => {
                    Self::Unreachable { path, detail: format!("{doing}: it does not answer in time") }
                }
                sqlx::Error::PoolTimedOut => Self::Database { path, detail: format!("{doing}: it does not answer in time") },
                source => Self::Database { path, detail: format!("{doing}: {source}") },
            };
        };
        let detail = format!("{doing}: {}", error.message());
        // A server's codes have five characters: out of room, and who may not enter.
        match error.code().filter(|code| code.len() == 5).as_deref() {
            Some("53100" | "53200") => return Self::Full { path, detail },
            Some("28000" | "28P01" | "3D000" | "42501") => return Self::Denied { path, detail },
            // It stops, starts, or has lost the connection.
            Some(code) if code.starts_with("08") || code.starts_with("57P0") => return Self::Unreachable { path, detail },
            Some(_) if super::server::is_address(&path) => return Self::Database { path, detail },
            _ => {}
        }
        // The low byte of an extended code is the primary one.
        let code = error.code().and_then(|code| code.parse::<u32>().ok()).map(|code| code & 0xff);
        match code {
            Some(code::FULL | code::IOERR) => Self::Full { path, detail },
            Some(code::CORRUPT) => Self::Damaged { path, detail },
            // Whatever this program asks for is in a store that is whole.
            Some(code::ERROR) if detail.contains("no such table") || detail.contains("no such column") => Self::Damaged { path, detail },
            Some(code::BUSY | code::LOCKED) => Self::Busy { path, detail },
            Some(code::NOTADB) => Self::NotAStore { path, detail },
            Some(code::READONLY | code::CANTOPEN) => Self::Denied { path, detail },
            _ => Self::Database { path, detail },
        }
    }

    /// The same for a failed migration.
    pub(super) fn migration(path: &Path, error: MigrateError) -> Self {
        match error {
            MigrateError::Execute(source) | MigrateError::ExecuteMigration(source, _) => {
                Self::database(path, "bringing its tables up to date", source)
            }
            other => Self::Damaged { path: super::shown(path), detail: other.to_string() },
        }
    }
}
