//! Energy that a pack still gives, with all that is not known of it.

use std::sync::Arc;

use super::{discharge, uncertain};
use crate::{Estimate, Facts, Model, Pack, Start, estimate::propagate_within, ocv_error};

/// Energy that a rested pack of this temperature, °C, still delivers at `power_w`, Wh, with its deviation from those of state of charge,
/// parameters, capacity and open-circuit table.
#[must_use]
pub fn remaining_wh(model: &Arc<Model>, soc: Estimate, temperature_degc: f64, power_w: f64) -> Estimate {
    remaining_from(model, soc, Start { temperature_degc, ..Start::at_soc(soc.value) }, power_w)
}

/// The same of a pack that is as old as `from` has it, and came to its charge like that.
///
/// Everything is carried to first order by central differences. The table's error is the same at each discharge (see `ocv_error`): what
/// it changes is the energy on the way, and where the end of discharge is met. What the shape of the resistance leaves out
/// (`resistance_relative_sigma`) is for gauges, which learn it.
#[must_use]
pub fn remaining_from(model: &Arc<Model>, soc: Estimate, from: Start, power_w: f64) -> Estimate {
    let energy_wh = |model: &Arc<Model>, x: &[f64]| {
        let start = Start { soc: x[0], ..from };
        let parameters = x[2..].iter().zip(model.parameters()).map(|(&value, p)| value.clamp(p.min, p.max)).collect();
        let mut pack = Pack::with_parameters(Arc::clone(model), parameters, start);
        x[1] * discharge(&mut pack, power_w).energy_wh
    };
    let inputs = uncertain(model, soc);
    let ranges = |input: usize| if input == 0 { (0.0, 1.0) } else { (f64::NEG_INFINITY, f64::INFINITY) };
    let known = propagate_within(&inputs, ranges, |x| energy_wh(model, x));
    let expected: Vec<f64> = inputs.iter().map(|input| input.value).collect();
    let by_table = tables(model).into_iter().map(|pair| pair.map(|model| energy_wh(&model, &expected)));
    let variance_wh2: f64 = by_table.map(|[above_wh, below_wh]| (0.5 * (above_wh - below_wh)).powi(2)).sum();
    Estimate::new(known.value, known.sigma.hypot(variance_wh2.sqrt()))
}

/// The model with its open-circuit table moved by one part of its error, up and down.
fn tables(model: &Model) -> Vec<[Arc<Model>; 2]> {
    let with = |ocv| {
        let mut facts = model.battery().clone();
        facts.ocv = ocv;
        Arc::new(model.part(Facts::Battery(facts), |_| true).0)
    };
    ocv_error::tables(&model.battery().ocv, &model.uncertainty).into_iter().map(|pair| pair.map(with)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_model;

    /// 2 Ah, OCV = 3 V + SoC x 1 V, no resistance, empty at 3.2 V, a table that is 3 mV wrong.
    fn straight() -> Arc<Model> {
        let text = "schema = 1\nsystem = \"battery\"\nname = \"straight\"\nsource = \"test\"\n[battery]\nseries = 1\nparallel = 1\ncapacity_ah = 2.0\n\
                    full_v_per_cell = 4.0\neod_v_per_cell = 3.2\ncharge_current_a = 1.0\ncharge_cutoff_a = 0.1\n\
                    ocv = { soc = [0.0, 1.0], voltage_v = [3.0, 4.0] }\n\
                    [uncertainty]\nocv_sigma_v = 3e-3\nresistance_relative_sigma = 0.0\ncapacity_relative_sigma = 0.0\n";
        Arc::new(Model::parse("straight", text, &|_| unreachable!("no table")).unwrap())
    }

    /// In closed form `dE = Q (integral of e over z + V_eod e(z_eod) / V')`, with the covariance of e, Matern 3/2 over 0.15.
    #[test]
    fn a_wrong_table_is_wrong_on_the_way_and_at_the_end() {
        let like = |d: f64| (1.0 + 3f64.sqrt() * d / 0.15) * (-(3f64.sqrt()) * d / 0.15).exp();
        let (n, empty) = (400, 0.2);
        let at = |k: i32| empty + (1.0 - empty) * (f64::from(k) + 0.5) / f64::from(n);
        let step = (1.0 - empty) / f64::from(n);
        let twice: f64 = (0..n).flat_map(|i| (0..n).map(move |j| like((at(i) - at(j)).abs()))).sum::<f64>() * step * step;
        let with_end: f64 = (0..n).map(|i| like(at(i) - empty)).sum::<f64>() * step;
        let expected_wh = 2.0 * 3e-3 * (twice + 2.0 * 3.2 * with_end + 3.2 * 3.2).sqrt();
        let told = remaining_wh(&straight(), Estimate::exact(1.0), 25.0, 1.0);
        assert!((told.sigma / expected_wh - 1.0).abs() < 0.03, "{told:?}, by hand {expected_wh}");
        // 2 Ah from 4.0 to 3.2 V.
        assert!((told.value - 2.0 * 0.8 * 3.6).abs() < 0.01, "{told:?}");
    }

    #[test]
    fn the_parts_of_the_error_hold_nearly_all_of_it() {
        let model = Arc::new(load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap());
        let knots: Vec<f64> = (0..21).map(|knot| f64::from(knot) * 0.05).collect();
        let mut exact = Model::clone(&model);
        exact.uncertainty.ocv_sigma_v = 0.0;
        let (exact, values) = (Arc::new(exact), model.values());
        let given_wh = |knot: usize, side: f64| {
            let mut facts = exact.battery().clone();
            let error = |soc: f64| side * 3e-3 * (1.0 - (soc.clamp(0.0, 1.0) - knots[knot]).abs() / 0.05).max(0.0);
            facts.ocv = facts.ocv.moved(&[&[-0.1], &knots[..], &[1.1]].concat(), error);
            let moved = Arc::new(exact.part(Facts::Battery(facts), |_| true).0);
            let mut pack = Pack::with_parameters(moved, values.clone(), Start::at_soc(0.9));
            discharge(&mut pack, 5.0).energy_wh
        };
        let slope: Vec<f64> = (0..21).map(|knot| (given_wh(knot, 1.0) - given_wh(knot, -1.0)) / 6e-3).collect();
        let known = crate::Uncertainty { ocv_sigma_v: 3e-3, ..exact.uncertainty };
        let mut variance = 0.0;
        for one in 0..21 {
            for other in 0..21 {
                variance += slope[one] * slope[other] * ocv_error::covariance(&known, one, other);
            }
        }
        let with = |sigma_v: f64| {
            let mut model = Model::clone(&model);
            model.uncertainty.ocv_sigma_v = sigma_v;
            remaining_wh(&Arc::new(model), Estimate::exact(0.9), 25.0, 5.0).sigma
        };
        let by_parts_wh = (with(3e-3).powi(2) - with(0.0).powi(2)).sqrt();
        assert!((by_parts_wh / variance.sqrt() - 1.0).abs() < 0.02, "{by_parts_wh} Wh by parts, {} Wh by knots", variance.sqrt());
    }
}
