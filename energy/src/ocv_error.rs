//! What is wrong with an OCV table: a smooth error over state of charge.
//!
//! A table's error is not noise: it is the same each time that a state of charge is seen, and
//! nearly the same at a state of charge near by. It is written as the values e_k at knots, linear
//! between them, with the covariance `s² (1 + √3 d/l) exp(-√3 d/l)` (Matern 3/2) over a distance
//! of d in SoC. s is the model's `ocv_sigma_v`, l its `ocv_length_soc`.

use nalgebra::{DMatrix, SymmetricEigen};

use crate::{OcvTable, Uncertainty};

/// How many knots: one each 0.05 of SoC.
pub(crate) const KNOTS: usize = 21;
/// Distance of two knots.
pub(crate) const SPACING: f64 = 1.0 / (KNOTS - 1) as f64;

/// The knot below `soc` and the share of the one above it.
#[inline]
pub(crate) fn weights(soc: f64) -> (usize, f64) {
    let position = soc.clamp(0.0, 1.0) * (KNOTS - 1) as f64;
    let low = (position as usize).min(KNOTS - 2);
    (low, position - low as f64)
}

/// Correlation of the errors at two states of charge.
fn like(distance: f64, length: f64) -> f64 {
    let reach = 3f64.sqrt() * distance / length;
    (1.0 + reach) * (-reach).exp()
}

/// Covariance of the errors at two knots, V².
pub(crate) fn covariance(known: &Uncertainty, one: usize, other: usize) -> f64 {
    known.ocv_sigma_v.powi(2) * like(one.abs_diff(other) as f64 * SPACING, known.ocv_length_soc)
}

/// Independent parts of the error that are told apart: with a length of 0.15 they hold 99.6 % and more of its deviation in any energy.
const PARTS: usize = 8;

/// The table as it is where one of the largest independent parts of its error is a deviation above nothing, and as much below; one pair
/// for each part, none where the table is exact. Beyond the knots the error goes on as it is there.
pub(crate) fn tables(table: &OcvTable, known: &Uncertainty) -> Vec<[OcvTable; 2]> {
    if known.ocv_sigma_v <= 0.0 {
        return Vec::new();
    }
    let SymmetricEigen { eigenvectors, eigenvalues } =
        DMatrix::from_fn(KNOTS, KNOTS, |one, other| covariance(known, one, other)).symmetric_eigen();
    let mut order: Vec<usize> = (0..KNOTS).collect();
    order.sort_by(|&one, &other| eigenvalues[other].total_cmp(&eigenvalues[one]));
    let knots = (0..KNOTS).map(|knot| knot as f64 * SPACING);
    let further: Vec<f64> = [-BEYOND].into_iter().chain(knots).chain([1.0 + BEYOND]).collect();
    let moved = |part: usize, side: f64| {
        let at = |knot: usize| side * eigenvalues[part].max(0.0).sqrt() * eigenvectors[(knot, part)];
        table.moved(&further, |soc| {
            let (low, share) = weights(soc);
            (1.0 - share) * at(low) + share * at(low + 1)
        })
    };
    order.into_iter().take(PARTS).map(|part| [moved(part, 1.0), moved(part, -1.0)]).collect()
}

/// How far beyond the knots a table may be asked.
const BEYOND: f64 = 0.1;

/// What the line between two knots leaves out of the error, RMS over the stretch, V.
pub(crate) fn between_v(known: &Uncertainty) -> f64 {
    // At the share w of the way: 1 + (1-w)² + w² + 2 w (1-w) c(d) - 2 (1-w) c(w d) - 2 w c((1-w) d).
    // Simpson's rule over ten stretches.
    const STRETCHES: u32 = 10;
    let c = |share: f64| like(share * SPACING, known.ocv_length_soc);
    let square = |w: f64| {
        let v = 1.0 - w;
        1.0 + v * v + w * w + 2.0 * w * v * c(1.0) - 2.0 * v * c(w) - 2.0 * w * c(v)
    };
    let width = 1.0 / f64::from(STRETCHES);
    let mean: f64 = (0..STRETCHES)
        .map(|i| {
            let low = f64::from(i) * width;
            (square(low) + 4.0 * square(low + width / 2.0) + square(low + width)) / 6.0 * width
        })
        .sum();
    known.ocv_sigma_v * mean.max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_states_of_charge_share_their_error_and_far_ones_do_not() {
        let known = Uncertainty { ocv_sigma_v: 3e-3, ..Uncertainty::default() };
        let own = covariance(&known, 4, 4);
        assert!((own - 9e-6).abs() < 1e-12);
        assert!(covariance(&known, 4, 5) > 0.8 * own && covariance(&known, 0, 20) < 1e-3 * own);
    }

    #[test]
    fn a_line_leaves_less_out_of_an_error_that_changes_slowly() {
        let left_v = |length: f64| between_v(&Uncertainty { ocv_sigma_v: 1.0, ocv_length_soc: length, ..Uncertainty::default() });
        // The same mean square, summed over 99 points by an independent script: 0.079.
        assert!((left_v(0.15) - 0.079).abs() < 5e-4, "{}", left_v(0.15));
        assert!(left_v(1.0) < 0.01);
    }

    #[test]
    fn weights_find_the_knots_on_either_side() {
        let close = |(low, share): (usize, f64), (knot, expected): (usize, f64)| low == knot && (share - expected).abs() < 1e-12;
        assert!(close(weights(0.275), (5, 0.5)) && close(weights(1.0), (19, 1.0)) && close(weights(-0.1), (0, 0.0)));
    }
}
