//! Records into rows, within the transaction of the caller.

use std::path::Path;

use proto::{
    Capacity, CommandReply, Estimate, Event, Explanation, Gauge, MAX_MESSAGE_BYTES, Message, PackId, RobotId, RobotState, Schedule,
    StationId, StationState, encode,
};
use sqlx::query_builder::Separated;
use sqlx::{QueryBuilder, Sqlite, SqliteConnection, query, query_scalar};

use super::{Record, StoreError};

/// Rows per INSERT of telemetry: enough to make the cost of a statement small, and fewer
/// than 32,766 parameters, SQLite's limit.
const ROWS_PER_INSERT: usize = 64;

/// The columns of both gauge tables after those that name the battery.
macro_rules! gauge_columns {
    () => {
        "at_ms, seq, soc, soc_sigma, remaining_wh, remaining_wh_sigma, full_wh, full_wh_sigma, \
         time_to_empty_s, time_to_empty_s_sigma, time_to_full_s, time_to_full_s_sigma, soh, soh_sigma, cycles, \
         voltage_v, current_a, temperature_degc, power_w, cells_series, source"
    };
}

/// A batch that is known to be readable again, telemetry by table.
#[derive(Debug, Default)]
pub(super) struct Batch<'a> {
    robot_gauges: Vec<(&'a RobotId, &'a Gauge)>,
    pack_gauges: Vec<(&'a StationId, &'a PackId, &'a Gauge)>,
    robot_states: Vec<(&'a RobotId, &'a RobotState, String)>,
    station_states: Vec<(&'a StationId, &'a StationState, String)>,
    /// The rest, in the order given.
    decisions: Vec<Decision<'a>>,
}

#[derive(Debug)]
enum Decision<'a> {
    Event(&'a Event, i64, String),
    Plan(&'a Schedule, i64, String),
    Capacity(&'a Capacity, String),
    Explanation(&'a Explanation, String),
    Command(CommandRow<'a>),
    Reply(&'a CommandReply, String),
}

/// What commands to robots and to stations have in common.
#[derive(Debug)]
struct CommandRow<'a> {
    id: &'a str,
    epoch: i64,
    at_ms: i64,
    deadline_ms: i64,
    robot: Option<&'a str>,
    station: Option<&'a str>,
    body: String,
}

impl<'a> Batch<'a> {
    pub(super) fn sorted(records: &'a [Record]) -> Result<Self, StoreError> {
        let mut batch = Self::default();
        for record in records {
            batch.take(record)?;
        }
        Ok(batch)
    }

    fn take(&mut self, record: &'a Record) -> Result<(), StoreError> {
        match record {
            Record::RobotGauge { robot, gauge } => {
                check(gauge, || format!("a gauge of robot {robot}"))?;
                self.robot_gauges.push((robot, gauge));
            }
            Record::PackGauge { station, pack, gauge } => {
                check(gauge, || format!("a gauge of pack {pack} of station {station}"))?;
                self.pack_gauges.push((station, pack, gauge));
            }
            Record::RobotState { robot, state } => {
                self.robot_states.push((robot, state, body(state, || format!("a state of robot {robot}"))?));
            }
            Record::StationState { station, state } => {
                self.station_states.push((station, state, body(state, || format!("a state of station {station}"))?));
            }
            Record::Explanations(explanations) => {
                for explanation in explanations {
                    let body = body(explanation, || format!("the explanation of robot {}", explanation.robot))?;
                    self.decisions.push(Decision::Explanation(explanation, body));
                }
            }
            Record::Heard(_) => {}
            decision => self.decisions.push(Decision::of(decision)?),
        }
        Ok(())
    }

    /// Writes everything. Telemetry that is there already is skipped: a message may arrive
    /// twice, and nothing that a network brings may make a batch fail.
    pub(super) async fn write(&self, connection: &mut SqliteConnection, path: &Path) -> Result<(), StoreError> {
        self.write_telemetry(connection).await.map_err(|source| StoreError::database(path, "writing telemetry", source))?;
        for decision in &self.decisions {
            let kept = decision.write(connection).await.map_err(|source| StoreError::database(path, "writing decisions", source))?;
            if kept == Kept::OtherUnderThisName {
                return Err(StoreError::Conflict { path: path.to_owned(), record: decision.name() });
            }
        }
        Ok(())
    }

    async fn write_telemetry(&self, connection: &mut SqliteConnection) -> Result<(), sqlx::Error> {
        let into = concat!("INSERT INTO robot_gauges (robot, ", gauge_columns!(), ") ");
        insert(connection, into, &self.robot_gauges, |row, (robot, gauge)| {
            row.push_bind(robot.as_str());
            bind_gauge(row, gauge);
        })
        .await?;
        let into = concat!("INSERT INTO pack_gauges (station, pack, ", gauge_columns!(), ") ");
        insert(connection, into, &self.pack_gauges, |row, (station, pack, gauge)| {
            row.push_bind(station.as_str()).push_bind(pack.as_str());
            bind_gauge(row, gauge);
        })
        .await?;
        let into = "INSERT INTO robot_states (robot, at_ms, seq, phase, station, bay, drain_w, drain_w_sigma, battery, body) ";
        insert(connection, into, &self.robot_states, |row, (robot, state, body)| {
            row.push_bind(robot.as_str()).push_bind(state.at.unix_ms()).push_bind(state.seq.cast_signed());
            row.push_bind(state.phase.to_string());
            row.push_bind(state.station.as_ref().map(StationId::as_str)).push_bind(state.bay.as_ref().map(AsRef::<str>::as_ref));
            bind_estimate(row, state.drain_w);
            row.push_bind(state.battery.as_str()).push_bind(body.as_str());
        })
        .await?;
        let into = "INSERT INTO station_states (station, at_ms, seq, active_pack, powered, lift_busy, pack_power_w, body) ";
        insert(connection, into, &self.station_states, |row, (station, state, body)| {
            row.push_bind(station.as_str()).push_bind(state.at.unix_ms()).push_bind(state.seq.cast_signed());
            row.push_bind(state.active_pack.as_ref().map(PackId::as_str));
            row.push_bind(state.powered).push_bind(state.lift_busy).push_bind(state.pack_power_w).push_bind(body.as_str());
        })
        .await
    }
}

/// Many rows with few statements.
async fn insert<T>(
    connection: &mut SqliteConnection,
    into: &str,
    rows: &[T],
    bind: impl Fn(&mut Separated<'_, Sqlite, &'static str>, &T),
) -> Result<(), sqlx::Error> {
    for chunk in rows.chunks(ROWS_PER_INSERT) {
        let mut sql = QueryBuilder::<Sqlite>::new(into);
        sql.push_values(chunk, |mut row, item| bind(&mut row, item));
        sql.push(" ON CONFLICT DO NOTHING");
        // Only whole chunks come again in the same words; the others are not worth keeping
        // a prepared statement for.
        sql.build().persistent(chunk.len() == ROWS_PER_INSERT).execute(&mut *connection).await?;
    }
    Ok(())
}

fn bind_estimate(row: &mut Separated<'_, Sqlite, &'static str>, estimate: Estimate) {
    row.push_bind(estimate.value).push_bind(estimate.sigma);
}

fn bind_gauge(row: &mut Separated<'_, Sqlite, &'static str>, gauge: &Gauge) {
    row.push_bind(gauge.at.unix_ms()).push_bind(gauge.seq.cast_signed());
    bind_estimate(row, gauge.soc);
    bind_estimate(row, gauge.remaining_wh);
    bind_estimate(row, gauge.full_wh);
    for time_s in [gauge.time_to_empty_s, gauge.time_to_full_s] {
        row.push_bind(time_s.map(|t| t.value)).push_bind(time_s.map(|t| t.sigma));
    }
    bind_estimate(row, gauge.soh);
    row.push_bind(gauge.cycles);
    row.push_bind(gauge.voltage_v).push_bind(gauge.current_a).push_bind(gauge.temperature_degc).push_bind(gauge.power_w);
    row.push_bind(i64::from(gauge.cells_series)).push_bind(gauge.source.as_str());
}

/// What became of a record that has a name of its own.
#[derive(Debug, PartialEq, Eq)]
enum Kept {
    Yes,
    OtherUnderThisName,
}

impl Kept {
    fn if_equal(stored: &str, given: &str) -> Self {
        if stored == given { Self::Yes } else { Self::OtherUnderThisName }
    }
}

impl<'a> Decision<'a> {
    fn of(record: &'a Record) -> Result<Self, StoreError> {
        Ok(match record {
            Record::Event(event) => {
                let name = || format!("event {}", event.seq);
                Self::Event(event, count(event.seq, name)?, body(event, name)?)
            }
            Record::Plan(schedule) => {
                let name = || format!("plan {}", schedule.plan);
                Self::Plan(schedule, count(schedule.plan, name)?, body(schedule, name)?)
            }
            Record::Capacity(capacity) => Self::Capacity(capacity, body(capacity, || format!("the capacity at {}", capacity.at))?),
            Record::RobotCommand { robot, command } => Self::command(command, Some(robot), None)?,
            Record::StationCommand { station, command } => Self::command(command, None, Some(station))?,
            Record::Reply(reply) => Self::Reply(reply, body(reply, || format!("the reply to command {}", reply.id))?),
            Record::RobotGauge { .. }
            | Record::PackGauge { .. }
            | Record::RobotState { .. }
            | Record::StationState { .. }
            | Record::Heard(_)
            | Record::Explanations(_) => unreachable!("`Batch::take` keeps these apart"),
        })
    }

    fn command<A>(command: &'a proto::Command<A>, robot: Option<&'a RobotId>, station: Option<&'a StationId>) -> Result<Self, StoreError>
    where
        proto::Command<A>: Message,
    {
        let name = || format!("command {}", command.id);
        Ok(Self::Command(CommandRow {
            id: command.id.as_str(),
            epoch: count(command.epoch, name)?,
            at_ms: command.at.unix_ms(),
            deadline_ms: command.deadline.unix_ms(),
            robot: robot.map(RobotId::as_str),
            station: station.map(StationId::as_str),
            body: body(command, name)?,
        }))
    }

    fn name(&self) -> String {
        match self {
            Self::Event(event, ..) => format!("event {}", event.seq),
            Self::Plan(schedule, ..) => format!("plan {}", schedule.plan),
            Self::Capacity(capacity, _) => format!("the capacity at {}", capacity.at),
            Self::Explanation(explanation, _) => format!("the explanation of robot {}", explanation.robot),
            Self::Command(command) => format!("command {}", command.id),
            Self::Reply(reply, _) => format!("the reply to command {}", reply.id),
        }
    }

    async fn write(&self, connection: &mut SqliteConnection) -> Result<Kept, sqlx::Error> {
        match self {
            Self::Event(event, seq, body) => write_event(connection, event, *seq, body).await,
            Self::Plan(schedule, plan, body) => write_plan(connection, schedule, *plan, body).await,
            Self::Capacity(capacity, body) => write_capacity(connection, capacity, body).await,
            Self::Explanation(explanation, body) => write_explanation(connection, explanation, body).await,
            Self::Command(command) => write_command(connection, command).await,
            Self::Reply(reply, body) => write_reply(connection, reply, body).await,
        }
    }
}

async fn write_event(connection: &mut SqliteConnection, event: &Event, seq: i64, body: &str) -> Result<Kept, sqlx::Error> {
    let insert = "INSERT INTO events (seq, at_ms, kind, robot, station, pack, body) VALUES ($1, $2, $3, $4, $5, $6, $7) \
                  ON CONFLICT (seq) DO NOTHING";
    let inserted = query(insert)
        .bind(seq)
        .bind(event.at.unix_ms())
        .bind(event.kind.to_string())
        .bind(event.robot.as_ref().map(RobotId::as_str))
        .bind(event.station.as_ref().map(StationId::as_str))
        .bind(event.pack.as_ref().map(PackId::as_str))
        .bind(body)
        .execute(&mut *connection)
        .await?;
    if inserted.rows_affected() > 0 {
        return Ok(Kept::Yes);
    }
    let stored: String = query_scalar("SELECT body FROM events WHERE seq = $1").bind(seq).fetch_one(connection).await?;
    Ok(Kept::if_equal(&stored, body))
}

async fn write_plan(connection: &mut SqliteConnection, schedule: &Schedule, plan: i64, body: &str) -> Result<Kept, sqlx::Error> {
    let insert = "INSERT INTO plans (plan, at_ms, policy, body) VALUES ($1, $2, $3, $4) ON CONFLICT (plan) DO NOTHING";
    let inserted =
        query(insert).bind(plan).bind(schedule.at.unix_ms()).bind(schedule.policy.as_str()).bind(body).execute(&mut *connection).await?;
    if inserted.rows_affected() > 0 {
        return Ok(Kept::Yes);
    }
    let stored: String = query_scalar("SELECT body FROM plans WHERE plan = $1").bind(plan).fetch_one(connection).await?;
    Ok(Kept::if_equal(&stored, body))
}

async fn write_capacity(connection: &mut SqliteConnection, capacity: &Capacity, body: &str) -> Result<Kept, sqlx::Error> {
    let insert = "INSERT INTO capacities (number, at_ms, robots_expected, robots_promised, confidence, body) \
                  VALUES ((SELECT COALESCE(MAX(number), 0) + 1 FROM capacities), $1, $2, $3, $4, $5)";
    query(insert)
        .bind(capacity.at.unix_ms())
        .bind(i64::from(capacity.robots_expected))
        .bind(i64::from(capacity.robots_promised))
        .bind(capacity.confidence)
        .bind(body)
        .execute(connection)
        .await?;
    Ok(Kept::Yes)
}

async fn write_explanation(connection: &mut SqliteConnection, explanation: &Explanation, body: &str) -> Result<Kept, sqlx::Error> {
    let insert = "INSERT INTO explanations (robot, at_ms, body) VALUES ($1, $2, $3) \
                  ON CONFLICT (robot) DO UPDATE SET at_ms = excluded.at_ms, body = excluded.body";
    query(insert).bind(explanation.robot.as_str()).bind(explanation.at.unix_ms()).bind(body).execute(connection).await?;
    Ok(Kept::Yes)
}

async fn write_command(connection: &mut SqliteConnection, command: &CommandRow<'_>) -> Result<Kept, sqlx::Error> {
    let insert = "INSERT INTO commands (id, epoch, at_ms, deadline_ms, robot, station, body) VALUES ($1, $2, $3, $4, $5, $6, $7) \
                  ON CONFLICT (id) DO NOTHING";
    let inserted = query(insert)
        .bind(command.id)
        .bind(command.epoch)
        .bind(command.at_ms)
        .bind(command.deadline_ms)
        .bind(command.robot)
        .bind(command.station)
        .bind(command.body.as_str())
        .execute(&mut *connection)
        .await?;
    if inserted.rows_affected() > 0 {
        return Ok(Kept::Yes);
    }
    let stored: (Option<String>, Option<String>, String) =
        sqlx::query_as("SELECT robot, station, body FROM commands WHERE id = $1").bind(command.id).fetch_one(connection).await?;
    let same_target = stored.0.as_deref() == command.robot && stored.1.as_deref() == command.station;
    Ok(if same_target { Kept::if_equal(&stored.2, &command.body) } else { Kept::OtherUnderThisName })
}

/// The first answer counts, later ones repeat it. An answer to a command that is not here
/// (the agent remembers one of an earlier store) has nothing to be kept with.
async fn write_reply(connection: &mut SqliteConnection, reply: &CommandReply, body: &str) -> Result<Kept, sqlx::Error> {
    let update = "UPDATE commands SET reply_at_ms = $2, reply_body = $3 WHERE id = $1 AND reply_body IS NULL";
    query(update).bind(reply.id.as_str()).bind(reply.at.unix_ms()).bind(body).execute(connection).await?;
    Ok(Kept::Yes)
}

fn check<M: Message>(message: &M, name: impl Fn() -> String) -> Result<(), StoreError> {
    message.validate().map_err(|error| StoreError::Refused { record: name(), detail: error.to_string() })
}

/// The message as it is kept, provided that it can be read back.
fn body<M: Message>(message: &M, name: impl Fn() -> String) -> Result<String, StoreError> {
    check(message, &name)?;
    let bytes = encode(message);
    if bytes.len() > MAX_MESSAGE_BYTES {
        let detail = format!("it is {} bytes long, allowed are at most {MAX_MESSAGE_BYTES}", bytes.len());
        return Err(StoreError::Refused { record: name(), detail });
    }
    Ok(String::from_utf8(bytes).expect("JSON is UTF-8"))
}

/// A number by which rows are ordered; databases have no unsigned ones.
fn count(number: u64, name: impl Fn() -> String) -> Result<i64, StoreError> {
    i64::try_from(number).map_err(|_| StoreError::Refused { record: name(), detail: format!("{number} is above {}", i64::MAX) })
}
