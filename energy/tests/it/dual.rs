//! Our dual numbers against another implementation's.

use energy::real::{Dual, HalfDual, LANES, Real, derivative, variable};
use nalgebra::{Const, U1};
use num_dual::{Derivative, DualNum, DualSVec64};
use proptest::prelude::*;

type Other = DualSVec64<LANES>;

fn other(value: f64, lane: usize) -> Other {
    Other::new(value, Derivative::derivative_generic(Const::<LANES>, U1, lane))
}

/// Many operations on three numbers, once for every kind of number.
macro_rules! compound {
    ($x:expr, $y:expr, $z:expr) => {{
        let (x, y, z) = ($x, $y, $z);
        let mut sum = x * y / z + (x - y) * 0.7 - z / 3.0 + 1.5;
        sum += x.recip() * y.sqrt();
        sum -= z.ln() * x.exp() + y.powi(3) - z.powf(1.7);
        sum *= (x * 0.3).sin() + (y * 0.2).cos() * (z * 0.1).tan();
        sum /= x + y + z + 2.0;
        sum += (x * 0.1).exp_m1() + y.ln_1p() + z.log10();
        sum -= (x * 0.1).asin() + (y * 0.1).acos() + z.atan();
        sum += x.tanh() + (y - z).asinh() + (x * 0.2).sinh() * (y * 0.2).cosh();
        sum + (-x).powi(0) + z.powi(-2)
    }};
}

proptest! {
    #[test]
    fn derivatives_are_those_of_another_implementation(x in 0.01..5.0_f64, y in 0.01..5.0_f64, z in 0.01..5.0_f64) {
        let ours: Dual = compound!(variable(x, 0), variable(y, 3), variable(z, 7));
        let theirs: Other = compound!(other(x, 0), other(y, 3), other(z, 7));
        let plain: f64 = compound!(x, y, z);
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-11 * (1.0 + a.abs().max(b.abs()));
        prop_assert!(near(ours.re, theirs.re) && near(ours.re, plain), "{} {} {plain}", ours.re, theirs.re);
        let eps = theirs.eps.unwrap_generic(Const::<LANES>, U1);
        for lane in 0..LANES {
            prop_assert!(near(derivative(&ours, lane), eps[lane]), "lane {lane}: {} {}", derivative(&ours, lane), eps[lane]);
        }
        // The narrower number says the same to the last bit.
        let half: HalfDual = compound!(HalfDual::variable(x, 0), HalfDual::variable(y, 1), HalfDual::variable(z, 3));
        prop_assert_eq!((half.re, half.lanes()), (ours.re, &[ours.lanes()[0], ours.lanes()[3], 0.0, ours.lanes()[7]][..]));
    }
}

#[test]
fn the_derivative_of_a_size_without_its_sign_turns_with_the_sign() {
    let (down, up) = (Real::abs(&variable(-2.0, 1)), Real::abs(&variable(2.0, 1)));
    assert_eq!([down.re, derivative(&down, 1), up.re, derivative(&up, 1)], [2.0, -1.0, 2.0, 1.0]);
    let sign = Real::signum(&variable(-2.0, 1));
    assert_eq!([sign.re, derivative(&sign, 1)], [-1.0, 0.0]);
}

#[test]
fn a_constant_has_no_derivative_even_where_a_function_is_infinitely_steep() {
    let root = Real::sqrt(&Dual::from(0.0));
    assert!(root.re == 0.0 && (0..LANES).all(|lane| derivative(&root, lane) == 0.0));
    assert_eq!(derivative(&Real::sqrt(&variable(0.0, 2)), 2), f64::INFINITY);
}
