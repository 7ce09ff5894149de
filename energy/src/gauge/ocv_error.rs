//! What is wrong with an OCV table: a smooth error over state of charge.
//!
//! A table's error is not noise: it is the same each time that a state of charge is seen, and
//! nearly the same at a state of charge near by. It is written as the values e_k at knots, linear
//! between them, with the covariance `s² (1 + √3 d/l) exp(-√3 d/l)` (Matern 3/2) over a distance
//! of d in SoC. s is the model's `ocv_sigma_v`; l = 0.15 is a guess (0.05 to 0.5): tables err
//! where electrode stages begin and end, which lie some 0.1 to 0.3 apart.

/// How many knots: one each 0.1 of SoC.
pub(crate) const KNOTS: usize = 11;
/// Correlation length over SoC; see the module's text.
const LENGTH: f64 = 0.15;

/// The knot below `soc` and the share of the one above it.
#[inline]
pub(crate) fn weights(soc: f64) -> (usize, f64) {
    let position = soc.clamp(0.0, 1.0) * (KNOTS - 1) as f64;
    let low = (position as usize).min(KNOTS - 2);
    (low, position - low as f64)
}

/// Covariance of the errors at two knots, V².
pub(crate) fn covariance(sigma_v: f64, one: usize, other: usize) -> f64 {
    let like = |distance: f64| {
        let reach = 3f64.sqrt() * distance / LENGTH;
        (1.0 + reach) * (-reach).exp()
    };
    let spacing = 1.0 / (KNOTS - 1) as f64;
    // Between knots a line varies less than the error does; on average over a stretch it shall
    // vary as much: the mean of (1-w)² + w² + 2 w (1-w) c is (2 + c) / 3.
    let whole = (2.0 + like(spacing)) / 3.0;
    sigma_v * sigma_v * like(one.abs_diff(other) as f64 * spacing) / whole
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_states_of_charge_share_their_error_and_far_ones_do_not() {
        let own = covariance(3e-3, 4, 4);
        assert!((9e-6..11e-6).contains(&own));
        assert!(covariance(3e-3, 4, 5) > 0.6 * own && covariance(3e-3, 0, 10) < 1e-3 * own);
    }

    #[test]
    fn weights_find_the_knots_on_either_side() {
        let close = |(low, share): (usize, f64), (knot, expected): (usize, f64)| low == knot && (share - expected).abs() < 1e-12;
        assert!(close(weights(0.25), (2, 0.5)) && close(weights(1.0), (9, 1.0)) && close(weights(-0.1), (0, 0.0)));
    }
}
