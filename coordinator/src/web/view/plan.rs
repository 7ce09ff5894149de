//! Services over time, one lane per bay, and one per station for exchanges of packs.

use std::collections::BTreeMap;

use proto::{Mode, RobotId, Schedule, Service, ServiceStatus, Timestamp};
use serde::Serialize;

use super::fleet::{Natural, natural};
use crate::models::from_wire;
use crate::view::Basis;
use crate::web::number::{Quantity, quantity};
use crate::web::past::Past;
use crate::when::minute_from;

/// Shortest time that is shown before and after now, s.
const MARGIN_S: f64 = 1800.0;

/// The chart.
#[derive(Debug, Clone, Serialize)]
pub struct PlanChart {
    /// Now.
    pub now: Timestamp,
    /// First instant that there is anything to see of.
    pub from: Timestamp,
    /// Last one.
    pub to: Timestamp,
    /// Lanes, station by station.
    pub lanes: Vec<Lane>,
    /// Robots without a service, and why.
    pub unserved: Vec<LeftOut>,
}

/// One lane.
#[derive(Debug, Clone, Serialize)]
pub struct Lane {
    /// `mds-1 bay-2`.
    pub label: String,
    /// Services, by their beginning.
    pub bars: Vec<Bar>,
}

/// One service.
#[derive(Debug, Clone, Serialize)]
pub struct Bar {
    /// Tells bars apart.
    pub id: String,
    /// Who is serviced.
    pub robot: RobotId,
    /// `past`, `failed`, `running` or `planned`.
    pub stage: &'static str,
    /// `recharge` or `swap`.
    pub mode: &'static str,
    /// When the robot leaves its work.
    pub leave: Timestamp,
    /// When the service begins.
    pub start: Timestamp,
    /// When it ends.
    pub end: Timestamp,
    /// Energy from the station's packs.
    pub energy: Quantity,
    /// All of it in a sentence.
    pub text: String,
}

/// A robot without a service.
#[derive(Debug, Clone, Serialize)]
pub struct LeftOut {
    /// Which.
    pub robot: RobotId,
    /// Whether it runs empty for want of one, or can do without.
    pub runs_empty: bool,
    /// Why.
    pub reasons: Vec<String>,
}

pub(super) fn chart(now: Timestamp, basis: &Basis<'_>, schedule: &Schedule, past: &Past) -> PlanChart {
    let mut lanes: BTreeMap<(Natural, String), Vec<Bar>> = BTreeMap::new();
    let mut lane_of = |label: String, bar: Option<Bar>| lanes.entry((natural(&label), label)).or_default().extend(bar);
    for (id, station) in &basis.fleet.stations {
        let Some(state) = &station.state else { continue };
        state.bays.iter().for_each(|bay| lane_of(format!("{id} {}", bay.bay), None));
        if !state.spares.is_empty() {
            lane_of(format!("{id} exchange"), None);
        }
    }
    for service in past.services.iter().chain(&schedule.services) {
        let place = service.bay.as_ref().map_or_else(|| "exchange".to_owned(), ToString::to_string);
        lane_of(format!("{} {place}", service.station), Some(bar(now, service)));
    }
    let mut lanes: Vec<Lane> = lanes.into_iter().map(|((_, label), bars)| Lane { label, bars }).collect();
    lanes.iter_mut().for_each(|lane| lane.bars.sort_by_key(|bar| (bar.start, bar.end)));
    let bars = || lanes.iter().flat_map(|lane| &lane.bars);
    let from = bars().map(|bar| bar.leave).min().unwrap_or(now).min(now.plus_s(-MARGIN_S));
    let to = bars().map(|bar| bar.end).max().unwrap_or(now).max(now.plus_s(MARGIN_S));
    let unserved = schedule
        .unserved
        .iter()
        .map(|left| LeftOut { robot: left.robot.clone(), runs_empty: left.runs_empty, reasons: left.reasons.clone() })
        .collect();
    PlanChart { now, from, to, lanes, unserved }
}

fn bar(now: Timestamp, service: &Service) -> Bar {
    let (mode, how) = match &service.mode {
        Mode::Recharge { to_soc } => ("recharge", format!("recharge to {:.0} %", 100.0 * to_soc)),
        Mode::Swap { spare } => ("swap", format!("exchange for {spare}")),
    };
    let stage = match service.status {
        ServiceStatus::Done => "past",
        ServiceStatus::Failed => "failed",
        ServiceStatus::Planned => "planned",
        _ => "running",
    };
    let energy = quantity(from_wire(service.pack_energy_wh), "Wh");
    let bay = service.bay.as_ref().map_or_else(String::new, |bay| format!(" {bay}"));
    let packs: Vec<String> = service.packs.iter().map(ToString::to_string).collect();
    let text = format!(
        "{}: {how} at {}{bay}, {} to {}, {} from {}, {}",
        service.robot,
        service.station,
        minute_from(now, service.start),
        minute_from(now, service.end),
        energy.text,
        if packs.is_empty() { "the station".to_owned() } else { packs.join(", ") },
        service.status
    );
    Bar {
        // A robot may be serviced often; planned services keep their bar while they move.
        id: if stage == "planned" || stage == "running" {
            service.robot.to_string()
        } else {
            format!("{}@{}", service.robot, service.end.unix_ms())
        },
        robot: service.robot.clone(),
        stage,
        mode,
        leave: service.leave.min(service.start),
        start: service.start,
        end: service.end,
        energy,
        text,
    }
}
