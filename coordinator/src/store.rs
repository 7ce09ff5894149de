//! The coordinator's memory on disk: what it was told, what it decided, and the count of
//! its starts. One SQLite file, written by one process, read by any.
//!
//! ```text
//!   core --Record--> Store::append --one transaction--> journal.db <-- Reader <-- CLI, lab
//!                        |                                  |
//!                    place, lock                       events, plans, telemetry ...
//!           refuses foreign files, second writers
//! ```
//!
//! What `append` returned from survives a power cut. A message or decision appended twice is
//! kept once, so a batch whose fate is unknown may be appended again.

mod error;
mod heard;
mod lock;
mod place;
mod read;
mod record;
#[cfg(test)]
mod tests;
mod write;

use std::ops::Deref;
use std::path::{Path, PathBuf};

use sqlx::sqlite::{SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{Connection, SqliteConnection};

pub use error::StoreError;
pub use heard::{Heard, What};
pub use read::{Reader, SentCommand, StoredCommand, TelemetryRow};
pub use record::Record;

use lock::Lock;
use place::{Content, Format};

/// An open store that this process may write; it reads like a [`Reader`].
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    epoch: u64,
    /// One connection: SQLite takes one writer at a time anyway.
    writer: SqlitePool,
    reader: Reader,
    _lock: Lock,
}

impl Store {
    /// Opens the store for this process alone, makes it where there is none, and counts
    /// one start more. Its directory has to exist.
    pub async fn open(path: &Path) -> Result<Self, StoreError> {
        let place = place::resolve(path)?;
        place::content(&place, path)?;
        let lock = Lock::take(&place, path)?;
        if place::content(&place, path)? == Content::Database {
            place::inspect(&place, path).await?;
        }
        let writer = open_writer(&place).await.map_err(|source| StoreError::database(path, "opening it", source))?;
        place::MIGRATOR.run(&writer).await.map_err(|error| StoreError::migration(path, error))?;
        let epoch = count_start(&writer, path).await?;
        let reader = Reader::connect(&place, path).await?;
        Ok(Self { path: path.to_owned(), epoch, writer, reader, _lock: lock })
    }

    /// Opens the store for reading, whether a coordinator works with it or not.
    pub async fn open_read_only(path: &Path) -> Result<Reader, StoreError> {
        let place = place::resolve(path)?;
        if !place.exists() {
            return Err(StoreError::Missing { path: path.to_owned() });
        }
        let older = |found| StoreError::Older { path: path.to_owned(), found, known: place::newest() };
        match place::content(&place, path)? {
            Content::Nothing => return Err(older(0)),
            Content::Database => match place::inspect(&place, path).await? {
                Format::Older(found) => return Err(older(found)),
                Format::Current => {}
            },
        }
        Reader::connect(&place, path).await
    }

    /// How many times the store was opened for writing, this time included: larger than
    /// that of every coordinator before.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Keeps all records, in one transaction, or none.
    ///
    /// After an error the store stays usable. An empty batch does nothing.
    pub async fn append(&self, records: &[Record]) -> Result<(), StoreError> {
        if records.is_empty() {
            return Ok(());
        }
        let batch = write::Batch::sorted(records)?;
        let failed = |source| StoreError::database(&self.path, "appending", source);
        let mut connection = self.writer.acquire().await.map_err(failed)?;
        let written = self.write(&mut connection, &batch).await;
        if written.is_err() {
            // SQLite may have ended the transaction by itself, of which sqlx takes no
            // notice: it would refuse every later one. Closing cannot fail to roll back.
            let _ = connection.close().await;
        }
        written
    }

    async fn write(&self, connection: &mut SqliteConnection, batch: &write::Batch<'_>) -> Result<(), StoreError> {
        let failed = |source| StoreError::database(&self.path, "appending", source);
        // IMMEDIATE asks for the write lock at once, where waiting for it is possible.
        let mut transaction = connection.begin_with("BEGIN IMMEDIATE").await.map_err(failed)?;
        batch.write(&mut transaction, &self.path).await?;
        transaction.commit().await.map_err(failed)
    }

    /// Closes in an orderly way: when it returns, the file holds everything and another
    /// process may open it. Dropping the store is safe too, only less tidy.
    pub async fn close(self) {
        self.reader.close().await;
        self.writer.close().await;
    }

    /// A disk of that many pages, as long as no append fails: then the connection that
    /// knows of it is replaced.
    #[cfg(test)]
    async fn limit_pages(&self, pages: u32) {
        let sql = sqlx::AssertSqlSafe(format!("PRAGMA max_page_count = {pages}"));
        sqlx::query(sql).execute(&self.writer).await.unwrap();
    }
}

impl Deref for Store {
    type Target = Reader;

    fn deref(&self) -> &Reader {
        &self.reader
    }
}

async fn open_writer(place: &Path) -> Result<SqlitePool, sqlx::Error> {
    let options = place::options(place).create_if_missing(true).journal_mode(SqliteJournalMode::Wal).synchronous(SqliteSynchronous::Full);
    let pool = SqlitePoolOptions::new().max_connections(1).idle_timeout(None).max_lifetime(None).test_before_acquire(false);
    pool.connect_with(options).await
}

async fn count_start(writer: &SqlitePool, path: &Path) -> Result<u64, StoreError> {
    let count = "UPDATE meta SET value = value + 1 WHERE name = 'epoch' RETURNING value";
    let epoch: Option<i64> = sqlx::query_scalar(count)
        .fetch_optional(writer)
        .await
        .map_err(|source| StoreError::database(path, "counting this start", source))?;
    epoch
        .and_then(|epoch| u64::try_from(epoch).ok())
        .ok_or_else(|| StoreError::Damaged { path: path.to_owned(), detail: "table `meta` has no valid `epoch`".to_owned() })
}
