//! Dual numbers: a value and its exact first derivatives by a few variables, moved along by the
//! rules of differentiation (forward mode).

use std::cmp::Ordering;
use std::iter::Sum;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use wide::f64x2;

/// f64 with twice `PAIRS` exact first derivatives. Compares by its value.
///
/// There are always all derivatives, with zeros for what the number does not depend on: no branch
/// asks for them. They lie in pairs that a processor works on at once; left to itself, the compiler
/// makes pairs across lanes and value, and spends its time on shuffling them. The value comes last
/// and the number ends with it: a copy then reads what was written in the same pieces, which a
/// processor need not wait for.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Derived<const PAIRS: usize> {
    eps: [Pair; PAIRS],
    /// Value.
    pub re: f64,
}

type Pair = [f64; 2];

impl<const PAIRS: usize> Derived<PAIRS> {
    /// How many derivatives it carries.
    pub const LANES: usize = 2 * PAIRS;

    /// A variable of the given value whose derivative with respect to itself sits in `lane`.
    #[must_use]
    #[inline]
    pub fn variable(value: f64, lane: usize) -> Self {
        let mut number = Self::from(value);
        number.eps.as_flattened_mut()[lane] = 1.0;
        number
    }

    /// The derivatives by the variable of each lane; zero where it does not depend on that.
    #[must_use]
    #[inline(always)]
    pub fn lanes(&self) -> &[f64] {
        self.eps.as_flattened()
    }

    /// The value and slope of a function of this number.
    #[inline(always)]
    pub(super) fn along(&self, value: f64, slope: f64) -> Self {
        if slope.is_finite() {
            return self.scaled(value, slope);
        }
        // What does not move has no derivative, also where the function is infinitely steep: the
        // square root of a constant zero.
        let steep = |eps: f64| if eps == 0.0 { 0.0 } else { eps * slope };
        Self { re: value, eps: self.eps.map(|pair| pair.map(steep)) }
    }

    #[inline(always)]
    fn scaled(&self, re: f64, factor: f64) -> Self {
        let factor = f64x2::splat(factor);
        Self { re, eps: self.eps.map(|eps| (f64x2::new(eps) * factor).to_array()) }
    }

    #[inline(always)]
    fn with(self, other: Self, re: f64, rule: impl Fn(f64x2, f64x2) -> f64x2) -> Self {
        let pair = |pair: usize| rule(f64x2::new(self.eps[pair]), f64x2::new(other.eps[pair])).to_array();
        Self { re, eps: std::array::from_fn(pair) }
    }
}

impl<const PAIRS: usize> From<f64> for Derived<PAIRS> {
    #[inline(always)]
    fn from(re: f64) -> Self {
        Self { re, eps: [[0.0; 2]; PAIRS] }
    }
}

impl<const PAIRS: usize> Neg for Derived<PAIRS> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.scaled(-self.re, -1.0)
    }
}

impl<const PAIRS: usize> Add for Derived<PAIRS> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, self.re + other.re, |a, b| a + b)
    }
}

impl<const PAIRS: usize> Sub for Derived<PAIRS> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, self.re - other.re, |a, b| a - b)
    }
}

impl<const PAIRS: usize> Mul for Derived<PAIRS> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl, reason = "the rule for products is a sum")]
    fn mul(self, other: Self) -> Self {
        let (x, y) = (f64x2::splat(self.re), f64x2::splat(other.re));
        self.with(other, self.re * other.re, |a, b| a * y + b * x)
    }
}

impl<const PAIRS: usize> Div for Derived<PAIRS> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl, reason = "so is the rule for quotients")]
    fn div(self, other: Self) -> Self {
        let re = self.re / other.re;
        let (quotient, inverse) = (f64x2::splat(re), f64x2::splat(other.re.recip()));
        self.with(other, re, |a, b| (a - b * quotient) * inverse)
    }
}

impl<const PAIRS: usize> Add<f64> for Derived<PAIRS> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: f64) -> Self {
        Self { re: self.re + other, eps: self.eps }
    }
}

impl<const PAIRS: usize> Sub<f64> for Derived<PAIRS> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: f64) -> Self {
        Self { re: self.re - other, eps: self.eps }
    }
}

impl<const PAIRS: usize> Mul<f64> for Derived<PAIRS> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self.scaled(self.re * other, other)
    }
}

impl<const PAIRS: usize> Div<f64> for Derived<PAIRS> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: f64) -> Self {
        self.scaled(self.re / other, other.recip())
    }
}

macro_rules! assign {
    ($($assign:ident::$assigned:ident = $operation:ident::$method:ident,)*) => {$(
        impl<T, const PAIRS: usize> $assign<T> for Derived<PAIRS>
        where
            Self: $operation<T, Output = Self>,
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

impl<const PAIRS: usize> Sum for Derived<PAIRS> {
    fn sum<I: Iterator<Item = Self>>(numbers: I) -> Self {
        numbers.fold(Self::from(0.0), |sum, number| sum + number)
    }
}

impl<const PAIRS: usize> PartialEq for Derived<PAIRS> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.re == other.re
    }
}

impl<const PAIRS: usize> PartialOrd for Derived<PAIRS> {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.re.partial_cmp(&other.re)
    }
}

impl<const PAIRS: usize> PartialEq<f64> for Derived<PAIRS> {
    #[inline(always)]
    fn eq(&self, other: &f64) -> bool {
        self.re == *other
    }
}

impl<const PAIRS: usize> PartialOrd<f64> for Derived<PAIRS> {
    #[inline(always)]
    fn partial_cmp(&self, other: &f64) -> Option<Ordering> {
        self.re.partial_cmp(other)
    }
}
