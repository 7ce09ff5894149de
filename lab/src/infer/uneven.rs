//! How much less certain numbers are where rows do not all err alike (see [`wider`]), on innovations, of which each is independent of those
//! before. Only where noise is all that is left: what a wrong model leaves of some rows is not what they err by.

use nalgebra::DMatrix;

use super::lens::Lens;
use super::state::State;
use crate::compare::WITHIN;
use crate::fit::wider;

impl State {
    /// Covariance of all unknowns (see [`State::covariance`]) as rows bear it out, and with what the noise of a current adds up to: no
    /// variance is less.
    #[must_use]
    pub fn covariance_by_rows(&self) -> DMatrix<f64> {
        let covariance = self.covariance();
        let evidence = &self.frame.evidence;
        let lens = self.lens(&self.noise);
        let influence = &covariance * &lens.design;
        let of_counts = self.of_counts(&lens, &influence);
        let is_noise = self.rms().iter().all(|&(channel, rms)| rms <= WITHIN * evidence.floor(channel));
        (if is_noise { widened(covariance, &influence, &lens) } else { covariance }) + of_counts
    }
}

/// A covariance as much wider as the rows bear out.
fn widened(covariance: DMatrix<f64>, influence: &DMatrix<f64>, lens: &Lens) -> DMatrix<f64> {
    let wider = |unknown: usize| {
        let rows: Vec<(f64, f64)> =
            influence.row(unknown).iter().zip(&lens.whitened).map(|(of_row, off)| (of_row * of_row, off * off)).collect();
        let of_rows: f64 = rows.iter().map(|(share, _)| share).sum();
        // What was known before is known no less.
        let own = covariance[(unknown, unknown)];
        if of_rows > 0.0 { (1.0 + (wider(&rows) - 1.0) * of_rows / own).sqrt() } else { 1.0 }
    };
    let wider: Vec<f64> = (0..covariance.nrows()).map(wider).collect();
    DMatrix::from_fn(wider.len(), wider.len(), |i, j| covariance[(i, j)] * wider[i] * wider[j])
}
