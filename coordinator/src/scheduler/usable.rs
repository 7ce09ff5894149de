//! What a pack gives down to its end of discharge, tabulated: a whole discharge for each of a grid of
//! states of charge and temperatures, made when it is first asked for.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use energy::{Estimate, Model};

use crate::forecast;

/// States of charge of the grid lie this far apart.
const SOC_STEP: f64 = 0.01;
/// Temperatures of the grid lie this far apart, °C: in the cold a cell that just delivers at one does not a
/// few degrees below.
const TEMPERATURE_STEP_DEGC: f64 = 1.0;

/// Kind of pack, power (bits: a station works at one of few), place on the grid: state of charge, temperature.
type Kind = (usize, u64, i32, i32);

/// All discharges that were asked for so far. They follow from models that never change, so keeping them
/// saves time and changes nothing.
#[derive(Debug, Default)]
pub struct Usable {
    known: Mutex<BTreeMap<Kind, Estimate>>,
}

impl Usable {
    /// Energy that a pack gives at this power, Wh, between the points of the grid. The doubt of its state of
    /// charge counts by what a deviation up and one down would change; beside full and empty, where one of them is cut short, by what is left of them.
    #[must_use]
    pub fn wh(&self, pack: &Arc<Model>, soc: Estimate, temperature_degc: f64, power_w: f64) -> Estimate {
        let at = |soc: f64| self.exact(pack, soc, temperature_degc, power_w);
        let middle = soc.value.clamp(0.0, 1.0);
        let (low, high) = ((middle - soc.sigma).max(0.0), (middle + soc.sigma).min(1.0));
        let usable = at(middle);
        let by_soc_wh = if high > low { (at(high).value - at(low).value) / (high - low) * soc.sigma } else { 0.0 };
        Estimate::new(usable.value, usable.sigma.hypot(by_soc_wh))
    }

    /// The same at a state of charge that is known.
    fn exact(&self, pack: &Arc<Model>, soc: f64, temperature_degc: f64, power_w: f64) -> Estimate {
        let (below, share) = place(soc / SOC_STEP, (1.0 / SOC_STEP).round());
        let (cold, warmth) = place(temperature_degc / TEMPERATURE_STEP_DEGC, f64::INFINITY);
        let column = |step: i32| {
            let [low, high] = [cold, cold + 1].map(|temperature| self.point(pack, power_w, step, temperature));
            between(low, high, warmth)
        };
        between(column(below), column(below + 1), share)
    }

    /// A point, with the doubt of the pack's parameters alone.
    fn point(&self, pack: &Arc<Model>, power_w: f64, soc: i32, temperature: i32) -> Estimate {
        let kind = (Arc::as_ptr(pack).addr(), power_w.to_bits(), soc, temperature);
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        *known.entry(kind).or_insert_with(|| {
            let soc = Estimate::exact(f64::from(soc) * SOC_STEP);
            forecast::usable_wh(pack, soc, f64::from(temperature) * TEMPERATURE_STEP_DEGC, power_w)
        })
    }
}

/// The point at or below, and the share of the way to the next; the last point is above.
fn place(steps: f64, last: f64) -> (i32, f64) {
    let below = steps.floor().min(last - 1.0);
    (below as i32, steps - below)
}

fn between(low: Estimate, high: Estimate, share: f64) -> Estimate {
    let part = |low: f64, high: f64| low + share * (high - low);
    Estimate::new(part(low.value, high.value), part(low.sigma, high.sigma))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_its_points_it_is_the_discharge_itself() {
        let usable = Usable::default();
        for name in ["mds-3s4p-7600mah", "nissan-leaf-33ah", "a123-lfp-26650-2p3ah"] {
            let pack = Arc::new(energy::load_model(name, &|_| unreachable!("built in")).unwrap());
            let (full_wh, c_rate) = (pack.battery().stored_wh(), 0.4);
            for (n, soc) in [0.013, 0.06, 0.111, 0.237, 0.48, 0.764, 0.987, 1.0].into_iter().enumerate() {
                let temperature_degc = 1.4 + 4.7 * n as f64;
                let soc = Estimate::new(soc, 0.01);
                let told = usable.wh(&pack, soc, temperature_degc, c_rate * full_wh);
                let true_wh = forecast::usable_wh(&pack, soc, temperature_degc, c_rate * full_wh);
                let off = (told.value - true_wh.value) / full_wh;
                assert!(off.abs() < 0.001, "{name} at {}: {:?} for {:?}", soc.value, told, true_wh);
                assert!(
                    (told.sigma / true_wh.sigma.max(1e-9) - 1.0).abs() < 0.1 || soc.value < 0.1,
                    "{name} at {}: {told:?} {true_wh:?}",
                    soc.value
                );
            }
        }
    }
}
