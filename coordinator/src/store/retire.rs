//! What is old is thinned, and what is older is deleted, a little at a time.
//!
//! ```text
//!   now ── fine ────────────── keep ──────────>  older
//!    all that was told │ a row in `coarse` │ gone
//!    plans, inputs     │ gone
//!    events, commands                      │ gone
//! ```
//!
//! Old is what the coordinator's clock says: telemetry whose sender has another clock is dated by when it came (`came_ms`).
//! Nothing here takes part in a decision: it may be late, or not run at all.

use energy::units::S_PER_H;
use proto::Timestamp;
use sqlx::any::AnyArguments;
use sqlx::query::Query;
use sqlx::{Any, AnyConnection, query, query_as, query_scalar};

use super::{Store, StoreError};

/// What is kept: instants that move with the clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Retention {
    /// Older telemetry is thinned; older plans and inputs are deleted.
    pub fine: Timestamp,
    /// To a row in this time, s.
    pub coarse_s: f64,
    /// Older telemetry, events and commands are deleted.
    pub keep: Timestamp,
}

/// A table of telemetry, and the columns that say whose it is.
struct Table {
    name: &'static str,
    whose: &'static [&'static str],
}

const TABLES: [Table; 4] = [
    Table { name: "robot_gauges", whose: &["robot"] },
    Table { name: "robot_states", whose: &["robot"] },
    Table { name: "pack_gauges", whose: &["station", "pack"] },
    Table { name: "station_states", whose: &["station"] },
];

/// By what telemetry is dated, and which rows are: by their senders' clocks, and where those are wrong by when they came.
const DATED: [(&str, &str); 2] = [("at_ms", " AND came_ms IS NULL"), ("came_ms", "")];

/// Senders whose telemetry is looked at in one step.
const SENDERS_AT_ONCE: usize = 20;
/// Rows of other tables that one step may delete.
const ROWS_AT_ONCE: i64 = 20_000;
/// Telemetry that one round may thin, ms: an old store is caught up with hour by hour.
const THINNED_AT_ONCE_MS: i64 = 6 * 1000 * S_PER_H as i64;

/// Where the work stands: it goes round all tables and senders, again and again.
#[derive(Debug, Default)]
pub struct Sweep {
    table: usize,
    after: Vec<String>,
    /// What this round thins, Unix ms: from, to.
    window: Option<(i64, i64)>,
}

impl Store {
    /// One step of a sweep. Call it about once a second: it goes from sender to sender until some have been looked at, or it is `enough`.
    ///
    /// # Errors
    /// When the store cannot be written; the step may be made again.
    pub async fn retire(&self, retention: &Retention, sweep: &mut Sweep, enough: impl Fn() -> bool) -> Result<(), StoreError> {
        let failed = |source| StoreError::database(&self.path, "deleting what is old", source);
        let mut connection = self.writer.acquire().await.map_err(failed)?;
        forget(&mut connection, retention).await.map_err(failed)?;
        sweep.step(&mut connection, retention, enough).await.map_err(failed)
    }
}

/// Deletes the oldest of what is not telemetry. The newest event and the newest plan stay: numbers go on from them.
async fn forget(connection: &mut AnyConnection, retention: &Retention) -> Result<(), sqlx::Error> {
    let (fine_ms, keep_ms) = (retention.fine.unix_ms(), retention.keep.unix_ms());
    // What a start was told goes from its beginning on, also what a clock that was set back later had called younger: a hole would look like lines
    // that were lost.
    let old = "SELECT epoch, number FROM inputs WHERE at_ms < $1 ORDER BY at_ms LIMIT $2";
    let last = sqlx::AssertSqlSafe(format!("SELECT epoch, MAX(number) FROM ({old}) AS old GROUP BY epoch"));
    let last: Vec<(i64, i64)> = query_as(last).bind(fine_ms).bind(ROWS_AT_ONCE).fetch_all(&mut *connection).await?;
    for (epoch, number) in last {
        let delete = query("DELETE FROM inputs WHERE epoch = $1 AND number <= $2").bind(epoch).bind(number);
        delete.execute(&mut *connection).await?;
    }
    for (before_ms, table, key, but) in [
        (fine_ms, "plans", "plan", " AND plan < (SELECT MAX(plan) FROM plans)"),
        (fine_ms, "capacities", "number", ""),
        (keep_ms, "events", "seq", " AND seq < (SELECT MAX(seq) FROM events)"),
        (keep_ms, "commands", "id", ""),
    ] {
        // All of it by the index over time: what has a time to come stands in nobody's way.
        let oldest = sqlx::AssertSqlSafe(format!("SELECT MIN(at_ms) FROM {table}"));
        let oldest_ms: Option<i64> = query_scalar(oldest).fetch_one(&mut *connection).await?;
        if oldest_ms.is_none_or(|at_ms| at_ms >= before_ms) {
            continue;
        }
        let old = format!("SELECT {key} FROM {table} WHERE at_ms < $1{but} ORDER BY at_ms LIMIT $2");
        let delete = sqlx::AssertSqlSafe(format!("DELETE FROM {table} WHERE ({key}) IN ({old})"));
        query(delete).bind(before_ms).bind(ROWS_AT_ONCE).execute(&mut *connection).await?;
    }
    Ok(())
}

impl Sweep {
    async fn step(&mut self, connection: &mut AnyConnection, retention: &Retention, enough: impl Fn() -> bool) -> Result<(), sqlx::Error> {
        let (from_ms, to_ms) = match self.window {
            Some(window) => window,
            None => *self.window.insert(window(connection, retention).await?),
        };
        let coarse_ms = coarse_ms(retention);
        let keep_ms = retention.keep.unix_ms();
        for _ in 0..SENDERS_AT_ONCE {
            let table = &TABLES[self.table];
            let Some(sender) = table.next(connection, &self.after).await? else {
                self.after.clear();
                self.table += 1;
                if self.table == TABLES.len() {
                    self.table = 0;
                    self.window = None;
                    thinned_until(connection, to_ms).await?;
                    return Ok(());
                }
                continue;
            };
            for (clock, dated) in DATED {
                let whose = format!("{}{dated}", table.is(0));
                let delete = format!("DELETE FROM {} WHERE {whose} AND {clock} < ${}", table.name, sender.len() + 1);
                bound(delete, &sender, &[keep_ms]).execute(&mut *connection).await?;
                if from_ms < to_ms {
                    let [a, b, c] = [1, 2, 3].map(|n| format!("${}", sender.len() + n));
                    let within = format!("{whose} AND {clock} >= {a} AND {clock} < {b}");
                    let first = format!("SELECT MIN({clock}) FROM {} WHERE {within} GROUP BY {clock} / {c}", table.name);
                    let thin = format!("DELETE FROM {} WHERE {within} AND {clock} NOT IN ({first})", table.name);
                    bound(thin, &sender, &[from_ms, to_ms, coarse_ms]).execute(&mut *connection).await?;
                }
            }
            self.after = sender;
            if enough() {
                break;
            }
        }
        Ok(())
    }
}

impl Table {
    /// The sender after this one, in order of names.
    async fn next(&self, connection: &mut AnyConnection, after: &[String]) -> Result<Option<Vec<String>>, sqlx::Error> {
        let columns = self.whose.join(", ");
        let places: Vec<String> = (1..=self.whose.len()).map(|n| format!("${n}")).collect();
        let beyond = if after.is_empty() { String::new() } else { format!("WHERE ({columns}) > ({})", places.join(", ")) };
        let select = format!("SELECT {columns} FROM {} {beyond} ORDER BY {columns} LIMIT 1", self.name);
        let select = sqlx::AssertSqlSafe(select);
        Ok(match self.whose.len() {
            1 => {
                let mut one = query_as::<_, (String,)>(select);
                for name in after {
                    one = one.bind(name.clone());
                }
                one.fetch_optional(connection).await?.map(|(name,)| vec![name])
            }
            _ => {
                let mut two = query_as::<_, (String, String)>(select);
                for name in after {
                    two = two.bind(name.clone());
                }
                two.fetch_optional(connection).await?.map(|(first, second)| vec![first, second])
            }
        })
    }

    /// The condition that a row is of the sender whose names are bound after the first `bound` values.
    fn is(&self, bound: usize) -> String {
        let equals: Vec<String> = self.whose.iter().zip(bound + 1..).map(|(column, n)| format!("{column} = ${n}")).collect();
        equals.join(" AND ")
    }
}

/// A statement with a sender's names and numbers bound to it.
fn bound(sql: String, sender: &[String], numbers: &[i64]) -> Query<'static, Any, AnyArguments> {
    let mut statement = query(sqlx::AssertSqlSafe(sql));
    for name in sender {
        statement = statement.bind(name.clone());
    }
    for number in numbers {
        statement = statement.bind(*number);
    }
    statement
}

fn coarse_ms(retention: &Retention) -> i64 {
    ((retention.coarse_s * 1e3) as i64).max(1)
}

/// What the next round thins: from where the last one ended.
async fn window(connection: &mut AnyConnection, retention: &Retention) -> Result<(i64, i64), sqlx::Error> {
    let coarse_ms = coarse_ms(retention);
    let fine_ms = retention.fine.unix_ms() / coarse_ms * coarse_ms;
    let select = "SELECT value FROM meta WHERE name = 'thinned_until_ms'";
    let until: Option<i64> = query_scalar(select).fetch_optional(&mut *connection).await?;
    let from_ms = match until {
        Some(until) => until,
        None => oldest(connection).await?.unwrap_or(fine_ms),
    };
    // Another `coarse` than before must not divide its rows.
    let from_ms = from_ms.max(retention.keep.unix_ms()) / coarse_ms * coarse_ms;
    Ok((from_ms, fine_ms.min(from_ms + THINNED_AT_ONCE_MS / coarse_ms * coarse_ms)))
}

async fn oldest(connection: &mut AnyConnection) -> Result<Option<i64>, sqlx::Error> {
    let select = "SELECT MIN(at_ms) FROM (SELECT MIN(at_ms) AS at_ms FROM robot_gauges UNION ALL SELECT MIN(at_ms) FROM robot_states \
                  UNION ALL SELECT MIN(at_ms) FROM pack_gauges UNION ALL SELECT MIN(at_ms) FROM station_states) AS oldest";
    query_scalar(select).fetch_one(connection).await
}

async fn thinned_until(connection: &mut AnyConnection, until_ms: i64) -> Result<(), sqlx::Error> {
    let insert = "INSERT INTO meta (name, value) VALUES ('thinned_until_ms', $1) ON CONFLICT (name) DO UPDATE SET value = excluded.value";
    query(insert).bind(until_ms).execute(connection).await.map(drop)
}
