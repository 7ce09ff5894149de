//! Coulomb counting with a correction at rest.
//!
//! `SoC(t) = SoC(0) - ∫ I dt / Q`. Its variance grows by the current sensor's gain (with the
//! charge moved), offset (with time) and noise, all from the sensor's datasheet. When the pack
//! rests - no current, and |dV/dt| < 4 uV/s per cell (Kottas, section 3.3.2) - the open-circuit
//! voltage gives a second estimate, fused by inverse variance.

use std::sync::Arc;

use super::{Gauge, Reading, Sample};
use crate::units::S_PER_H;
use crate::{Channel, Estimate, Model, forecast};

/// Rested when the voltage moves less than this, V/s per cell (Kottas, section 3.3.2).
const REST_SLOPE_V_PER_S: f64 = 4e-6;
/// Time over which the voltage's slope is taken, s: with steps of 1 mV a shorter one cannot tell
/// a slope below the limit from none.
const REST_WINDOW_S: f64 = 300.0;
/// A current below this share of capacity per hour counts as none.
const REST_CURRENT_SHARE: f64 = 0.005;
/// Time constant of the mean power that energy is predicted at, s.
const POWER_TAU_S: f64 = 60.0;
/// A prediction is made anew when the state of charge has moved this far.
const FRESH_SOC: f64 = 0.005;
/// A prediction is made anew when the power has changed by this share of itself.
const FRESH_POWER: f64 = 0.05;

/// Counts charge; see the module's text.
#[derive(Debug, Clone)]
pub struct CoulombCounter {
    model: Arc<Model>,
    soc: f64,
    drift: Drift,
    power_w: f64,
    temperature_degc: f64,
    rest: Option<Rest>,
    predicted: Option<Predicted>,
    /// Energy of a full pack, and the power that it was predicted for.
    full: Option<(f64, Estimate)>,
}

/// Deviation of the state of charge by origin. What offset and gain do is the same error every
/// second, so their deviations grow with time and charge; noise walks at random.
#[derive(Debug, Clone, Copy, Default)]
struct Drift {
    start_sigma: f64,
    offset_sigma: f64,
    gain_sigma: f64,
    noise_variance: f64,
}

impl Drift {
    fn sigma(&self) -> f64 {
        (self.start_sigma.powi(2) + self.offset_sigma.powi(2) + self.gain_sigma.powi(2) + self.noise_variance).sqrt()
    }
}

#[derive(Debug, Clone, Copy)]
struct Rest {
    since_s: f64,
    voltage_v: f64,
}

/// The last prediction and where it was made; between predictions energy is counted.
#[derive(Debug, Clone, Copy)]
struct Predicted {
    soc: f64,
    power_w: f64,
    moved_wh: f64,
    remaining_wh: Estimate,
    full_wh: Estimate,
    time_to_full_s: Option<Estimate>,
}

impl CoulombCounter {
    /// Starts at a known state of charge.
    #[must_use]
    pub fn new(model: Arc<Model>, soc: Estimate, temperature_degc: f64) -> Self {
        let drift = Drift { start_sigma: soc.sigma, ..Drift::default() };
        Self { model, soc: soc.value, drift, power_w: 0.0, temperature_degc, rest: None, predicted: None, full: None }
    }

    /// Starts from the voltage of a rested pack, by the OCV table.
    #[must_use]
    pub fn at_rest(model: Arc<Model>, voltage_v: f64, temperature_degc: f64) -> Self {
        let soc = soc_at_rest(&model, voltage_v);
        Self::new(model, soc, temperature_degc)
    }

    /// The battery model that the gauge believes.
    #[must_use]
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    fn correct_at_rest(&mut self, sample: &Sample) {
        let facts = self.model.battery();
        if sample.current_a.abs() > REST_CURRENT_SHARE * facts.capacity_ah {
            self.rest = None;
            return;
        }
        let Some(rest) = &mut self.rest else {
            self.rest = Some(Rest { since_s: 0.0, voltage_v: sample.voltage_v });
            return;
        };
        rest.since_s += sample.dt_s;
        if rest.since_s < REST_WINDOW_S {
            return;
        }
        let slope = (sample.voltage_v - rest.voltage_v) / rest.since_s / f64::from(facts.series);
        *rest = Rest { since_s: 0.0, voltage_v: sample.voltage_v };
        if slope.abs() < REST_SLOPE_V_PER_S {
            let (counted, rested) = (self.soc(), soc_at_rest(&self.model, sample.voltage_v));
            let fused = counted.fused_with(rested);
            // Every rest reads the same OCV table: resting longer cannot make its error smaller,
            // so the deviation stays at what one reading gives.
            let sigma = fused.sigma.max(rested.sigma.min(counted.sigma));
            self.soc = fused.value;
            self.drift = Drift { start_sigma: sigma, ..Drift::default() };
            self.predicted = None;
        }
    }

    fn prediction(&mut self) -> Predicted {
        let soc = self.soc();
        let drawn_w = self.power_w.max(0.0);
        // Near rest, noise is most of the power: there only a change that matters to the forecast
        // counts, which takes no power below this for one.
        let idle_w = REST_CURRENT_SHARE * self.model.battery().stored_wh();
        let fresh = self.predicted.filter(|last| {
            let power_moved_w = (last.power_w - self.power_w).abs();
            (last.soc - soc.value).abs() < FRESH_SOC && power_moved_w <= FRESH_POWER * last.power_w.abs() + idle_w
        });
        let full = self.full.filter(|full| (full.0 - drawn_w).abs() <= FRESH_POWER * full.0 + idle_w);
        let full_wh = match full {
            Some((_, full_wh)) => full_wh,
            None => {
                let full_wh = forecast::remaining_wh(&self.model, Estimate::exact(1.0), self.temperature_degc, drawn_w);
                self.full = Some((drawn_w, full_wh));
                full_wh
            }
        };
        fresh.unwrap_or_else(|| {
            let charging = self.power_w < -idle_w;
            let predicted = Predicted {
                soc: soc.value,
                power_w: self.power_w,
                moved_wh: 0.0,
                remaining_wh: forecast::remaining_wh(&self.model, soc, self.temperature_degc, drawn_w),
                full_wh,
                time_to_full_s: charging.then(|| forecast::charge_estimate(&self.model, soc, 1.0, self.temperature_degc).1),
            };
            self.predicted = Some(predicted);
            predicted
        })
    }
}

/// State of charge of a rested pack from its voltage, with the deviation that the OCV table and
/// the voltage sensor leave.
fn soc_at_rest(model: &Model, voltage_v: f64) -> Estimate {
    let facts = model.battery();
    let per_cell_v = voltage_v / f64::from(facts.series);
    let soc = facts.ocv.soc(per_cell_v);
    let sensor = model.sensor(Channel::VoltageV);
    let sensor_v = sensor.floor().hypot(sensor.offset_sigma) / f64::from(facts.series);
    let slope = facts.ocv.slope_v(soc).max(1e-3);
    Estimate::new(soc, (model.uncertainty.ocv_sigma_v.hypot(sensor_v) / slope).clamp(1e-4, 0.5))
}

impl Gauge for CoulombCounter {
    fn update(&mut self, sample: &Sample) {
        let capacity_ah = self.model.battery().capacity_ah;
        let sensor = self.model.sensor(Channel::CurrentA);
        let hours = sample.dt_s / S_PER_H;
        let moved = sample.current_a * hours / capacity_ah;
        self.soc -= moved;
        self.drift.gain_sigma += moved * sensor.gain_sigma.hypot(self.model.uncertainty.capacity_relative_sigma);
        self.drift.offset_sigma += sensor.offset_sigma * hours / capacity_ah;
        self.drift.noise_variance += (sensor.floor() * hours / capacity_ah).powi(2);
        let keep = (-sample.dt_s / POWER_TAU_S).exp();
        self.power_w = keep * self.power_w + (1.0 - keep) * sample.current_a * sample.voltage_v;
        self.temperature_degc = sample.temperature_degc;
        if let Some(predicted) = &mut self.predicted {
            predicted.moved_wh += sample.current_a * sample.voltage_v * hours;
        }
        self.correct_at_rest(sample);
    }

    fn exchange(&mut self, soc: Estimate) {
        *self = Self { power_w: self.power_w, ..Self::new(Arc::clone(&self.model), soc, self.temperature_degc) };
    }

    fn soc(&self) -> Estimate {
        Estimate::new(self.soc.clamp(0.0, 1.0), self.drift.sigma())
    }

    fn reading(&mut self) -> Reading {
        let predicted = self.prediction();
        let stored_wh = self.model.battery().stored_wh();
        let remaining_wh = Estimate::new((predicted.remaining_wh.value - predicted.moved_wh).max(0.0), predicted.remaining_wh.sigma);
        let time_to_empty_s = (self.power_w > REST_CURRENT_SHARE * stored_wh).then(|| {
            let s_per_wh = S_PER_H / self.power_w;
            Estimate::new(remaining_wh.value * s_per_wh, remaining_wh.sigma * s_per_wh)
        });
        Reading {
            soc: self.soc(),
            remaining_wh,
            full_wh: predicted.full_wh,
            time_to_empty_s,
            time_to_full_s: predicted.time_to_full_s,
            soh: Estimate::new(1.0, self.model.uncertainty.capacity_relative_sigma),
            power_w: self.power_w,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::Terminals as _;
    use crate::{Run, Start, load_model};

    fn model() -> Arc<Model> {
        Arc::new(load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap())
    }

    #[test]
    fn counts_the_charge_and_widens_with_it() {
        let mut gauge = CoulombCounter::new(model(), Estimate::new(0.9, 0.01), 25.0);
        for _ in 0..1800 {
            gauge.update(&Sample { dt_s: 1.0, current_a: 0.66, voltage_v: 11.5, temperature_degc: 25.0 });
        }
        // Half of 1C for half an hour is a quarter of the capacity.
        assert!((gauge.soc().value - 0.65).abs() < 1e-9);
        assert!(gauge.soc().sigma > 0.01 && gauge.soc().sigma < 0.02);
    }

    #[test]
    fn a_rest_corrects_a_wrong_start_and_does_not_shrink_below_the_table() {
        let model = model();
        let truth_v = Run::new(Arc::clone(&model), Start::at_soc(0.5)).channels[Channel::VoltageV];
        let mut gauge = CoulombCounter::new(model, Estimate::new(0.8, 0.2), 25.0);
        let rest = Sample { dt_s: 10.0, current_a: 0.0, voltage_v: truth_v, temperature_degc: 25.0 };
        (0..40).for_each(|_| gauge.update(&rest));
        let once = gauge.soc();
        assert!((once.value - 0.5).abs() < 0.01, "{once:?}");
        (0..4000).for_each(|_| gauge.update(&rest));
        assert!(gauge.soc().sigma >= 0.9 * once.sigma, "{:?} after {once:?}", gauge.soc());
    }

    #[test]
    fn predicted_energy_is_what_the_pack_then_delivers() {
        let model = model();
        let mut body = Run::new(Arc::clone(&model), Start::at_soc(0.8));
        let mut gauge = CoulombCounter::new(Arc::clone(&model), Estimate::exact(0.8), 25.0);
        let step = |body: &mut Run<f64>, gauge: &mut CoulombCounter| {
            body.step_power(4.0, 1.0).unwrap();
            let [current_a, voltage_v, temperature_degc] =
                [Channel::CurrentA, Channel::VoltageV, Channel::TemperatureDegc].map(|c| body.channels[c]);
            gauge.update(&Sample { dt_s: 1.0, current_a, voltage_v, temperature_degc });
            voltage_v
        };
        (0..600).for_each(|_| {
            step(&mut body, &mut gauge);
        });
        let predicted_wh = gauge.reading().remaining_wh.value;
        let mut delivered_wh = 0.0;
        while step(&mut body, &mut gauge) > model.battery().eod_v() {
            delivered_wh += 4.0 / S_PER_H;
        }
        assert!((predicted_wh / delivered_wh - 1.0).abs() < 0.01, "{predicted_wh} against {delivered_wh}");
    }
}
