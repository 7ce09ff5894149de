//! The coordinator's store as a source of logs: what the gauges of a robot's battery, of a
//! station's pack, or a station itself told it. The store, a file or on a server, is only read, page by page, so that a
//! coordinator that works with it is neither stopped nor slowed. A place in such a log is the
//! number of the row.

mod gauge;
mod open;
mod station;

use std::path::Path;

use energy::document::hint;
use proto::Timestamp;
use sqlx::{AnyConnection, Connection as _, query_as, query_scalar};

use super::limits::check_cells;
use super::{Log, LogError, LogFacts, Table};

const COOLEST: &str = "SELECT degc, whose FROM \
     (SELECT temperature_degc AS degc, robot AS whose, at_ms FROM robot_gauges WHERE at_ms BETWEEN $1 AND $2 UNION ALL \
      SELECT temperature_degc, pack || ' of ' || station, at_ms FROM pack_gauges WHERE at_ms BETWEEN $1 AND $2) AS told \
     ORDER BY degc, at_ms, whose LIMIT 1";
/// Packs of robots are as cool as what is around them after so long, s: several times their time constants (`thermal`).
const COOLS_S: f64 = 3600.0;

/// Rows that are fetched at once.
const PAGE: i64 = 10_000;

/// Whose log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Subject {
    /// The battery of a robot.
    Robot(String),
    /// A pack of a station.
    Pack {
        /// The station.
        station: String,
        /// The pack.
        pack: String,
    },
    /// A station as a load on its active pack.
    Station(String),
}

/// Which part of which log of a store.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoreQuery {
    /// Whose log.
    pub subject: Subject,
    /// Not before.
    pub from: Option<Timestamp>,
    /// Not after.
    pub to: Option<Timestamp>,
}

/// Reads an instant: RFC 3339, or seconds since 1970.
///
/// # Errors
/// Says how to write it.
pub fn instant(text: &str) -> Result<Timestamp, String> {
    if let Some(seconds) = text.parse::<f64>().ok().filter(|seconds| seconds.is_finite()) {
        return Ok(Timestamp::default().plus_s(seconds));
    }
    text.parse().map_err(|_| format!("`{text}` is neither an instant like 2026-01-01T00:00:00Z nor seconds since 1970"))
}

/// Reads a log from a coordinator's store.
///
/// # Errors
/// When it is no store, and for an unknown robot, station or pack, with the nearest known one.
pub fn read_store(path: &Path, query: &StoreQuery, mut facts: LogFacts) -> Result<Log, LogError> {
    let file = open::shown(path);
    let whole = |message: String| LogError::Whole { file: file.clone(), message };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| whole(format!("cannot be opened: {error}")))?;
    let needs_ambient = facts.ambient_degc.is_none() && !matches!(query.subject, Subject::Station(_));
    let (table, begin, coolest) = runtime.block_on(async {
        let mut source = Source::open(path).await?;
        let answer = match source.table(query).await {
            Ok((table, begin)) if needs_ambient => {
                let coolest = source.coolest(&table, begin).await;
                coolest.map(|coolest| (table, begin, coolest))
            }
            other => other.map(|(table, begin)| (table, begin, None)),
        };
        // Nothing was written, so closing has nothing to lose.
        let _ = source.connection.close().await;
        answer
    })?;
    let name = match &query.subject {
        Subject::Robot(robot) => robot.clone(),
        Subject::Pack { station, pack } => format!("{station}-{pack}"),
        Subject::Station(station) => station.clone(),
    };
    facts.id = facts.id.or(Some(name.clone()));
    if let Some((degc, _)) = &coolest {
        (facts.ambient_degc, facts.ambient_is_read) = (Some(*degc), facts.ambient_sigma_k.is_none());
    }
    let mut log = Log::from_table(&format!("{file} ({name})"), table, facts)?;
    if let Some((degc, whose)) = coolest {
        log.notes.push(format!(
            "{}: no message tells how warm it is around the battery: taken as {degc:.1} degC, the coolest that one was there then ({whose}), \
             and as no better known than its sensor is; --ambient-degc says better",
            log.file
        ));
    }
    log.notes.push(format!("{}: time 0 is {begin}", log.file));
    log.name = name;
    Ok(log)
}

/// An open store.
struct Source {
    /// As it is told.
    file: String,
    connection: AnyConnection,
}

impl Source {
    fn whole(&self, message: String) -> LogError {
        LogError::Whole { file: self.file.clone(), message }
    }

    fn failed(&self, error: &sqlx::Error) -> LogError {
        self.whole(format!("cannot be read: {error}; is it the store of another version?"))
    }

    async fn table(&mut self, query: &StoreQuery) -> Result<(Table, Timestamp), LogError> {
        let between = (query.from.map_or(i64::MIN, Timestamp::unix_ms), query.to.map_or(i64::MAX, Timestamp::unix_ms));
        match &query.subject {
            Subject::Robot(robot) => self.gauges(gauge::OF_ROBOT, ("", robot), between).await,
            Subject::Pack { station, pack } => self.gauges(gauge::OF_PACK, (station, pack), between).await,
            Subject::Station(station) => self.station(station, between).await,
        }
    }

    /// The coolest that any battery was over a log, and shortly before it: none that is left alone is cooler than what is around it.
    async fn coolest(&mut self, table: &Table, begin: Timestamp) -> Result<Option<(f64, String)>, LogError> {
        let length_s = table.columns.first().and_then(|time_s| time_s.numbers().last().copied()).unwrap_or(0.0);
        let (from_ms, to_ms) = (begin.plus_s(-COOLS_S).unix_ms(), begin.plus_s(length_s).unix_ms());
        let found = query_as::<_, (f64, String)>(COOLEST).bind(from_ms).bind(to_ms).fetch_optional(&mut self.connection).await;
        found.map_err(|error| self.failed(&error))
    }

    /// Why there is no row: the name is unknown, or nothing happened then.
    async fn no_rows(&mut self, what: &str, name: &str, names: &'static str, ends: &'static str) -> LogError {
        let known: Vec<String> = match query_scalar(names).fetch_all(&mut self.connection).await {
            Ok(known) => known,
            Err(error) => return self.failed(&error),
        };
        if known.is_empty() {
            return self.whole(format!("holds no {what} yet"));
        }
        if !known.iter().any(|known| known == name) {
            let near = hint(name, known.iter().map(String::as_str));
            return self.whole(format!("no {what} `{name}`{near} It holds: {}", known.join(", ")));
        }
        match query_as::<_, (i64, i64)>(ends).bind(name.to_owned()).fetch_one(&mut self.connection).await {
            Ok((first, last)) => {
                let [first, last] = [first, last].map(Timestamp::from_unix_ms);
                self.whole(format!("no row of {what} `{name}` lies between --from and --to; its rows reach from {first} to {last}"))
            }
            Err(error) => self.failed(&error),
        }
    }
}

/// Seconds between two instants in milliseconds.
fn seconds(from_ms: i64, to_ms: i64) -> f64 {
    Timestamp::from_unix_ms(to_ms).seconds_since(Timestamp::from_unix_ms(from_ms))
}

/// Numbers the next row of a table.
fn count_row(file: &str, table: &mut Table) -> Result<(), LogError> {
    table.lines.push(table.lines.len() as u64 + 1);
    check_cells(file, table)
}
