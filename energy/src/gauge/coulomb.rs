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
/// Time over which the voltage's slope is taken: at 1 mV steps a shorter one shows no slope
/// below the limit, s.
const REST_WINDOW_S: f64 = 300.0;
/// A current below this share of capacity per hour counts as none.
const REST_CURRENT_SHARE: f64 = 0.005;
/// Time constant of the mean power that energy is predicted at, s.
const POWER_TAU_S: f64 = 60.0;

/// Counts charge; see the module's text.
#[derive(Debug, Clone)]
pub struct CoulombCounter {
    model: Arc<Model>,
    soc: f64,
    /// Variance by origin: what offset and gain do is correlated over time, so their standard
    /// deviations grow linearly; noise grows as a random walk.
    start_sigma: f64,
    offset_sigma: f64,
    gain_sigma: f64,
    noise_variance: f64,
    power_w: f64,
    temperature_degc: f64,
    rest: Option<Rest>,
}

#[derive(Debug, Clone, Copy)]
struct Rest {
    since_s: f64,
    voltage_v: f64,
}

impl CoulombCounter {
    /// Starts at a known state of charge.
    #[must_use]
    pub fn new(model: Arc<Model>, soc: Estimate, temperature_degc: f64) -> Self {
        Self {
            model,
            soc: soc.value,
            start_sigma: soc.sigma,
            offset_sigma: 0.0,
            gain_sigma: 0.0,
            noise_variance: 0.0,
            power_w: 0.0,
            temperature_degc,
            rest: None,
        }
    }

    /// Starts from the voltage of a rested pack, by the OCV table.
    #[must_use]
    pub fn at_rest(model: Arc<Model>, voltage_v: f64, temperature_degc: f64) -> Self {
        let soc = soc_at_rest(&model, voltage_v);
        Self::new(model, soc, temperature_degc)
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
            let fused = self.soc().fused_with(soc_at_rest(&self.model, sample.voltage_v));
            // The same table error stands behind every later rest: one correction is taken at
            // its full worth, later ones cannot shrink the deviation below it.
            let floor = soc_at_rest(&self.model, sample.voltage_v).sigma;
            *self = Self {
                soc: fused.value,
                start_sigma: fused.sigma.max(floor.min(self.soc().sigma)),
                offset_sigma: 0.0,
                gain_sigma: 0.0,
                noise_variance: 0.0,
                ..self.clone()
            };
        }
    }
}

/// State of charge of a rested pack from its voltage, with the deviation that the OCV table and
/// the voltage sensor leave.
fn soc_at_rest(model: &Model, voltage_v: f64) -> Estimate {
    let facts = model.battery();
    let per_cell_v = voltage_v / f64::from(facts.series);
    let soc = facts.ocv.soc(per_cell_v);
    let sensor = model.sensor(Channel::VoltageV);
    let sensor_v = (sensor.floor().powi(2) + sensor.offset_sigma.powi(2)).sqrt() / f64::from(facts.series);
    let voltage_sigma = (model.uncertainty.ocv_sigma_v.powi(2) + sensor_v.powi(2)).sqrt();
    let slope = facts.ocv.slope_v(soc).max(1e-3);
    Estimate::new(soc, (voltage_sigma / slope).clamp(1e-4, 0.5))
}

impl Gauge for CoulombCounter {
    fn update(&mut self, sample: &Sample) {
        let capacity_ah = self.model.battery().capacity_ah;
        let sensor = self.model.sensor(Channel::CurrentA);
        let hours = sample.dt_s / S_PER_H;
        let moved = sample.current_a * hours / capacity_ah;
        self.soc -= moved;
        self.gain_sigma += moved * (sensor.gain_sigma.powi(2) + self.model.uncertainty.capacity_relative_sigma.powi(2)).sqrt();
        self.offset_sigma += sensor.offset_sigma * hours / capacity_ah;
        self.noise_variance += (sensor.floor() * hours / capacity_ah).powi(2);
        let keep = (-sample.dt_s / POWER_TAU_S).exp();
        self.power_w = keep * self.power_w + (1.0 - keep) * sample.current_a * sample.voltage_v;
        self.temperature_degc = sample.temperature_degc;
        self.correct_at_rest(sample);
    }

    fn exchange(&mut self, soc: Estimate) {
        *self = Self { power_w: self.power_w, ..Self::new(Arc::clone(&self.model), soc, self.temperature_degc) };
    }

    fn soc(&self) -> Estimate {
        let variance = self.start_sigma.powi(2) + self.offset_sigma.powi(2) + self.gain_sigma.powi(2) + self.noise_variance;
        Estimate::new(self.soc.clamp(0.0, 1.0), variance.sqrt())
    }

    fn reading(&self) -> Reading {
        let soc = self.soc();
        let drawn_w = self.power_w.max(0.0);
        let remaining_wh = forecast::remaining_wh(&self.model, soc, self.temperature_degc, drawn_w);
        let full_wh = forecast::remaining_wh(&self.model, Estimate::exact(1.0), self.temperature_degc, drawn_w);
        let hours_to_seconds = S_PER_H / drawn_w.max(1e-9);
        let idle_w = REST_CURRENT_SHARE * self.model.battery().stored_wh();
        let time_to_empty_s =
            (drawn_w > idle_w).then(|| Estimate::new(remaining_wh.value * hours_to_seconds, remaining_wh.sigma * hours_to_seconds));
        let time_to_full_s = (self.power_w < -idle_w).then(|| forecast::charge_estimate(&self.model, soc, 1.0, self.temperature_degc).1);
        let soh = Estimate::new(1.0, self.model.uncertainty.capacity_relative_sigma);
        Reading { soc, remaining_wh, full_wh, time_to_empty_s, time_to_full_s, soh, power_w: self.power_w }
    }
}
