//! Dual numbers: a value and its exact first derivatives by [`LANES`] variables, moved along by the
//! rules of differentiation (forward mode).

use std::cmp::Ordering;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use wide::f64x2;

use super::LANES;

/// f64 with [`LANES`] exact first derivatives. Compares by its value.
///
/// There are always all derivatives, with zeros for what the number does not depend on: no branch
/// asks for them. They lie in pairs that a processor works on at once; left to itself, the compiler
/// makes pairs across lanes and value, and spends its time on shuffling them. The value comes last
/// and the number ends with it: a copy then reads what was written in the same pieces, which a
/// processor need not wait for.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Dual {
    eps: [Pair; LANES / 2],
    /// Value.
    pub re: f64,
}

type Pair = [f64; 2];

impl Dual {
    /// The derivatives by the variable of each lane.
    #[inline]
    pub(super) fn lanes(&self) -> [f64; LANES] {
        std::array::from_fn(|lane| self.eps[lane / 2][lane % 2])
    }

    /// A number of these derivatives.
    #[inline]
    pub(super) fn from_lanes(re: f64, lanes: [f64; LANES]) -> Dual {
        Dual { re, eps: std::array::from_fn(|pair| [lanes[2 * pair], lanes[2 * pair + 1]]) }
    }

    /// The value and slope of a function of this number.
    #[inline(always)]
    pub(super) fn along(&self, value: f64, slope: f64) -> Dual {
        if slope.is_finite() {
            return self.scaled(value, slope);
        }
        // What does not move has no derivative, also where the function is infinitely steep: the
        // square root of a constant zero.
        Dual::from_lanes(value, self.lanes().map(|eps| if eps == 0.0 { 0.0 } else { eps * slope }))
    }

    #[inline(always)]
    fn scaled(&self, re: f64, factor: f64) -> Dual {
        let factor = f64x2::splat(factor);
        Dual { re, eps: self.eps.map(|eps| (f64x2::new(eps) * factor).to_array()) }
    }

    #[inline(always)]
    fn with(self, other: Dual, re: f64, rule: impl Fn(f64x2, f64x2) -> f64x2) -> Dual {
        let pair = |pair: usize| rule(f64x2::new(self.eps[pair]), f64x2::new(other.eps[pair])).to_array();
        Dual { re, eps: std::array::from_fn(pair) }
    }
}

impl From<f64> for Dual {
    #[inline(always)]
    fn from(re: f64) -> Self {
        Self { re, eps: [[0.0; 2]; LANES / 2] }
    }
}

impl Neg for Dual {
    type Output = Dual;
    #[inline(always)]
    fn neg(self) -> Dual {
        self.scaled(-self.re, -1.0)
    }
}

impl Add for Dual {
    type Output = Dual;
    #[inline(always)]
    fn add(self, other: Dual) -> Dual {
        self.with(other, self.re + other.re, |a, b| a + b)
    }
}

impl Sub for Dual {
    type Output = Dual;
    #[inline(always)]
    fn sub(self, other: Dual) -> Dual {
        self.with(other, self.re - other.re, |a, b| a - b)
    }
}

impl Mul for Dual {
    type Output = Dual;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl, reason = "the rule for products is a sum")]
    fn mul(self, other: Dual) -> Dual {
        let (x, y) = (f64x2::splat(self.re), f64x2::splat(other.re));
        self.with(other, self.re * other.re, |a, b| a * y + b * x)
    }
}

impl Div for Dual {
    type Output = Dual;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl, reason = "so is the rule for quotients")]
    fn div(self, other: Dual) -> Dual {
        let re = self.re / other.re;
        let (quotient, inverse) = (f64x2::splat(re), f64x2::splat(other.re.recip()));
        self.with(other, re, |a, b| (a - b * quotient) * inverse)
    }
}

impl Add<f64> for Dual {
    type Output = Dual;
    #[inline(always)]
    fn add(self, other: f64) -> Dual {
        Dual { re: self.re + other, eps: self.eps }
    }
}

impl Sub<f64> for Dual {
    type Output = Dual;
    #[inline(always)]
    fn sub(self, other: f64) -> Dual {
        Dual { re: self.re - other, eps: self.eps }
    }
}

impl Mul<f64> for Dual {
    type Output = Dual;
    #[inline(always)]
    fn mul(self, other: f64) -> Dual {
        self.scaled(self.re * other, other)
    }
}

impl Div<f64> for Dual {
    type Output = Dual;
    #[inline(always)]
    fn div(self, other: f64) -> Dual {
        self.scaled(self.re / other, other.recip())
    }
}

macro_rules! assign {
    ($($assign:ident::$assigned:ident = $operation:ident::$method:ident,)*) => {$(
        impl<T> $assign<T> for Dual
        where
            Dual: $operation<T, Output = Dual>,
        {
            #[inline(always)]
            fn $assigned(&mut self, other: T) {
                *self = $operation::$method(*self, other);
            }
        }
    )*};
}

assign! {
    AddAssign::add_assign = Add::add,
    SubAssign::sub_assign = Sub::sub,
    MulAssign::mul_assign = Mul::mul,
    DivAssign::div_assign = Div::div,
}

impl Sum for Dual {
    fn sum<I: Iterator<Item = Dual>>(numbers: I) -> Dual {
        numbers.fold(Dual::from(0.0), |sum, number| sum + number)
    }
}

impl PartialEq for Dual {
    #[inline(always)]
    fn eq(&self, other: &Dual) -> bool {
        self.re == other.re
    }
}

impl PartialOrd for Dual {
    #[inline(always)]
    fn partial_cmp(&self, other: &Dual) -> Option<Ordering> {
        self.re.partial_cmp(&other.re)
    }
}

impl PartialEq<f64> for Dual {
    #[inline(always)]
    fn eq(&self, other: &f64) -> bool {
        self.re == *other
    }
}

impl PartialOrd<f64> for Dual {
    #[inline(always)]
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.re.partial_cmp(other)
    }
}
