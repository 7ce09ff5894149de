//! Estimators that turn raw samples into state of charge and energy.
//!
//! ```text
//!   coulomb.rs       counts charge, corrected at rest          |  counter.rs, ledger.rs  a charge count and its errors
//!   impedance.rs     and learns resistance and capacity        |  follow.rs, rest.rs, equilibrium.rs, power.rs, cycles.rs
//!   sigma_point.rs   a filter over all that the model is       |  prediction.rs  energy and times from what is believed
//!                    unsure of                                 |
//! ```
//!
//! Every gauge predicts by stepping the model and none divides an energy by a power. What each of
//! them knows comes with a deviation that means what it says: see `tests/it/coverage.rs`.

mod coulomb;
mod counter;
mod cycles;
mod equilibrium;
mod follow;
mod impedance;
mod kind;
mod ledger;
mod power;
mod prediction;
mod resistance;
mod rest;
mod sigma_point;

pub use coulomb::CoulombCounter;
pub use impedance::ImpedanceTrack;
pub use kind::{Kind, open};
pub use sigma_point::SigmaPoint;

use std::sync::Arc;

use crate::{Channel, Estimate, Model};

/// One raw sample of a pack: what its sensors showed at the end of an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Length of the interval, s.
    pub dt_s: f64,
    /// Mean current over the interval, A (discharge positive).
    pub current_a: f64,
    /// Terminal voltage, V.
    pub voltage_v: f64,
    /// Cell temperature, °C.
    pub temperature_degc: f64,
}

/// No pack has a current (A), a voltage (V) or a temperature (°C) like this, and no two samples lie so far apart (s).
pub const MEASURED_MAX: f64 = 1e7;

impl Sample {
    /// Whether this can have been measured: every number finite and below [`MEASURED_MAX`], and some time over which it was.
    /// Open inputs, lost messages and a driver's marks for "nothing" (such as -3.4e38) give others.
    #[must_use]
    pub fn is_reading(&self) -> bool {
        let values = [self.dt_s, self.current_a, self.voltage_v, self.temperature_degc];
        values.iter().all(|value| value.abs() < MEASURED_MAX) && self.dt_s > 0.0
    }
}

/// What a gauge knows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// State of charge, 0..1.
    pub soc: Estimate,
    /// Energy still usable at the present power down to the end of discharge, Wh.
    pub remaining_wh: Estimate,
    /// Energy usable from full at the present power, Wh.
    pub full_wh: Estimate,
    /// Time to the end of discharge at the present power, s; none while the pack is not drained.
    pub time_to_empty_s: Option<Estimate>,
    /// Time to full on the pack's own charger, s; none while it is not charged.
    pub time_to_full_s: Option<Estimate>,
    /// Capacity over the capacity when new.
    pub soh: Estimate,
    /// Recent mean power, W (discharge positive).
    pub power_w: f64,
    /// Full-equivalent cycles since the gauge began: charge drawn over capacity.
    pub cycles: f64,
    /// Pseudo cycles since the gauge began: partial cycles by the rainflow count.
    pub pseudo_cycles: f64,
}

/// A gauge: fed sample by sample, read at any time.
pub trait Gauge: Send {
    /// The battery model that the gauge believes.
    fn model(&self) -> &Arc<Model>;

    /// Takes in one sample. One that is no reading ([`Sample::is_reading`]) changes nothing: its time is not counted.
    fn update(&mut self, sample: &Sample);

    /// Another pack was put in, whose state of charge is known this well.
    fn exchange(&mut self, soc: Estimate);

    /// State of charge, cheaply.
    fn soc(&self) -> Estimate;

    /// Everything the gauge knows; steps the battery model to the end of discharge.
    fn reading(&mut self) -> Reading;
}

/// State of charge of a rested pack from its voltage, with the deviation that the OCV table, the voltage sensor and,
/// where a cell rests higher after a charge than after a discharge, not knowing which it was leave.
#[must_use]
pub fn soc_at_rest(model: &Arc<Model>, voltage_v: f64) -> Estimate {
    let (facts, curve) = (model.battery(), equilibrium::curve(model));
    let soc = curve.soc(voltage_v / f64::from(facts.series));
    let sensor = model.sensor(Channel::VoltageV);
    let sensor_v = sensor.floor().hypot(sensor.offset_sigma) / f64::from(facts.series);
    let slope = curve.slope_v(soc).max(1e-3);
    let apart_v = follow::branch_v(model, soc);
    let [charged, discharged] = [-apart_v, apart_v].map(|below_v| curve.soc(voltage_v / f64::from(facts.series) + below_v));
    let branch = 0.5 * (discharged - charged);
    Estimate::new(soc, (model.uncertainty.ocv_sigma_v.hypot(sensor_v) / slope).hypot(branch).clamp(1e-4, 0.5))
}
