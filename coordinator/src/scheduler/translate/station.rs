//! A station for the planner: its places, its packs and how surely they must last.

use energy::units::S_PER_H;
use planner::problem::{Chance, LeftPacks, Ongoing, Pack, Spare, Station, Tick};
use proto::BayId;
use statrs::distribution::{ContinuousCDF, Normal};

use super::{Grid, Offer, UNITS_PER_WH};
use crate::models::Settings;
use crate::scheduler::problem::{PackView, StationView, View};
use crate::scheduler::racks::Racks;

/// How much earlier than they must services of a station that leaves are planned to end, s: a guess, of what a charge takes longer than was
/// thought. Who is promised one already may need that time. They must when there is still time to ask twice.
const LEAVING_SLACK_S: f64 = 120.0;
/// What a station may draw in a tick where nothing limits it.
const NO_LIMIT: i64 = 1 << 40;
/// A promise that was given is kept as long as it is more likely than not that it can be; what makes it
/// less likely is measured, never planned ([`planner::hold`]).
pub(in crate::scheduler) const KEEP_CONFIDENCE: f64 = 0.5;

/// The station of the view with this index; `charger` is how it charges.
pub(super) fn station(
    (view, racks): (&View, &Racks),
    index: usize,
    charger: usize,
    lift_wh: f64,
    settings: &Settings,
    grid: Grid,
    offer: Offer<'_>,
) -> Station {
    let (station, spares) = (&view.stations[index], racks.all_next(view, index));
    let ahead_s = view.now.seconds_since(grid.origin);
    let tick = |seconds: f64| grid.up(seconds + ahead_s);
    let [load_ticks, unload_ticks, swap_ticks] =
        [station.handling.load_s, station.handling.unload_s, station.handling.swap_s].map(|seconds| grid.up(seconds));
    // A service in a bay that has failed takes none of those that work.
    let begun = station.begun.iter().filter_map(|begun| {
        let place = |bay: &BayId| station.bays.iter().position(|known| known == bay).map(|place| place as u32);
        let bay = begun.bay.as_ref().map(place);
        if bay == Some(None) {
            return None;
        }
        let bay = bay.flatten();
        let (from, until) = (if begun.from_s > 0.0 { tick(begun.from_s) } else { 0 }, tick(begun.until_s));
        let lift = |ticks: Tick| if bay.is_some() { ticks } else { 0 };
        let load_ticks = if begun.load_s > 0.0 && from == 0 { tick(begun.load_s) } else { grid.up(begun.load_s) };
        Some(Ongoing { bay, from: from.min(until), until, draw: 0, load_ticks: lift(load_ticks), unload_ticks: lift(unload_ticks) })
    });
    let out = station.out_of_order.is_some();
    let lifting = i64::from(load_ticks + unload_ticks).max(1);
    let lift_draw = (lift_wh * UNITS_PER_WH / lifting as f64).round() as i64;
    // What an exchange takes is at the power of the lift.
    let handling_s = (station.handling.load_s + station.handling.unload_s).max(1e-9);
    let swap_wh = lift_wh * station.handling.swap_s / handling_s;
    Station {
        name: station.station.to_string(),
        charger,
        opens: if station.opens_s > 0.0 { tick(station.opens_s) } else { 0 },
        away: station
            .away_s
            .iter()
            .map(|away_s| grid.down(away_s.start - settings.deadline_s - LEAVING_SLACK_S + ahead_s)..tick(away_s.end))
            .collect(),
        away_slack: grid.down(LEAVING_SLACK_S),
        bays: if out { 0 } else { station.bays.len() as u32 },
        lift_slots: 1,
        swap_slots: 1,
        hotel: 0,
        p_max: NO_LIMIT,
        switch_cost: 0,
        load_ticks,
        load_draw: lift_draw,
        unload_ticks,
        unload_draw: lift_draw,
        swap_ticks,
        swap_draw: (swap_wh * UNITS_PER_WH / f64::from(swap_ticks.max(1))).round() as i64,
        spares: spares.map(|(kind, spare)| Spare { ready: if spare.ready_s > 0.0 { tick(spare.ready_s) } else { 0 }, kind }).collect(),
        left_packs: match offer {
            _ if !station.charges_spares => LeftPacks::PutAside,
            Offer::Spares(_) => LeftPacks::AsPlanned,
            _ => LeftPacks::Charged,
        },
        packs: packs(station, tick),
        ongoing: begun.filter(|begun| !out || begun.bay.is_none()).collect(),
        chance: Some(chance(station, settings, grid, offer)),
    }
}

/// What its packs hold, from when on; then what comes into them from outside, which counts as packs of its own.
fn packs(station: &StationView, tick: impl Fn(f64) -> Tick) -> Vec<Pack> {
    let pack = |pack: &PackView, wh: f64, from_s: f64| Pack {
        name: pack.pack.to_string(),
        remaining: (wh.max(0.0) * UNITS_PER_WH) as i64,
        reserve: 0,
        available_from: if from_s > 0.0 { i64::from(tick(from_s)) } else { 0 },
    };
    let held = station.packs.iter().map(|of| pack(of, of.usable_wh.value, of.available_s));
    let comes = station.packs.iter().flat_map(|of| of.refill().levels().map(move |level| pack(of, level.more_wh, level.at_s)));
    held.chain(comes).collect()
}

/// How certain it must be that the packs hold what is promised, in the problem's units.
fn chance(station: &StationView, settings: &Settings, grid: Grid, offer: Offer<'_>) -> Chance {
    let tick_h = f64::from(grid.tick_s) / S_PER_H;
    // What lasts for no spare's charge may last for exchanges before it is drawn: how long it does is stepped afterwards.
    let begun = if matches!(offer, Offer::Spares(_)) { station.committed.clone() } else { station.owed() };
    let hotel = station.overhead_per_h.scaled(tick_h);
    let parts = [&begun.shared_wh, &hotel.shared_wh, &station.shared_per_wh];
    // What goes with a unit of service is a ratio, the others are Wh.
    let scales = [UNITS_PER_WH, UNITS_PER_WH, 1.0];
    let product = |a: usize, b: usize| {
        let sum: f64 = parts[a].iter().zip(parts[b].iter()).map(|(x, y)| x * y).sum();
        sum * scales[a] * scales[b]
    };
    let packs: f64 = station.packs.iter().map(|pack| pack.usable_wh.sigma.powi(2)).sum();
    Chance {
        quantile: settings.caution(),
        quantile_held: Normal::standard().inverse_cdf(KEEP_CONFIDENCE),
        hotel: (hotel.mean_wh * UNITS_PER_WH).round() as i64,
        begun: (begun.mean_wh * UNITS_PER_WH).round() as i64,
        variance: (packs + begun.own_variance) * UNITS_PER_WH.powi(2),
        shared: std::array::from_fn(|a| std::array::from_fn(|b| product(a, b))),
    }
}
