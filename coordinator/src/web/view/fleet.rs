//! One row per robot.

use energy::Estimate;
use proto::{RobotId, RobotPhase, Schedule, ServiceStatus, Timestamp};
use serde::Serialize;

use super::{Sort, Tone, Wanted};
use crate::fleet::Robot;
use crate::models::from_wire;
use crate::view::Basis;
use crate::watch::Subject;
use crate::web::number::{Quantity, percent, quantity, span};
use crate::when::minute_from;

/// Rows of a page when nothing is said: more cannot be read, and would be sent every second.
const ROWS: usize = 100;
/// Most rows that are given.
const ROWS_MAX: usize = 10_000;

/// The fleet, or as much of it as was asked for.
#[derive(Debug, Clone, Serialize)]
pub struct FleetTable {
    /// Robots that are known.
    pub total: usize,
    /// Robots that match what was searched for.
    pub matching: usize,
    /// What is not shown, in words; empty when all is.
    pub note: String,
    /// Robots.
    pub rows: Vec<RobotRow>,
}

/// One robot.
#[derive(Debug, Clone, Serialize)]
pub struct RobotRow {
    /// Which.
    pub robot: RobotId,
    /// What it does, and where: `charging at mds-1 bay-2`.
    pub doing: String,
    /// How it stands.
    pub tone: Tone,
    /// State of charge; none before its gauge spoke.
    pub charge: Option<Quantity>,
    /// State of charge one sigma down and up, %, for drawing.
    pub charge_band: Option<[f64; 2]>,
    /// Level below which it wants a service, %.
    pub wanted_below: f64,
    /// Energy left.
    pub remaining: Option<Quantity>,
    /// Power drawn at work.
    pub drain: Option<Quantity>,
    /// Time until it is empty, or full: the text says which.
    pub time: Option<Quantity>,
    /// Whether that time ends with a full battery.
    pub filling: bool,
    /// Its service: `mds-1 bay-3, 12:52 to 13:44`; `left out`, or `none needed`.
    pub service: String,
    /// Whether a model of it is doubted.
    pub doubted: bool,
}

pub(super) fn table(basis: &Basis<'_>, schedule: &Schedule, wanted: &Wanted) -> FleetTable {
    let find = wanted.find.trim().to_lowercase();
    let matches = |row: &RobotRow| find.is_empty() || row.robot.as_ref().to_lowercase().contains(&find) || row.doing.contains(&find);
    let all = basis.fleet.robots.iter().map(|(id, robot)| row(basis, schedule, id, robot));
    let mut rows: Vec<RobotRow> = all.filter(matches).collect();
    if wanted.sort == Sort::Urgency {
        // Without a time it is not running down.
        let left_s = |row: &RobotRow| row.time.as_ref().filter(|_| !row.filling).map_or(f64::INFINITY, |time| time.value);
        rows.sort_by(|a, b| (a.tone != Tone::Bad).cmp(&(b.tone != Tone::Bad)).then(left_s(a).total_cmp(&left_s(b))));
    } else {
        // explorer-10 comes after explorer-9.
        rows.sort_by_cached_key(|row| natural(row.robot.as_ref()));
    }
    let matching = rows.len();
    rows.truncate(if wanted.rows == 0 { ROWS } else { wanted.rows.min(ROWS_MAX) });
    let total = basis.fleet.robots.len();
    let note = match (total, rows.len() < matching) {
        (0, _) => "No robot has been heard yet.".to_owned(),
        (_, true) => format!("{} of {matching} are shown: search for others.", rows.len()),
        _ if matching == 0 => format!("No robot matches \u{201c}{}\u{201d}.", wanted.find.trim()),
        _ => String::new(),
    };
    FleetTable { total, matching, note, rows }
}

/// A name with its numbers as numbers: texts, each with the number behind it.
pub(super) type Natural = Vec<(String, u64)>;

/// What a name is ordered by.
pub(super) fn natural(name: &str) -> Natural {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let text_end = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let digits_end = rest[text_end..].find(|c: char| !c.is_ascii_digit()).map_or(rest.len(), |end| text_end + end);
        parts.push((rest[..text_end].to_owned(), rest[text_end..digits_end].parse().unwrap_or(u64::MAX)));
        rest = &rest[digits_end..];
    }
    parts
}

fn row(basis: &Basis<'_>, schedule: &Schedule, id: &RobotId, robot: &Robot) -> RobotRow {
    let gauge = robot.gauge.as_ref();
    let soc = gauge.map(|gauge| from_wire(gauge.soc));
    let to_empty = gauge.and_then(|gauge| gauge.time_to_empty_s);
    let to_full = to_full_s(robot);
    let subjects = [Subject::RobotBattery(id.clone()), Subject::RobotWork(id.clone()), Subject::RobotWay(id.clone())];
    let (doing, tone) = doing(robot);
    RobotRow {
        robot: id.clone(),
        doing,
        tone,
        charge: soc.map(percent),
        charge_band: soc.map(|Estimate { value, sigma }| [value - sigma, value + sigma].map(|edge| (100.0 * edge).clamp(0.0, 100.0))),
        wanted_below: 100.0 * basis.settings.serve_below_soc,
        remaining: gauge.map(|gauge| quantity(from_wire(gauge.remaining_wh), "Wh")),
        drain: robot.state.as_ref().map(|state| quantity(from_wire(state.drain_w), "W")),
        time: to_empty.or(to_full).map(|time_s| span(from_wire(time_s))),
        filling: to_empty.is_none() && to_full.is_some(),
        service: service(basis.now, schedule, id),
        doubted: subjects.iter().any(|subject| basis.watch.wider(subject) > 1.0),
    }
}

/// How long it takes until a robot is full: of one that is let out its gauge still says so for a while.
pub(super) fn to_full_s(robot: &Robot) -> Option<proto::Estimate> {
    robot.gauge.as_ref().filter(|_| robot.phase() == Some(RobotPhase::Charging))?.time_to_full_s
}

/// What a robot does and where, and how that stands.
pub(super) fn doing(robot: &Robot) -> (String, Tone) {
    let Some(state) = &robot.state else { return ("not heard yet".to_owned(), Tone::Quiet) };
    if robot.is_lost() {
        return (format!("lost while {}", state.phase), Tone::Bad);
    }
    let place = match (&state.station, &state.bay, state.phase) {
        (Some(station), _, RobotPhase::Travelling) => format!(" to {station}"),
        (Some(station), Some(bay), _) => format!(" at {station} {bay}"),
        (Some(station), None, _) => format!(" at {station}"),
        (None, ..) => String::new(),
    };
    let tone = match state.phase {
        RobotPhase::Working => Tone::Good,
        RobotPhase::Stranded => Tone::Bad,
        _ => Tone::Active,
    };
    (format!("{}{place}", state.phase), tone)
}

fn service(now: Timestamp, schedule: &Schedule, robot: &RobotId) -> String {
    if let Some(service) = schedule.services.iter().find(|service| service.robot == *robot) {
        let bay = service.bay.as_ref().map_or_else(String::new, |bay| format!(" {bay}"));
        let when = match service.status {
            ServiceStatus::Planned => format!("{} to {}", minute_from(now, service.start), minute_from(now, service.end)),
            _ => format!("until {}", minute_from(now, service.end)),
        };
        return format!("{}{bay}, {when}", service.station);
    }
    // Why stands with the plan, and with the robot in full.
    let unserved = schedule.unserved.iter().find(|unserved| unserved.robot == *robot);
    unserved.map_or("", |unserved| if unserved.runs_empty { "left out" } else { "none needed" }).to_owned()
}

#[cfg(test)]
mod tests {
    use super::natural;

    #[test]
    fn names_are_ordered_as_people_count() {
        let mut names = ["r-10", "r-9", "r-1b", "r-1a", "q"];
        names.sort_by_key(|name| natural(name));
        assert_eq!(names, ["q", "r-1a", "r-1b", "r-9", "r-10"]);
    }
}
