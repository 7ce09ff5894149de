//! Estimators that turn raw samples of a pack into state of charge and energy.

mod coulomb;

pub use coulomb::CoulombCounter;

use crate::Estimate;

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
}

/// A gauge: fed sample by sample, read at any time.
pub trait Gauge: Send {
    /// Takes in one sample.
    fn update(&mut self, sample: &Sample);

    /// Another pack was put in, whose state of charge is known this well.
    fn exchange(&mut self, soc: Estimate);

    /// State of charge, cheaply.
    fn soc(&self) -> Estimate;

    /// Everything the gauge knows; steps the battery model to the end of discharge.
    fn reading(&mut self) -> Reading;
}
