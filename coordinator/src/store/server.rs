//! A store on a PostgreSQL server: several coordinators may share it, one leads.
//!
//! Who leads holds a lease that it renews; the server's clock decides when it has run out. The next
//! leader counts a start, and each batch of the journal asks in its own transaction whether that count is still ours: a leader that
//! was replaced can add nothing to the journal.
//!
//! That alone does not keep it from commanding, since commands leave unwritten too while the server fails or hangs
//! (`service/keep.rs`). It stops when its lease has ended by its own clock, which it looks at before commands leave
//! (`service/lead.rs`). What left just before, or while the process was suspended, may arrive later; agents refuse it by its epoch once
//! they have heard the next leader.

use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::path::{Path, PathBuf};
use std::time::Duration;

use sqlx::any::AnyConnectOptions;
use sqlx::{AnyConnection, AnyPool, Connection as _, query};

use super::StoreError;

/// How long a lease lasts without being renewed.
pub(super) const LEASE: Duration = Duration::from_millis(3000);
/// How often it is renewed, and how often others look whether it has run out.
pub(super) const RENEWAL: Duration = Duration::from_millis(1000);
/// How long a question to the server may take.
pub(super) const PATIENCE: Duration = Duration::from_millis(2000);

/// Now, by the server's clock, in milliseconds.
const NOW: &str = "(EXTRACT(EPOCH FROM clock_timestamp()) * 1000)::BIGINT";

/// Whether a store's name is the address of a server.
pub(super) fn is_address(path: &Path) -> bool {
    path.to_str().is_some_and(|text| text.starts_with("postgres://") || text.starts_with("postgresql://"))
}

/// Whether it is the address of something else: no file is named so by who means a file.
pub(super) fn is_unknown_address(path: &Path) -> bool {
    path.to_str().is_some_and(|text| text.contains("://")) && !is_address(path)
}

/// The name of a store as it may be told: without a password.
#[must_use]
pub fn shown(path: &Path) -> PathBuf {
    let Some(text) = path.to_str().filter(|text| text.contains("://")) else { return path.to_owned() };
    let (scheme, rest) = text.split_once("://").expect("addresses have a scheme");
    let (place, options) = rest.split_once('?').map_or((rest, ""), |(place, options)| (place, options));
    let place = place
        .rsplit_once('@')
        .map_or_else(|| place.to_owned(), |(who, place)| format!("{}@{place}", who.split_once(':').map_or(who, |(user, _)| user)));
    // Options may hold a password too; only the socket's folder is told.
    let host = options.split('&').find(|option| option.starts_with("host=")).map_or_else(String::new, |host| format!("?{host}"));
    PathBuf::from(format!("{scheme}://{place}{host}"))
}

/// Connects once: a pool tries again and again, and in the end says only that it has waited.
pub(super) async fn reach(options: &AnyConnectOptions, path: &Path) -> Result<(), StoreError> {
    let failed = |source| StoreError::database(path, "connecting", source);
    let connected = tokio::time::timeout(PATIENCE, AnyConnection::connect_with(options)).await;
    let connection = connected.unwrap_or(Err(sqlx::Error::PoolTimedOut)).map_err(failed)?;
    // Nothing was asked of it.
    let _ = connection.close().await;
    Ok(())
}

/// Takes the lease, or renews it; false while another holds it.
pub(super) async fn lease(pool: &AnyPool, path: &Path, holder: &str) -> Result<bool, StoreError> {
    let sql = format!("UPDATE lease SET holder = $1, until_ms = {NOW} + $2 WHERE id = 1 AND (holder = $1 OR until_ms < {NOW})");
    let taken = query(sqlx::AssertSqlSafe(sql)).bind(holder.to_owned()).bind(LEASE.as_millis() as i64).execute(pool).await;
    taken.map(|done| done.rows_affected() == 1).map_err(|source| StoreError::database(path, "taking the lease", source))
}

/// Gives the lease back, so that the next need not wait.
pub(super) async fn release(pool: &AnyPool, holder: &str) {
    let _ = query("UPDATE lease SET until_ms = 0 WHERE id = 1 AND holder = $1").bind(holder.to_owned()).execute(pool).await;
}

/// A name that no other process has.
pub(super) fn holder() -> String {
    let host = std::fs::read_to_string("/etc/hostname").unwrap_or_default();
    // The standard library seeds its hashers from the operating system.
    let random = RandomState::new().build_hasher().finish();
    format!("{} process {} {random:016x}", host.trim(), std::process::id())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_is_never_told() {
        let shown = |text: &str| shown(Path::new(text)).display().to_string();
        assert_eq!(shown("postgres://tender:hunter2@db.example/site"), "postgres://tender@db.example/site");
        assert_eq!(shown("postgres://tender@db/site?password=hunter2&host=/run/pg"), "postgres://tender@db/site?host=/run/pg");
        assert_eq!(shown("postgresql://a:p%40ss:w@h:5432/d"), "postgresql://a@h:5432/d");
        assert_eq!(shown("mysql://tender:hunter2@db/site"), "mysql://tender@db/site");
        assert_eq!(shown("/var/lib/tender.db"), "/var/lib/tender.db");
    }
}
