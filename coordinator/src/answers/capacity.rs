//! How many more robots can be serviced: the services of the plan first, in its order, then whoever else would come.

use std::collections::BTreeMap;

use energy::units::S_PER_H;
use energy::{Estimate, Need};
use planner::Mode;
use proto::{Capacity, PackId, RobotId};

use crate::forecast;
use crate::models::{StationModels, from_wire};
use crate::scheduler::capacity::{Coming, Holding, Question, Wanted, capacity as count};
use crate::scheduler::charging::{Course, Table};
use crate::scheduler::translate::HORIZON_MAX_S;
use crate::scheduler::{PackView, Plan, Planned, RobotView, StationView, View, WHOLE_FLEET_MAX, packs_after_begun};
use crate::view::Basis;

/// How many more robots each pack can service, each pack by itself, and each station, beyond the services
/// that have begun.
#[must_use]
pub fn capacity(basis: &Basis<'_>, plan: &Plan) -> Capacity {
    let view = basis.view();
    let planned: BTreeMap<&RobotId, &Planned> = plan.planned.iter().map(|planned| (&planned.robot, planned)).collect();
    let coming = |index: usize| {
        let here = view.robots.iter().filter_map(|robot| Some((comes(basis, &view, robot, planned.get(&robot.robot).copied())?, robot)));
        let mut here: Vec<_> = here.filter(|((station, ..), _)| *station == index).collect();
        here.sort_by(|((_, a_s, a), one), ((_, b_s, b), other)| {
            a.is_none().cmp(&b.is_none()).then(a_s.total_cmp(b_s)).then_with(|| one.robot.cmp(&other.robot))
        });
        here.into_iter().map(|((_, from_s, planned), robot)| (from_s, planned, robot)).collect::<Vec<_>>()
    };
    let asked = view.stations.iter().enumerate().filter_map(|(index, station)| question(basis, &coming(index), index, station));
    count(basis.now, &asked.collect::<Vec<_>>(), basis.settings.confidence)
}

/// Where a robot comes for a service and when, s, and how if that is planned: else to the nearest station that it reaches, when it
/// wants one. None where it comes to none, or wants one beyond any plan: nobody waits for that.
fn comes<'p>(basis: &Basis<'_>, view: &View, robot: &RobotView, planned: Option<&'p Planned>) -> Option<(usize, f64, Option<&'p Planned>)> {
    if let Some(planned) = planned {
        let station = view.stations.iter().position(|station| station.station == planned.station)?;
        return Some((station, planned.start.seconds_since(basis.now), Some(planned)));
    }
    let reached = robot.travel.iter().map(|(station, travel_s, _)| (*station, travel_s.max(view.stations[*station].opens_s)));
    let reached = reached.filter(|(_, there_s)| *there_s <= robot.endures_s(*there_s));
    let (station, there_s) = reached.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (robot.wanted_s <= HORIZON_MAX_S).then(|| (station, robot.wanted_s.max(there_s), None))
}

/// What is asked of a station, for robots in the order in which they come.
fn question(basis: &Basis<'_>, robots: &[(f64, Option<&Planned>, &RobotView)], index: usize, station: &StationView) -> Option<Question> {
    let id = &station.station;
    let (models, known) = (basis.models.stations.get(id)?, basis.fleet.stations.get(id)?);
    let state = known.known()?;
    let table = basis.reference(id, models)?;
    let from_soc = basis.settings.serve_below_soc;
    let coming = robots.iter().filter_map(|(from_s, planned, robot)| {
        let (_, _, table) = robot.travel.iter().find(|(station, _, _)| *station == index)?;
        let soc = Estimate::new((robot.soc.value - robot.drain_soc_per_s * from_s).max(0.0), robot.soc.sigma);
        let wanted = match planned {
            Some(planned) => as_planned(planned, table, soc.value, models),
            None => charge(station, models, table, soc),
        };
        let from_s = from_s - station.committed_until_s;
        Some(Coming { robot: robot.robot.clone(), wanted, from_s, is_planned: planned.is_some() })
    });
    Some(Question {
        station: id.clone(),
        packs: state.packs.iter().filter_map(|pack| holding(basis, station, &pack.pack, pack.connected)).collect(),
        robots: coming.collect(),
        service: charge(station, models, &table, Estimate::exact(from_soc)),
        breakdown_wh: table.breakdown_wh.clone(),
        bays: state.bays.len() as u32,
        overhead_per_h: station.overhead_per_h.clone(),
        overhead_breakdown: forecast::overhead_breakdown(models),
    })
}

/// A charge to the usual level.
fn charge(station: &StationView, models: &StationModels, table: &Table, soc: Estimate) -> Wanted {
    let need = table.need(soc, 1.0);
    let shared_wh = station.shared_per_wh.iter().map(|change| change * need.mean_wh).collect();
    Wanted {
        need: Need { shared_wh, ..need },
        time_s: table.at(soc.value).charge_s + models.handling.load_s + models.handling.unload_s,
        course: Course::charge(table, soc.value, table.target_soc(), models.handling.load_s),
        in_bay: true,
    }
}

/// What the plan says of a service.
fn as_planned(planned: &Planned, table: &Table, soc: f64, models: &StationModels) -> Wanted {
    let course = match planned.mode {
        Mode::Charge(_) => Course::charge(table, soc, planned.to_soc, models.handling.load_s),
        Mode::Swap | Mode::SwapAndRecharge => Course { even_wh: planned.need.mean_wh, ..Course::default() },
    };
    let in_bay = matches!(planned.mode, Mode::Charge(_));
    Wanted { need: planned.need.clone(), time_s: planned.end.seconds_since(planned.start), course, in_bay }
}

/// What a pack holds when services that have begun are paid for; none of a pack that is away for nobody knows how long.
fn holding(basis: &Basis<'_>, station: &StationView, pack: &PackId, is_connected: bool) -> Option<Holding> {
    let planned = station.packs.iter().position(|planned| planned.pack == *pack);
    if !is_connected && planned.is_none() {
        return None;
    }
    let begun = station.committed.plus(&station.overhead_per_h.scaled(station.committed_until_s / S_PER_H));
    // A pack that gave out, or that no model is known of, is in no plan.
    let usable_wh = free_wh(&station.packs, begun.estimate()).get(pack).copied().unwrap_or(Estimate::exact(0.0));
    let gauge = basis.fleet.stations.get(&station.station)?.packs.get(pack);
    let states = (basis.fleet.robots.len() <= WHOLE_FLEET_MAX).then(|| packs_after_begun(station)).flatten();
    Some(Holding {
        pack: pack.clone(),
        remaining_wh: gauge.filter(|_| is_connected).map_or(usable_wh, |gauge| from_wire(gauge.remaining_wh)),
        usable_wh,
        gain_wh: planned.map_or(0.0, |index| station.packs[index].gain_wh),
        state: planned.and_then(|index| Some(states?[index].clone())),
        from_s: planned.map_or(0.0, |index| (station.packs[index].available_s - station.committed_until_s).max(0.0)),
    })
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
