//! The number that physics is written in: a plain f64, or a dual number that carries exact
//! derivatives with respect to parameters.

use num_dual::{DualNum, DualSVec64};

/// How many derivatives one [`Dual`] carries; more parameters take several passes.
pub const LANES: usize = 8;

/// f64 with [`LANES`] exact first derivatives.
pub type Dual = DualSVec64<LANES>;

/// What an effect may calculate with. Implemented by f64 and [`Dual`].
pub trait Real: DualNum<Primitive = f64> + Copy + Send + Sync {}

impl<T: DualNum<Primitive = f64> + Copy + Send + Sync> Real for T {}

/// A variable of the given value whose derivative with respect to itself sits in `lane`.
#[must_use]
pub fn variable(value: f64, lane: usize) -> Dual {
    let mut dual = Dual::from(value);
    dual.eps = num_dual::Derivative::derivative_generic(nalgebra::Const::<LANES>, nalgebra::U1, lane);
    dual
}

/// The derivative in `lane`; zero where the number does not depend on it.
#[must_use]
pub fn derivative(dual: &Dual, lane: usize) -> f64 {
    dual.eps.0.map_or(0.0, |eps| eps[lane])
}

/// Largest argument for the series of [`exp`]: its first missing term, x^8/8!, is 7e-17 there.
const SERIES_MAX: f64 = 0.036;

/// e^x to double precision; by its series where a step changes little, which is several times
/// faster than a general exponential.
#[inline]
#[must_use]
pub fn exp<S: Real>(x: S) -> S {
    if x.re().abs() > SERIES_MAX {
        return x.exp();
    }
    let mut sum = x * (1.0 / 5040.0) + 1.0 / 720.0;
    for factor in [1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        sum = sum * x + factor;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_meets_the_general_exponential() {
        for step in -40..=40 {
            let x = f64::from(step) * 1e-3;
            assert!((exp(x) / x.exp() - 1.0).abs() < 4e-16, "{x}");
            let dual = exp(variable(x, 3));
            assert!((derivative(&dual, 3) / x.exp() - 1.0).abs() < 1e-13, "{x}");
        }
    }
}
