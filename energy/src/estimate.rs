//! A value with its standard deviation, and how deviations pass through a function.

use serde::{Deserialize, Serialize};

/// A value and its standard deviation, in the same unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Best estimate.
    pub value: f64,
    /// Standard deviation, >= 0.
    pub sigma: f64,
}

impl Estimate {
    /// A value known to within `sigma`.
    #[must_use]
    pub const fn new(value: f64, sigma: f64) -> Self {
        Self { value, sigma }
    }

    /// A value without uncertainty.
    #[must_use]
    pub const fn exact(value: f64) -> Self {
        Self { value, sigma: 0.0 }
    }
}

/// Evaluates `f` at the inputs' values and carries their (independent) deviations to first order,
/// by one central difference per uncertain input.
pub fn propagate(inputs: &[Estimate], f: impl FnMut(&[f64]) -> f64) -> Estimate {
    propagate_within(inputs, |_| (f64::NEG_INFINITY, f64::INFINITY), f)
}

/// The same where an input means nothing outside a range: `f` sees none that is, and at the edge of one its slope is that within.
pub(crate) fn propagate_within(inputs: &[Estimate], range: impl Fn(usize) -> (f64, f64), mut f: impl FnMut(&[f64]) -> f64) -> Estimate {
    let held = |index: usize, value: f64| value.clamp(range(index).0, range(index).1);
    let mut at: Vec<f64> = inputs.iter().enumerate().map(|(index, input)| held(index, input.value)).collect();
    let value = f(&at);
    let mut variance = 0.0;
    for (index, input) in inputs.iter().enumerate() {
        if input.sigma == 0.0 {
            continue;
        }
        let middle = at[index];
        let mut side = |by: f64| {
            at[index] = held(index, middle + by);
            (at[index], f(&at))
        };
        let ((high, above), (low, below)) = (side(input.sigma), side(-input.sigma));
        at[index] = middle;
        // A deviation that rounding swallows changes nothing.
        if high > low {
            variance += ((above - below) / (high - low) * input.sigma).powi(2);
        }
    }
    Estimate::new(value, variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A vessel of one litre that is full to within a tenth: what runs out of it is as uncertain as that of a half full one, on one side.
    #[test]
    fn at_the_edge_of_a_range_the_slope_is_that_within() {
        let out = |filled: f64, sigma: f64| propagate_within(&[Estimate::new(filled, sigma)], |_| (0.0, 1.0), |x| 7.0 * x[0]);
        for filled in [0.0, 0.05, 0.5, 0.95, 1.0, 1.03] {
            let told = out(filled, 0.1);
            assert!((told.sigma - 0.7).abs() < 1e-9 && (told.value - 7.0 * filled.min(1.0)).abs() < 1e-9, "{filled}: {told:?}");
        }
    }

    #[test]
    fn a_product_carries_both_relative_sigmas() {
        let area = propagate(&[Estimate::new(3.0, 0.03), Estimate::new(4.0, 0.08)], |x| x[0] * x[1]);
        assert!((area.value - 12.0).abs() < 1e-12);
        // sqrt(1 %² + 2 %²) of 12, by hand.
        assert!((area.sigma - 12.0 * 0.0005_f64.sqrt()).abs() < 1e-9);
    }
}
