//! Records into rows, within the transaction of the caller.

use std::path::Path;

use proto::{
    Capacity, CommandReply, Estimate, Event, Explanation, Gauge, MAX_MESSAGE_BYTES, Message, PackId, RobotId, RobotState, Schedule,
    StationId, StationState, Timestamp, encode,
};
use sqlx::{AnyConnection, query, query_scalar};

use super::rows::{Value, insert};
use super::{Heard, Record, StoreError, inputs, shown};

/// The columns of both gauge tables after those that name the battery.
macro_rules! gauge_columns {
    () => {
        "at_ms, seq, soc, soc_sigma, remaining_wh, remaining_wh_sigma, full_wh, full_wh_sigma, \
         time_to_empty_s, time_to_empty_s_sigma, time_to_full_s, time_to_full_s_sigma, soh, soh_sigma, cycles, \
         voltage_v, current_a, temperature_degc, power_w, cells_series, source, came_ms"
    };
}

/// A sender's clock that is farther away from the coordinator's is not believed when old telemetry is looked for, s.
const CLOCKS_APART_S: f64 = 60.0;

/// A batch that is known to be readable again, telemetry by table.
#[derive(Debug, Default)]
pub(super) struct Batch<'a> {
    robot_gauges: Vec<(&'a RobotId, &'a Gauge, Came)>,
    pack_gauges: Vec<(&'a StationId, &'a PackId, &'a Gauge, Came)>,
    robot_states: Vec<(&'a RobotId, &'a RobotState, String, Came)>,
    station_states: Vec<(&'a StationId, &'a StationState, String, Came)>,
    heard: Vec<&'a Heard>,
    /// When that came of which the records are.
    came: Option<Timestamp>,
    /// The rest, in the order given.
    decisions: Vec<Decision<'a>>,
}

/// When a message came, Unix ms; none where its sender's clock says as much.
type Came = Option<i64>;

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
                self.robot_gauges.push((robot, gauge, self.came(gauge.at)));
            }
            Record::PackGauge { station, pack, gauge } => {
                check(gauge, || format!("a gauge of pack {pack} of station {station}"))?;
                self.pack_gauges.push((station, pack, gauge, self.came(gauge.at)));
            }
            Record::RobotState { robot, state } => {
                let body = body(state, || format!("a state of robot {robot}"))?;
                self.robot_states.push((robot, state, body, self.came(state.at)));
            }
            Record::StationState { station, state } => {
                let body = body(state, || format!("a state of station {station}"))?;
                self.station_states.push((station, state, body, self.came(state.at)));
            }
            Record::Explanations(explanations) => {
                for explanation in explanations {
                    let body = body(explanation, || format!("the explanation of robot {}", explanation.robot))?;
                    self.decisions.push(Decision::Explanation(explanation, body));
                }
            }
            Record::Heard(heard) => {
                self.came = Some(heard.at);
                self.heard.push(heard);
            }
            decision => self.decisions.push(Decision::of(decision)?),
        }
        Ok(())
    }

    /// When a message came that was sent at `at` by its sender's clock, where that clock is wrong.
    fn came(&self, at: Timestamp) -> Came {
        self.came.filter(|came| came.seconds_since(at).abs() > CLOCKS_APART_S).map(Timestamp::unix_ms)
    }

    /// Writes everything. Telemetry that is there already is skipped: a message may arrive
    /// twice, and nothing that a network brings may make a batch fail.
    pub(super) async fn write(&self, connection: &mut AnyConnection, path: &Path) -> Result<(), StoreError> {
        self.write_telemetry(connection).await.map_err(|source| StoreError::database(path, "writing telemetry", source))?;
        for decision in &self.decisions {
            let kept = decision.write(connection).await.map_err(|source| StoreError::database(path, "writing decisions", source))?;
            if kept == Kept::OtherUnderThisName {
                return Err(StoreError::Conflict { path: shown(path), record: decision.name() });
            }
        }
        Ok(())
    }

    async fn write_telemetry(&self, connection: &mut AnyConnection) -> Result<(), sqlx::Error> {
        let into = concat!("robot_gauges (robot, ", gauge_columns!(), ")");
        insert(connection, into, &self.robot_gauges, |(robot, gauge, came)| gauge_row(&[robot.as_str()], gauge, *came)).await?;
        let into = concat!("pack_gauges (station, pack, ", gauge_columns!(), ")");
        insert(connection, into, &self.pack_gauges, |(station, pack, gauge, came)| {
            gauge_row(&[station.as_str(), pack.as_str()], gauge, *came)
        })
        .await?;
        let into = "robot_states (robot, at_ms, seq, phase, station, bay, drain_w, drain_w_sigma, battery, body, came_ms)";
        insert(connection, into, &self.robot_states, |(robot, state, body, came)| {
            vec![
                Value::text(robot.as_str()),
                Value::int(state.at.unix_ms()),
                Value::int(state.seq.cast_signed()),
                Value::text(&state.phase.to_string()),
                Value::perhaps(state.station.as_ref().map(StationId::as_str)),
                Value::perhaps(state.bay.as_ref().map(AsRef::<str>::as_ref)),
                Value::real(state.drain_w.value),
                Value::real(state.drain_w.sigma),
                Value::text(&state.battery),
                Value::text(body),
                Value::Int(*came),
            ]
        })
        .await?;
        let into = "station_states (station, at_ms, seq, active_pack, powered, lift_busy, pack_power_w, body, came_ms)";
        insert(connection, into, &self.station_states, |(station, state, body, came)| {
            vec![
                Value::text(station.as_str()),
                Value::int(state.at.unix_ms()),
                Value::int(state.seq.cast_signed()),
                Value::perhaps(state.active_pack.as_ref().map(PackId::as_str)),
                Value::Flag(state.powered),
                Value::Flag(state.lift_busy),
                Value::real(state.pack_power_w),
                Value::text(body),
                Value::Int(*came),
            ]
        })
        .await?;
        insert(connection, inputs::INTO, &self.heard, |heard| inputs::row(heard)).await
    }
}

fn gauge_row(names: &[&str], gauge: &Gauge, came: Came) -> Vec<Value> {
    let mut row: Vec<Value> = names.iter().map(|name| Value::text(name)).collect();
    row.extend([Value::int(gauge.at.unix_ms()), Value::int(gauge.seq.cast_signed())]);
    let estimate = |row: &mut Vec<Value>, of: Option<Estimate>| {
        row.extend([Value::Real(of.map(|of| of.value)), Value::Real(of.map(|of| of.sigma))]);
    };
    for of in [gauge.soc, gauge.remaining_wh, gauge.full_wh] {
        estimate(&mut row, Some(of));
    }
    estimate(&mut row, gauge.time_to_empty_s);
    estimate(&mut row, gauge.time_to_full_s);
    estimate(&mut row, Some(gauge.soh));
    row.push(Value::Real(gauge.cycles));
    row.extend([gauge.voltage_v, gauge.current_a, gauge.temperature_degc, gauge.power_w].map(Value::real));
    row.extend([Value::int(i64::from(gauge.cells_series)), Value::text(&gauge.source), Value::Int(came)]);
    row
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
                Self::Plan(schedule, count(schedule.plan, name)?, body(schedule.as_ref(), name)?)
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

    async fn write(&self, connection: &mut AnyConnection) -> Result<Kept, sqlx::Error> {
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

async fn write_event(connection: &mut AnyConnection, event: &Event, seq: i64, body: &str) -> Result<Kept, sqlx::Error> {
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

async fn write_plan(connection: &mut AnyConnection, schedule: &Schedule, plan: i64, body: &str) -> Result<Kept, sqlx::Error> {
    let insert = "INSERT INTO plans (plan, at_ms, policy, body) VALUES ($1, $2, $3, $4) ON CONFLICT (plan) DO NOTHING";
    let inserted =
        query(insert).bind(plan).bind(schedule.at.unix_ms()).bind(schedule.policy.as_str()).bind(body).execute(&mut *connection).await?;
    if inserted.rows_affected() > 0 {
        return Ok(Kept::Yes);
    }
    let stored: String = query_scalar("SELECT body FROM plans WHERE plan = $1").bind(plan).fetch_one(connection).await?;
    Ok(Kept::if_equal(&stored, body))
}

async fn write_capacity(connection: &mut AnyConnection, capacity: &Capacity, body: &str) -> Result<Kept, sqlx::Error> {
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

async fn write_explanation(connection: &mut AnyConnection, explanation: &Explanation, body: &str) -> Result<Kept, sqlx::Error> {
    let insert = "INSERT INTO explanations (robot, at_ms, body) VALUES ($1, $2, $3) \
                  ON CONFLICT (robot) DO UPDATE SET at_ms = excluded.at_ms, body = excluded.body";
    query(insert).bind(explanation.robot.as_str()).bind(explanation.at.unix_ms()).bind(body).execute(connection).await?;
    Ok(Kept::Yes)
}

async fn write_command(connection: &mut AnyConnection, command: &CommandRow<'_>) -> Result<Kept, sqlx::Error> {
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
async fn write_reply(connection: &mut AnyConnection, reply: &CommandReply, body: &str) -> Result<Kept, sqlx::Error> {
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
