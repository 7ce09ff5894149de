//! The coordinator's memory on disk: what it was told, what it decided, and the count of
//! its starts. One SQLite file, written by one process, read by any; or a PostgreSQL server, written by
//! whichever coordinator leads.
//!
//! ```text
//!   core --Record--> Store::append --one transaction--> journal.db <-- Reader <-- CLI, lab
//!                        |                                  |
//!               place, lock; server                   events, plans, telemetry, inputs ...
//!        refuse foreign files, second writers
//! ```
//!
//! What `append` returned from survives a power cut. A message or decision appended twice is
//! kept once, so a batch whose fate is unknown may be appended again.

mod error;
mod heard;
mod inputs;
mod lock;
mod place;
mod read;
mod record;
mod retire;
mod rows;
mod server;
mod standing;
#[cfg(test)]
pub(crate) mod tests;
mod write;

use std::ops::Deref;
use std::path::{Path, PathBuf};

use sqlx::AnyPool;
use sqlx::any::AnyPoolOptions;
use sqlx::{AnyConnection, Connection};

pub use error::StoreError;
pub use heard::{Heard, What};
pub use read::Reader;
pub use record::Record;
pub use retire::{Retention, Sweep};
pub use server::shown;
use server::{LEASE, PATIENCE, RENEWAL};
pub use standing::{Failing, Standing};

use lock::Lock;
use place::{Content, Format};

/// An open store that this process may write; it reads like a [`Reader`].
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    epoch: u64,
    /// One connection for what is kept: SQLite takes one writer at a time anyway, and batches have an order.
    writer: AnyPool,
    reader: Reader,
    right: Right,
}

/// Why this process may write.
#[derive(Debug)]
enum Right {
    /// It holds the lock of a file.
    File(#[allow(dead_code, reason = "held, not asked")] Lock),
    /// It holds the lease of a server's store under this name, and renews it over a connection of its own: a long batch, or a lock on a
    /// table that somebody builds an index of, must not cost it the lead.
    Server { holder: String, lease: AnyPool },
}

impl Store {
    /// Opens the store for this process alone, makes it where there is none, and counts
    /// one start more. A file's directory has to exist, as has a server's database.
    pub async fn open(path: &Path) -> Result<Self, StoreError> {
        known(path)?;
        if server::is_address(path) { Self::open_server(path).await } else { Self::open_file(path).await }
    }

    /// The same for a coordinator of that site: a store of another one is refused.
    pub async fn open_for(path: &Path, site: &str) -> Result<Self, StoreError> {
        let store = Self::open(path).await?;
        let failed = |source| StoreError::database(path, "looking whose it is", source);
        let insert = "INSERT INTO facts (name, value) VALUES ('site', $1) ON CONFLICT DO NOTHING";
        sqlx::query(insert).bind(site.to_owned()).execute(&store.writer).await.map_err(failed)?;
        let select = "SELECT value FROM facts WHERE name = 'site'";
        let found: String = sqlx::query_scalar(select).fetch_one(&store.writer).await.map_err(failed)?;
        if found == site {
            return Ok(store);
        }
        store.close().await;
        Err(StoreError::OtherSite { path: shown(path), found, site: site.to_owned() })
    }

    async fn open_file(path: &Path) -> Result<Self, StoreError> {
        let place = place::resolve(path)?;
        place::content(&place, path)?;
        place::one_name(&place, path)?;
        let lock = Lock::take(&place, path)?;
        if place::content(&place, path)? == Content::Database {
            place::inspect(&place, path).await?;
        }
        let failed = |source| StoreError::database(path, "opening it", source);
        let pool = AnyPoolOptions::new().max_connections(1).idle_timeout(None).max_lifetime(None).test_before_acquire(false);
        let pool = pool.after_connect(|connection, _| {
            Box::pin(async move {
                sqlx::query("PRAGMA journal_mode = WAL").execute(&mut *connection).await?;
                sqlx::query("PRAGMA synchronous = FULL").execute(&mut *connection).await?;
                Ok(())
            })
        });
        let options = place::any(&place::address(&place, "rwc")).map_err(failed)?;
        let writer = pool.connect_with(options).await.map_err(failed)?;
        place::MIGRATOR.run(&writer).await.map_err(|error| StoreError::migration(path, error))?;
        Self::begun(writer, &place::address(&place, "ro"), path, Right::File(lock)).await
    }

    /// Waits until it may lead.
    async fn open_server(path: &Path) -> Result<Self, StoreError> {
        let address = path.to_str().expect("addresses are text");
        let failed = |source| StoreError::database(path, "connecting", source);
        let options = place::any(address).map_err(failed)?;
        server::reach(&options, path).await?;
        let pool = || AnyPoolOptions::new().max_connections(1).acquire_timeout(PATIENCE);
        let lease = pool().connect_with(options.clone()).await.map_err(failed)?;
        let writer = pool().connect_with(options).await.map_err(failed)?;
        place::MIGRATOR.run(&writer).await.map_err(|error| StoreError::migration(path, error))?;
        let holder = server::holder();
        let (mut told, mut warned) = (false, false);
        loop {
            match server::lease(&lease, path, &holder).await {
                Ok(true) => break,
                Ok(false) if !std::mem::replace(&mut told, true) => {
                    tracing::info!("standing by: another coordinator leads with store {}", shown(path).display());
                }
                Ok(false) => warned = false,
                // Who waits for the server to say that it may lead also waits for the server.
                Err(error) if error.is_of_the_moment() => {
                    if !std::mem::replace(&mut warned, true) {
                        tracing::warn!("{error} Asking again until it does.");
                    }
                }
                Err(error) => return Err(error),
            }
            tokio::time::sleep(RENEWAL / 2).await;
        }
        Self::begun(writer, address, path, Right::Server { holder, lease }).await
    }

    /// Counts the start.
    async fn begun(writer: AnyPool, address: &str, path: &Path, right: Right) -> Result<Self, StoreError> {
        let reader = Reader::connect(address, path).await?;
        let epoch = count_start(&writer, path).await?;
        let store = Self { path: path.to_owned(), epoch, writer, reader, right };
        let insert = "INSERT INTO starts (epoch, event, plan) VALUES ($1, $2, $3)";
        let (event, plan) = (store.next_event_seq().await?, store.next_plan().await?);
        let start = sqlx::query(insert).bind(epoch.cast_signed()).bind(event.cast_signed()).bind(plan.cast_signed());
        start.execute(&store.writer).await.map_err(|source| StoreError::database(path, "counting this start", source))?;
        Ok(store)
    }

    /// Opens the store for reading, whether a coordinator works with it or not.
    pub async fn open_read_only(path: &Path) -> Result<Reader, StoreError> {
        known(path)?;
        if server::is_address(path) {
            return Reader::connect(path.to_str().expect("addresses are text"), path).await;
        }
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
        Reader::connect(&place::address(&place, "ro"), path).await
    }

    /// How many times the store was opened for writing, this time included: larger than
    /// that of every coordinator before.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// How often [`Store::renew`] has to be called: never for a file, whose lock lasts as long as the
    /// process.
    pub fn renewal(&self) -> Option<std::time::Duration> {
        matches!(self.right, Right::Server { .. }).then_some(RENEWAL)
    }

    /// How long this process may lead without having renewed.
    pub fn lease(&self) -> Option<std::time::Duration> {
        matches!(self.right, Right::Server { .. }).then_some(LEASE)
    }

    /// Goes on leading. When another has taken over that is [`StoreError::Deposed`].
    pub async fn renew(&self) -> Result<(), StoreError> {
        let Right::Server { holder, lease } = &self.right else { return Ok(()) };
        let renewed = tokio::time::timeout(PATIENCE, server::lease(lease, &self.path, holder)).await;
        match renewed.unwrap_or_else(|_| Err(StoreError::database(&self.path, "renewing the lease", sqlx::Error::PoolTimedOut)))? {
            true => Ok(()),
            false => Err(StoreError::Deposed { path: shown(&self.path) }),
        }
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

    async fn write(&self, connection: &mut AnyConnection, batch: &write::Batch<'_>) -> Result<(), StoreError> {
        let failed = |source| StoreError::database(&self.path, "appending", source);
        // For a file, IMMEDIATE asks for the write lock at once, where waiting for it is possible. On a
        // server the row of the count is held, so that nobody counts a start meanwhile.
        let (begin, count) = match self.right {
            Right::File(_) => ("BEGIN IMMEDIATE", "SELECT value FROM meta WHERE name = 'epoch'"),
            Right::Server { .. } => ("BEGIN", "SELECT value FROM meta WHERE name = 'epoch' FOR SHARE"),
        };
        let mut transaction = connection.begin_with(begin).await.map_err(failed)?;
        let epoch: i64 = sqlx::query_scalar(count).fetch_one(&mut *transaction).await.map_err(failed)?;
        if epoch != self.epoch.cast_signed() {
            return Err(StoreError::Deposed { path: shown(&self.path) });
        }
        batch.write(&mut transaction, &self.path).await?;
        transaction.commit().await.map_err(failed)
    }

    /// Closes in an orderly way: when it returns, the file holds everything and another
    /// process may open it. Dropping the store is safe too, only less tidy.
    pub async fn close(self) {
        if let Right::Server { holder, lease } = &self.right {
            server::release(lease, holder).await;
            lease.close().await;
        }
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

/// Refuses addresses of what is no store.
fn known(path: &Path) -> Result<(), StoreError> {
    match server::is_unknown_address(path) {
        true => Err(StoreError::UnknownAddress { path: shown(path) }),
        false => Ok(()),
    }
}

impl Deref for Store {
    type Target = Reader;

    fn deref(&self) -> &Reader {
        &self.reader
    }
}

async fn count_start(writer: &AnyPool, path: &Path) -> Result<u64, StoreError> {
    let count = "UPDATE meta SET value = value + 1 WHERE name = 'epoch' RETURNING value";
    let epoch: Option<i64> = sqlx::query_scalar(count)
        .fetch_optional(writer)
        .await
        .map_err(|source| StoreError::database(path, "counting this start", source))?;
    epoch
        .and_then(|epoch| u64::try_from(epoch).ok())
        .ok_or_else(|| StoreError::Damaged { path: shown(path), detail: "table `meta` has no valid `epoch`".to_owned() })
}
