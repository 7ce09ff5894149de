//! What the points show at the end of a window, and how far a straight line through them is wrong.
//!
//! The filter takes the voltage for a straight line over what it is unsure of. What bends besides
//! is an error, and one that lasts: as long as the pack is where it was, every window is wrong in
//! the same way. Taken for fresh noise it would be averaged away, and the filter would learn the
//! state of charge out of nothing from a long look at one place. An error with the correlation k from
//! one window to the next weighs like noise of (1 + k) / (1 - k) times its variance.

use nalgebra::DVector;

use super::{Gathered, MODEL_V, Point, REACH, SigmaPoint};
use crate::Channel;
use crate::ocv_error::{self, SPACING};

/// Most windows that are taken to be wrong in the same way: an hour (guess: a rest or a drive, 0.3
/// to 3 hours).
const ALIKE_MAX: u32 = 30;

/// The observation of a window.
pub(super) struct Shown {
    /// What one deviation of each column of the factor adds to the voltage of a cell, V.
    pub(super) slopes: DVector<f64>,
    /// How far the voltage lies above what was expected, V.
    pub(super) innovation_v: f64,
    /// Variance of what no column explains, V².
    pub(super) noise_v2: f64,
}

impl Shown {
    /// Variance that the innovation is expected to have, V².
    pub(super) fn expected_v2(&self) -> f64 {
        self.slopes.norm_squared() + self.noise_v2
    }

    /// Size of the innovation in deviations.
    pub(super) fn surprise(&self) -> f64 {
        self.innovation_v.abs() / self.expected_v2().sqrt()
    }
}

impl SigmaPoint {
    /// Reads the points against the window that has been gathered.
    pub(super) fn shown(&self) -> Shown {
        let Gathered { samples, cell_v, moved, .. } = self.gathered;
        let of_point = |point: &Point| point.shown_v / samples + self.line_v(&point.state, point.soc / samples);
        let middle_v = of_point(&self.points[0]);
        let middle_soc = self.points[0].soc / samples;
        let mut slopes = DVector::zeros(self.layout.len);
        let (mut mean_v, mut bend_v2) = (middle_v, 0.0);
        for column in 0..self.layout.len {
            if column < self.layout.followed() {
                let (above_v, below_v) = (of_point(&self.points[1 + 2 * column]), of_point(&self.points[2 + 2 * column]));
                // The square term of the voltage over this column, in deviations.
                let square_v = (above_v + below_v - 2.0 * middle_v) / (2.0 * REACH * REACH);
                slopes[column] = (above_v - below_v) / (2.0 * REACH);
                mean_v += square_v;
                bend_v2 += (REACH * REACH - 1.0) * square_v * square_v;
            } else {
                slopes[column] = self.line_v(&self.factor.column(column).into_owned(), middle_soc);
            }
        }
        // Two unsure things multiplied: how steep the OCV table's error is, and where on it the pack is.
        let steepness = self.steepness(middle_soc);
        let steepness_with_soc = self.factor.row(0).transpose().dot(&steepness);
        mean_v += steepness_with_soc;
        bend_v2 += self.p[(0, 0)] * steepness.norm_squared() + steepness_with_soc * steepness_with_soc;

        let kept = (-moved / self.p[(0, 0)].sqrt()).exp();
        let alike = f64::from(2 * self.windows.min(ALIKE_MAX)).min((1.0 + kept) / (1.0 - kept)).max(1.0);
        let floor_v = self.model.sensor(Channel::VoltageV).floor() / f64::from(self.model.battery().series);
        let noise_v2 = floor_v * floor_v / samples + MODEL_V * MODEL_V + alike * bend_v2;
        Shown { slopes, innovation_v: cell_v / samples - mean_v, noise_v2 }
    }

    /// What the resistance left out and the errors of sensor and table add to the voltage of a
    /// point at a state of charge, V.
    fn line_v(&self, state: &DVector<f64>, soc: f64) -> f64 {
        let layout = &self.layout;
        let (knot, share) = ocv_error::weights(soc);
        let at = layout.ocv + knot;
        let left_out_v = state[layout.resistance] * self.gathered.resisted_a / self.gathered.samples;
        state[layout.voltage_offset] + state[layout.fine] + (1.0 - share) * state[at] + share * state[at + 1] - left_out_v
    }

    /// How much each column of the factor adds to the steepness of the OCV table's error, V per full
    /// charge.
    fn steepness(&self, soc: f64) -> DVector<f64> {
        let at = self.layout.ocv + ocv_error::weights(soc).0;
        ((self.factor.row(at + 1) - self.factor.row(at)) / SPACING).transpose()
    }
}
