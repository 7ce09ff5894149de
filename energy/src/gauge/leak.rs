//! Self-discharge, asked of the model: what a pack loses that lies unused.

use std::sync::Arc;

use crate::units::S_PER_DAY;
use crate::{Channel, Estimate, Model, Run, Start, propagate};

/// Share of capacity that is lost per second at rest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leak {
    /// 1/s, with the deviation that the model's parameters give.
    pub(crate) per_s: Estimate,
}

impl Default for Leak {
    fn default() -> Self {
        Self { per_s: Estimate::exact(0.0) }
    }
}

impl Leak {
    /// What half a pack loses in a day without a current, by the model.
    pub(crate) fn of(model: &Arc<Model>, temperature_degc: f64) -> Self {
        let start = Start { temperature_degc, ..Start::at_soc(0.5) };
        let lost = propagate(&model.estimates(), |values| {
            let values = values.iter().zip(model.parameters()).map(|(&value, p)| value.clamp(p.min, p.max)).collect();
            let mut run = Run::with_parameters(Arc::clone(model), values, start);
            run.channels[Channel::CurrentA] = 0.0;
            run.step(S_PER_DAY);
            start.soc - run.channels[Channel::Soc]
        });
        Self { per_s: Estimate::new(lost.value / S_PER_DAY, lost.sigma / S_PER_DAY) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_month_costs_what_the_thesis_says() {
        let model = Arc::new(crate::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
        let month = Leak::of(&model, 25.0).per_s.value * 30.0 * S_PER_DAY;
        // Kottas, section 3.4: 3 % of capacity in a month.
        assert!((month - 0.03).abs() < 1e-6, "{month}");
    }
}
