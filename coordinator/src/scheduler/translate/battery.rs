//! A kind of battery for the planner: what it holds, and how each station charges it.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::forecast::TIME_MAX_S;
use planner::problem::{Battery, Charger, Segment, Tick};

use super::UNITS_PER_WH;
use crate::models::Settings;
use crate::scheduler::charging::{Point, Table};
use crate::scheduler::problem::{RobotView, StationView, View};
use crate::scheduler::racks::Racks;

/// Levels below the usual one that a charge may end at.
const LOWER_LEVELS: u32 = 3;

/// Levels at which a charge may end, ascending; the last is the usual one.
pub(super) fn levels_soc(settings: &Settings) -> Vec<f64> {
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

/// A battery like that of `robot`; `tables` says what charging it takes at the stations in reach.
pub(super) fn battery(
    robot: &RobotView,
    tables: &BTreeMap<usize, Arc<Table>>,
    (view, racks): (&View, &Racks),
    settings: &Settings,
    tick_s: u32,
) -> Battery {
    let capacity = robot.battery.battery().stored_wh() * UNITS_PER_WH;
    let levels = levels_soc(settings);
    let stations = &view.stations;
    let chargers = (0..stations.len()).map(|station| {
        let spares = racks.given(view, robot, station).map(|kind| racks.next(view, station, kind));
        let swap_soc = spares.into_iter().flatten().map(|spare| spare.soc).fold(f64::INFINITY, f64::min);
        let swap_energy = if swap_soc.is_finite() { (swap_soc.min(1.0) * capacity) as i64 } else { 0 };
        let again_energy = ((settings.charge_to_soc * capacity) as i64).max(swap_energy);
        let curve = tables.get(&station).map_or_else(Vec::new, |table| curve(table, capacity, tick_s));
        let any = Segment { below: capacity as i64, gain: capacity as i64, draw: 0, draw_bare: 0 };
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

/// A table as stretches of equal power.
fn curve(table: &Table, capacity: f64, tick_s: u32) -> Vec<Segment> {
    let mut curve: Vec<Segment> = Vec::new();
    // What a pack alone takes after the last point, its charger's end, is spread over what it takes before.
    let bare_wh = [&table.points[0], &table.points[table.points.len() - 1]].map(|point| point.bare_wh);
    let to_the_end = bare_wh[0] / (bare_wh[0] - bare_wh[1]).max(f64::MIN_POSITIVE);
    // A charge that heat or cold stops ends between two points: another one stands there.
    let inner = |points: &[Point]| (points[0].soc < table.reaches_soc && table.reaches_soc < points[1].soc).then_some(table.reaches_soc);
    let ends = table.points.windows(2).find_map(inner).map(|soc| table.at(soc));
    let mut points: Vec<Point> = table.points.iter().copied().chain(ends).collect();
    points.sort_by(|a, b| a.soc.total_cmp(&b.soc));
    for pair in points.windows(2) {
        let [low, high] = [pair[0], pair[1]];
        // Beyond that it takes longer than anybody plans ahead.
        let never_s = if low.stopped.is_some() && high.soc > table.reaches_soc { TIME_MAX_S } else { 0.0 };
        let ticks = (low.charge_s - high.charge_s + never_s) / f64::from(tick_s);
        let last = curve.last().copied();
        let below = (high.soc * capacity) as i64;
        if ticks <= 1e-6 || below <= last.map_or(0, |last| last.below) {
            continue;
        }
        let per_tick = |wh: f64| ((wh * UNITS_PER_WH / ticks).round() as i64).max(0);
        curve.push(Segment {
            below,
            gain: (((high.soc - low.soc) * capacity / ticks).round() as i64).max(1),
            draw: per_tick(low.need_wh - high.need_wh),
            draw_bare: per_tick(to_the_end * (low.bare_wh - high.bare_wh)),
        });
    }
    if let Some(last) = curve.last_mut() {
        last.below = capacity as i64;
    }
    curve
}
