//! What charging takes and how long it lasts, from the energy models: the CC-CV charge of a robot's
//! battery behind a station's converters, tabulated over the state of charge.
//!
//! A table is made once for a kind of battery at a kind of station, a number of robots side by side, its
//! temperature and that of the station ([`super::tables`]); plans look it up. A battery that is too hot rests until it has cooled down, one that comes
//! too cold until it has warmed up, as its protection wants it; one that
//! stays too hot or too cold is charged as far as it goes.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::protection::Trip;
use energy::units::S_PER_H;
use energy::{Estimate, Model, Need};

use crate::forecast::{self, Recharge};
use crate::models::StationModels;

/// Steps of a table.
const STEPS: u32 = 20;
/// The last steps, in which the current falls off, and into how many each is divided: how gently a charge ends says
/// how much of a station's last pack is usable.
const TAPER_STEPS: u32 = 2;
const TAPER_DIVIDED: u32 = 5;
/// Points of a table before its last between which the current falls off.
pub(super) const TAPER_POINTS: usize = (TAPER_STEPS * TAPER_DIVIDED) as usize;
/// Temperatures are told apart in steps of this, °C: the second where a battery may get too hot or too cold to be charged.
const TEMPERATURE_STEPS_DEGC: [f64; 2] = [5.0, 1.0];
/// That is within so much of where it may be charged again, °C: a charge warms a small pack by some 6.
const NEAR_DEGC: f64 = 10.0;

/// One state of charge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// State of charge.
    pub soc: f64,
    /// Time on the charger from there to the target, s.
    pub charge_s: f64,
    /// What the station's packs give for that, with the lift, Wh.
    pub need_wh: f64,
    /// Variance of that by the battery's parameters, Wh².
    pub own_variance: f64,
    /// What the station's packs give to charge the pack alone until its charger ends, Wh.
    pub bare_wh: f64,
    /// Time that takes, s.
    pub bare_s: f64,
    /// Why the charge never ends; time and energy are then those of one that nothing stops.
    pub stopped: Option<Trip>,
}

impl Point {
    /// What the station's packs give on the mean while it charges, W.
    #[must_use]
    pub fn mean_w(&self) -> f64 {
        self.need_wh / (self.charge_s / S_PER_H).max(1e-6)
    }
}

/// A charge from any state of charge to the target.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Ascending; the last is the target.
    pub points: Vec<Point>,
    /// Part of the need that the lift takes, Wh.
    pub lift_wh: f64,
    /// Change of a Wh of need by one standard deviation of each of the station's parameters.
    pub shared_per_wh: Vec<f64>,
    /// A full service from the level at which one is wanted, by cause, Wh.
    pub breakdown_wh: BTreeMap<String, f64>,
    /// How far a charge goes that heat or cold stops, from the level at which one is wanted: 0 for not at all.
    pub reaches_soc: f64,
}

impl Table {
    pub(super) fn new(
        station: &StationModels,
        [at_once, alone]: [usize; 2],
        battery: &Arc<Model>,
        [temperature_degc, station_degc]: [f64; 2],
        [from_soc, to_soc]: [f64; 2],
    ) -> Self {
        let forecast = |soc: f64, protected: bool| {
            let degc = [temperature_degc, station_degc];
            forecast::recharge(station, at_once, battery, (degc, protected), Estimate::exact(soc), to_soc)
        };
        let recharge = |soc: f64| {
            let recharge = forecast(soc, true);
            if recharge.stopped.is_none() { recharge } else { Recharge { stopped: recharge.stopped, ..forecast(soc, false) } }
        };
        let point = |share: f64| {
            let soc = to_soc * share;
            let recharge = recharge(soc);
            let (bare_wh, bare_s) = forecast::spare_again(station, battery, alone, station_degc, soc).unwrap_or((0.0, recharge.charge_s));
            let (need_wh, own_variance) = (recharge.need.mean_wh, recharge.need.own_variance);
            Point {
                soc,
                charge_s: recharge.charge_s,
                need_wh,
                own_variance,
                bare_wh,
                bare_s,
                stopped: recharge.stopped.map(|(why, _)| why),
            }
        };
        let reference = recharge(from_soc);
        let mean_wh = reference.need.mean_wh.max(f64::MIN_POSITIVE);
        let (coarse, fine) = (STEPS - TAPER_STEPS, TAPER_STEPS * TAPER_DIVIDED);
        let shares = (0..coarse).map(|step| f64::from(step) / f64::from(STEPS));
        let shares = shares.chain((0..=fine).map(|step| 1.0 - f64::from(fine - step) / f64::from(STEPS * TAPER_DIVIDED)));
        let points: Vec<Point> = shares.map(point).collect();
        Self {
            lift_wh: points.last().map_or(0.0, |last| last.need_wh),
            points,
            shared_per_wh: reference.need.shared_wh.iter().map(|change_wh| change_wh / mean_wh).collect(),
            breakdown_wh: reference.breakdown_wh,
            reaches_soc: reference.stopped.map_or(0.0, |(_, soc)| if soc > from_soc { soc } else { 0.0 }),
        }
    }

    /// The same for a battery with that share of the capacity, behind the same charger: every stretch of a charge takes that much less time and energy. The
    /// capacities' deviations, relative to them, are those given: of this table's battery, and of the other.
    #[must_use]
    pub(super) fn scaled(&self, share: f64, [sigma, other_sigma]: [f64; 2]) -> Self {
        let point = |point: &Point| {
            let charged_wh = point.need_wh - self.lift_wh;
            let variance = point.own_variance + charged_wh.powi(2) * (other_sigma.powi(2) - sigma.powi(2));
            Point {
                charge_s: share * point.charge_s,
                need_wh: self.lift_wh + share * charged_wh,
                own_variance: share * share * variance.max(0.0),
                bare_wh: share * point.bare_wh,
                bare_s: share * point.bare_s,
                ..*point
            }
        };
        let whole_wh: f64 = self.breakdown_wh.values().sum();
        let of_whole = (self.lift_wh + share * (whole_wh - self.lift_wh)) / whole_wh.max(f64::MIN_POSITIVE);
        let breakdown_wh = self.breakdown_wh.iter().map(|(cause, wh)| (cause.clone(), of_whole * wh)).collect();
        Self { points: self.points.iter().map(point).collect(), breakdown_wh, ..self.clone() }
    }

    /// Level at which a charge is done.
    #[must_use]
    pub fn target_soc(&self) -> f64 {
        self.points.last().map_or(1.0, |last| last.soc)
    }

    /// The charge from a state of charge, between the points.
    #[must_use]
    pub fn at(&self, soc: f64) -> Point {
        let above = self.points.partition_point(|point| point.soc < soc).clamp(1, self.points.len() - 1);
        let [low, high] = [self.points[above - 1], self.points[above]];
        let share = ((soc - low.soc) / (high.soc - low.soc)).clamp(0.0, 1.0);
        let between = |of: fn(&Point) -> f64| of(&low) + share * (of(&high) - of(&low));
        Point {
            soc,
            charge_s: between(|point| point.charge_s),
            need_wh: between(|point| point.need_wh),
            own_variance: between(|point| point.own_variance),
            bare_wh: between(|point| point.bare_wh),
            bare_s: between(|point| point.bare_s),
            stopped: low.stopped.or(high.stopped),
        }
    }

    /// The charge from a state of charge to a level below the target, with the lift.
    #[must_use]
    pub fn between(&self, soc: f64, to_soc: f64) -> Point {
        let (from, to) = (self.at(soc), self.at(to_soc));
        let share = if from.need_wh > self.lift_wh { (from.need_wh - to.need_wh).max(0.0) / (from.need_wh - self.lift_wh) } else { 0.0 };
        Point {
            soc,
            charge_s: (from.charge_s - to.charge_s).max(0.0),
            need_wh: (from.need_wh - to.need_wh).max(0.0) + self.lift_wh,
            own_variance: share * share * from.own_variance,
            bare_wh: from.bare_wh,
            bare_s: from.bare_s,
            stopped: from.stopped,
        }
    }

    /// Level that the charge of the pack alone has reached this long (s) after it was at that one.
    #[must_use]
    pub fn reached_alone(&self, soc: f64, after_s: f64) -> f64 {
        self.reached_by(|point| point.bare_s, soc, after_s)
    }

    /// Level that a charge has reached this long (s) after it was at that one.
    #[must_use]
    pub fn reached(&self, soc: f64, after_s: f64) -> f64 {
        self.reached_by(|point| point.charge_s, soc, after_s)
    }

    fn reached_by(&self, left_s: fn(&Point) -> f64, soc: f64, after_s: f64) -> f64 {
        let still_s = left_s(&self.at(soc)) - after_s;
        let above = self.points.partition_point(|point| left_s(point) > still_s).clamp(1, self.points.len() - 1);
        let [low, high] = [self.points[above - 1], self.points[above]];
        let share = ((left_s(&low) - still_s) / (left_s(&low) - left_s(&high)).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (low.soc + share * (high.soc - low.soc)).max(soc)
    }

    /// The charge from a state of charge to a level: how long (s) and how much (W), in order, without the lift.
    #[must_use]
    pub fn stretches(&self, soc: f64, to_soc: f64) -> Vec<(f64, f64)> {
        let inner = self.points.iter().map(|point| point.soc).filter(|&at| soc < at && at < to_soc);
        let levels: Vec<Point> = std::iter::once(soc).chain(inner).chain([to_soc]).map(|soc| self.at(soc)).collect();
        let stretch = |pair: &[Point]| {
            let (time_s, wh) = (pair[0].charge_s - pair[1].charge_s, pair[0].need_wh - pair[1].need_wh);
            (time_s > 0.0).then(|| (time_s, wh.max(0.0) / time_s * S_PER_H))
        };
        levels.windows(2).filter_map(stretch).collect()
    }

    /// The end of a charge, from when it takes less than this power (W), as such stretches.
    #[must_use]
    pub fn taper(&self, below_w: f64) -> Vec<(f64, f64)> {
        let stretches = self.stretches(0.0, self.target_soc());
        let full = stretches.iter().rposition(|&(_, power_w)| power_w >= below_w).map_or(0, |last| last + 1);
        stretches[full..].to_vec()
    }

    /// What a service from an uncertain state of charge takes; its shared doubt is `wider` times that of
    /// the station's model.
    #[must_use]
    pub fn need(&self, soc: Estimate, wider: f64) -> Need {
        self.need_to(soc, self.target_soc(), wider)
    }

    /// The same to a level below the target.
    #[must_use]
    pub fn need_to(&self, soc: Estimate, to_soc: f64, wider: f64) -> Need {
        let whole = self.at(soc.value);
        let part = self.between(soc.value, to_soc);
        // What a charge begins with counts in full, wherever it ends.
        self.with_doubt(part.need_wh, self.own_variance(soc) - whole.own_variance + part.own_variance, wider)
    }

    /// What charging the pack alone takes from an uncertain state of charge, without its robot.
    #[must_use]
    pub fn bare(&self, soc: Estimate, wider: f64) -> Need {
        let at = self.at(soc.value);
        let share = if at.need_wh > 0.0 { at.bare_wh / at.need_wh } else { 0.0 };
        self.with_doubt(at.bare_wh, share * share * self.own_variance(soc), wider)
    }

    /// The part of that need's variance that is the robot's own: its battery's, and that of its state of charge, Wh².
    #[must_use]
    pub fn own_variance(&self, soc: Estimate) -> f64 {
        self.at(soc.value).own_variance + (self.slope_wh(soc.value) * soc.sigma).powi(2)
    }

    /// A need of this mean and own variance, with the shared doubt that goes with it.
    #[must_use]
    pub fn with_doubt(&self, mean_wh: f64, own_variance: f64, wider: f64) -> Need {
        let shared_wh = self.shared_per_wh.iter().map(|change| wider * change * mean_wh).collect();
        Need { mean_wh, shared_wh, own_variance: wider * wider * own_variance }
    }

    /// Change of the need with the state of charge, Wh.
    fn slope_wh(&self, soc: f64) -> f64 {
        let step = self.target_soc() / f64::from(STEPS);
        let low = soc.clamp(0.0, self.target_soc() - step);
        (self.at(low + step).need_wh - self.at(low).need_wh) / step
    }
}

/// What a service draws when, from its beginning on.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Course {
    /// Spread over all of it, Wh: the lift.
    pub even_wh: f64,
    /// The charge as it tapers off: how long (s) and how much (W), in order.
    pub charge: Vec<(f64, f64)>,
    /// When that begins, s.
    pub charge_from_s: f64,
}

impl Course {
    /// A charge from a state of charge to a level, in a bay that the robot is brought into for `load_s`.
    #[must_use]
    pub fn charge(table: &Table, soc: f64, to_soc: f64, load_s: f64) -> Self {
        Self { even_wh: table.lift_wh, charge: table.stretches(soc, to_soc), charge_from_s: load_s }
    }

    /// The same of a service between two times, s: from when until when, and how much (W).
    #[must_use]
    pub fn parts(&self, start_s: f64, end_s: f64) -> Vec<(f64, f64, f64)> {
        let mut from_s = start_s + self.charge_from_s;
        let charge = self.charge.iter().map(|&(time_s, power_w)| {
            let begin_s = from_s;
            from_s += time_s;
            (begin_s, from_s, power_w)
        });
        std::iter::once((start_s, end_s, self.even_wh / (end_s - start_s).max(1.0) * S_PER_H)).chain(charge).collect()
    }
}

/// The temperature that a table for this one stands for, whole °C: the nearest step, a finer one where heat may keep the battery from being
/// charged, and the next colder one where cold may: at its limit that does so at once.
pub(crate) fn step_degc(battery: &Model, temperature_degc: f64) -> f64 {
    let ([coarse, fine], [hot_degc, cold_degc]) = (TEMPERATURE_STEPS_DEGC, uncritical_degc(battery));
    match temperature_degc {
        _ if temperature_degc > hot_degc => (temperature_degc / fine).round() * fine,
        _ if temperature_degc < cold_degc => (temperature_degc / fine).floor() * fine,
        _ => (temperature_degc / coarse).round() * coarse,
    }
}

/// Above and below which temperature a battery may get too hot or too cold to be charged, °C.
pub(crate) fn uncritical_degc(battery: &Model) -> [f64; 2] {
    let releases = |trip| battery.battery().protection.get(trip).release;
    let cold_degc = releases(Trip::UnderTemperatureCharge);
    [(releases(Trip::OverTemperatureCharge) - NEAR_DEGC).max(cold_degc), cold_degc]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_fine_where_heat_or_cold_may_stop_a_charge() {
        let battery = energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap();
        for (is_degc, counts_as_degc) in
            [(-0.4, -1.0), (0.6, 0.0), (4.9, 4.0), (5.0, 5.0), (22.4, 20.0), (27.6, 30.0), (30.0, 30.0), (30.6, 31.0), (39.4, 39.0)]
        {
            assert_eq!(step_degc(&battery, is_degc), counts_as_degc, "{is_degc}");
        }
    }

    #[test]
    fn less_capacity_behind_the_same_charger_takes_as_much_less_time_and_energy() {
        let load = |name: &str| Arc::new(energy::load_model(name, &|_| unreachable!("built in")).unwrap());
        let (new, pack) = (load("explorer-3s1p-1320mah"), load("mds-3s4p-7600mah"));
        let station = StationModels {
            load: load("mds-station"),
            handling: forecast::Handling { load_s: 30.0, unload_s: 30.0, swap_s: 60.0 },
            packs: [(proto::PackId::new("p").unwrap(), pack)].into(),
            converter_w_max: f64::INFINITY,
            recharge_w: 0.0,
            spare_battery: Some(Arc::clone(&new)),
            spare_ready_soc: None,
        };
        let table = |battery: &Arc<Model>| Table::new(&station, [3, 1], battery, [25.0; 2], [0.1, 0.98]);
        let (sigma, worn_sigma) = (new.uncertainty.capacity_relative_sigma, 0.03);
        let worn = Arc::new(new.worn(Estimate::new(0.75, 0.75 * worn_sigma), 0.0));
        let (scaled, own) = (table(&new).scaled(0.75, [sigma, worn_sigma]), table(&worn));
        for (scaled, own) in scaled.points.iter().zip(&own.points).filter(|(point, _)| point.soc < 0.9) {
            let near = |of: fn(&Point) -> f64, by: f64| (of(scaled) / of(own) - 1.0).abs() < by;
            assert!(near(|point| point.charge_s, 0.03) && near(|point| point.need_wh, 0.01), "{scaled:?} {own:?}");
            assert!(near(|point| point.bare_s, 0.03) && near(|point| point.bare_wh, 0.01), "{scaled:?} {own:?}");
            assert!(near(|point| point.own_variance, 0.15), "{scaled:?} {own:?}");
        }
        assert_eq!(scaled.lift_wh, own.lift_wh);
        let whole_wh = [&scaled, &own].map(|table| table.breakdown_wh.values().sum::<f64>());
        assert!((whole_wh[0] / whole_wh[1] - 1.0).abs() < 0.01, "{whole_wh:?}");
    }

    #[test]
    fn a_charge_has_reached_the_level_from_which_it_takes_as_much_less_time() {
        // An hour from empty to 90 %, the last third of it for the last tenth; a robot in a bay takes three times as long.
        let point = |soc: f64, bare_s: f64| Point {
            soc,
            charge_s: 3.0 * bare_s,
            need_wh: 0.0,
            own_variance: 0.0,
            bare_wh: 0.0,
            bare_s,
            stopped: None,
        };
        let points = vec![point(0.0, 3600.0), point(0.8, 1200.0), point(0.9, 0.0)];
        let table = Table { points, lift_wh: 0.0, shared_per_wh: Vec::new(), breakdown_wh: BTreeMap::new(), reaches_soc: 0.0 };
        for (soc, after_s, reached) in [(0.0, 0.0, 0.0), (0.0, 1200.0, 0.4), (0.4, 1800.0, 0.85), (0.4, 9000.0, 0.9), (0.95, 60.0, 0.95)] {
            let found = table.reached_alone(soc, after_s);
            assert!((found - reached).abs() < 1e-9, "{soc} {after_s}: {found}");
            assert!((table.reached(soc, 3.0 * after_s) - reached).abs() < 1e-9, "in a bay, {soc} {after_s}");
        }
    }
}
