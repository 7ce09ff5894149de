//! What a service takes, from the coordinator's own models of a station.

use std::collections::BTreeMap;
use std::sync::Arc;

pub use energy::forecast::ending::Draw;
pub use energy::service::{Circumstances, Handling, Recharge};
use energy::units::S_PER_H;
use energy::{Estimate, Model, Need, Pack, Start, forecast, service};

use crate::models::StationModels;

/// How services go at a station where `at_once` robots charge side by side.
///
/// The voltage of the station's packs is that of the first, on average over a discharge at rest.
#[must_use]
pub fn circumstances(station: &StationModels, at_once: usize) -> Circumstances {
    let pack_v = station.packs.values().next().map_or(0.0, |pack| pack.battery().stored_wh() / pack.battery().capacity_ah);
    Circumstances { pack_v, at_once: at_once.max(1) as f64, converter_w_max: station.converter_w_max, ..Circumstances::ALONE }
}

/// Recharges a robot from `soc` to `target_soc`: what the station's packs give, beyond what the
/// station takes anyway. The battery and its surroundings there are so warm, °C, at the beginning; a `protected` charge rests while the
/// battery is too hot or too cold.
#[must_use]
pub fn recharge(
    station: &StationModels,
    at_once: usize,
    battery: &Arc<Model>,
    ([temperature_degc, ambient_degc], protected): ([f64; 2], bool),
    soc: Estimate,
    target_soc: f64,
) -> Recharge {
    let around = Circumstances { temperature_degc, ambient_degc, protected, ..circumstances(station, at_once) };
    service::service_energy(&station.load, station.handling, battery, soc, target_soc, &around)
}

/// What the station takes in an hour in which it services nobody.
#[must_use]
pub fn overhead_per_h(station: &StationModels) -> Need {
    service::overhead_per_h(&station.load, circumstances(station, 1).pack_v)
}

/// The station's overhead in an hour by cause, Wh.
#[must_use]
pub fn overhead_breakdown(station: &StationModels) -> BTreeMap<String, f64> {
    service::overhead_breakdown(&station.load, circumstances(station, 1).pack_v)
}

/// A charger that nobody stops goes on until its current has fallen off: no battery that is charged so holds as much as this before.
const UNTIL_IT_ENDS_SOC: f64 = 1.1;

/// What the station's packs give to charge a pack of this model that a robot left behind until it is a spare again, Wh, and how long that
/// takes, s, where so many are charged side by side at this temperature. They give nothing where such packs are charged from outside; none where packs are put aside.
#[must_use]
pub fn spare_again(station: &StationModels, battery: &Arc<Model>, at_once: usize, temperature_degc: f64, soc: f64) -> Option<(f64, f64)> {
    station.spare_battery.as_ref()?;
    let around = Circumstances { temperature_degc, ambient_degc: temperature_degc, ..circumstances(station, at_once) };
    let to_soc = station.spare_ready_soc.unwrap_or(UNTIL_IT_ENDS_SOC);
    let recharge = service::pack_energy(&station.load, battery, Estimate::exact(soc), to_soc, &around);
    let given_wh = if station.recharge_w <= 0.0 { recharge.need.mean_wh } else { 0.0 };
    Some((given_wh, recharge.charge_s))
}

/// How a pack is charged from empty with this power into it, W: when (s), and its state of charge. It ends where its charger does, or where it
/// stays too hot or too cold.
#[must_use]
pub fn refill(pack: &Arc<Model>, power_w: f64, temperature_degc: f64) -> Vec<(f64, f64)> {
    let mut run = Pack::new(Arc::clone(pack), Start { temperature_degc, ..Start::at_soc(0.0) });
    let (mut course, mut at_s, mut soc) = (vec![(0.0, 0.0)], 0.0, 0.0);
    let capacity_as = pack.battery().capacity_ah * S_PER_H;
    forecast::charge_within(&mut run, 1.0, power_w, true, |time_s, current_a, _| {
        at_s += time_s;
        soc = f64::min(soc + current_a * time_s / capacity_as, 1.0);
        course.push((at_s, soc));
    });
    course
}

/// What an exchange takes without the charge of the pack that is left.
#[must_use]
pub fn exchange(station: &StationModels) -> Need {
    service::exchange(&station.load, station.handling, circumstances(station, 1).pack_v)
}

/// Energy that a pack gives down to its end of discharge at this power.
#[must_use]
pub fn usable_wh(pack: &Arc<Model>, soc: Estimate, temperature_degc: f64, power_w: f64) -> Estimate {
    forecast::remaining_wh(pack, soc, temperature_degc, power_w)
}

/// How the load of full bays ends, as stretches of equal power (s, W): each bay's charge at `each_w` falls off by
/// `taper`, and as one lift empties them one after the other, each ends at least `apart_s` after the one before.
#[must_use]
pub fn ending(taper: &[(f64, f64)], each_w: f64, bays: usize, apart_s: f64, overhead_w: f64) -> Vec<(f64, f64)> {
    let ends_s: Vec<f64> = taper
        .iter()
        .scan(0.0, |end_s, &(time_s, _)| {
            *end_s += time_s;
            Some(*end_s)
        })
        .collect();
    let of_bay_w = |since_s: f64| match ends_s.iter().position(|&end_s| since_s < end_s) {
        _ if since_s < 0.0 => each_w,
        Some(stretch) => taper[stretch].1,
        None => 0.0,
    };
    let late_s = |bay: usize| bay as f64 * apart_s;
    let mut changes_s: Vec<f64> =
        (0..bays).flat_map(|bay| ends_s.iter().map(move |end_s| end_s + late_s(bay)).chain([late_s(bay)])).collect();
    changes_s.sort_by(f64::total_cmp);
    let stretches = changes_s.windows(2).filter(|pair| pair[1] > pair[0]);
    let power_w = |at_s: f64| overhead_w + (0..bays).map(|bay| of_bay_w(at_s - late_s(bay))).sum::<f64>();
    stretches.map(|pair| (pair[1] - pair[0], power_w(f64::midpoint(pair[0], pair[1])))).collect()
}

/// How much more a pack that gives `steady_wh` at full power gives to a load that ends gently, where a full
/// pack gives `gain_wh` more: one that holds less than the ending gives that much less of it.
#[must_use]
pub fn ending_gain_wh(steady_wh: f64, draw: &Draw, gain_wh: f64) -> f64 {
    gain_wh * (steady_wh / draw.ending_wh().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bays at 10 W, a taper of a minute at 6 W, the second half a minute after the first; the station takes 1 W.
    #[test]
    fn bays_end_one_after_the_other() {
        assert_eq!(ending(&[(60.0, 6.0)], 10.0, 2, 30.0, 1.0), [(30.0, 17.0), (30.0, 13.0), (30.0, 7.0)]);
        assert_eq!(ending(&[(60.0, 6.0)], 10.0, 2, 0.0, 1.0), [(60.0, 13.0)]);
        assert_eq!(ending(&[], 10.0, 2, 30.0, 1.0), [(30.0, 11.0)]);
        assert_eq!(ending(&[], 10.0, 1, 30.0, 1.0), []);
    }
}
