//! How many more robots can be serviced: the services of the plan first, in its order, then whoever else would come.

use std::collections::BTreeMap;

use energy::{Estimate, Need};
use planner::Mode;
use proto::{BayId, Capacity, PackId, RobotId, StationId};
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

use crate::forecast;
use crate::models::{StationModels, from_wire};
use crate::scheduler::capacity::{Coming, Holding, Place, Question, Supply, Wanted, capacity as count};
use crate::scheduler::charging::{Course, Table};
use crate::scheduler::translate::HORIZON_MAX_S;
use crate::scheduler::{PackView, Plan, Planned, Racks, Recharging, RobotView, StationView, View, WHOLE_FLEET_MAX, packs_after_begun};
use crate::view::Basis;

/// A pack that holds this many standard deviations more than is owed leaves nothing to the next.
const SIGMAS_OWED: f64 = 6.0;
/// Levels of charge that differ by less are printed alike.
const SAME_SOC: f64 = 0.005;

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
    let racks = Racks::new(&view);
    let asked = (0..view.stations.len()).filter_map(|index| {
        let id = &view.stations[index].station;
        let shorts = plan.rejected.iter().filter_map(|left| left.short.as_ref().filter(|(station, _)| station == id));
        let planned_short_wh = shorts.map(|(_, short_wh)| *short_wh).min_by(f64::total_cmp);
        Some(Question { planned_short_wh, ..question(basis, &coming(index), (&view, &racks), index)? })
    });
    let mut told = count(basis.now, &asked.collect::<Vec<_>>(), basis.settings.confidence);
    without_power(basis, &mut told);
    parts_of(&mut told, &planned, basis.settings.charge_to_soc);
    told
}

/// A station without power serves nobody in any bay: power is what is lacking there, and nothing else is worth a word before that.
fn without_power(basis: &Basis<'_>, told: &mut Capacity) {
    let is_dark = |id: &StationId| basis.fleet.stations.get(id).and_then(|station| station.known()).is_some_and(|state| !state.powered);
    for pack in told.packs.iter_mut().filter(|pack| is_dark(&pack.station)) {
        (pack.lacks_power, pack.lacks_bay, pack.lacks_spare, pack.lacks_right_temperature) = (true, false, false, false);
    }
    for station in told.stations.iter_mut().filter(|station| is_dark(&station.station)) {
        (station.lacks_power, station.lacks_bay, station.lacks_spare, station.lacks_right_temperature) = (true, false, false, false);
    }
}

/// Says of whom it is planned that it is charged to less than the usual level, and to which.
fn parts_of(told: &mut Capacity, planned: &BTreeMap<&RobotId, &Planned>, usual_soc: f64) {
    let of_packs = told.packs.iter_mut().map(|pack| &mut pack.promises);
    let of_stations = told.stations.iter_mut().map(|station| &mut station.promises);
    for promise in of_packs.chain(of_stations).flatten() {
        let planned = promise.robot.as_ref().and_then(|robot| planned.get(robot));
        let part = planned.filter(|planned| matches!(planned.mode, Mode::Charge(_)) && planned.to_soc < usual_soc - SAME_SOC);
        promise.part_to_soc = part.map(|planned| planned.to_soc);
    }
}

/// Where a robot comes for a service and when, s, and how if that is planned: else to the nearest station that it reaches, when it
/// wants one. None where it comes to none, or wants one beyond any plan: nobody waits for that.
fn comes<'p>(basis: &Basis<'_>, view: &View, robot: &RobotView, planned: Option<&'p Planned>) -> Option<(usize, f64, Option<&'p Planned>)> {
    if let Some(planned) = planned {
        let station = view.stations.iter().position(|station| station.station == planned.station)?;
        return Some((station, planned.start.seconds_since(basis.now), Some(planned)));
    }
    let is_in_reach = robot.is_in_reach(&view.stations);
    let reached = robot.ways.iter().filter_map(|way| {
        let there_s = way.time_s.max(view.stations[way.station].opens_s);
        (there_s <= way.lasts.counted_s(is_in_reach)).then_some((way.station, there_s))
    });
    let (station, there_s) = reached.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (robot.wanted_s <= HORIZON_MAX_S).then(|| (station, robot.wanted_s.max(there_s), None))
}

/// What is asked of a station, for robots in the order in which they come.
fn question(
    basis: &Basis<'_>,
    robots: &[(f64, Option<&Planned>, &RobotView)],
    (view, racks): (&View, &Racks),
    index: usize,
) -> Option<Question> {
    let station = &view.stations[index];
    let id = &station.station;
    let (models, known) = (basis.models.stations.get(id)?, basis.fleet.stations.get(id)?);
    let state = known.known()?;
    let table = basis.reference(id, models)?;
    let from_soc = basis.settings.serve_below_soc;
    // Where nothing charges in a bay, a service is an exchange.
    let exchanges = state.bays.is_empty() && !state.spares.is_empty();
    let usual = |soc: Estimate, table: &Table, kind: Option<u16>| match exchanges {
        true => exchange(basis, station, models, table, soc, kind),
        false => charge(station, models, table, soc),
    };
    // Whose battery is never charged as it is now does not come for that.
    let in_vain = |soc: Estimate, table: &Table| !exchanges && table.at(soc.value).stopped.is_some();
    let coming = robots.iter().filter_map(|(from_s, planned, robot)| {
        let way = robot.way(index)?;
        let (table, extra_soc) = (&way.table, way.extra_soc);
        let left_soc = robot.soc.value - robot.drain_soc_per_s * from_s - extra_soc.value;
        let soc = Estimate::new(left_soc.max(0.0), robot.soc.sigma.hypot(extra_soc.sigma));
        let wanted = match planned {
            Some(planned) => {
                let spare = station.spares.iter().find(|spare| planned.spare.as_ref() == Some(&spare.spare));
                as_planned(planned, station, models, table, soc, spare.map(|spare| racks.kind(index, spare)))
            }
            // Where all spares are away, nobody knows what they are: they may fit. Who takes none of them is not served there.
            None => match racks.given(view, robot, index) {
                None if exchanges && !station.spares.is_empty() => return None,
                _ if in_vain(soc, table) => return None,
                kind => usual(soc, table, kind),
            },
        };
        Some(Coming { robot: robot.robot.clone(), wanted, from_s: *from_s, is_planned: planned.is_some() })
    });
    let mut service = usual(Estimate::exact(from_soc), &table, None);
    let battery = basis.usual_battery(id)?;
    if in_vain(Estimate::exact(from_soc), &basis.table(id, models, battery, basis.left_degc(id, battery))) {
        service.place = Place::InVain;
    }
    // A station that takes no part has no place for anybody, nor has a bay that does not work or that somebody is in whom nobody knows.
    let takes_part = station.out_of_order.is_none();
    let bays = state.bays.iter().filter(|bay| takes_part && basis.takes_in(id, bay));
    let spares = station.spares.iter().filter(|_| takes_part);
    Some(Question {
        station: id.clone(),
        begun_until_s: station.committed_until_s,
        packs: state.packs.iter().filter_map(|pack| holding(basis, station, &pack.pack, pack.connected)).collect(),
        together: supply(basis, station),
        robots: coming.collect(),
        recharging: station.recharging.iter().map(|charged| charged.after(station.committed_until_s)).collect(),
        breakdown_wh: if exchanges { by_cause(&service) } else { table.breakdown_wh.clone() },
        service,
        bays_s: bays.map(|bay| taken_until_s(station, &bay.bay)).collect(),
        spares: spares.map(|spare| (racks.kind(index, spare), spare.ready_s.max(0.0))).collect(),
        planned_short_wh: None,
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
        place: Place::Bay,
        left: None,
    }
}

/// An exchange for a charged spare of a kind, or any.
fn exchange(basis: &Basis<'_>, station: &StationView, models: &StationModels, table: &Table, soc: Estimate, kind: Option<u16>) -> Wanted {
    let (need, time_s) = (basis.exchange(&station.station, models), models.handling.swap_s);
    let course = Course { even_wh: need.mean_wh, ..Course::default() };
    Wanted { need, time_s, course, place: Place::Spare(kind), left: left_behind(station, models, table, soc, time_s) }
}

/// The charge of the pack that a robot leaves after so many seconds; none where such packs are put aside.
fn left_behind(station: &StationView, models: &StationModels, table: &Table, soc: Estimate, from_s: f64) -> Option<Recharging> {
    models.spare_battery.as_ref()?;
    let (need, until_s) = (table.bare(soc, 1.0), from_s + table.at(soc.value).bare_s);
    // What is never charged is no spare again.
    if until_s >= HORIZON_MAX_S {
        return None;
    }
    let shared_wh = station.shared_per_wh.iter().map(|change| change * need.mean_wh).collect();
    Some(Recharging { from_s, until_s, need: Need { shared_wh, ..need } })
}

/// Where the energy of an exchange goes, Wh.
fn by_cause(exchange: &Wanted) -> BTreeMap<String, f64> {
    let left_wh = exchange.left.as_ref().map(|left| ("spare_charge".to_owned(), left.need.mean_wh));
    std::iter::once(("exchange".to_owned(), exchange.need.mean_wh)).chain(left_wh).collect()
}

/// What the plan says of a service; an exchange is for a spare of the kind.
fn as_planned(planned: &Planned, station: &StationView, models: &StationModels, table: &Table, soc: Estimate, kind: Option<u16>) -> Wanted {
    let time_s = planned.end.seconds_since(planned.start);
    let (need, left) = match planned.mode {
        Mode::SwapAndRecharge => Recharging::split(&planned.need, table.at(soc.value), time_s),
        // Also where the plan does not count on it, the station charges what robots leave.
        Mode::Swap => (planned.need.clone(), left_behind(station, models, table, Estimate::exact(soc.value), time_s)),
        Mode::Charge(_) => (planned.need.clone(), None),
    };
    let course = match planned.mode {
        Mode::Charge(_) => Course::charge(table, soc.value, planned.to_soc, models.handling.load_s),
        Mode::Swap | Mode::SwapAndRecharge => Course { even_wh: need.mean_wh, ..Course::default() },
    };
    let place = if matches!(planned.mode, Mode::Charge(_)) { Place::Bay } else { Place::Spare(kind) };
    Wanted { need, time_s, course, place, left }
}

/// Until when a bay is taken by a service that has begun, s from now.
fn taken_until_s(station: &StationView, bay: &BayId) -> f64 {
    station.begun.iter().filter(|begun| begun.bay.as_ref() == Some(bay)).map(|begun| begun.until_s).fold(0.0, f64::max)
}

/// All packs of a station; how they stand is known of them in a fleet that is stepped.
fn supply(basis: &Basis<'_>, station: &StationView) -> Supply {
    let supply = Supply::of(station);
    let is_stepped = basis.fleet.robots.len() <= WHOLE_FLEET_MAX;
    Supply { packs: supply.packs.filter(|_| is_stepped), ..supply }
}

/// What a pack holds when services that have begun are paid for; none of a pack that is away for nobody knows how long.
fn holding(basis: &Basis<'_>, station: &StationView, pack: &PackId, is_connected: bool) -> Option<Holding> {
    let planned = station.packs.iter().position(|planned| planned.pack == *pack);
    if !is_connected && planned.is_none() {
        return None;
    }
    // A pack that gave out, or that no model is known of, is in no plan.
    let usable_wh = free_wh(&station.packs, station.begun().estimate()).get(pack).copied().unwrap_or(Estimate::exact(0.0));
    let gauge = basis.fleet.stations.get(&station.station)?.packs.get(pack);
    let is_there = planned.is_some_and(|index| station.packs[index].available_s <= 0.0);
    let alone = match planned {
        // What the station has is what it has.
        Some(0) if is_there && station.packs.len() == 1 => supply(basis, station),
        _ => alone(basis, station, planned, usable_wh),
    };
    let remaining_wh = gauge.filter(|_| is_connected).map_or(usable_wh, |gauge| from_wire(gauge.remaining_wh));
    Some(Holding { pack: pack.clone(), remaining_wh, alone, is_there })
}

/// One of several packs as if it were the only one, and there, when what has begun was drawn as it will be.
fn alone(basis: &Basis<'_>, station: &StationView, planned: Option<usize>, usable_wh: Estimate) -> Supply {
    let states = (basis.fleet.robots.len() <= WHOLE_FLEET_MAX).then(|| packs_after_begun(station)).flatten();
    let usable_wh = planned.map_or(usable_wh, |index| {
        let pack = &station.packs[index];
        Estimate::new(usable_wh.value + pack.gain_wh, usable_wh.sigma.max(pack.usable_wh.sigma))
    });
    let left = station.recharging.iter().map(|charged| charged.after(station.committed_until_s));
    Supply {
        usable_wh,
        begun: Need::default(),
        parts: left.map(|left| left.part()).collect(),
        overhead_from_s: station.committed_until_s.max(0.0),
        packs: planned.and_then(|index| Some(vec![(0.0, states?[index].clone())])),
        comes: Vec::new(),
    }
}

/// What each pack has left when services that have begun are paid for, in the order in which packs are drained: none has less
/// than nothing, and what one may lack the next may have to pay.
fn free_wh(packs: &[PackView], begun: Estimate) -> BTreeMap<PackId, Estimate> {
    let mut owed = begun;
    let free = |pack: &PackView| {
        let (usable, sigma) = (pack.usable_wh.value, pack.usable_wh.sigma.hypot(owed.sigma));
        let left_wh = usable - owed.value;
        owed = if left_wh < sigma * SIGMAS_OWED { at_least_nothing(Estimate::new(-left_wh, sigma)) } else { Estimate::exact(0.0) };
        (pack.pack.clone(), at_least_nothing(Estimate::new(left_wh, sigma)))
    };
    packs.iter().map(free).collect()
}

/// Mean and standard deviation of `max(0, X)` of a normal `X`, by its moments:
/// `m Phi(m/s) + s phi(m/s)` and `(m² + s²) Phi(m/s) + m s phi(m/s)`.
fn at_least_nothing(of: Estimate) -> Estimate {
    let (mean, sigma) = (of.value, of.sigma);
    if sigma <= 0.0 {
        return Estimate::exact(mean.max(0.0));
    }
    let (above, density) = (Normal::standard().cdf(mean / sigma), Normal::standard().pdf(mean / sigma));
    let first = mean * above + sigma * density;
    let second = (mean * mean + sigma * sigma) * above + mean * sigma * density;
    Estimate::new(first.max(0.0), (second - first * first).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pack(n: usize, wh: f64, sigma_wh: f64) -> PackView {
        PackView {
            pack: PackId::new(format!("p-{n}")).unwrap(),
            usable_wh: Estimate::new(wh, sigma_wh),
            gain_wh: 0.0,
            uncounted_wh: 0.0,
            state: None,
            available_s: 0.0,
        }
    }

    fn free(packs: &[(f64, f64)], begun: Estimate) -> Vec<Estimate> {
        let packs: Vec<PackView> = packs.iter().enumerate().map(|(n, &(wh, sigma_wh))| pack(n, wh, sigma_wh)).collect();
        free_wh(&packs, begun).into_values().collect()
    }

    #[test]
    fn services_that_have_begun_are_paid_pack_by_pack() {
        assert_eq!(free(&[(10.0, 0.0), (50.0, 1.0)], Estimate::exact(4.0)), [Estimate::exact(6.0), Estimate::new(50.0, 1.0)]);
        assert_eq!(free(&[(10.0, 0.0), (50.0, 0.0)], Estimate::exact(14.0)), [Estimate::exact(0.0), Estimate::exact(46.0)]);
        assert_eq!(free(&[(10.0, 0.0), (50.0, 0.0)], Estimate::exact(90.0)), [Estimate::exact(0.0), Estimate::exact(0.0)]);
    }

    #[test]
    fn what_one_pack_may_lack_the_next_may_have_to_pay_and_together_they_have_what_there_is() {
        // The first just pays what has begun, ± 1 Wh: half of the time it lacks 0.8 Wh on average (sqrt(2/pi)), half of the time
        // it keeps as much.
        let told = free(&[(10.0, 0.6), (50.0, 1.0)], Estimate::new(10.0, 0.8));
        let half = (0.5 / std::f64::consts::PI).sqrt();
        assert!((told[0].value - half).abs() < 1e-9 && (told[1].value - (50.0 - half)).abs() < 1e-9, "{told:?}");
        // Variance of max(0, N(0, 1)): 1/2 - 1/(2 pi).
        let variance = 0.5 - half * half;
        assert!((told[0].sigma.powi(2) - variance).abs() < 1e-9 && (told[1].sigma.powi(2) - 1.0 - variance).abs() < 1e-9);
    }
}
