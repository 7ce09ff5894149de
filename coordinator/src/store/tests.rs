//! The store as its users see it: on a real file, in a directory of its own.

mod cluster;
mod damage;
mod journal;
mod opening;
mod retire;
mod server;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use proto::*;
use tempfile::TempDir;

use super::{Heard, RENEWAL, Reader, Record, Store, StoreError, What};
use crate::core::Numbering;

/// A directory that vanishes with the test, and a path in it.
fn place() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("journal.db");
    (directory, path)
}

async fn open(path: &Path) -> Store {
    Store::open(path).await.unwrap()
}

fn id<T: std::str::FromStr<Err = IdError>>(text: &str) -> T {
    text.parse().unwrap()
}

/// `after_s` seconds into 2026.
fn at(after_s: i64) -> Timestamp {
    Timestamp::from_unix_ms(1_767_225_600_000 + after_s * 1_000)
}

fn gauge(seq: u64) -> Gauge {
    Gauge {
        at: at(seq.cast_signed()),
        seq,
        soc: Estimate::new(0.5, 0.125),
        remaining_wh: Estimate::new(12.5, 0.25),
        full_wh: Estimate::new(29.0, 0.5),
        time_to_empty_s: Some(Estimate::new(5_270.0, 180.0)),
        time_to_full_s: None,
        soh: Estimate::new(0.875, 0.0),
        cycles: Some(12.5),
        voltage_v: 7.41,
        current_a: -1.13,
        temperature_degc: 27.5,
        power_w: 8.4,
        cells_series: 2,
        source: "sigma-point".to_owned(),
    }
}

fn robot_gauge(robot: &str, seq: u64) -> Record {
    Record::RobotGauge { robot: id(robot), gauge: gauge(seq) }
}

fn pack_gauge(seq: u64) -> Record {
    Record::PackGauge { station: id("north"), pack: id("p1"), gauge: gauge(seq) }
}

fn robot_state(robot: &str, seq: u64, phase: RobotPhase) -> Record {
    let state = RobotState {
        at: at(seq.cast_signed()),
        seq,
        phase,
        station: None,
        bay: None,
        drain_w: Estimate::new(8.5, 0.5),
        travel: Default::default(),
        mission: Mission { weight: 1.0, until: None },
        battery: "two-cell-rover".to_owned(),
        load: None,
        last_command: None,
        note: None,
    };
    Record::RobotState { robot: id(robot), state }
}

fn station_state(seq: u64) -> Record {
    let state = StationState {
        at: at(seq.cast_signed()),
        seq,
        bays: Vec::new(),
        lift_busy: false,
        swapping: None,
        packs: Vec::new(),
        active_pack: None,
        powered: true,
        pack_power_w: 31.5,
        arrives: None,
        away: Vec::new(),
        spares: Vec::new(),
        last_command: None,
        note: None,
    };
    Record::StationState { station: id("north"), state }
}

pub(crate) fn event(seq: u64, text: &str) -> Event {
    Event {
        at: at(seq.cast_signed()),
        seq,
        kind: EventKind::Joined,
        robot: Some(id("r1")),
        station: None,
        pack: None,
        text: text.to_owned(),
    }
}

fn events(seqs: std::ops::RangeInclusive<u64>) -> Vec<Record> {
    seqs.map(|seq| Record::Event(event(seq, "r1 joined"))).collect()
}

pub(crate) fn schedule(plan: u64) -> Schedule {
    let unserved = vec![Unserved { robot: id("r3"), runs_empty: true, reasons: vec!["north: out of reach by 0.4 Wh".to_owned()] }];
    Schedule {
        at: at(6),
        plan,
        policy: "least-regret".to_owned(),
        trigger: "r1 joined".to_owned(),
        services: Vec::new(),
        unserved,
        doubts: Vec::new(),
        quality: None,
    }
}

pub(crate) fn capacity(robots_promised: u32) -> Capacity {
    Capacity { at: at(7), packs: Vec::new(), stations: Vec::new(), robots_expected: 9, robots_promised, confidence: 0.95 }
}

pub(crate) fn explanation(robot: &str, reason: &str) -> Explanation {
    Explanation {
        at: at(8),
        robot: id(robot),
        service: None,
        reasons: vec![reason.to_owned()],
        alternatives: Vec::new(),
        doubts: Vec::new(),
        earlier: Vec::new(),
        changed: Vec::new(),
    }
}

fn robot_command(name: &str, after_s: i64) -> RobotCommand {
    Command { id: id(name), epoch: 1, at: at(after_s), deadline: at(after_s + 60), action: RobotAction::Undock }
}

fn to_robot(name: &str, after_s: i64) -> Record {
    Record::RobotCommand { robot: id("r1"), command: robot_command(name, after_s) }
}

fn station_command(name: &str, after_s: i64) -> StationCommand {
    let action = StationAction::SelectPack { pack: id("p1") };
    Command { id: id(name), epoch: 1, at: at(after_s), deadline: at(after_s + 60), action }
}

fn to_station(name: &str, after_s: i64) -> Record {
    Record::StationCommand { station: id("north"), command: station_command(name, after_s) }
}

fn reply(name: &str, after_s: i64) -> CommandReply {
    CommandReply { id: id(name), at: at(after_s), outcome: Outcome::Accepted }
}

/// One record of every kind.
fn one_of_each() -> Vec<Record> {
    vec![
        robot_gauge("r1", 1),
        pack_gauge(1),
        robot_state("r1", 1, RobotPhase::Working),
        station_state(1),
        Record::Event(event(1, "r1 joined")),
        Record::Plan(Arc::new(schedule(1))),
        Record::Capacity(capacity(8)),
        Record::Explanations(vec![explanation("r1", "it runs empty first")]),
        to_robot("c1", 3),
        Record::Reply(reply("c1", 5)),
    ]
}

/// The tables of what is told and decided.
const TABLES: [&str; 9] =
    ["robot_gauges", "pack_gauges", "robot_states", "station_states", "events", "plans", "capacities", "explanations", "commands"];

/// Rows per table, all of one moment.
async fn counts(reader: &Reader) -> BTreeMap<&'static str, i64> {
    let count = TABLES.map(|table| format!("SELECT '{table}' AS name, COUNT(*) AS held FROM {table}")).join(" UNION ALL ");
    let rows: Vec<(String, i64)> = sqlx::query_as(sqlx::AssertSqlSafe(count)).fetch_all(&reader.pool).await.unwrap();
    TABLES.into_iter().map(|table| (table, rows.iter().find(|(name, _)| name == table).unwrap().1)).collect()
}

async fn rows(reader: &Reader) -> i64 {
    counts(reader).await.values().sum()
}

/// The commands of the first start.
async fn commands(reader: &Reader) -> Vec<Record> {
    let start = Numbering { epoch: 1, event: 0, plan: 0 };
    reader.decisions(start, None).await.unwrap().into_iter().filter(Record::is_command).collect()
}

/// The answer that is kept with a command, as it came.
async fn reply_to(reader: &Reader, id: &str) -> Option<CommandReply> {
    let select = sqlx::query_scalar::<_, Option<String>>("SELECT reply_body FROM commands WHERE id = $1").bind(id.to_owned());
    let body = select.fetch_optional(&reader.pool).await.unwrap().flatten()?;
    Some(decode(body.as_bytes()).unwrap())
}

/// The message that is kept of what was heard.
async fn message(reader: &Reader, what: What) -> Result<Option<Record>, StoreError> {
    reader.message_of(&Heard { epoch: 1, number: 1, at: at(0), what }).await
}
