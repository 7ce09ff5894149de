//! What the core was told, as rows and back.

use proto::{CommandReply, PackId, RobotId, StationId, Timestamp, decode, encode};
use sqlx::Row as _;
use sqlx::any::AnyRow;

use super::rows::Value;
use super::{Heard, What};

/// The columns of a line, in this order.
pub(super) const INTO: &str = "inputs (epoch, number, at_ms, kind, robot, station, pack, message_at_ms, message_seq, body)";

/// A line as a row.
pub(super) fn row(heard: &Heard) -> Vec<Value> {
    let (kind, robot, station, pack, message, body): (
        &str,
        Option<&RobotId>,
        Option<&StationId>,
        Option<&PackId>,
        Option<(Timestamp, u64)>,
        Option<String>,
    ) = match &heard.what {
        What::Nothing => ("nothing", None, None, None, None, None),
        What::RobotGauge(robot, at, seq) => ("robot_gauge", Some(robot), None, None, Some((*at, *seq)), None),
        What::RobotState(robot, at, seq) => ("robot_state", Some(robot), None, None, Some((*at, *seq)), None),
        What::RobotAlive(robot, alive) => (if *alive { "robot_there" } else { "robot_lost" }, Some(robot), None, None, None, None),
        What::StationState(station, at, seq) => ("station_state", None, Some(station), None, Some((*at, *seq)), None),
        What::PackGauge(station, pack, at, seq) => ("pack_gauge", None, Some(station), Some(pack), Some((*at, *seq)), None),
        What::StationAlive(station, alive) => {
            (if *alive { "station_there" } else { "station_lost" }, None, Some(station), None, None, None)
        }
        What::Reply(reply) => ("reply", None, None, None, None, Some(String::from_utf8(encode(reply)).expect("JSON is UTF-8"))),
        What::Refused(text) => ("refused", None, None, None, None, Some(text.clone())),
    };
    vec![
        Value::int(heard.epoch.cast_signed()),
        Value::int(heard.number.cast_signed()),
        Value::int(heard.at.unix_ms()),
        Value::text(kind),
        Value::perhaps(robot.map(RobotId::as_str)),
        Value::perhaps(station.map(StationId::as_str)),
        Value::perhaps(pack.map(PackId::as_str)),
        Value::Int(message.map(|(at, _)| at.unix_ms())),
        Value::Int(message.map(|(_, seq)| seq.cast_signed())),
        Value::Text(body),
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
        "robot_gauge" => What::RobotGauge(robot()?, at()?, seq()?),
        "robot_state" => What::RobotState(robot()?, at()?, seq()?),
        "robot_there" => What::RobotAlive(robot()?, true),
        "robot_lost" => What::RobotAlive(robot()?, false),
        "station_state" => What::StationState(station()?, at()?, seq()?),
        "pack_gauge" => What::PackGauge(station()?, pack()?, at()?, seq()?),
        "station_there" => What::StationAlive(station()?, true),
        "station_lost" => What::StationAlive(station()?, false),
        "reply" => What::Reply(decode::<CommandReply>(need("body")?.as_bytes()).map_err(|error| wrong(error.into()))?),
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
