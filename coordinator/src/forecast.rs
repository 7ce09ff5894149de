//! What a service takes, from the coordinator's own models.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::units::S_PER_H;
use energy::{Channel, Estimate, Model, Run, Start, forecast};

use crate::need::Need;

/// What one recharge takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Recharge {
    /// Time on the charger, s.
    pub charge_s: f64,
    /// Energy from the station's packs, Wh.
    pub need: Need,
    /// The same by cause, Wh: the charge itself, then each effect of the station's model.
    pub breakdown_wh: BTreeMap<String, f64>,
}

/// A station's handling of robots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Handling {
    /// Time to lift a robot into a bay, s.
    pub load_s: f64,
    /// Time to lift a robot out of a bay, s.
    pub unload_s: f64,
    /// Time to exchange a robot's pack, s.
    pub swap_s: f64,
}

/// The station's inputs while a robot charges, while the lift moves, and while nothing happens.
struct Situation {
    charging_w: f64,
    docked: f64,
    lift: f64,
}

const NOTHING: Situation = Situation { charging_w: 0.0, docked: 0.0, lift: 0.0 };

/// Recharges a robot from `soc` to `target_soc`: what the station's packs give, beyond what the
/// station takes anyway.
#[must_use]
pub fn recharge(station: &Arc<Model>, handling: Handling, battery: &Arc<Model>, soc: Estimate, target_soc: f64) -> Recharge {
    let temperature_degc = energy::units::REFERENCE_DEGC;
    let (charge_wh, charge_s) = forecast::charge_estimate(battery, soc, target_soc, temperature_degc);
    let hours = (charge_s.value / S_PER_H).max(1e-6);
    let charging = Situation { charging_w: charge_wh.value / hours, docked: 1.0, lift: 0.0 };
    let lifting = Situation { lift: 1.0, ..NOTHING };
    let lift_h = (handling.load_s + handling.unload_s) / S_PER_H;
    let energy_wh = |values: &[f64]| {
        let idle_w = power_w(station, values, &NOTHING);
        (power_w(station, values, &charging) - idle_w) * hours + (power_w(station, values, &lifting) - idle_w) * lift_h
    };
    let mut need = need(station, energy_wh);
    // What the battery's own doubt adds: more charge passes through the same losses.
    let values = station.values();
    let more = Situation { charging_w: charging.charging_w + charge_wh.sigma / hours, ..charging };
    need.own_variance = ((power_w(station, &values, &more) - power_w(station, &values, &charging)) * hours).powi(2);

    let mut breakdown_wh = BTreeMap::from([("charge".to_owned(), charge_wh.value)]);
    let idle = shares(station, &NOTHING);
    for (situation, span_h) in [(&charging, hours), (&lifting, lift_h)] {
        for ((cause, share_w), (_, idle_w)) in shares(station, situation).into_iter().zip(&idle) {
            *breakdown_wh.entry(cause.to_owned()).or_insert(0.0) += (share_w - idle_w) * span_h;
        }
    }
    breakdown_wh.retain(|_, wh| wh.abs() > 1e-9);
    Recharge { charge_s: charge_s.value, need, breakdown_wh }
}

/// What the station takes in an hour in which it services nobody.
#[must_use]
pub fn overhead_per_h(station: &Arc<Model>) -> Need {
    need(station, |values| power_w(station, values, &NOTHING))
}

/// What an exchange of a robot's pack takes: the station's handling, at the power of its lift.
#[must_use]
pub fn exchange(station: &Arc<Model>, handling: Handling) -> Need {
    let lifting = Situation { lift: 1.0, ..NOTHING };
    need(station, |values| (power_w(station, values, &lifting) - power_w(station, values, &NOTHING)) * handling.swap_s / S_PER_H)
}

/// The station's overhead in an hour by cause, Wh.
#[must_use]
pub fn overhead_breakdown(station: &Arc<Model>) -> BTreeMap<String, f64> {
    shares(station, &NOTHING).into_iter().map(|(cause, w)| (cause.to_owned(), w)).filter(|(_, w)| w.abs() > 1e-9).collect()
}

/// Energy that a pack gives down to its end of discharge at this power.
#[must_use]
pub fn usable_wh(pack: &Arc<Model>, soc: Estimate, temperature_degc: f64, power_w: f64) -> Estimate {
    forecast::remaining_wh(pack, soc, temperature_degc, power_w)
}

fn run_with(station: &Arc<Model>, values: &[f64], situation: &Situation) -> Run<f64> {
    let mut run = Run::with_parameters(Arc::clone(station), values.to_vec(), Start::at_soc(0.0));
    run.channels[Channel::ChargePowerW] = situation.charging_w;
    run.channels[Channel::RobotsDocked] = situation.docked;
    run.channels[Channel::LiftActive] = situation.lift;
    run
}

fn power_w(station: &Arc<Model>, values: &[f64], situation: &Situation) -> f64 {
    let mut run = run_with(station, values, situation);
    run.step(1.0);
    run.channels[Channel::PackPowerW]
}

fn shares(station: &Arc<Model>, situation: &Situation) -> Vec<(&'static str, f64)> {
    run_with(station, &station.values(), situation).step_explained(1.0)
}

/// Value and change by each parameter's deviation (central differences).
fn need(station: &Arc<Model>, energy_wh: impl Fn(&[f64]) -> f64) -> Need {
    let mut values = station.values();
    let mean_wh = energy_wh(&values);
    let mut shared_wh = Vec::new();
    for (index, parameter) in station.parameters().iter().enumerate() {
        let mut at = |value: f64| {
            values[index] = value.clamp(parameter.min, parameter.max);
            energy_wh(&values)
        };
        let change = (at(parameter.value + parameter.sigma) - at(parameter.value - parameter.sigma)) / 2.0;
        values[index] = parameter.value;
        shared_wh.push(change);
    }
    Need { mean_wh, shared_wh, own_variance: 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(name: &str) -> Arc<Model> {
        node::files::model(name, None).unwrap()
    }

    const HANDLING: Handling = Handling { load_s: 30.0, unload_s: 30.0, swap_s: 60.0 };

    #[test]
    fn the_breakdown_sums_to_the_whole() {
        let (station, battery) = (model("mds-station"), model("explorer-3s1p-1320mah"));
        let recharge = recharge(&station, HANDLING, &battery, Estimate::new(0.1, 0.01), 0.98);
        let sum: f64 = recharge.breakdown_wh.values().sum();
        assert!((sum - recharge.need.mean_wh).abs() < 1e-9, "{sum} and {}", recharge.need.mean_wh);
        assert!(recharge.breakdown_wh.contains_key("robot_own_load"), "{:?}", recharge.breakdown_wh);
    }

    #[test]
    fn without_effects_a_service_costs_what_goes_into_the_battery() {
        let (station, battery) = (Arc::new(model("mds-station").without(|_| true)), model("explorer-3s1p-1320mah"));
        let recharge = recharge(&station, HANDLING, &battery, Estimate::exact(0.1), 0.98);
        assert!((recharge.need.mean_wh - recharge.breakdown_wh["charge"]).abs() < 1e-9);
        // 0.88 x 1.32 Ah at 11.1 V nominal is 12.9 Wh; charging voltage is a little higher.
        assert!((12.9..15.0).contains(&recharge.need.mean_wh), "{}", recharge.need.mean_wh);
    }
}
