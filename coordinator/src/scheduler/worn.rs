//! Models of batteries as their gauges have found them: with the capacity that is left, after the cycles that were counted.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, PoisonError};

use energy::{Channel, Estimate, Model, forecast};
use proto::Gauge;

use crate::models::from_wire;

/// Capacities are told apart in steps of this, as shares of the model's: what a gauge learns from one charge to the next is more.
const CAPACITY_STEP: f64 = 0.005;
/// Deviations are told apart in steps of this factor, rounded up.
const SIGMA_STEP: f64 = 1.25;
/// Least deviation that is told from none.
const SIGMA_LEAST: f64 = 1e-4;
/// Cycles are told apart in steps of this: 0.2 % of the capacity at a fade of a fifth in a thousand.
const CYCLES_STEP: f64 = 10.0;
/// A gauge that is so much surer of the capacity than the model has learned it.
const SURER: f64 = 0.5;

/// A capacity that is known no better than this, as a share of the rated one, is not known.
const SIGMA_MOST: f64 = 0.15;
/// Capacities beyond these are no batteries' that are in use: a gauge that tells one is wrong. A guess.
const PLAUSIBLE: RangeInclusive<f64> = 0.3..=1.2;

/// Model that another was made from (address); its capacity, the deviation of that where a gauge knows it, and cycles, in steps.
type Kind = (usize, i32, Option<i32>, i32);

/// All such models that were asked for so far. They are kept: other tables know them by their address.
#[derive(Debug, Default)]
pub struct Worn(Mutex<Known>);

#[derive(Debug, Default)]
struct Known {
    models: BTreeMap<Kind, Arc<Model>>,
    /// By address, what each was made from, and what its capacity is as a share of that.
    origins: BTreeMap<usize, (Arc<Model>, f64)>,
}

impl Worn {
    /// A battery of this model as its gauge has it: the model itself where that has learned nothing of it.
    #[must_use]
    pub fn of(&self, model: &Arc<Model>, gauge: &Gauge) -> Arc<Model> {
        let hears_cycles = model.effects().any(|effect| effect.spec().needs.contains(&Channel::CycleCount));
        let cycles = if hears_cycles { (gauge.cycles.unwrap_or(0.0) / CYCLES_STEP).round() } else { 0.0 };
        let stated_sigma = model.uncertainty.capacity_relative_sigma;
        let learned = learned(from_wire(gauge.soh), stated_sigma);
        if learned.is_none() && cycles == 0.0 {
            return Arc::clone(model);
        }
        let own = forecast::health(model, cycles * CYCLES_STEP);
        let capacity = learned.map_or(1.0, |soh| soh.value / own);
        let steps = (capacity / CAPACITY_STEP).round().max(1.0);
        let sigma_steps = learned.map(|soh| (soh.sigma / own / SIGMA_LEAST).max(1.0).log(SIGMA_STEP).ceil());
        let kind = (Arc::as_ptr(model).addr(), steps as i32, sigma_steps.map(|steps| steps as i32), cycles as i32);
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(worn) = known.models.get(&kind) {
            return Arc::clone(worn);
        }
        let capacity = steps * CAPACITY_STEP;
        let sigma = sigma_steps.map_or(stated_sigma, |steps| SIGMA_LEAST * SIGMA_STEP.powf(steps));
        let worn = Arc::new(model.worn(Estimate::new(capacity, sigma), cycles * CYCLES_STEP));
        let share = capacity * own / forecast::health(model, 0.0);
        known.origins.insert(Arc::as_ptr(&worn).addr(), (Arc::clone(model), share));
        known.models.insert(kind, Arc::clone(&worn));
        worn
    }

    /// The model that this one was made from, and what its capacity is as a share of that one's; none where it was not made here.
    #[must_use]
    pub fn origin(&self, model: &Arc<Model>) -> Option<(Arc<Model>, f64)> {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.origins.get(&Arc::as_ptr(model).addr()).cloned()
    }
}

/// The capacity that a gauge has learned, over the rated one; none where it only repeats what it began with: the rated one, give or take what a
/// model says whose capacity deviates by `sigma`. What states no deviation has that one.
fn learned(soh: Estimate, sigma: f64) -> Option<Estimate> {
    let moved = (soh.value - 1.0).abs();
    let is_known = PLAUSIBLE.contains(&soh.value) && soh.sigma <= SIGMA_MOST;
    let is_learned = is_known && moved > 0.0 && (moved > soh.sigma || soh.sigma < SURER * sigma);
    is_learned.then(|| Estimate::new(soh.value, if soh.sigma > 0.0 { soh.sigma } else { sigma }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gauge_has_learned_what_differs_from_what_it_began_with() {
        // The model's capacity is known within 1 %.
        for (soh, learned_as) in [
            ((1.0, 0.01), None),
            ((1.0, 0.0), None),
            ((0.995, 0.009), None),
            ((0.995, 0.004), Some((0.995, 0.004))),
            ((0.7, 0.05), Some((0.7, 0.05))),
            ((0.96, 0.05), None),
            ((0.93, 0.0), Some((0.93, 0.01))),
            ((0.0, 0.0), None),
            ((0.2, 0.01), None),
            ((1.4, 0.01), None),
            ((0.6, 0.2), None),
        ] {
            let told = learned(Estimate::new(soh.0, soh.1), 0.01).map(|soh| (soh.value, soh.sigma));
            assert_eq!(told, learned_as, "{soh:?}");
        }
    }

    fn gauge(soh: f64, sigma: f64, cycles: f64) -> Gauge {
        let text = format!(
            r#"{{"schema": "tender.gauge/1", "at": 1767225600000, "seq": 1, "soc": {{"value": 0.5, "sigma": 0.01}},
                "remaining_wh": {{"value": 40.0, "sigma": 1.0}}, "full_wh": {{"value": 80.0, "sigma": 1.0}},
                "soh": {{"value": {soh}, "sigma": {sigma}}}, "cycles": {cycles}, "voltage_v": 11.1, "current_a": 0.0,
                "temperature_degc": 25.0, "power_w": 0.0, "cells_series": 3, "source": "test"}}"#
        );
        proto::decode(text.as_bytes()).unwrap()
    }

    #[test]
    fn what_a_gauge_has_learned_is_the_capacity_of_the_model_whatever_the_model_says_of_cycles() {
        let new = Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
        let fading = Arc::new(new.with("capacity_fade").unwrap());
        let worn = Worn::default();
        let capacity_ah = |model: &Arc<Model>| {
            let mut run = energy::Run::new(Arc::clone(model), energy::Start::at_soc(0.5));
            energy::load::Terminals::step_current(&mut run, 0.0, 1.0);
            run.channels[Channel::CapacityAh]
        };
        for model in [&new, &fading] {
            for cycles in [0.0, 400.0] {
                let found = worn.of(model, &gauge(0.7, 0.012, cycles));
                assert!((capacity_ah(&found) / (0.7 * 7.6) - 1.0).abs() < 0.004, "{} after {cycles}", capacity_ah(&found));
                assert!((0.012..0.018).contains(&(0.7 * found.uncertainty.capacity_relative_sigma)));
                assert!(Arc::ptr_eq(&found, &worn.of(model, &gauge(0.7004, 0.0121, cycles + 1.0))), "a step");
                let (origin, share) = worn.origin(&found).unwrap();
                assert!(Arc::ptr_eq(&origin, model) && (share - 0.7).abs() < 0.004, "{share}");
            }
        }
        // Nothing learned: as the model has it after as many cycles, 0.02 % each.
        assert!(Arc::ptr_eq(&worn.of(&new, &gauge(1.0, 0.01, 400.0)), &new) && worn.origin(&new).is_none());
        let found = worn.of(&fading, &gauge(1.0, 0.01, 400.0));
        assert!((capacity_ah(&found) / (0.92 * 7.6) - 1.0).abs() < 1e-6, "{}", capacity_ah(&found));
        assert_eq!(found.uncertainty.capacity_relative_sigma, new.uncertainty.capacity_relative_sigma);
    }
}
