//! What a service takes, from the coordinator's own models of a station.

use std::collections::BTreeMap;
use std::sync::Arc;

pub use energy::forecast::ending::Draw;
pub use energy::service::{Circumstances, Handling, Recharge};
use energy::{Estimate, Model, Need, forecast, service};

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
/// station takes anyway.
#[must_use]
pub fn recharge(
    station: &StationModels,
    at_once: usize,
    battery: &Arc<Model>,
    temperature_degc: f64,
    soc: Estimate,
    target_soc: f64,
) -> Recharge {
    let around = Circumstances { temperature_degc, ..circumstances(station, at_once) };
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

/// What the station's packs give to charge a pack that a robot left behind: nothing where such
/// packs are put aside, or charged from outside.
#[must_use]
pub fn spare_again(station: &StationModels, soc: Estimate, target_soc: f64) -> Need {
    match &station.spare_battery {
        Some(battery) if station.recharge_w <= 0.0 => {
            service::pack_energy(&station.load, battery, soc, target_soc, &circumstances(station, 1)).need
        }
        _ => Need::default(),
    }
}

/// Energy that a pack gives down to its end of discharge at this power.
#[must_use]
pub fn usable_wh(pack: &Arc<Model>, soc: Estimate, temperature_degc: f64, power_w: f64) -> Estimate {
    forecast::remaining_wh(pack, soc, temperature_degc, power_w)
}

/// How much more a pack that gives `steady_wh` at full power gives to a load that ends gently, where a full
/// pack gives `gain_wh` more: one that holds less than the ending gives that much less of it.
#[must_use]
pub fn ending_gain_wh(steady_wh: f64, draw: &Draw, gain_wh: f64) -> f64 {
    gain_wh * (steady_wh / draw.ending_wh().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}
