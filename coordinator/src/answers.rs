//! What the coordinator tells: schedule, capacity, explanations, as they go on the wire.

use std::collections::BTreeMap;

use energy::Estimate;
use proto::{
    Alternative, Capacity, Explanation, Mode, PackId, RobotAction, RobotId, Schedule, Service, ServiceStatus, StationAction, StationId,
    Unserved,
};

use crate::forecast;
use crate::models::from_wire;
use crate::scheduler::capacity::{PackQuestion, capacity as count};
use crate::scheduler::{Book, PackView, Plan, Planned, Problem, Way};
use crate::service_run::{How, ServiceRun};
use crate::view::Basis;

/// A station is handed over when its active pack lasts no longer than this at the present power, s.
const HANDOVER_S: f64 = 60.0;

/// The plan made at `basis.now`, and the services that have begun.
#[must_use]
pub fn schedule(basis: &Basis<'_>, plan: &Plan, number: u64, trigger: String) -> Schedule {
    let begun = basis.running.values().map(running_service);
    let planned = plan.planned.iter().map(|planned| planned_service(basis, planned));
    let mut services: Vec<Service> = begun.chain(planned).collect();
    services.sort_by(|a, b| a.start.cmp(&b.start).then_with(|| a.robot.cmp(&b.robot)));
    let unserved = plan.rejected.iter().map(|rejected| Unserved { robot: rejected.robot.clone(), reasons: rejected.reasons.clone() });
    Schedule {
        at: basis.now,
        plan: number,
        policy: basis.settings.policy.name().to_owned(),
        trigger,
        services,
        unserved: unserved.filter(|unserved| !basis.running.contains_key(&unserved.robot)).chain(stuck(basis, plan)).collect(),
        doubts: basis.watch.doubts(basis.fleet, basis.models),
    }
}

/// Robots that no plan can reach where they are: in a bay without power, say.
fn stuck<'a>(basis: &'a Basis<'_>, plan: &'a Plan) -> impl Iterator<Item = Unserved> + 'a {
    basis.fleet.robots.iter().filter_map(|(id, robot)| {
        let (_, state) = robot.known()?;
        let told = basis.running.contains_key(id)
            || plan.planned.iter().any(|planned| planned.robot == *id)
            || plan.rejected.iter().any(|rejected| rejected.robot == *id);
        let place = state.station.as_ref().map_or_else(String::new, |station| format!(" at {station}"));
        let note = state.note.as_ref().map_or_else(String::new, |note| format!(": {note}"));
        // Between two plans a robot that was just let go is in neither list.
        let plannable = matches!(state.phase, proto::RobotPhase::Working | proto::RobotPhase::Waiting);
        (!told && !plannable).then(|| Unserved { robot: id.clone(), reasons: vec![format!("{}{place}{note}", state.phase)] })
    })
}

fn running_service(run: &ServiceRun) -> Service {
    let (mode, bay) = match &run.how {
        How::Recharge { bay, to_soc } => (Mode::Recharge { to_soc: *to_soc }, Some(bay.clone())),
        How::Swap { spare } => (Mode::Swap { spare: spare.clone() }, None),
    };
    Service {
        robot: run.robot.clone(),
        station: run.station.clone(),
        mode,
        bay,
        packs: run.packs.clone(),
        leave: run.left,
        start: run.start,
        end: run.end,
        pack_energy_wh: node::wire(run.need.estimate()),
        status: run.status(),
        why: run.why.clone(),
    }
}

fn planned_service(basis: &Basis<'_>, planned: &Planned) -> Service {
    let Planned { robot, slot, why } = planned;
    let station = basis.models.stations.keys().nth(slot.station).expect("slots name stations of the problem").clone();
    let mode = match (&slot.spare, slot.to_soc) {
        (Some(spare), _) => Mode::Swap { spare: spare.clone() },
        (None, to_soc) => Mode::Recharge { to_soc: to_soc.unwrap_or(1.0) },
    };
    Service {
        robot: robot.clone(),
        station,
        mode,
        bay: slot.bay.clone(),
        packs: slot.packs.clone(),
        leave: basis.now.plus_s(slot.leave_s),
        start: basis.now.plus_s(slot.start_s),
        end: basis.now.plus_s(slot.end_s),
        pack_energy_wh: node::wire(slot.need.estimate()),
        status: ServiceStatus::Planned,
        why: why.clone(),
    }
}

/// How many more robots each pack can service, each pack by itself, beyond the services that have
/// begun.
#[must_use]
pub fn capacity(basis: &Basis<'_>) -> Capacity {
    let mut questions = Vec::new();
    for (id, models) in &basis.models.stations {
        let Some(station) = basis.fleet.stations.get(id) else { continue };
        let Some(state) = station.known() else { continue };
        let Some(battery) = basis.reference_battery() else { continue };
        let service = basis.reference_recharge(id, models, battery, state.bays.len());
        let service_s = service.charge_s + models.handling.load_s + models.handling.unload_s;
        let view = basis.station(id, models, Some(station));
        let begun = view.committed.plus(&view.overhead_per_h.scaled(view.committed_until_s / energy::units::S_PER_H));
        let free = free_wh(&view.packs, begun.estimate());
        for pack in state.packs.iter().filter(|pack| pack.connected) {
            let Some(gauge) = station.packs.get(&pack.pack) else { continue };
            // A pack that gave out, or that no model is known of, is in no plan.
            let usable_wh = free.get(&pack.pack).copied().unwrap_or(Estimate::exact(0.0));
            questions.push(PackQuestion {
                station: id.clone(),
                pack: pack.pack.clone(),
                remaining_wh: from_wire(gauge.remaining_wh),
                usable_wh,
                service: service.clone(),
                service_s,
                bays: state.bays.len() as u32,
                overhead_per_h: view.overhead_per_h.clone(),
                overhead_breakdown: forecast::overhead_breakdown(models),
            });
        }
    }
    count(basis.now, &questions, basis.settings.confidence)
}

/// What each pack has left when services that have begun are paid for, in the order in which packs
/// are drained. Who pays a share carries the share's doubt.
fn free_wh(packs: &[PackView], begun: Estimate) -> BTreeMap<PackId, Estimate> {
    let mut owed_wh = begun.value;
    let free = |pack: &PackView| {
        let paid_wh = owed_wh.min(pack.usable_wh.value).max(0.0);
        owed_wh -= paid_wh;
        let sigma = if paid_wh > 0.0 { pack.usable_wh.sigma.hypot(begun.sigma) } else { pack.usable_wh.sigma };
        (pack.pack.clone(), Estimate::new(pack.usable_wh.value - paid_wh, sigma))
    };
    packs.iter().map(free).collect()
}

/// Why a robot is serviced as it is, from the problem that the last plan solved.
///
/// # Errors
/// When the robot is not known, with the nearest that is.
pub fn explain(basis: &Basis<'_>, problem: &Problem, plan: &Plan, schedule: &Schedule, robot: &RobotId) -> Result<Explanation, String> {
    let Some(belief) = basis.fleet.robots.get(robot) else {
        let known = || basis.fleet.robots.keys().map(AsRef::as_ref);
        let hint = energy::document::hint(robot.as_ref(), known());
        return Err(format!("robot {robot} is not known{hint} Known: {}", known().collect::<Vec<_>>().join(", ")));
    };
    let service = schedule.services.iter().find(|service| service.robot == *robot).cloned();
    let mut reasons = Vec::new();
    if let Some((gauge, state)) = belief.known() {
        let (soc, left) = (gauge.soc, gauge.remaining_wh);
        reasons.push(format!(
            "{} at {:.1} ± {:.1} % charge, {:.1} ± {:.1} Wh left",
            state.phase,
            soc.value * 100.0,
            soc.sigma * 100.0,
            left.value,
            left.sigma
        ));
    } else {
        reasons.push("it has not been heard, or was lost".to_owned());
    }
    match (&service, plan.rejected.iter().find(|rejected| rejected.robot == *robot)) {
        (Some(service), _) => reasons.extend(service.why.iter().cloned()),
        (None, Some(rejected)) => reasons.extend(rejected.reasons.iter().cloned()),
        (None, None) => reasons.push("no service is planned".to_owned()),
    }
    let at = service.as_ref().map(|service| service.station.clone());
    // What a service rests on: the robot's own models, and those of its station.
    let concerns = |doubt: &proto::Doubt| doubt.robot.as_ref() == Some(robot) || doubt.station.is_some() && doubt.station == at;
    let doubts = basis.watch.doubts(basis.fleet, basis.models).into_iter().filter(concerns).collect();
    let alternatives = alternatives(schedule, problem, robot);
    Ok(Explanation { at: basis.now, robot: robot.clone(), service, reasons, alternatives, doubts })
}

/// Every way of servicing a robot, as if nothing but what has begun were promised.
fn alternatives(schedule: &Schedule, problem: &Problem, robot: &RobotId) -> Vec<Alternative> {
    let Some(view) = problem.robots.iter().find(|view| view.robot == *robot) else { return Vec::new() };
    let tried = view.options.iter().map(|option| {
        let station = &problem.stations[option.station];
        let mode = match option.way {
            Way::Recharge { .. } => "recharge",
            Way::Swap { .. } => "swap",
        };
        let (start, why_not) = match Book::new(station).slot(problem, view, option) {
            Ok(slot) => (Some(schedule.at.plus_s(slot.start_s)), Vec::new()),
            Err(refusal) => (None, vec![refusal.to_string()]),
        };
        Alternative { station: station.station.clone(), mode: mode.to_owned(), start, why_not }
    });
    tried.collect()
}

/// The pack that a station should be handed over to now, if its active one is about to give out.
#[must_use]
pub fn next_pack(basis: &Basis<'_>, id: &StationId) -> Option<PackId> {
    let station = basis.fleet.stations.get(id)?;
    let state = station.known()?;
    let active = state.active_pack.as_ref()?;
    let left_s = station.packs.get(active)?.time_to_empty_s?.value;
    if left_s > HANDOVER_S {
        return None;
    }
    // The least full first, so that full packs stay full. What a pack holds counts at the power
    // that the station draws: at rest even an empty one looks as if it held something.
    let models = basis.models.stations.get(id)?;
    let usable_wh = |pack: &PackId| {
        let (gauge, model) = (station.packs.get(pack)?, models.packs.get(pack)?);
        Some(forecast::usable_wh(model, from_wire(gauge.soc), gauge.temperature_degc, state.pack_power_w.max(0.0)).value)
    };
    let enough_wh = state.pack_power_w * 2.0 * HANDOVER_S / energy::units::S_PER_H;
    let others = state.packs.iter().filter(|pack| pack.pack != *active && pack.connected && !pack.depleted);
    let holding = others.filter_map(|pack| Some((pack, usable_wh(&pack.pack)?))).filter(|(_, left_wh)| *left_wh > enough_wh);
    let (next, _) = holding.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(next.pack.clone())
}

/// A robot's command in words.
#[must_use]
pub fn robot_action(action: &RobotAction) -> String {
    match action {
        RobotAction::Dock { station, bay: Some(bay) } => format!("dock at {station} {bay}"),
        RobotAction::Dock { station, bay: None } => format!("come to {station}"),
        RobotAction::ChargeTo { soc } => format!("charge to {:.0} %", soc * 100.0),
        RobotAction::SwapPack { station, spare } => format!("swap pack at {station} for {spare}"),
        RobotAction::Undock => "undock".to_owned(),
    }
}

/// A station's command in words.
#[must_use]
pub fn station_action(action: &StationAction) -> String {
    match action {
        StationAction::Dock { robot, bay } => format!("dock {robot} in {bay}"),
        StationAction::SwapPack { robot, spare } => format!("swap the pack of {robot} for {spare}"),
        StationAction::Undock { robot, bay } => format!("undock {robot} from {bay}"),
        StationAction::SelectPack { pack } => format!("select {pack}"),
    }
}
