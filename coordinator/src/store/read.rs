//! Questions to the store.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use proto::{Capacity, Estimate, Event, EventKind, Explanation, Gauge, Message, RobotId, Schedule, StationId, Timestamp, decode};
use sqlx::AnyPool;
use sqlx::any::{AnyPoolOptions, AnyRow};
use sqlx::{Row, query, query_as, query_scalar};

use super::{Heard, Record, StoreError, What, inputs, place, server, shown};
use crate::core::Numbering;

/// A store open for reading. It sees every batch as soon as that is appended, whole.
#[derive(Debug, Clone)]
pub struct Reader {
    path: PathBuf,
    pub(super) pool: AnyPool,
}

impl Reader {
    pub(super) async fn connect(address: &str, asked: &Path) -> Result<Self, StoreError> {
        let failed = |source| StoreError::database(asked, "opening it for reading", source);
        let options = place::any(address).map_err(failed)?;
        if server::is_address(asked) {
            server::reach(&options, asked).await?;
        }
        let pool = AnyPoolOptions::new().max_connections(2).test_before_acquire(false).acquire_timeout(super::PATIENCE);
        let pool = pool.connect_with(options).await.map_err(failed)?;
        Ok(Self { path: asked.to_owned(), pool })
    }

    /// The file, as it was named when opening.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Lets go of the file. Dropping does the same a little later.
    pub async fn close(&self) {
        self.pool.close().await;
    }

    /// Whose it is; none in one that only simulations wrote.
    pub async fn site(&self) -> Result<Option<String>, StoreError> {
        let select = query_scalar("SELECT value FROM facts WHERE name = 'site'");
        select.fetch_optional(&self.pool).await.map_err(self.failed("looking whose it is"))
    }

    /// The plan made last.
    pub async fn latest_schedule(&self) -> Result<Option<Schedule>, StoreError> {
        let select = "SELECT body FROM plans ORDER BY plan DESC LIMIT 1";
        let body = query_scalar(select).fetch_optional(&self.pool).await.map_err(self.failed("reading plans"))?;
        self.message(body, "plans")
    }

    /// The capacity computed last.
    pub async fn latest_capacity(&self) -> Result<Option<Capacity>, StoreError> {
        let select = "SELECT body FROM capacities ORDER BY number DESC LIMIT 1";
        let body = query_scalar(select).fetch_optional(&self.pool).await.map_err(self.failed("reading capacities"))?;
        self.message(body, "capacities")
    }

    /// The explanation given last for this robot.
    pub async fn latest_explanation(&self, robot: &RobotId) -> Result<Option<Explanation>, StoreError> {
        let select = query_scalar("SELECT body FROM explanations WHERE robot = $1").bind(robot.as_str());
        let body = select.fetch_optional(&self.pool).await.map_err(self.failed("reading explanations"))?;
        self.message(body, "explanations")
    }

    /// Robots that were explained, by name.
    pub async fn explained(&self) -> Result<Vec<String>, StoreError> {
        let select = query_scalar("SELECT robot FROM explanations ORDER BY robot");
        select.fetch_all(&self.pool).await.map_err(self.failed("reading explanations"))
    }

    /// The last `limit` events, oldest first.
    pub async fn events(&self, limit: usize) -> Result<Vec<Event>, StoreError> {
        self.events_of(limit, None, None).await
    }

    /// The last `limit` events of this robot and this kind, as far as these are named, oldest first.
    pub async fn events_of(&self, limit: usize, robot: Option<&RobotId>, kind: Option<EventKind>) -> Result<Vec<Event>, StoreError> {
        let limit = i64::try_from(limit).unwrap_or(i64::MAX);
        let select = match (robot, kind) {
            (None, None) => "SELECT body FROM events ORDER BY seq DESC LIMIT $1",
            (Some(_), None) => "SELECT body FROM events WHERE robot = $2 ORDER BY seq DESC LIMIT $1",
            (None, Some(_)) => "SELECT body FROM events WHERE kind = $2 ORDER BY seq DESC LIMIT $1",
            (Some(_), Some(_)) => "SELECT body FROM events WHERE robot = $2 AND kind = $3 ORDER BY seq DESC LIMIT $1",
        };
        let named = robot.map(ToString::to_string).into_iter().chain(kind.map(|kind| kind.to_string()));
        let select = named.fold(query_scalar::<_, String>(select).bind(limit), |select, name| select.bind(name));
        let bodies = select.fetch_all(&self.pool).await.map_err(self.failed("reading events"))?;
        bodies.iter().rev().map(|body| self.decode(body, "events")).collect()
    }

    /// Robots of which there are events, by name.
    pub async fn robots_of_events(&self) -> Result<Vec<String>, StoreError> {
        let select = query_scalar("SELECT DISTINCT robot FROM events WHERE robot IS NOT NULL ORDER BY robot");
        select.fetch_all(&self.pool).await.map_err(self.failed("reading events"))
    }

    /// Where the numbers of each start of a coordinator began, oldest first.
    pub async fn starts(&self) -> Result<Vec<Numbering>, StoreError> {
        let rows: Vec<(i64, i64, i64)> = query_as("SELECT epoch, event, plan FROM starts ORDER BY epoch")
            .fetch_all(&self.pool)
            .await
            .map_err(self.failed("reading starts"))?;
        let number = |number: i64| number.cast_unsigned();
        Ok(rows
            .into_iter()
            .map(|(epoch, event, plan)| Numbering { epoch: number(epoch), event: number(event), plan: number(plan) })
            .collect())
    }

    /// Number of the last thing that the core of that start was told; 0 before the first.
    pub async fn heard_last(&self, epoch: u64) -> Result<u64, StoreError> {
        let select = query_scalar::<_, Option<i64>>("SELECT MAX(number) FROM inputs WHERE epoch = $1").bind(epoch.cast_signed());
        let last = select.fetch_one(&self.pool).await.map_err(self.failed("reading inputs"))?;
        Ok(last.unwrap_or(0).cast_unsigned())
    }

    /// The first thing that the core of that start was told, of those that are kept: its number, and when.
    pub async fn heard_first(&self, epoch: u64) -> Result<Option<(u64, Timestamp)>, StoreError> {
        let select = query_as("SELECT number, at_ms FROM inputs WHERE epoch = $1 ORDER BY number LIMIT 1").bind(epoch.cast_signed());
        let first: Option<(i64, i64)> = select.fetch_optional(&self.pool).await.map_err(self.failed("reading inputs"))?;
        Ok(first.map(|(number, at_ms)| (number.cast_unsigned(), Timestamp::from_unix_ms(at_ms))))
    }

    /// What the core of that start was told after line `after`, in order; at most `limit` lines.
    pub async fn heard(&self, epoch: u64, after: u64, limit: usize) -> Result<Vec<Heard>, StoreError> {
        let select = query("SELECT * FROM inputs WHERE epoch = $1 AND number > $2 ORDER BY number LIMIT $3")
            .bind(epoch.cast_signed())
            .bind(after.cast_signed())
            .bind(i64::try_from(limit).unwrap_or(i64::MAX));
        let rows = select.fetch_all(&self.pool).await.map_err(self.failed("reading inputs"))?;
        rows.iter().map(inputs::heard).collect::<Result<_, _>>().map_err(self.failed("reading inputs"))
    }

    /// The message that a line points to; none for one that says all itself, or whose telemetry was
    /// dropped.
    pub async fn message_of(&self, heard: &Heard) -> Result<Option<Record>, StoreError> {
        let failed = self.failed("reading what a line points to");
        let at = |at: &Timestamp, seq: &u64| (at.unix_ms(), seq.cast_signed());
        let (select, names, (at_ms, seq)) = match &heard.what {
            What::RobotGauge(robot, when, seq) => (
                "SELECT * FROM robot_gauges WHERE robot = $1 AND robot = $2 AND at_ms = $3 AND seq = $4",
                [robot.as_str(); 2],
                at(when, seq),
            ),
            What::PackGauge(station, pack, when, seq) => {
                let names = [station.as_str(), pack.as_str()];
                ("SELECT * FROM pack_gauges WHERE station = $1 AND pack = $2 AND at_ms = $3 AND seq = $4", names, at(when, seq))
            }
            What::RobotState(robot, when, seq) => (
                "SELECT body FROM robot_states WHERE robot = $1 AND robot = $2 AND at_ms = $3 AND seq = $4",
                [robot.as_str(); 2],
                at(when, seq),
            ),
            What::StationState(station, when, seq) => {
                let select = "SELECT body FROM station_states WHERE station = $1 AND station = $2 AND at_ms = $3 AND seq = $4";
                (select, [station.as_str(); 2], at(when, seq))
            }
            _ => return Ok(None),
        };
        let row = query(select).bind(names[0]).bind(names[1]).bind(at_ms).bind(seq).fetch_optional(&self.pool).await.map_err(&failed)?;
        let Some(row) = row else { return Ok(None) };
        let body = || row.try_get::<String, _>("body").map_err(&failed);
        Ok(Some(match heard.what.clone() {
            What::RobotGauge(robot, ..) => Record::RobotGauge { robot, gauge: gauge(&row).map_err(&failed)? },
            What::PackGauge(station, pack, ..) => Record::PackGauge { station, pack, gauge: gauge(&row).map_err(&failed)? },
            What::RobotState(robot, ..) => Record::RobotState { robot, state: self.decode(&body()?, "robot_states")? },
            What::StationState(station, ..) => Record::StationState { station, state: self.decode(&body()?, "station_states")? },
            _ => return Ok(None),
        }))
    }

    /// Events, plans and commands of one start, each kind in order, up to where the next one began.
    pub async fn decisions(&self, start: Numbering, next: Option<Numbering>) -> Result<Vec<Record>, StoreError> {
        let failed = self.failed("reading decisions");
        let (event, plan) = next.map_or((i64::MAX, i64::MAX), |next| (next.event.cast_signed(), next.plan.cast_signed()));
        let select = query_scalar::<_, String>("SELECT body FROM events WHERE seq >= $1 AND seq < $2 ORDER BY seq");
        let events = select.bind(start.event.cast_signed()).bind(event).fetch_all(&self.pool).await.map_err(&failed)?;
        let select = query_scalar::<_, String>("SELECT body FROM plans WHERE plan >= $1 AND plan < $2 ORDER BY plan");
        let plans = select.bind(start.plan.cast_signed()).bind(plan).fetch_all(&self.pool).await.map_err(&failed)?;
        let select = query_as("SELECT id, robot, station, body FROM commands WHERE epoch = $1").bind(start.epoch.cast_signed());
        let mut commands: Vec<CommandColumns> = select.fetch_all(&self.pool).await.map_err(&failed)?;
        // Ids end with a number that counts up.
        commands.sort_by_key(|(id, ..)| id.rsplit('-').next().and_then(|n| n.parse::<u64>().ok()).unwrap_or(0));
        let mut records = Vec::new();
        for body in &events {
            records.push(Record::Event(self.decode(body, "events")?));
        }
        for body in &plans {
            records.push(Record::Plan(Arc::new(self.decode(body, "plans")?)));
        }
        for command in commands {
            records.push(self.command(command)?);
        }
        Ok(records)
    }

    /// The number for the next event: one above the largest so far, 1 in an empty store.
    pub async fn next_event_seq(&self) -> Result<u64, StoreError> {
        self.number("SELECT COALESCE(MAX(seq), 0) + 1 FROM events", "reading events").await
    }

    /// The number for the next plan: one above the largest so far, 1 in an empty store.
    pub async fn next_plan(&self) -> Result<u64, StoreError> {
        self.number("SELECT COALESCE(MAX(plan), 0) + 1 FROM plans", "reading plans").await
    }

    async fn number(&self, select: &'static str, doing: &'static str) -> Result<u64, StoreError> {
        let number: i64 = query_scalar(select).fetch_one(&self.pool).await.map_err(self.failed(doing))?;
        u64::try_from(number).map_err(|_| self.damaged(format!("{doing}: {number} is below zero")))
    }

    fn command(&self, (_, robot, station, body): CommandColumns) -> Result<Record, StoreError> {
        let bad_id = |error: proto::IdError| self.damaged(format!("table commands: {error}"));
        Ok(match (robot, station) {
            (Some(robot), None) => {
                Record::RobotCommand { robot: RobotId::new(robot).map_err(bad_id)?, command: self.decode(&body, "commands")? }
            }
            (None, Some(station)) => {
                Record::StationCommand { station: StationId::new(station).map_err(bad_id)?, command: self.decode(&body, "commands")? }
            }
            _ => return Err(self.damaged(format!("table commands: not one addressee: {body}"))),
        })
    }

    fn message<M: Message>(&self, body: Option<String>, table: &str) -> Result<Option<M>, StoreError> {
        body.map(|body| self.decode(&body, table)).transpose()
    }

    fn decode<M: Message>(&self, body: &str, table: &str) -> Result<M, StoreError> {
        decode(body.as_bytes()).map_err(|error| self.damaged(format!("table {table}: {error}")))
    }

    fn damaged(&self, detail: String) -> StoreError {
        StoreError::Damaged { path: shown(&self.path), detail }
    }

    fn failed(&self, doing: &'static str) -> impl Fn(sqlx::Error) -> StoreError {
        move |source| StoreError::database(&self.path, doing, source)
    }
}

/// Id, robot, station and body.
type CommandColumns = (String, Option<String>, Option<String>, String);

fn gauge(row: &AnyRow) -> Result<Gauge, sqlx::Error> {
    let estimate = |value: &str, sigma: &str| Ok::<_, sqlx::Error>(Estimate::new(row.try_get(value)?, row.try_get(sigma)?));
    let perhaps = |value: &str, sigma: &str| {
        let pair: (Option<f64>, Option<f64>) = (row.try_get(value)?, row.try_get(sigma)?);
        Ok::<_, sqlx::Error>(pair.0.zip(pair.1).map(|(value, sigma)| Estimate::new(value, sigma)))
    };
    Ok(Gauge {
        at: Timestamp::from_unix_ms(row.try_get("at_ms")?),
        seq: row.try_get::<i64, _>("seq")?.cast_unsigned(),
        soc: estimate("soc", "soc_sigma")?,
        remaining_wh: estimate("remaining_wh", "remaining_wh_sigma")?,
        full_wh: estimate("full_wh", "full_wh_sigma")?,
        time_to_empty_s: perhaps("time_to_empty_s", "time_to_empty_s_sigma")?,
        time_to_full_s: perhaps("time_to_full_s", "time_to_full_s_sigma")?,
        soh: estimate("soh", "soh_sigma")?,
        cycles: row.try_get("cycles")?,
        voltage_v: row.try_get("voltage_v")?,
        current_a: row.try_get("current_a")?,
        temperature_degc: row.try_get("temperature_degc")?,
        power_w: row.try_get("power_w")?,
        cells_series: u32::try_from(row.try_get::<i64, _>("cells_series")?).map_err(|error| sqlx::Error::Decode(Box::new(error)))?,
        source: row.try_get("source")?,
    })
}
