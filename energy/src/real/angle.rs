//! Sine and cosine of angles as they occur: of slopes, which are asked for at every step.

use super::Real;

/// Largest angle for the polynomials, rad: an eighth of a turn.
const ANGLE_MAX: f64 = std::f64::consts::FRAC_PI_4;

/// Coefficients of x^3, x^5 and so on for the sine, of x^4, x^6 and so on for the cosine, with the least
/// largest error up to [`ANGLE_MAX`]: below 2^-58 (FreeBSD msun, `k_sin.c` and `k_cos.c`, Sun 1993).
const SINE: [f64; 6] = [
    -0.166_666_666_666_666_32,
    0.008_333_333_333_322_49,
    -0.000_198_412_698_298_579_5,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COSINE: [f64; 6] = [
    0.041_666_666_666_666_6,
    -0.001_388_888_888_887_411,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Sine to double precision, several times faster than a general one for angles of up to an eighth of a turn.
#[inline]
#[must_use]
pub fn sin<S: Real>(x: S) -> S {
    let (sine, cosine) = both(x.re());
    x.chain(sine, cosine)
}

/// The cosine likewise.
#[inline]
#[must_use]
pub fn cos<S: Real>(x: S) -> S {
    let (sine, cosine) = both(x.re());
    x.chain(cosine, -sine)
}

/// What is not asked for costs nothing: the function becomes part of whoever calls it.
#[inline(always)]
fn both(x: f64) -> (f64, f64) {
    if x.abs() > ANGLE_MAX { (x.sin(), x.cos()) } else { (sine(x), cosine(x)) }
}

#[inline(always)]
fn sine(x: f64) -> f64 {
    let z = x * x;
    x + x * z * (SINE[0] + z * (SINE[1] + z * (SINE[2] + z * (SINE[3] + z * (SINE[4] + z * SINE[5])))))
}

#[inline(always)]
fn cosine(x: f64) -> f64 {
    let z = x * x;
    let tail = z * z * (COSINE[0] + z * (COSINE[1] + z * (COSINE[2] + z * (COSINE[3] + z * (COSINE[4] + z * COSINE[5])))));
    // What is lost where half the square is taken from one is given back.
    let (half, near) = (0.5 * z, 1.0 - 0.5 * z);
    near + ((1.0 - near - half) + tail)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::{derivative, variable};

    #[test]
    fn the_polynomials_meet_the_general_functions() {
        for step in -1000..=1000 {
            let x = f64::from(step) * 1e-3;
            assert!((sin(x) - x.sin()).abs() <= f64::EPSILON * x.sin().abs(), "{x}");
            assert!((cos(x) - x.cos()).abs() <= f64::EPSILON * x.cos(), "{x}");
            let dual = variable(x, 3);
            assert!((derivative(&sin(dual), 3) - x.cos()).abs() < 3e-16, "{x}");
            assert!((derivative(&cos(dual), 3) + x.sin()).abs() < 3e-16, "{x}");
        }
    }
}
