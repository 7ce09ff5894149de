//! A number together with how well it is known.

use std::ops::Add;

use serde::{Deserialize, Serialize};

/// A value and its standard deviation, both in the unit that the field's name states.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The expected value.
    pub value: f64,
    /// One standard deviation, same unit, zero or more.
    pub sigma: f64,
}

impl Estimate {
    /// A value known to within `sigma` (one standard deviation).
    pub const fn new(value: f64, sigma: f64) -> Self {
        Self { value, sigma }
    }

    /// A value without uncertainty.
    pub const fn exact(value: f64) -> Self {
        Self::new(value, 0.0)
    }

    /// The estimate of `k` times the quantity.
    pub fn scaled(self, k: f64) -> Self {
        Self::new(self.value * k, self.sigma * k.abs())
    }
}

/// Sum of two *independent* estimates: the variances add.
impl Add for Estimate {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::new(self.value + other.value, self.sigma.hypot(other.sigma))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variances_of_independent_estimates_add() {
        let sum = Estimate::new(1.0, 3.0) + Estimate::new(2.0, 4.0);
        assert_eq!(sum, Estimate::new(3.0, 5.0));
    }

    #[test]
    fn scaling_keeps_sigma_positive() {
        assert_eq!(Estimate::new(2.0, 0.5).scaled(-2.0), Estimate::new(-4.0, 1.0));
    }
}
