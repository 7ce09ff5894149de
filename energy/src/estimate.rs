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
pub fn propagate(inputs: &[Estimate], mut f: impl FnMut(&[f64]) -> f64) -> Estimate {
    let mut at: Vec<f64> = inputs.iter().map(|input| input.value).collect();
    let value = f(&at);
    let mut variance = 0.0;
    for (index, input) in inputs.iter().enumerate() {
        if input.sigma == 0.0 {
            continue;
        }
        at[index] = input.value + input.sigma;
        let above = f(&at);
        at[index] = input.value - input.sigma;
        let below = f(&at);
        at[index] = input.value;
        variance += ((above - below) / 2.0).powi(2);
    }
    Estimate::new(value, variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_carries_both_relative_sigmas() {
        let area = propagate(&[Estimate::new(3.0, 0.03), Estimate::new(4.0, 0.08)], |x| x[0] * x[1]);
        assert!((area.value - 12.0).abs() < 1e-12);
        // sqrt(1 %² + 2 %²) of 12, by hand.
        assert!((area.sigma - 12.0 * 0.0005_f64.sqrt()).abs() < 1e-9);
    }
}
