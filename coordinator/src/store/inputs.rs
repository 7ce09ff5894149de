//! What the core was told, as rows and back.

use std::sync::Arc;

use proto::{CommandReply, Message, PackId, RobotId, Schedule, StationId, Timestamp, decode, encode};
use sqlx::Row as _;
use sqlx::any::AnyRow;

use super::rows::Value;
use super::{Heard, What};

/// The columns of a line, in this order.
pub(super) const INTO: &str = "inputs (epoch, number, at_ms, kind, robot, station, pack, message_at_ms, message_seq, body)";

/// What stands in a row beside number and instant.
#[derive(Default)]
struct Line<'a> {
    robot: Option<&'a RobotId>,
    station: Option<&'a StationId>,
    pack: Option<&'a PackId>,
    message: Option<(Timestamp, u64)>,
    body: Option<String>,
}

/// A message as it stands in a row.
fn text<M: Message>(message: &M) -> String {
    String::from_utf8(encode(message)).expect("JSON is UTF-8")
}

/// A line as a row.
pub(super) fn row(heard: &Heard) -> Vec<Value> {
    let none = Line::default();
    let of_robot = |robot| Line { robot: Some(robot), ..Line::default() };
    let of_station = |station| Line { station: Some(station), ..Line::default() };
    let (kind, line) = match &heard.what {
        What::Nothing => ("nothing", none),
        What::Tick => ("tick", none),
        What::RobotGauge(robot, at, seq) => ("robot_gauge", Line { message: Some((*at, *seq)), ..of_robot(robot) }),
        What::RobotState(robot, at, seq) => ("robot_state", Line { message: Some((*at, *seq)), ..of_robot(robot) }),
        What::RobotAlive(robot, alive) => (if *alive { "robot_there" } else { "robot_lost" }, of_robot(robot)),
        What::StationState(station, at, seq) => ("station_state", Line { message: Some((*at, *seq)), ..of_station(station) }),
        What::PackGauge(station, pack, at, seq) => {
            ("pack_gauge", Line { pack: Some(pack), message: Some((*at, *seq)), ..of_station(station) })
        }
        What::StationAlive(station, alive) => (if *alive { "station_there" } else { "station_lost" }, of_station(station)),
        What::Reply(reply) => ("reply", Line { body: Some(text(reply)), ..none }),
        What::Studied => ("studied", none),
        What::Before(schedule) => ("before", Line { body: Some(text(schedule.as_ref())), ..none }),
        What::Replan(why) => ("replan", Line { body: Some(why.clone()), ..none }),
        What::Forget(robot) => ("forget", of_robot(robot)),
        What::Refused(text) => ("refused", Line { body: Some(text.clone()), ..none }),
    };
    vec![
        Value::int(heard.epoch.cast_signed()),
        Value::int(heard.number.cast_signed()),
        Value::int(heard.at.unix_ms()),
        Value::text(kind),
        Value::perhaps(line.robot.map(RobotId::as_str)),
        Value::perhaps(line.station.map(StationId::as_str)),
        Value::perhaps(line.pack.map(PackId::as_str)),
        Value::Int(line.message.map(|(at, _)| at.unix_ms())),
        Value::Int(line.message.map(|(_, seq)| seq.cast_signed())),
        Value::Text(line.body),
    ]
}

/// A row as a line.
pub(super) fn heard(row: &AnyRow) -> Result<Heard, sqlx::Error> {
    let wrong = |error: Box<dyn std::error::Error + Send + Sync>| sqlx::Error::Decode(error);
    let text = |column: &str| row.try_get::<Option<String>, _>(column);
    let need = |column: &'static str| text(column)?.ok_or_else(|| wrong(format!("inputs.{column} is missing").into()));
    let robot = || RobotId::new(need("robot")?).map_err(|error| wrong(error.into()));
    let station = || StationId::new(need("station")?).map_err(|error| wrong(error.into()));
    let pack = || PackId::new(need("pack")?).map_err(|error| wrong(error.into()));
    let at = || row.try_get::<i64, _>("message_at_ms").map(Timestamp::from_unix_ms);
    let seq = || row.try_get::<i64, _>("message_seq").map(i64::cast_unsigned);
    let what = match row.try_get::<String, _>("kind")?.as_str() {
        "nothing" => What::Nothing,
        "tick" => What::Tick,
        "robot_gauge" => What::RobotGauge(robot()?, at()?, seq()?),
        "robot_state" => What::RobotState(robot()?, at()?, seq()?),
        "robot_there" => What::RobotAlive(robot()?, true),
        "robot_lost" => What::RobotAlive(robot()?, false),
        "station_state" => What::StationState(station()?, at()?, seq()?),
        "pack_gauge" => What::PackGauge(station()?, pack()?, at()?, seq()?),
        "station_there" => What::StationAlive(station()?, true),
        "station_lost" => What::StationAlive(station()?, false),
        "reply" => What::Reply(decode::<CommandReply>(need("body")?.as_bytes()).map_err(|error| wrong(error.into()))?),
        "before" => What::Before(Arc::new(decode::<Schedule>(need("body")?.as_bytes()).map_err(|error| wrong(error.into()))?)),
        "replan" => What::Replan(need("body")?),
        "forget" => What::Forget(robot()?),
        "studied" => What::Studied,
        "refused" => What::Refused(need("body")?),
        other => return Err(wrong(format!("inputs.kind is `{other}`").into())),
    };
    Ok(Heard {
        epoch: row.try_get::<i64, _>("epoch")?.cast_unsigned(),
        number: row.try_get::<i64, _>("number")?.cast_unsigned(),
        at: Timestamp::from_unix_ms(row.try_get("at_ms")?),
        what,
    })
}
