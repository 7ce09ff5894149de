//! Resistance beyond the model's, over state of charge: what a gauge learns of a pack's cells.
//!
//! The table has grid points over depth of discharge, as the gauge ICs of the thesis have (Kottas,
//! section 3.2), denser near empty where the resistance rises. At each point it holds `r`, ohm per
//! cell at the reference temperature: `(OCV - V) / I` less what the model's own effects explain.
//! At another temperature it is scaled as the model's resistance is (an Arrhenius factor when the
//! model has one).
//!
//! How far `r` may be from zero at the start follows from the model: the covariance that its
//! parameters' deviations give its resistance at the grid points. To this comes the
//! model's `resistance_relative_sigma` of it at each point: what its shape leaves out. A model without
//! any resistance is taken for one that leaves it out: 0.1 ohm Ah (guess; cells of phones and
//! drones have 0.05 to 0.3).

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::units::{REFERENCE_DEGC, S_PER_H};
use crate::{Channel, Model, Run, Start};

/// State of charge of the grid points.
pub(crate) const GRID: [f64; 13] = [0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.85, 1.0];
/// Deviation of a resistance that the model leaves out, times the cell's capacity, ohm Ah.
const LEFT_OUT_OHM_AH: f64 = 0.1;
/// Below this, times the cell's capacity, a model has no resistance, ohm Ah.
const NONE_OHM_AH: f64 = 0.02;
/// Current at which the model's resistance is asked, as a share of capacity per hour.
const PROBE_SHARE: f64 = 0.3;
/// Length of that question, s: as long as the loads that a gauge learns from last at least.
const PROBE_S: f64 = 60.0;

/// Share of each grid point at a state of charge.
pub(crate) fn shares(soc: f64) -> [f64; GRID.len()] {
    let mut shares = [0.0; GRID.len()];
    let soc = soc.clamp(0.0, 1.0);
    let high = GRID.partition_point(|&point| point <= soc).clamp(1, GRID.len() - 1);
    let share = (soc - GRID[high - 1]) / (GRID[high] - GRID[high - 1]);
    (shares[high - 1], shares[high]) = (1.0 - share, share);
    shares
}

/// A table's value at a state of charge.
pub(crate) fn at(table: &[f64], soc: f64) -> f64 {
    shares(soc).iter().zip(table).map(|(share, value)| share * value).sum()
}

/// The model's own resistance at a state of charge, ohm per cell.
pub(crate) fn modelled_ohm(model: &Arc<Model>, parameters: Vec<f64>, soc: f64, temperature_degc: f64) -> f64 {
    let facts = model.battery();
    // So that it ends there.
    let begin = soc + PROBE_SHARE * PROBE_S / S_PER_H;
    // From the discharged branch: a cell's hysteresis is no resistance, and no more is what a sensor shows too much of.
    let start = |soc: f64| Start { temperature_degc, history: 1.0, ..Start::at_soc(soc) };
    let mut run = Run::with_parameters(Arc::clone(model), parameters, start(begin));
    let mut drop_v = |start: Start, current_a: f64| {
        run.restart(start);
        run.channels[Channel::CurrentA] = current_a;
        run.step(PROBE_S);
        run.channels[Channel::OcvV] - run.channels[Channel::VoltageV] / f64::from(facts.series)
    };
    let probe_a = PROBE_SHARE * facts.capacity_ah;
    (drop_v(start(begin), probe_a) - drop_v(start(soc), 0.0)) * f64::from(facts.parallel) / probe_a
}

/// The model's resistance at a temperature over that at the reference temperature; 1 for a model
/// without resistance.
pub(crate) fn temperature_factor(model: &Arc<Model>, temperature_degc: f64) -> f64 {
    let [here, reference] = [temperature_degc, REFERENCE_DEGC].map(|degc| modelled_ohm(model, model.values(), 0.5, degc));
    if reference > 0.0 && here > 0.0 { here / reference } else { 1.0 }
}

/// What is known before anything is learned.
#[derive(Debug, Clone)]
pub(crate) struct Prior {
    /// The model's own resistance at each grid point, ohm per cell.
    pub(crate) modelled_ohm: [f64; GRID.len()],
    /// Covariance of what the model may be wrong by, ohm² per cell.
    pub(crate) covariance: DMatrix<f64>,
    /// The part of it that no parameter explains, in the middle of the table, as a deviation, ohm.
    pub(crate) left_out_ohm: f64,
}

impl Prior {
    pub(crate) fn of(model: &Arc<Model>) -> Self {
        let facts = model.battery();
        let cell_ah = facts.capacity_ah / f64::from(facts.parallel);
        let table = |values: &[f64]| GRID.map(|soc| modelled_ohm(model, values.to_vec(), soc, REFERENCE_DEGC));
        let mut values = model.values();
        let modelled_ohm = table(&values);
        let n = GRID.len();
        let mut covariance = DMatrix::zeros(n, n);
        for (index, parameter) in model.parameters().iter().enumerate().filter(|(_, p)| p.sigma > 0.0) {
            let mut moved = |side: f64| {
                values[index] = (parameter.value + side * parameter.sigma).clamp(parameter.min, parameter.max);
                table(&values)
            };
            let (above, below) = (moved(1.0), moved(-1.0));
            values[index] = parameter.value;
            let slope: [f64; GRID.len()] = std::array::from_fn(|point| (above[point] - below[point]) / 2.0);
            for one in 0..n {
                for other in 0..n {
                    covariance[(one, other)] += slope[one] * slope[other];
                }
            }
        }
        for point in 0..n {
            covariance[(point, point)] += (model.uncertainty.resistance_relative_sigma * modelled_ohm[point]).powi(2);
        }
        let mut left_out_ohm = model.uncertainty.resistance_relative_sigma * modelled_ohm[n / 2].abs();
        if modelled_ohm[n / 2] * cell_ah < NONE_OHM_AH {
            left_out_ohm = left_out_ohm.hypot(LEFT_OUT_OHM_AH / cell_ah);
            covariance.add_scalar_mut((LEFT_OUT_OHM_AH / cell_ah).powi(2));
        }
        Self { modelled_ohm, covariance, left_out_ohm }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> Arc<Model> {
        Arc::new(crate::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap())
    }

    #[test]
    fn the_prior_is_what_the_models_file_says() {
        let prior = Prior::of(&model());
        // 0.1102 ohm at 40 % with a deviation of 10 %, and 2 % of shape.
        assert!((prior.modelled_ohm[7] - 0.1102).abs() < 3e-5, "{:?}", prior.modelled_ohm);
        let expected = 0.0110_f64.hypot(0.02 * 0.1102);
        assert!((prior.covariance[(7, 7)].sqrt() / expected - 1.0).abs() < 0.03);
        // Points on either side of one knot move with it, far ones do not.
        assert!(prior.covariance[(6, 8)] > 0.0 && prior.covariance[(0, 12)].abs() < 1e-12);
    }

    #[test]
    fn hysteresis_is_no_resistance() {
        let lfp = crate::load_model("a123-lfp-26650-2p3ah", &|_| unreachable!("built in")).unwrap();
        let [with, without] = [lfp.clone(), lfp.without(|id| id == "hysteresis")].map(|model| Prior::of(&Arc::new(model)).modelled_ohm);
        // By hand at half charge: 9.572 mohm at once, 6.418 mohm whole after a minute, and 83.05 mohm of which 60 s of 1200 have come.
        let expected_ohm = 9.572e-3 + 6.418e-3 * (1.0 - (-60.0_f64 / 12.86).exp()) + 83.05e-3 * (1.0 - (-60.0_f64 / 1200.0).exp());
        assert!((with[8] / expected_ohm - 1.0).abs() < 0.02, "{} and {expected_ohm}", with[8]);
        assert!(with.iter().zip(without).all(|(with, without)| (with / without - 1.0).abs() < 0.02), "{with:?} {without:?}");
    }

    #[test]
    fn a_model_without_resistance_may_have_left_it_out() {
        let bare = Arc::new(model().without(|_| true));
        let prior = Prior::of(&bare);
        assert!((prior.covariance[(3, 8)].sqrt() - 0.1 / 1.32).abs() < 1e-9);
        assert!((temperature_factor(&bare, 0.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn between_grid_points_the_table_is_linear() {
        let mut table = [0.0; GRID.len()];
        (table[7], table[8]) = (0.1, 0.2);
        assert!((at(&table, 0.45) - 0.15).abs() < 1e-12 && at(&table, 0.85).abs() < 1e-12);
        assert!((at(&table, 0.4) - 0.1).abs() < 1e-12);
    }
}
