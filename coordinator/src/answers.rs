//! What the coordinator tells: the schedule as it goes on the wire; capacity in `capacity.rs`, explanations in `explain.rs`.

mod capacity;
mod explain;

use std::collections::BTreeSet;

use energy::units::S_PER_H;
use proto::{BayPhase, Mode, PackId, Quality, RobotId, RobotPhase, RobotState, Schedule, Service, ServiceStatus, StationId, Unserved};

pub use self::capacity::capacity;
pub use self::explain::{Explainer, changes};
use crate::fleet::Station;
use crate::forecast;
use crate::scheduler::{HANDOVER_S, Plan, Planned};
use crate::service_run::{How, ServiceRun};
use crate::trust::Owner;
use crate::view::Basis;
use crate::when;

/// The plan made at `basis.now`, and the services that have begun.
#[must_use]
pub fn schedule(basis: &Basis<'_>, plan: &Plan, number: u64, trigger: String) -> Schedule {
    let begun = basis.running.values().map(|run| running_service(basis, run));
    let planned = plan.planned.iter().map(planned_service);
    let mut services: Vec<Service> = begun.chain(planned).collect();
    services.sort_by(|a, b| a.start.cmp(&b.start).then_with(|| a.robot.cmp(&b.robot)));
    let unserved = plan.rejected.iter().map(|rejected| Unserved {
        robot: rejected.robot.clone(),
        runs_empty: rejected.stranded,
        reasons: rejected.reasons.clone(),
    });
    let (stuck, lost): (Vec<Unserved>, Vec<Unserved>) = untold(basis, plan).partition(|unserved| unserved.runs_empty);
    let mut quality = quality(plan);
    // They strand whatever is planned.
    let count = u32::try_from(stuck.len()).unwrap_or(u32::MAX);
    (quality.stranded, quality.stranded_bound) = (quality.stranded + count, quality.stranded_bound + count);
    Schedule {
        at: basis.now,
        plan: number,
        policy: basis.settings.policy.name().to_owned(),
        trigger,
        services,
        unserved: unserved.filter(|unserved| !basis.running.contains_key(&unserved.robot)).chain(stuck).chain(lost).collect(),
        doubts: basis.watch.doubts(basis.now, basis.fleet, basis.models),
        quality: Some(quality),
    }
}

fn quality(plan: &Plan) -> Quality {
    let robots = |count: i64| u32::try_from(count.max(0)).unwrap_or(u32::MAX);
    let of = &plan.quality;
    Quality {
        stranded: robots(of.stranded),
        stranded_bound: robots(of.stranded_bound),
        missed_s: of.missed_s.max(0.0),
        missed_bound_s: of.missed_bound_s.max(0.0),
        moved: plan.moved.clone(),
    }
}

/// Robots of which no plan tells: those that it cannot reach where they are, in a bay without power say, and those that were lost, of which
/// nobody knows whether they run empty.
fn untold<'a>(basis: &'a Basis<'_>, plan: &'a Plan) -> impl Iterator<Item = Unserved> + 'a {
    let planned = plan.planned.iter().map(|planned| &planned.robot);
    let in_plan: BTreeSet<&RobotId> = planned.chain(plan.rejected.iter().map(|rejected| &rejected.robot)).collect();
    // Between two plans a robot that was just let go is in neither list.
    let is_told = move |id: &RobotId| basis.running.contains_key(id) || in_plan.contains(id);
    basis.fleet.robots.iter().filter(move |(id, _)| !is_told(id)).filter_map(|(id, robot)| {
        if robot.written_off {
            let since = robot.lost_since.map(|since| format!(": it has not been heard since {}", when::minute_from(basis.now, since)));
            let why = format!("it was lost{}", since.unwrap_or_default());
            return Some(Unserved { robot: id.clone(), runs_empty: false, reasons: vec![why] });
        }
        let (_, state) = robot.known()?;
        let place = state.station.as_ref().map_or_else(String::new, |station| format!(" at {station}"));
        let note = state.note.as_ref().map_or_else(String::new, |note| format!(": {note}"));
        let plannable = matches!(state.phase, RobotPhase::Working | RobotPhase::Waiting);
        let why = || format!("{}{place}{note}", state.phase);
        (!plannable).then(|| Unserved { robot: id.clone(), runs_empty: is_stuck(basis, state), reasons: vec![why()] })
    })
}

/// Whether a robot that no service moves gets no energy where it is: it stands where it gave out, or in a place without power.
fn is_stuck(basis: &Basis<'_>, robot: &RobotState) -> bool {
    match robot.phase {
        RobotPhase::Stranded => true,
        RobotPhase::Docked | RobotPhase::Charging | RobotPhase::Charged | RobotPhase::Swapping => {
            let station = robot.station.as_ref().and_then(|station| basis.fleet.stations.get(station));
            let failed = |station: &Station| robot.bay.as_ref().is_some_and(|bay| station.bay_phase(bay) == Some(BayPhase::Failed));
            station.is_some_and(|station| failed(station) || station.known().is_none_or(|state| !state.powered))
        }
        RobotPhase::Working | RobotPhase::Waiting | RobotPhase::Travelling => false,
    }
}

fn running_service(basis: &Basis<'_>, run: &ServiceRun) -> Service {
    let (mode, bay) = match &run.how {
        How::Recharge { bay, to_soc } => (Mode::Recharge { to_soc: *to_soc }, Some(bay.clone())),
        How::Swap { spare } => (Mode::Swap { spare: spare.clone() }, None),
    };
    let lost = basis.fleet.stations.get(&run.station).filter(|station| station.is_lost());
    let lost = lost
        .into_iter()
        .map(|_| format!("{} was lost: whether the service goes on is not known; what follows is as it was planned", run.station));
    Service {
        robot: run.robot.clone(),
        station: run.station.clone(),
        mode,
        bay,
        packs: run.packs.clone(),
        leave: run.left,
        // What the plan counts on, which need not be what was once planned.
        start: run.start.plus_s(basis.late_s(run)),
        end: basis.now.plus_s(basis.ends_s(run)),
        pack_energy_wh: node::wire(run.need.estimate()),
        probability: None,
        status: run.status(),
        why: lost.chain(run.why.iter().cloned()).collect(),
    }
}

fn planned_service(planned: &Planned) -> Service {
    let mode = match (&planned.bay, &planned.spare) {
        (None, Some(spare)) => Mode::Swap { spare: spare.clone() },
        _ => Mode::Recharge { to_soc: planned.to_soc },
    };
    Service {
        robot: planned.robot.clone(),
        station: planned.station.clone(),
        mode,
        bay: planned.bay.clone(),
        packs: planned.packs.clone(),
        leave: planned.leave,
        start: planned.start,
        end: planned.end,
        pack_energy_wh: node::wire(planned.need.estimate()),
        probability: Some(planned.probability),
        status: ServiceStatus::Planned,
        why: planned.why.clone(),
    }
}

/// How a robot gets its energy, as people are told it everywhere else: what is `swap` on the wire is an exchange to them.
#[must_use]
pub fn mode_in_words(mode: &str) -> &str {
    if mode == "swap" { "exchange" } else { mode }
}

/// The pack that a station should be handed over to now, if its active one is about to give out.
#[must_use]
pub fn next_pack(basis: &Basis<'_>, id: &StationId) -> Option<PackId> {
    let station = basis.fleet.stations.get(id)?;
    let state = station.heard()?;
    let active = state.active_pack.as_ref()?;
    let models = basis.models.stations.get(id)?;
    let (owner, gauge) = (Owner::Pack(id.clone(), active.clone()), station.packs.get(active)?);
    let told_s = gauge.time_to_empty_s.map(|time_s| time_s.value);
    let left_s = match basis.trust.fault(basis.now, &owner) {
        None => told_s?,
        Some(_) if state.pack_power_w <= 0.0 => return None,
        // Its gauge may not say how it is now.
        Some(_) => {
            let (_, left_wh) = basis.trust.belief(basis.now, &owner, gauge, models.packs.get(active)?.battery().stored_wh());
            (left_wh.value / state.pack_power_w * S_PER_H).min(told_s.unwrap_or(f64::INFINITY))
        }
    };
    if left_s > HANDOVER_S {
        return None;
    }
    // The least full first, so that full packs stay full. What a pack holds counts at the power
    // that the station draws: at rest even an empty one looks as if it held something.
    let usable_wh = |pack: &PackId| {
        let (gauge, model) = (station.packs.get(pack)?, models.packs.get(pack)?);
        let soc = basis.believed(id, pack, gauge, model);
        let model = basis.worn(&Owner::Pack(id.clone(), pack.clone()), model, gauge);
        Some(forecast::usable_wh(&model, soc, gauge.temperature_degc, state.pack_power_w.max(0.0)).value)
    };
    let enough_wh = state.pack_power_w * 2.0 * HANDOVER_S / S_PER_H;
    let others = state.packs.iter().filter(|pack| pack.pack != *active && pack.connected && !pack.depleted);
    let holding = others.filter_map(|pack| Some((pack, usable_wh(&pack.pack)?))).filter(|(_, left_wh)| *left_wh > enough_wh);
    let (next, _) = holding.min_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(next.pack.clone())
}

#[cfg(test)]
mod tests {
    #[test]
    fn an_exchange_is_called_so_and_a_recharge_as_on_the_wire() {
        assert_eq!(["swap", "recharge"].map(super::mode_in_words), ["exchange", "recharge"]);
    }
}
