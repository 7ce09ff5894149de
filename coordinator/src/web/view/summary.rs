//! The tiles at the top: what somebody who walks by wants to know.

use proto::{Capacity, RobotPhase, Schedule, ServiceStatus};
use serde::Serialize;

use super::{HealthPanel, Tone};
use crate::models::from_wire;
use crate::store::Standing;
use crate::view::Basis;
use crate::web::number::span;
use crate::when::second;

/// One tile.
#[derive(Debug, Clone, Serialize)]
pub struct Tile {
    /// Tells tiles apart.
    pub id: &'static str,
    /// What is shown.
    pub label: String,
    /// The number, large.
    pub value: String,
    /// What to know of it.
    pub note: String,
    /// How it stands.
    pub tone: Tone,
}

pub(super) fn tiles(
    basis: &Basis<'_>,
    schedule: &Schedule,
    capacity: &Capacity,
    health: &HealthPanel,
    store: Option<&Standing>,
) -> Vec<Tile> {
    let usual = [more(capacity), services(schedule), next_empty(basis), at_work(basis), models(health)];
    usual.into_iter().chain(store.and_then(unkept)).collect()
}

/// Only where it fails: nobody looks at a store that works. Why it fails is told by `/healthz` and the log.
fn unkept(store: &Standing) -> Option<Tile> {
    let failing = store.failing.as_ref()?;
    let note = format!("since {} UTC, {} records wait in memory", second(failing.since), store.waiting);
    Some(Tile { id: "store", label: "Store".to_owned(), value: "not written".to_owned(), note, tone: Tone::Bad })
}

fn more(capacity: &Capacity) -> Tile {
    let (promised, expected) = (capacity.robots_promised, capacity.robots_expected);
    Tile {
        id: "capacity",
        label: "Packs can service".to_owned(),
        value: format!("{promised} more"),
        note: format!("with {:.0} % certainty; {expected} expected", 100.0 * capacity.confidence),
        tone: if promised == 0 { Tone::Warn } else { Tone::Good },
    }
}

fn services(schedule: &Schedule) -> Tile {
    let planned = schedule.services.iter().filter(|service| service.status == ServiceStatus::Planned).count();
    let running = schedule.services.len() - planned;
    let unserved = schedule.unserved.iter().filter(|unserved| unserved.runs_empty).count();
    let note = match unserved {
        0 => format!("{running} under way, nobody left out"),
        _ => format!("{running} under way, {unserved} left out"),
    };
    let tone = if unserved > 0 { Tone::Bad } else { Tone::Good };
    Tile { id: "services", label: "Services planned".to_owned(), value: planned.to_string(), note, tone }
}

fn next_empty(basis: &Basis<'_>) -> Tile {
    let left = basis.fleet.robots.iter().filter_map(|(id, robot)| {
        let (gauge, _) = robot.heard()?;
        Some((id, from_wire(gauge.time_to_empty_s?)))
    });
    let soonest = left.min_by(|a, b| a.1.value.total_cmp(&b.1.value));
    let (value, note) = match soonest {
        Some((id, left_s)) => (span(left_s).text, format!("{id}, at its recent load")),
        None => ("–".to_owned(), "no robot is running down".to_owned()),
    };
    Tile { id: "next_empty", label: "First to run empty".to_owned(), value, note, tone: Tone::Quiet }
}

fn at_work(basis: &Basis<'_>) -> Tile {
    let robots = basis.fleet.robots.values();
    let (all, working) =
        (robots.len(), robots.clone().filter(|robot| robot.phase() == Some(RobotPhase::Working) && !robot.is_lost()).count());
    let count = |so: &dyn Fn(&crate::fleet::Robot) -> bool| basis.fleet.robots.values().filter(|robot| so(robot)).count();
    let stranded = count(&|robot| robot.phase() == Some(RobotPhase::Stranded));
    let lost = count(&|robot| robot.is_lost());
    let lost_stations = basis.fleet.stations.values().filter(|station| station.is_lost()).count();
    let in_words = if lost_stations == 1 { "station lost" } else { "stations lost" };
    let troubles: Vec<String> = [(stranded, "stranded"), (lost, "lost"), (lost_stations, in_words)]
        .iter()
        .filter(|(n, _)| *n > 0)
        .map(|(n, what)| format!("{n} {what}"))
        .collect();
    let (note, tone) =
        if troubles.is_empty() { ("nobody stranded or lost".to_owned(), Tone::Good) } else { (troubles.join(", "), Tone::Bad) };
    Tile { id: "at_work", label: "Robots at work".to_owned(), value: format!("{working} of {all}"), note, tone }
}

fn models(health: &HealthPanel) -> Tile {
    let (value, note, tone) = match health.doubted {
        0 if health.rows.is_empty() => ("–".to_owned(), "none has been judged yet".to_owned(), Tone::Quiet),
        0 => ("hold".to_owned(), format!("{} watched, none doubted", health.rows.len()), Tone::Good),
        n => (format!("{n} doubted"), "forecasts that rest on them are taken as less certain".to_owned(), Tone::Warn),
    };
    Tile { id: "models", label: "Energy models".to_owned(), value, note, tone }
}
