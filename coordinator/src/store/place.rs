//! What stands at a path, found out before anything is written there.

use std::cmp::Ordering;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use sqlx::migrate::{Migration, Migrator};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection, SqliteConnection};

use super::StoreError;

/// The tables, step by step. A new step is a new file; old ones never change.
pub(super) static MIGRATOR: Migrator = sqlx::migrate!("./migrations");

/// Every SQLite file starts so.
const HEADER: &[u8; 16] = b"SQLite format 3\0";

/// Whether a file has several names: two processes could each make a log of changes beside their own,
/// and destroy it.
pub(super) fn one_name(place: &Path, asked: &Path) -> Result<(), StoreError> {
    use std::os::unix::fs::MetadataExt as _;
    match std::fs::metadata(place) {
        Ok(facts) if facts.is_file() && facts.nlink() > 1 => Err(StoreError::Linked { path: asked.to_owned(), names: facts.nlink() }),
        _ => Ok(()),
    }
}

/// The absolute path of a store that exists or could be made. Two spellings of one place
/// get one lock, and SQLite's special names (`:memory:`, `file:...`) are plain names here.
pub(super) fn resolve(path: &Path) -> Result<PathBuf, StoreError> {
    if let Ok(found) = path.canonicalize() {
        return Ok(found);
    }
    let directory = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let missing = || StoreError::MissingDirectory { path: path.to_owned(), directory: directory.to_owned() };
    let name = path.file_name().ok_or_else(missing)?;
    let directory = directory.canonicalize().ok().filter(|d| d.is_dir()).ok_or_else(missing)?;
    Ok(directory.join(name))
}

/// What a file is, as far as its first bytes tell.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// No file, or one without a byte: SQLite makes a new database of both.
    Nothing,
    /// A database, whosever.
    Database,
}

/// Reads the first bytes; another kind of file, or one that lacks its end, is an error.
pub(super) fn content(place: &Path, asked: &Path) -> Result<Content, StoreError> {
    let failed = |source: io::Error| match source.kind() {
        io::ErrorKind::PermissionDenied => StoreError::Denied { path: asked.to_owned(), detail: source.to_string() },
        _ => StoreError::File { path: asked.to_owned(), doing: "reading its first bytes", source },
    };
    if place.is_dir() {
        let detail = "it is a folder; `coordinator run` and `coordinator simulate --store FILE` write stores".to_owned();
        return Err(StoreError::NotAStore { path: asked.to_owned(), detail });
    }
    let file = match File::open(place) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Content::Nothing),
        Err(error) => return Err(failed(error)),
    };
    let bytes = file.metadata().map_err(failed)?.len();
    let mut start = Vec::with_capacity(HEADER.len() + 2);
    file.take(HEADER.len() as u64 + 2).read_to_end(&mut start).map_err(failed)?;
    if start.is_empty() {
        return Ok(Content::Nothing);
    }
    if !start.starts_with(HEADER) {
        return Err(StoreError::NotAStore { path: asked.to_owned(), detail: "it is not an SQLite file".to_owned() });
    }
    if let [.., high, low] = start.as_slice()
        && ends_within_page(bytes, u16::from_be_bytes([*high, *low]))
        && !has_log(place)
    {
        let detail = format!("its length of {bytes} bytes is not a whole number of pages, so its end is missing");
        return Err(StoreError::Damaged { path: asked.to_owned(), detail });
    }
    Ok(Content::Database)
}

/// Whether part of a page is missing; whole missing pages SQLite notices itself.
fn ends_within_page(bytes: u64, page_size: u16) -> bool {
    // The largest size, 65536, does not fit and is written as 1. Odd sizes are for SQLite
    // to refuse.
    let page_size = if page_size == 1 { 65_536 } else { u64::from(page_size) };
    page_size >= 512 && page_size.is_power_of_two() && !bytes.is_multiple_of(page_size)
}

/// Whether a write-ahead log stands beside it, from which SQLite would complete the file.
fn has_log(place: &Path) -> bool {
    let mut name = place.as_os_str().to_owned();
    name.push("-wal");
    PathBuf::from(name).metadata().is_ok_and(|log| log.len() > 0)
}

/// How the tables of a database compare with those known here.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// The same.
    Current,
    /// Earlier steps of the same; `0` when not even the first was completed.
    Older(i64),
}

/// The newest step known here.
pub(super) fn newest() -> i64 {
    MIGRATOR.iter().map(|step| step.version).max().unwrap_or(0)
}

/// Looks into a database without writing to it; one that is not ours, or too new, is an error.
pub(super) async fn inspect(place: &Path, asked: &Path) -> Result<Format, StoreError> {
    let failed = |source| StoreError::database(asked, "looking at its tables", source);
    let mut connection = options(place).read_only(true).connect().await.map_err(failed)?;
    let found = applied(&mut connection).await;
    // Nothing was written, so closing has nothing to lose.
    let _ = connection.close().await;
    let not_a_store = |detail: &str| StoreError::NotAStore { path: asked.to_owned(), detail: detail.to_owned() };
    let Some(applied) = found.map_err(failed)? else {
        return Err(not_a_store("it is an SQLite file with the tables of another program"));
    };
    let known = newest();
    let ours = |((version, checksum), step): (&(i64, Vec<u8>), &Migration)| *version == step.version && *checksum == *step.checksum;
    if !applied.iter().zip(MIGRATOR.iter()).all(ours) {
        return Err(not_a_store("its tables were made by another program, or by a trial version of this one"));
    }
    let found = applied.last().map_or(0, |(version, _)| *version);
    match found.cmp(&known) {
        Ordering::Less => Ok(Format::Older(found)),
        Ordering::Equal => Ok(Format::Current),
        Ordering::Greater => Err(StoreError::Newer { path: asked.to_owned(), found, known }),
    }
}

/// The steps applied so far, none of them in an empty database; `None` where the tables are
/// not kept by steps at all.
async fn applied(connection: &mut SqliteConnection) -> Result<Option<Vec<(i64, Vec<u8>)>>, sqlx::Error> {
    let tables: Vec<String> = sqlx::query_scalar("SELECT name FROM sqlite_master WHERE type = 'table'").fetch_all(&mut *connection).await?;
    if tables.is_empty() {
        return Ok(Some(Vec::new()));
    }
    if !tables.iter().any(|name| name == "_sqlx_migrations") {
        return Ok(None);
    }
    sqlx::query_as("SELECT version, checksum FROM _sqlx_migrations ORDER BY version").fetch_all(connection).await.map(Some)
}

/// What all connections have in common.
pub(super) fn options(place: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(place)
        .foreign_keys(true)
        .busy_timeout(std::time::Duration::from_secs(5))
        .disable_statement_logging()
}

/// The file as the address of a connection that may read, or read and write.
pub(super) fn address(place: &Path, mode: &str) -> String {
    use std::fmt::Write as _;
    use std::os::unix::ffi::OsStrExt as _;
    let mut address = String::from("sqlite://");
    for &byte in place.as_os_str().as_bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'_' | b'.' | b'~' => address.push(char::from(byte)),
            _ => write!(address, "%{byte:02X}").expect("a text can be written to"),
        }
    }
    format!("{address}?mode={mode}")
}

/// How to reach a store by address.
pub(super) fn any(address: &str) -> Result<sqlx::any::AnyConnectOptions, sqlx::Error> {
    sqlx::any::install_default_drivers();
    Ok(address.parse::<sqlx::any::AnyConnectOptions>()?.disable_statement_logging())
}
