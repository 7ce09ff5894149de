//! How well a fit determines its parameters, when residuals follow each other.
//!
//! Rows of one log are not independent: what the model gets wrong at one second it gets wrong at
//! the next. With R_l the correlation of the rows of one channel of log l ([`crate::persistence`]), J_l their derivatives, and s_l² their residual variance,
//!
//! `Cov = A⁻¹ (Σ_l s_l² J_lᵀ R_l J_l) A⁻¹`,  `A = Σ_l J_lᵀ J_l`.
//!
//! Where neighbouring rows say all of that correlation rho, R is taken for (1 + rho) / (1 - rho): a log is then worth n (1 - rho) / (1 + rho) rows (an AR(1) process; rho
//! below 0 counts as 0), and at least one.
//!
//! Where noise is all that is left, but rows do not all err alike, and a parameter hangs on those that err more, its deviation is as much larger as
//! those rows bear out (see [`wider`]). What a wrong model leaves of some rows is not what they err by.
//!
//! Residuals below the floor of their sensor, as of a log that was simulated without noise, do not make a number surer than the sensor
//! can show: what lacks to the floor counts as white noise.
//!
//! What the noise of a current adds up to is beside that ([`super::count`]).
//!
//! This holds while residuals are small against the curvature of the model. Parameters at a bound count as
//! free here, which makes the others' sigmas cautious.

use std::ops::Range;

use energy::Channel;
use nalgebra::{DMatrix, DVector};

use super::count::{self, Walk};
use crate::persistence::Persistence;

/// The rows of a fit that come from one channel of one log.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Index of the log.
    pub log: usize,
    /// The channel.
    pub channel: Channel,
    /// Where its rows stand in the fit.
    pub range: Range<usize>,
    /// Row in the log of each of them.
    pub rows: Vec<usize>,
    /// What its sensor cannot show, in the unit of its residuals; 0 where the model does not say.
    pub floor: f64,
}

/// What one channel of one log is worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentCertainty {
    /// Lag-1 autocorrelation of its residuals after the fit.
    pub lag1: f64,
    /// Independent rows that its rows are worth.
    pub effective_rows: f64,
}

/// What a fit is worth.
#[derive(Debug, Clone, PartialEq)]
pub struct Certainty {
    /// Standard deviation of each parameter; none when the logs say no more about it than its
    /// plausible range does.
    pub sigma: Vec<Option<f64>>,
    /// Parameters on which no row depends at all.
    pub silent: Vec<bool>,
    /// Sets of parameters that the rows determine only in combination.
    pub tangled: Vec<Vec<usize>>,
    /// Correlation between parameters; NaN where one has no sigma.
    pub correlation: DMatrix<f64>,
    /// By segment of the fit.
    pub segments: Vec<SegmentCertainty>,
}

/// Eigenvalue of the scaled normal matrix below which a direction is not determined.
const SINGULAR: f64 = 1e-12;

/// Judges a fit from its Jacobian and residuals; `is_noise` says that these are noise, `walks` what the counts of charge err by.
#[must_use]
pub fn certainty(
    jacobian: &DMatrix<f64>,
    residual: &DVector<f64>,
    segments: &[Segment],
    bounds: &[(f64, f64)],
    is_noise: bool,
    walks: &[Walk],
) -> Certainty {
    let n = residual.len() as f64;
    let p = jacobian.ncols();
    let freedom = n / (n - p as f64).max(1.0);
    let mut normal = DMatrix::zeros(p, p);
    let mut middle = DMatrix::zeros(p, p);
    let mut lacks = DMatrix::zeros(p, p);
    let mut worth = Vec::new();
    for segment in segments {
        // What was found of a gap may have left nothing of a log's channel to judge.
        if segment.range.is_empty() {
            worth.push(SegmentCertainty { lag1: 0.0, effective_rows: 0.0 });
            continue;
        }
        let rows = segment.range.len() as f64;
        let part = jacobian.rows(segment.range.start, segment.range.len());
        let own = residual.rows(segment.range.start, segment.range.len());
        let persistence = Persistence::of(&segment.rows, own.as_slice());
        let effective_rows = rows / persistence.rows_per_independent(segment.range.len());
        worth.push(SegmentCertainty { lag1: persistence.lag1, effective_rows });
        let part = part.into_owned();
        let (variance, square) = (own.norm_squared() / rows * freedom, part.tr_mul(&part));
        middle += persistence.spread(&segment.rows, &part) * variance;
        lacks += &square * (segment.floor.powi(2) - variance).max(0.0);
        normal += square;
    }
    let silent: Vec<bool> = (0..p).map(|index| normal[(index, index)] == 0.0).collect();
    let (inverse, tangled) = inverse(&normal);
    let mut covariance = &inverse * middle * &inverse;
    if is_noise || !walks.is_empty() {
        let influence = &inverse * jacobian.transpose();
        if is_noise {
            covariance = covariance_by_rows(covariance, &influence, &off(residual, segments, &worth, freedom));
        }
        covariance += count::covariance(walks, segments, &influence);
    }
    // All rows lack the same: how unlike they err by what is left does not widen this.
    covariance += &inverse * lacks * &inverse;
    let sigma: Vec<Option<f64>> = (0..p)
        .map(|index| {
            let sigma = covariance[(index, index)].max(0.0).sqrt();
            let known = !silent[index] && !tangled.iter().any(|set| set.contains(&index)) && sigma < uniform_sigma(bounds[index]);
            known.then_some(sigma)
        })
        .collect();
    let correlation = DMatrix::from_fn(p, p, |i, j| match (sigma[i], sigma[j]) {
        (Some(_), Some(_)) if i == j => 1.0,
        (Some(a), Some(b)) if a > 0.0 && b > 0.0 => (covariance[(i, j)] / (a * b)).clamp(-1.0, 1.0),
        _ => f64::NAN,
    });
    Certainty { sigma, silent, tangled, correlation, segments: worth }
}

/// Deviations of chance by which rows must be off further than all together.
const CHANCE: f64 = 2.0;

/// How many times as large as the rows' common noise makes it a number's variance is, where they do not all err alike: each row adds a share to it,
/// and is off by so much of the square that is expected of it. What the noise of a speed does to a power grows with the force, and
/// what a charger draws errs while it charges: such rows err more than others, and may be those that a number hangs on (White,
/// Econometrica 48, 1980, p. 817). 1 where they are off no more than chance makes of so few.
pub(crate) fn wider(rows: &[(f64, f64)]) -> f64 {
    let (mut own, mut all, mut squares) = (0.0, 0.0, 0.0);
    for (share, off) in rows {
        own += share * off;
        all += share;
        squares += share * share;
    }
    // What as many rows of the same weight are off by chance.
    let chance = (2.0 * squares).sqrt() / all;
    if own > (1.0 + CHANCE * chance) * all { own / all } else { 1.0 }
}

/// The covariance as rows bear it out; `influence` is what each row moves each parameter by.
fn covariance_by_rows(covariance: DMatrix<f64>, influence: &DMatrix<f64>, off: &[(f64, f64)]) -> DMatrix<f64> {
    let wider = |index: usize| {
        let of_rows = influence.row(index);
        let rows = of_rows.iter().zip(off).map(|(of_row, (variance, off))| (of_row * of_row * variance, *off));
        wider(&rows.collect::<Vec<_>>()).sqrt()
    };
    let wider: Vec<f64> = (0..covariance.nrows()).map(wider).collect();
    DMatrix::from_fn(wider.len(), wider.len(), |i, j| covariance[(i, j)] * wider[i] * wider[j])
}

/// By row: the variance that it counts with, and its square in units of what is expected of it.
fn off(residual: &DVector<f64>, segments: &[Segment], worth: &[SegmentCertainty], freedom: f64) -> Vec<(f64, f64)> {
    let of_segment = |(segment, worth): (&Segment, &SegmentCertainty)| {
        let own = residual.rows(segment.range.start, segment.range.len());
        let rows = own.len() as f64;
        let mean = own.norm_squared() / rows;
        let weight = mean * freedom * rows / worth.effective_rows;
        own.iter().map(|off| (weight, if mean > 0.0 { off * off / mean } else { 1.0 })).collect::<Vec<_>>()
    };
    segments.iter().zip(worth).flat_map(of_segment).collect()
}

/// Standard deviation of a parameter of which nothing but its range is known.
#[must_use]
pub fn uniform_sigma((min, max): (f64, f64)) -> f64 {
    (max - min) / 12f64.sqrt()
}

/// Inverse of a normal matrix without the directions that it does not determine, and the sets of
/// parameters that take part in those together.
pub(super) fn inverse(normal: &DMatrix<f64>) -> (DMatrix<f64>, Vec<Vec<usize>>) {
    let p = normal.nrows();
    let scale: Vec<f64> = (0..p).map(|index| normal[(index, index)].sqrt()).map(|root| if root > 0.0 { root } else { 1.0 }).collect();
    let scaled = DMatrix::from_fn(p, p, |i, j| normal[(i, j)] / (scale[i] * scale[j]));
    let eigen = scaled.symmetric_eigen();
    let mut inverse = DMatrix::zeros(p, p);
    let mut tangled: Vec<Vec<usize>> = Vec::new();
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > SINGULAR {
            inverse += vector * vector.transpose() / *value;
        } else {
            let mut set: Vec<usize> = (0..p).filter(|&index| vector[index].abs() > 0.05 && normal[(index, index)] > 0.0).collect();
            // Several lost directions of one set are one set.
            while let Some(known) = tangled.iter().position(|known| known.iter().any(|index| set.contains(index))) {
                set.extend(tangled.swap_remove(known));
            }
            set.sort_unstable();
            set.dedup();
            if !set.is_empty() {
                tangled.push(set);
            }
        }
    }
    (DMatrix::from_fn(p, p, |i, j| inverse[(i, j)] / (scale[i] * scale[j])), tangled)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDE: (f64, f64) = (-1e3, 1e3);

    fn one_log(rows: usize) -> Vec<Segment> {
        vec![Segment { log: 0, channel: Channel::VoltageV, range: 0..rows, rows: (0..rows).collect(), floor: 0.0 }]
    }

    #[test]
    fn white_residuals_give_the_textbook_sigma_of_a_mean() {
        // Residuals +1, +1, -1, -1, ...: lag 1 is about 0, variance 1, so sigma = 1 / sqrt(n).
        let n = 400;
        let residual = DVector::from_fn(n, |row, _| if row % 4 < 2 { 1.0 } else { -1.0 });
        let certainty = certainty(&DMatrix::from_element(n, 1, -1.0), &residual, &one_log(n), &[WIDE], true, &[]);
        assert!((certainty.sigma[0].unwrap() - 0.05).abs() < 2e-3, "{certainty:?}");
    }

    #[test]
    fn residuals_below_the_floor_of_their_sensor_count_as_it() {
        // A mean of 400 rows, each of which the sensor shows to 2.
        let n = 400;
        let of = |size: f64| {
            let residual = DVector::from_fn(n, |row, _| if row % 4 < 2 { size } else { -size });
            let segments = one_log(n).into_iter().map(|segment| Segment { floor: 2.0, ..segment }).collect::<Vec<_>>();
            certainty(&DMatrix::from_element(n, 1, -1.0), &residual, &segments, &[WIDE], true, &[]).sigma[0].unwrap()
        };
        for size in [0.0, 1e-12, 1.0] {
            assert!((of(size) - 0.1).abs() < 4e-3, "{size}: {}", of(size));
        }
        assert!((of(4.0) - 0.2).abs() < 8e-3, "{}", of(4.0));
    }

    /// The same slope, of residuals that are nothing beside the floor.
    #[test]
    fn what_lacks_to_the_floor_is_not_widened_by_how_unlike_rows_err() {
        let n = 4000;
        let x = |row: usize| (row % 10) as f64;
        let residual = DVector::from_fn(n, |row, _| if row.is_multiple_of(2) { 1e-9 * x(row) } else { -1e-9 * x(row) });
        let jacobian = DMatrix::from_fn(n, 1, |row, _| -x(row));
        let segments = one_log(n).into_iter().map(|segment| Segment { floor: 2.0, ..segment }).collect::<Vec<_>>();
        let sigma = certainty(&jacobian, &residual, &segments, &[WIDE], true, &[]).sigma[0].unwrap();
        let expected = 2.0 / (0..n).map(|row| x(row).powi(2)).sum::<f64>().sqrt();
        assert!((sigma / expected - 1.0).abs() < 1e-3, "{sigma}, {expected}");
    }

    #[test]
    fn a_log_of_which_nothing_is_judged_says_nothing() {
        let n = 100;
        let residual = DVector::from_fn(n, |row, _| if row % 4 < 2 { 1.0 } else { -1.0 });
        let jacobian = DMatrix::from_element(n, 1, -1.0);
        let nothing = Segment { log: 1, channel: Channel::VoltageV, range: n..n, rows: Vec::new(), floor: 0.0 };
        let beside = [one_log(n), vec![nothing]].concat();
        let of = |segments: &[Segment]| certainty(&jacobian, &residual, segments, &[WIDE], true, &[]).sigma;
        assert_eq!(of(&beside), of(&one_log(n)));
    }

    #[test]
    fn residuals_that_follow_each_other_widen_sigma() {
        // Blocks of 20 equal residuals: lag 1 = 0.9, so 400 rows are worth about 20.
        let n = 400;
        let residual = DVector::from_fn(n, |row, _| if (row / 20) % 2 == 0 { 1.0 } else { -1.0 });
        let certainty = certainty(&DMatrix::from_element(n, 1, -1.0), &residual, &one_log(n), &[WIDE], true, &[]);
        assert!((certainty.segments[0].effective_rows - 20.0).abs() < 3.0, "{certainty:?}");
        assert!((certainty.sigma[0].unwrap() - 20f64.powf(-0.5)).abs() < 0.03, "{certainty:?}");
    }

    /// A slope through the origin, y = b x, of rows that err in proportion to x: sigma² = sum x² e² / (sum x²)², and not s² / sum x².
    #[test]
    fn rows_that_err_more_where_a_number_hangs_on_them_widen_its_sigma() {
        let n = 4000;
        let x = |row: usize| (row % 10) as f64;
        // No two that follow each other are alike.
        let sign = |row: usize| if row.is_multiple_of(2) { 1.0 } else { -1.0 };
        let residual = DVector::from_fn(n, |row, _| sign(row) * x(row));
        let jacobian = DMatrix::from_fn(n, 1, |row, _| -x(row));
        let certainty = certainty(&jacobian, &residual, &one_log(n), &[WIDE], true, &[]);
        let sum = |power: i32| (0..n).map(|row| x(row).powi(power)).sum::<f64>();
        let (expected, plain) = (sum(4).sqrt() / sum(2), (sum(2) / n as f64 / sum(2)).sqrt());
        assert!(
            (certainty.sigma[0].unwrap() / expected - 1.0).abs() < 0.02 && expected > 1.3 * plain,
            "{certainty:?}, {expected}, {plain}"
        );
    }

    #[test]
    fn so_few_rows_that_chance_may_have_it_widen_nothing() {
        let rows = |off: f64| [(1.0, off), (1.0, 1.0), (1.0, 1.0)];
        assert_eq!(wider(&rows(3.0)), 1.0);
        assert_eq!(wider(&rows(9.0)), 11.0 / 3.0);
    }

    #[test]
    fn twins_and_parameters_without_effect_have_no_sigma() {
        let n = 100;
        let jacobian = DMatrix::from_fn(n, 4, |row, column| match column {
            0 | 1 => row as f64,
            2 => 0.0,
            _ => 1.0,
        });
        let residual = DVector::from_fn(n, |row, _| if row % 4 < 2 { 1.0 } else { -1.0 });
        let certainty = certainty(&jacobian, &residual, &one_log(n), &[WIDE; 4], true, &[]);
        assert_eq!(certainty.sigma.iter().map(Option::is_some).collect::<Vec<_>>(), [false, false, false, true]);
        assert_eq!(certainty.silent, [false, false, true, false]);
        assert_eq!(certainty.tangled, [[0, 1]]);
    }
}
