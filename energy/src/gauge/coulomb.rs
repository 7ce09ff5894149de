//! Coulomb counting with a correction at rest.
//!
//! `SoC(t) = SoC(0) - ∫ I dt / Q`, kept in a [ledger](super::ledger) of what it can be wrong by.
//! When the pack rests (see [`super::rest`]) the open-circuit voltage tells the state of charge,
//! weighted by what table and sensor can be wrong by. Nothing else is learned: capacity and
//! resistance stay those of the model. The cheapest gauge, and the yardstick of the others.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::counter::Counter;
use super::follow::go_on_like;
use super::ledger::{CAPACITY, Ledger, SOC, Seen};
use super::prediction::{Believed, CurrentErrors};
use super::{Gauge, Reading, Sample};
use crate::{Estimate, Model, Run, Start, forecast};

/// Counts charge; see the module's text.
#[derive(Debug, Clone)]
pub struct CoulombCounter(Counter);

impl CoulombCounter {
    /// Starts at a known state of charge.
    #[must_use]
    pub fn new(model: Arc<Model>, soc: Estimate, temperature_degc: f64) -> Self {
        Self(Counter::new(model, soc, temperature_degc, None))
    }
}

/// What the counter believes: the model's pack, at the ledger's state of charge.
struct Pack<'a> {
    model: &'a Arc<Model>,
    ledger: &'a Ledger,
    followed: &'a Run<f64>,
    temperature_degc: f64,
    cycles: f64,
}

impl Pack<'_> {
    fn run(&self, inputs: &[f64], rested: bool) -> Run<f64> {
        let (temperature_degc, cycle_count) = (self.temperature_degc, self.cycles);
        let start = Start { temperature_degc, cycle_count, ..Start::at_soc(inputs[0].clamp(0.0, 1.0)) };
        let parameters = inputs[2..].iter().zip(self.model.parameters()).map(|(&value, p)| value.clamp(p.min, p.max)).collect();
        let mut run = Run::with_parameters(Arc::clone(self.model), parameters, start);
        if !rested {
            go_on_like(&mut run, start, self.followed, 1.0 + self.ledger.state(CAPACITY).value);
        }
        run
    }
}

impl Believed for Pack<'_> {
    fn inputs(&self) -> (DVector<f64>, DMatrix<f64>) {
        let parameters = self.model.parameters();
        let own = [SOC, CAPACITY];
        let n = own.len() + parameters.len();
        let (mut x, mut p) = (DVector::zeros(n), DMatrix::zeros(n, n));
        for (i, one) in own.into_iter().enumerate() {
            x[i] = self.ledger.state(one).value;
            for (j, other) in own.into_iter().enumerate() {
                p[(i, j)] = self.ledger.covariance(one, other);
            }
        }
        for (i, parameter) in parameters.iter().enumerate() {
            x[own.len() + i] = parameter.value;
            p[(own.len() + i, own.len() + i)] = parameter.sigma * parameter.sigma;
        }
        (x, p)
    }

    fn discharge_wh(&self, inputs: &[f64], power_w: f64, rested: bool) -> f64 {
        (1.0 + inputs[1]) * forecast::discharge(&mut self.run(inputs, rested), power_w).energy_wh
    }

    fn charge_s(&self, inputs: &[f64]) -> f64 {
        (1.0 + inputs[1]) * forecast::charge(&mut self.run(inputs, false), 1.0).time_s
    }

    fn current_errors(&self) -> CurrentErrors {
        let mut inputs = vec![Some(SOC), Some(CAPACITY)];
        inputs.resize(2 + self.model.parameters().len(), None);
        self.ledger.current_errors(&inputs)
    }
}

impl Gauge for CoulombCounter {
    fn model(&self) -> &Arc<Model> {
        &self.0.model
    }

    fn update(&mut self, sample: &Sample) {
        if !sample.is_reading() {
            return;
        }
        let (followed, _) = self.0.count(sample, false);
        if let Some(rested) = self.0.rested(sample) {
            let seen = Seen {
                cell_v: rested.cell_v,
                noise_v2: rested.noise_v2 + followed.branch_v.powi(2),
                below_v: followed.shift_v + followed.drop_v,
                load: None,
                teaches_capacity: false,
            };
            self.0.ledger.see(&self.0.ocv, &seen);
        }
    }

    fn exchange(&mut self, soc: Estimate) {
        let fresh = Self::new(Arc::clone(&self.0.model), soc, self.0.watch.temperature_degc);
        self.0 = self.0.exchanged(fresh.0);
    }

    fn soc(&self) -> Estimate {
        self.0.soc()
    }

    fn reading(&mut self) -> Reading {
        let (soc, followed) = (self.0.soc(), self.0.run().clone());
        let Counter { model, ledger, watch, .. } = &mut self.0;
        let (temperature_degc, cycles) = (watch.temperature_degc, watch.cycles.full());
        let pack = Pack { model, ledger, followed: &followed, temperature_degc, cycles };
        watch.reading(model, &pack, soc, Estimate::new(1.0, ledger.state(CAPACITY).sigma))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::Terminals as _;
    use crate::units::S_PER_H;
    use crate::{Channel, load_model};

    fn model() -> Arc<Model> {
        Arc::new(load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap())
    }

    #[test]
    fn counts_the_charge_and_widens_with_it() {
        let mut gauge = CoulombCounter::new(model(), Estimate::new(0.9, 0.01), 25.0);
        for _ in 0..1800 {
            gauge.update(&Sample { dt_s: 1.0, current_a: 0.66, voltage_v: 11.5, temperature_degc: 25.0 });
        }
        // Half of 1C for half an hour is a quarter of the capacity; self-discharge is 2e-5.
        assert!((gauge.soc().value - 0.65).abs() < 5e-5);
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
