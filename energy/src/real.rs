//! The number that physics is written in: a plain f64, or a dual number that carries exact
//! derivatives with respect to parameters.

mod dual;

pub use dual::Derived;

use std::fmt::Debug;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// How many derivatives one [`Dual`] carries; more parameters take several passes.
pub const LANES: usize = Dual::LANES;

/// The number that carries derivatives by up to eight variables.
pub type Dual = Derived<4>;
/// The same by up to four, for less work.
pub type HalfDual = Derived<2>;

/// Arithmetic within a kind of number, and of it with plain numbers.
pub trait Arithmetic:
    Sized
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + AddAssign<f64>
    + SubAssign<f64>
    + MulAssign<f64>
    + DivAssign<f64>
    + Neg<Output = Self>
    + Sum
{
}

impl Arithmetic for f64 {}
impl<const PAIRS: usize> Arithmetic for Derived<PAIRS> {}

/// Declares the functions of one variable once, each with its slope at `x`, where it has the value
/// `y`: they become methods of [`Real`], for f64 by the standard library and for [`Derived`] by the
/// chain rule.
macro_rules! real {
    ($($(#[$doc:meta])* $name:ident: |$x:ident, $y:ident| $slope:expr;)*) => {
        /// What an effect may calculate with. Implemented by f64 and [`Derived`], which compare by
        /// their values.
        pub trait Real: Arithmetic + Copy + Debug + From<f64> + PartialOrd + PartialOrd<f64> + Send + Sync + 'static {
            /// The value without derivatives.
            fn re(&self) -> f64;
            /// Whether it has no derivative but zero.
            fn stands_still(&self) -> bool;
            /// A function of the number that has this value and this slope there.
            #[must_use]
            fn chain(&self, value: f64, slope: f64) -> Self;
            /// One over the number.
            #[must_use]
            fn recip(&self) -> Self;
            /// The number to a whole power.
            #[must_use]
            fn powi(&self, n: i32) -> Self;
            /// The number to a power.
            #[must_use]
            fn powf(&self, n: f64) -> Self;
            /// The number without its sign.
            #[must_use]
            fn abs(&self) -> Self;
            /// 1 or -1, by the sign.
            #[must_use]
            fn signum(&self) -> Self;
            $($(#[$doc])* #[must_use] fn $name(&self) -> Self;)*
        }

        impl Real for f64 {
            #[inline(always)]
            fn re(&self) -> f64 {
                *self
            }
            #[inline(always)]
            fn stands_still(&self) -> bool {
                true
            }
            #[inline(always)]
            fn chain(&self, value: f64, _: f64) -> f64 {
                value
            }
            #[inline(always)]
            fn recip(&self) -> f64 {
                f64::recip(*self)
            }
            #[inline(always)]
            fn powi(&self, n: i32) -> f64 {
                f64::powi(*self, n)
            }
            #[inline(always)]
            fn powf(&self, n: f64) -> f64 {
                f64::powf(*self, n)
            }
            #[inline(always)]
            fn abs(&self) -> f64 {
                f64::abs(*self)
            }
            #[inline(always)]
            fn signum(&self) -> f64 {
                f64::signum(*self)
            }
            $(#[inline(always)]
            fn $name(&self) -> f64 {
                f64::$name(*self)
            })*
        }

        impl<const PAIRS: usize> Real for Derived<PAIRS> {
            #[inline(always)]
            fn re(&self) -> f64 {
                self.re
            }
            #[inline]
            fn stands_still(&self) -> bool {
                self.lanes().iter().all(|eps| *eps == 0.0)
            }
            #[inline(always)]
            fn chain(&self, value: f64, slope: f64) -> Self {
                self.along(value, slope)
            }
            #[inline]
            fn recip(&self) -> Self {
                let inverse = self.re.recip();
                self.chain(inverse, -inverse * inverse)
            }
            #[inline]
            fn powi(&self, n: i32) -> Self {
                match n {
                    0 => Self::from(1.0),
                    n => self.chain(self.re.powi(n), f64::from(n) * self.re.powi(n - 1)),
                }
            }
            #[inline]
            fn powf(&self, n: f64) -> Self {
                if n == 0.0 { Self::from(1.0) } else { self.chain(self.re.powf(n), n * self.re.powf(n - 1.0)) }
            }
            #[inline]
            fn abs(&self) -> Self {
                if self.re.is_sign_negative() { -*self } else { *self }
            }
            #[inline]
            fn signum(&self) -> Self {
                Self::from(self.re.signum())
            }
            $(#[inline]
            #[allow(unused_variables, reason = "a slope is stated by whichever of x and y is shorter")]
            fn $name(&self) -> Self {
                let $x = self.re;
                let $y = $x.$name();
                self.chain($y, $slope)
            })*
        }
    };
}

real! {
    /// Square root.
    sqrt: |x, y| 0.5 / y;
    /// e to the power of the number.
    exp: |x, y| y;
    /// `exp(x) - 1`, exact where x is small.
    exp_m1: |x, y| y + 1.0;
    /// Natural logarithm.
    ln: |x, y| x.recip();
    /// `ln(1 + x)`, exact where x is small.
    ln_1p: |x, y| (1.0 + x).recip();
    /// Logarithm to base 10.
    log10: |x, y| (x * std::f64::consts::LN_10).recip();
    /// Sine.
    sin: |x, y| x.cos();
    /// Cosine.
    cos: |x, y| -x.sin();
    /// Tangent.
    tan: |x, y| 1.0 + y * y;
    /// Arcsine.
    asin: |x, y| (1.0 - x * x).sqrt().recip();
    /// Arccosine.
    acos: |x, y| -(1.0 - x * x).sqrt().recip();
    /// Arctangent.
    atan: |x, y| (1.0 + x * x).recip();
    /// Hyperbolic sine.
    sinh: |x, y| x.cosh();
    /// Hyperbolic cosine.
    cosh: |x, y| x.sinh();
    /// Hyperbolic tangent.
    tanh: |x, y| 1.0 - y * y;
    /// Inverse hyperbolic sine.
    asinh: |x, y| (1.0 + x * x).sqrt().recip();
}

/// A variable of the given value whose derivative with respect to itself sits in `lane`.
#[must_use]
#[inline]
pub fn variable(value: f64, lane: usize) -> Dual {
    Dual::variable(value, lane)
}

/// The derivative in `lane`; zero where the number does not depend on it.
#[must_use]
#[inline]
pub fn derivative(dual: &Dual, lane: usize) -> f64 {
    dual.lanes()[lane]
}

/// Largest argument for the series of [`exp`]: its first missing term, x^8/8!, is 7e-17 there.
const SERIES_MAX: f64 = 0.036;

/// e^x to double precision; by its series where a step changes little, which is several times
/// faster than a general exponential.
#[inline]
#[must_use]
pub fn exp<S: Real>(x: S) -> S {
    let re = x.re();
    let value = if re.abs() > SERIES_MAX { re.exp() } else { series(re) };
    x.chain(value, value)
}

/// The first eight terms, in pairs: sums that do not wait for one another.
#[inline]
fn series(x: f64) -> f64 {
    let square = x * x;
    let low = (1.0 + x) + square * (1.0 / 2.0 + x * (1.0 / 6.0));
    let high = (1.0 / 24.0 + x * (1.0 / 120.0)) + square * (1.0 / 720.0 + x * (1.0 / 5040.0));
    low + square * square * high
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
