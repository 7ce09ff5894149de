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
