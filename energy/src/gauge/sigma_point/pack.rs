//! Predictions from what the filter believes.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::SigmaPoint;
use crate::gauge::follow::go_on_like;
use crate::gauge::prediction::{Believed, CurrentErrors};
use crate::{Run, Start, forecast};

/// What the gauge believes: the model's pack with the filter's parameters.
pub(super) struct Pack<'a> {
    pub(super) gauge: &'a SigmaPoint,
    pub(super) temperature_degc: f64,
    pub(super) cycles: f64,
}

impl Pack<'_> {
    fn places(&self) -> Vec<usize> {
        let layout = &self.gauge.layout;
        [0, layout.capacity, layout.resistance].into_iter().chain(layout.first_parameter..layout.capacity).collect()
    }

    fn run(&self, inputs: &[f64], rested: bool) -> Run<f64> {
        let gauge = self.gauge;
        let soc = inputs[0].clamp(0.0, 1.0);
        let (temperature_degc, cycle_count) = (self.temperature_degc, self.cycles);
        let mut values = gauge.model.values();
        for (&parameter, &value) in gauge.layout.parameters.iter().zip(&inputs[3..]) {
            let limits = &gauge.model.parameters()[parameter];
            values[parameter] = value.clamp(limits.min, limits.max);
        }
        let start = Start { temperature_degc, cycle_count, ..Start::at_soc(soc) };
        let mut run = Run::with_parameters(Arc::clone(&gauge.model), values, start);
        if !rested {
            go_on_like(&mut run, start, &gauge.points[0].run, 1.0 + gauge.x[gauge.layout.capacity]);
        }
        run
    }
}

impl Believed for Pack<'_> {
    fn inputs(&self) -> (DVector<f64>, DMatrix<f64>) {
        let (places, gauge) = (self.places(), self.gauge);
        let mut x = DVector::from_fn(places.len(), |input, _| gauge.x[places[input]]);
        x[0] = gauge.points[0].run.states()[0];
        (x, DMatrix::from_fn(places.len(), places.len(), |one, other| gauge.p[(places[one], places[other])]))
    }

    fn discharge_wh(&self, inputs: &[f64], power_w: f64, rested: bool) -> f64 {
        let facts = self.gauge.model.battery();
        let of_pack = inputs[2] * self.gauge.warmth.1 * f64::from(facts.series) / f64::from(facts.parallel);
        let length = self.gauge.resistance_length();
        let more_ohm = |soc: f64| of_pack * (-(inputs[0] - soc).abs() / length).exp();
        (1.0 + inputs[1]) * forecast::discharge_behind(&mut self.run(inputs, rested), power_w, more_ohm).energy_wh
    }

    fn charge_s(&self, inputs: &[f64]) -> f64 {
        (1.0 + inputs[1]) * forecast::charge(&mut self.run(inputs, false), 1.0).time_s
    }

    fn current_errors(&self) -> CurrentErrors {
        let (gauge, layout) = (self.gauge, &self.gauge.layout);
        let inputs: Vec<Option<usize>> = self.places().into_iter().map(Some).collect();
        CurrentErrors::of(&gauge.x, &gauge.p, [layout.current_offset, layout.current_gain], &inputs)
    }
}
