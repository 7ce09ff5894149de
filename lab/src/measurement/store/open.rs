//! Where a store lies, and how it is opened: to be read, and for nothing else.

use std::path::{Path, PathBuf};

use sqlx::any::AnyConnectOptions;
use sqlx::postgres::PgConnectOptions;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{AnyConnection, ConnectOptions as _, query, query_scalar};

use super::Source;
use crate::measurement::LogError;

/// How many of the tables that logs are made of a file has, and a server's database.
const IN_FILE: &str =
    "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('robot_gauges', 'pack_gauges', 'station_states')";
const ON_SERVER: &str = "SELECT count(*) FROM information_schema.tables WHERE table_schema = ANY (current_schemas(false)) \
                         AND table_name IN ('robot_gauges', 'pack_gauges', 'station_states')";
const TABLES: i64 = 3;

/// The address of a store on a server; none for a file.
fn address(path: &Path) -> Option<&str> {
    path.to_str().filter(|text| text.starts_with("postgres://") || text.starts_with("postgresql://"))
}

/// A store as it may be told: of an address no password.
pub(super) fn shown(path: &Path) -> String {
    let Some(address) = address(path) else { return path.display().to_string() };
    let Ok(options) = address.parse::<PgConnectOptions>() else { return "the address of a store".to_owned() };
    let host = options.get_socket().map_or_else(|| options.get_host().to_owned(), |socket| socket.display().to_string());
    format!("{} on {host}", options.get_database().unwrap_or(options.get_username()))
}

impl Source {
    pub(super) async fn open(path: &Path) -> Result<Source, LogError> {
        sqlx::any::install_default_drivers();
        let file = shown(path);
        let whole = |message: String| LogError::Whole { file: file.clone(), message };
        let failed = |error: sqlx::Error| whole(format!("cannot be opened: {error}"));
        let (mut connection, tables) = match address(path) {
            Some(address) => (of_server(address).await.map_err(failed)?, ON_SERVER),
            None => {
                // An absolute path, since SQLite gives some names a meaning of their own.
                let place = path.canonicalize().map_err(|error| whole(format!("there is no store: {error}")))?;
                if place.is_dir() {
                    return Err(whole("is a directory; name the store's file".to_owned()));
                }
                (of_file(&place).await.map_err(failed)?, IN_FILE)
            }
        };
        match query_scalar::<_, i64>(tables).fetch_one(&mut connection).await {
            Ok(TABLES) => Ok(Source { file, connection }),
            Ok(_) => Err(whole("is not a coordinator's store: it has other tables".to_owned())),
            Err(error) => Err(whole(format!("is not a coordinator's store: {error}"))),
        }
    }
}

async fn of_file(place: &Path) -> Result<AnyConnection, sqlx::Error> {
    // What is already written with a percent sign is not meant as a code.
    let name = place.to_str().ok_or_else(|| sqlx::Error::Configuration("its path is no text".into()))?.replace('%', "%25");
    let options = SqliteConnectOptions::new().filename(name).read_only(true);
    match connected(&options).await {
        // On a read-only disk there is no room for what readers share; nobody writes there either.
        Err(_) if !beside(place, "-wal").exists() => connected(&options.immutable(true)).await,
        answer => answer,
    }
}

async fn connected(options: &SqliteConnectOptions) -> Result<AnyConnection, sqlx::Error> {
    AnyConnectOptions::from_url(&options.to_url_lossy())?.disable_statement_logging().connect().await
}

async fn of_server(address: &str) -> Result<AnyConnection, sqlx::Error> {
    let mut connection = address.parse::<AnyConnectOptions>()?.disable_statement_logging().connect().await?;
    query("SET default_transaction_read_only = on").execute(&mut connection).await?;
    Ok(connection)
}

fn beside(place: &Path, ending: &str) -> PathBuf {
    let mut name = place.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_is_never_told() {
        let shown = |text: &str| shown(Path::new(text));
        assert_eq!(shown("postgres://tender:hunter2@db.example/site"), "site on db.example");
        assert_eq!(shown("postgresql://tender@db/site?password=hunter2&host=/run/pg"), "site on /run/pg");
        assert_eq!(shown("postgres://tender:hunter2@db.example:no/site"), "the address of a store");
        assert_eq!(shown("/var/lib/tender.db"), "/var/lib/tender.db");
    }
}
