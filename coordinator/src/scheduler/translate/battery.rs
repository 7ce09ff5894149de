//! A kind of battery for the planner: what it holds, and how each station charges it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use energy::forecast::TIME_MAX_S;
use planner::problem::{Battery, Charger, Segment, Tick};

use super::UNITS_PER_WH;
use crate::models::Settings;
use crate::scheduler::charging::{Point, TAPER_POINTS, Table};
use crate::scheduler::problem::{RobotView, StationView, View};
use crate::scheduler::racks::Racks;

/// Levels below the usual one that a charge may end at.
const LOWER_LEVELS: u32 = 3;

/// Levels at which a charge may end, ascending; the last is the usual one.
pub(crate) fn levels_soc(settings: &Settings) -> Vec<f64> {
    let (least, full) = (settings.charge_at_least_soc, settings.charge_to_soc);
    let lower = (0..LOWER_LEVELS).map(|level| least + (full - least) * f64::from(level) / f64::from(LOWER_LEVELS));
    lower.filter(|&soc| soc < full).chain([full]).collect()
}

/// Time that a robot owes which leaves with so much less than the usual level, s: what charging it there would have
/// taken, and the same part of the lift's time of a service from where one is wanted.
fn owed_s(table: &Table, station: &StationView, settings: &Settings, soc: f64) -> f64 {
    let part = (settings.charge_to_soc - soc) / (settings.charge_to_soc - settings.serve_below_soc);
    table.at(soc).charge_s + part.clamp(0.0, 1.0) * (station.handling.load_s + station.handling.unload_s)
}

/// A pack's model and the temperature at which it is charged.
type Pack = (usize, i32);

/// Robots whose batteries are alike to a plan, and so are the spares that they are given: the kind of each robot, and the robots of each kind.
pub(super) fn kinds<'v>(view: &'v View, racks: &Racks) -> (Vec<usize>, Vec<Vec<&'v RobotView>>) {
    // Where spares are all of one kind it does not matter who is given one.
    let several: Vec<usize> = (0..view.stations.len()).filter(|station| racks.are_several(*station)).collect();
    let mut keys: Vec<(Pack, Vec<Option<u16>>)> = Vec::new();
    let mut members: Vec<Vec<&RobotView>> = Vec::new();
    let kind_of = view.robots.iter().map(|robot| {
        let pack = (Arc::as_ptr(&robot.battery).addr(), robot.charge_degc as i32);
        let given = |&station: &usize| robot.way(station).and_then(|_| racks.given(view, robot, station));
        let given: Vec<Option<u16>> = several.iter().map(given).collect();
        let goes_with = |known: &[Option<u16>]| known.iter().zip(&given).all(|(a, b)| a == b || a.is_none() || b.is_none());
        let kind = keys.iter().position(|(known, spares)| *known == pack && goes_with(spares)).unwrap_or_else(|| {
            keys.push((pack, given.clone()));
            members.push(Vec::new());
            keys.len() - 1
        });
        keys[kind].1.iter_mut().zip(&given).for_each(|(known, given)| *known = known.or(*given));
        members[kind].push(robot);
        kind
    });
    (kind_of.collect(), members)
}

/// The battery of these robots, which are all alike; `tables` says what charging it takes at the stations in reach.
pub(super) fn battery(
    robots: &[&RobotView],
    tables: &BTreeMap<usize, Arc<Table>>,
    (view, racks): (&View, &Racks),
    settings: &Settings,
    tick_s: u32,
) -> Battery {
    let capacity = robots[0].battery.battery().stored_wh() * UNITS_PER_WH;
    let levels = levels_soc(settings);
    let stations = &view.stations;
    let chargers = (0..stations.len()).map(|station| {
        // Who is given none says nothing of the others.
        let come = robots.iter().filter(|robot| robot.way(station).is_some());
        let given: BTreeSet<u16> = come.filter_map(|robot| racks.given(view, robot, station)).collect();
        let spares = given.into_iter().flat_map(|kind| racks.next(view, station, kind));
        let swap_soc = spares.map(|spare| spare.soc).fold(f64::INFINITY, f64::min);
        let swap_energy = if swap_soc.is_finite() { (swap_soc.min(1.0) * capacity) as i64 } else { 0 };
        let again_energy = ((stations[station].ready_soc * capacity) as i64).max(swap_energy);
        let curve = tables.get(&station).map_or_else(Vec::new, |table| curve(table, capacity, again_energy as f64 / capacity, tick_s));
        let at_once = capacity as i64;
        let any = Segment { below: at_once, gain: at_once, gain_bare: at_once, draw: 0, draw_bare: 0 };
        let owed = |&soc: &f64| tables.get(&station).map_or(0.0, |table| owed_s(table, &stations[station], settings, soc));
        let owed = levels.iter().map(|soc| (owed(soc) / f64::from(tick_s) - 1e-9).ceil().max(0.0) as Tick).collect();
        Charger { swap_energy, again_energy, curve: if curve.is_empty() { vec![any] } else { curve }, owed }
    });
    Battery {
        capacity: capacity as i64,
        floor: 0,
        min_gain: (settings.min_gain_soc * capacity) as i64,
        targets: levels.iter().map(|soc| (soc * capacity) as i64).collect(),
        chargers: chargers.collect(),
    }
}

/// Leaves one charger for all stations that charge every battery alike: the planner works out a charge once for each.
/// Which one is whose.
pub(super) fn share_chargers(batteries: &mut [Battery], stations: usize) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::new();
    let alike = |a: usize, b: usize| batteries.iter().all(|battery| battery.chargers[a] == battery.chargers[b]);
    let charger_of = (0..stations).map(|station| {
        kept.iter().position(|&known| alike(known, station)).unwrap_or_else(|| {
            kept.push(station);
            kept.len() - 1
        })
    });
    let charger_of: Vec<usize> = charger_of.collect();
    for battery in batteries {
        battery.chargers = kept.iter().map(|&station| battery.chargers[station].clone()).collect();
    }
    charger_of
}

/// A table as stretches of equal power; a pack alone is charged until it holds `again_soc` of the capacity.
fn curve(table: &Table, capacity: f64, again_soc: f64, tick_s: u32) -> Vec<Segment> {
    let mut curve: Vec<Segment> = Vec::new();
    // A charge that heat or cold stops ends between two points: another one stands there.
    let inner = |points: &[Point]| (points[0].soc < table.reaches_soc && table.reaches_soc < points[1].soc).then_some(table.reaches_soc);
    let ends = table.points.windows(2).find_map(inner).map(|soc| table.at(soc));
    let mut points: Vec<Point> = table.points.iter().copied().chain(ends).collect();
    points.sort_by(|a, b| a.soc.total_cmp(&b.soc));
    let ticks = |time_s: f64| time_s / f64::from(tick_s);
    let gain = |soc: f64, ticks: f64| ((soc * capacity / ticks.max(f64::MIN_POSITIVE)).round() as i64).max(1);
    let per_tick = |wh: f64, ticks: f64| ((wh * UNITS_PER_WH / ticks.max(f64::MIN_POSITIVE)).round() as i64).max(0);
    // A pack alone goes on until its charger ends: that is spread over the last stretches, for in whole ticks a charge would jump over a part
    // of one that is short and slow.
    let (end, taper) = (points[points.len() - 1], &points[points.len() - 1 - TAPER_POINTS..]);
    let (from_soc, again_soc) = (taper[0].soc, again_soc.max(end.soc));
    let to_the_end = |of: f64, soc: f64| if soc > from_soc { of / (again_soc - from_soc) * (again_soc - soc) } else { of };
    let bare_at = |point: &Point, soc: f64| {
        [(point.bare_s, end.bare_s), (point.bare_wh, end.bare_wh)].map(|(of, at_end)| of - at_end + to_the_end(at_end, soc))
    };
    for (place, pair) in points.windows(2).enumerate() {
        let [low, high] = [pair[0], pair[1]];
        // Beyond that it takes longer than anybody plans ahead.
        let never_s = if low.stopped.is_some() && high.soc > table.reaches_soc { TIME_MAX_S } else { 0.0 };
        let in_bay = ticks(low.charge_s - high.charge_s + never_s);
        let last = curve.last().copied();
        let below = (high.soc * capacity) as i64;
        if in_bay <= 1e-6 || below <= last.map_or(0, |last| last.below) {
            continue;
        }
        let to_soc = if place + 2 == points.len() { again_soc } else { high.soc };
        let ([from_s, from_wh], [to_s, to_wh]) = (bare_at(&low, low.soc), bare_at(&high, to_soc));
        let alone = ticks(from_s - to_s);
        curve.push(Segment {
            below,
            gain: gain(high.soc - low.soc, in_bay),
            gain_bare: gain(to_soc - low.soc, alone).min(capacity as i64),
            draw: per_tick(low.need_wh - high.need_wh, in_bay),
            draw_bare: if alone > 0.0 { per_tick(from_wh - to_wh, alone) } else { 0 },
        });
    }
    if let Some(last) = curve.last_mut() {
        last.below = capacity as i64;
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pack_that_is_charged_alone_is_ready_when_its_table_says() {
        // 1C up to 88 %, then ever slower, and its charger goes on for ten minutes and 0.2 Wh beyond the last point.
        let left = |soc: f64| if soc < 0.88 { (4000.0 * (0.88 - soc), 19.0 * (0.88 - soc)) } else { (0.0, 0.0) };
        let tapering = |soc: f64| (0.98 - soc.max(0.88)) / 0.1;
        let point = |soc: f64| {
            let (fast_s, fast_wh) = left(soc);
            let bare_s = fast_s + 900.0 * tapering(soc).powi(2) + 600.0;
            let bare_wh = fast_wh + 2.0 * tapering(soc) + 0.2;
            let charge_s = if soc < 0.98 { 0.8 * (bare_s - 600.0) } else { 0.0 };
            Point { soc, charge_s, need_wh: 1.3 * bare_wh, own_variance: 0.0, bare_wh, bare_s, stopped: None }
        };
        let coarse = (0..18).map(|step| 0.98 * f64::from(step) / 20.0);
        let points: Vec<Point> = coarse.chain((0..=10).map(|step| 0.98 * (0.9 + f64::from(step) / 100.0))).map(point).collect();
        let (shared_per_wh, breakdown_wh) = (Vec::new(), BTreeMap::new());
        let table = Table { points, lift_wh: 0.0, shared_per_wh, breakdown_wh, reaches_soc: 0.0 };
        let capacity = 14.0 * UNITS_PER_WH;
        for again_soc in [0.98, 1.0] {
            let curve = curve(&table, capacity, again_soc, 10);
            for soc in [0.05, 0.3, 0.77] {
                let (mut energy, mut ticks, mut drawn) = ((soc * capacity) as i64, 0, 0);
                while energy < (again_soc * capacity) as i64 {
                    let at = curve.iter().find(|segment| energy < segment.below).unwrap();
                    (energy, ticks, drawn) = (energy + at.gain_bare, ticks + 1, drawn + at.draw_bare);
                }
                let (is, time_s, wh) = (table.at(soc), f64::from(ticks * 10), drawn as f64 / UNITS_PER_WH);
                assert!((time_s - is.bare_s).abs() <= 30.0, "from {soc} to {again_soc}: {time_s} s, {} s", is.bare_s);
                assert!((wh - is.bare_wh).abs() < 0.01 * is.bare_wh, "from {soc} to {again_soc}: {wh} Wh, {} Wh", is.bare_wh);
            }
        }
    }
}
