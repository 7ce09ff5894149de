//! Rows and derivatives in units of independent noise: what a linear refit works with.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::frame::Frame;
use super::noise::Filter;

/// The rows through one kind of noise.
#[derive(Debug, Clone)]
pub(super) struct Lens {
    /// One filter per segment.
    pub(super) filters: Vec<Filter>,
    /// Derivatives of the predictions: one row per unknown, one column per judged row.
    pub(super) design: DMatrix<f64>,
    /// Observed minus predicted.
    pub(super) whitened: DVector<f64>,
    /// Information about the unknowns, with what is known of the rough numbers.
    pub(super) normal: DMatrix<f64>,
    /// Half the fall of the cost along each unknown.
    pub(super) pull: DVector<f64>,
    /// Twice the negative log-likelihood, with what is known of the rough numbers.
    pub(super) cost: f64,
}

impl Lens {
    /// Of derivatives by some unknowns (see [`Frame::linearise`]) and residuals at `x`.
    pub(super) fn new(frame: &Frame, x: &[f64], by: &[usize], slopes: &DMatrix<f64>, residual: &[f64], filters: Vec<Filter>) -> Lens {
        let design = whiten_all(frame, &filters, slopes.clone());
        let mut whitened = residual.to_vec();
        whiten(frame, &filters, &mut whitened);
        let whitened = DVector::from_vec(whitened);
        let (mut normal, mut pull) = (square(&design), &design * &whitened);
        let mut cost = filters.iter().map(|filter| filter.log_variance).sum::<f64>() + whitened.norm_squared();
        for (place, &unknown) in by.iter().enumerate() {
            let Some(sigma) = sigma(frame, unknown) else { continue };
            normal[(place, place)] += sigma.powi(-2);
            pull[place] -= x[unknown] * sigma.powi(-2);
            cost += (x[unknown] / sigma).powi(2);
        }
        Lens { filters, design, whitened, normal, pull, cost }
    }
}

/// The deviation of an unknown that is only roughly known.
pub(super) fn sigma(frame: &Frame, unknown: usize) -> Option<f64> {
    unknown.checked_sub(frame.free.len()).map(|place| frame.known[place].sigma)
}

/// Turns a value per judged row into innovations.
pub(super) fn whiten(frame: &Frame, filters: &[Filter], rows: &mut [f64]) {
    for (segment, filter) in frame.evidence.segments.iter().zip(filters) {
        filter.apply(&mut rows[segment.range()]);
    }
}

/// The same for one column of a matrix per judged row.
pub(super) fn whiten_all(frame: &Frame, filters: &[Filter], mut slopes: DMatrix<f64>) -> DMatrix<f64> {
    let height = slopes.nrows();
    if height > 0 {
        for (segment, filter) in frame.evidence.segments.iter().zip(filters) {
            let range = segment.range();
            filter.apply_to_all(&mut slopes.as_mut_slice()[range.start * height..range.end * height], height);
        }
    }
    slopes
}

/// A matrix times its transpose: of what lies beside the diagonal, a part is the mirror image of another.
pub(super) fn square(rows: &DMatrix<f64>) -> DMatrix<f64> {
    let (size, half) = (rows.nrows(), rows.nrows() / 2);
    let mut sum = DMatrix::zeros(size, size);
    for begin in (0..rows.ncols()).step_by(COLUMNS) {
        let part = rows.columns(begin, COLUMNS.min(rows.ncols() - begin));
        let turned = part.transpose();
        sum.view_mut((0, 0), (half, half)).gemm(1.0, &part.rows(0, half), &turned.columns(0, half), 1.0);
        sum.view_mut((half, 0), (size - half, size)).gemm(1.0, &part.rows(half, size - half), &turned, 1.0);
    }
    let mirrored = sum.view((half, 0), (size - half, half)).transpose();
    sum.view_mut((0, half), (half, size - half)).copy_from(&mirrored);
    sum
}

/// Columns that fit a processor's near cache, where one of two factors lies transposed meanwhile.
const COLUMNS: usize = 128;

/// A matrix times the transpose of another.
pub(super) fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    product_all(a, std::slice::from_ref(b))
}

/// A matrix times the transposes of several others, side by side.
pub(super) fn product_all(a: &DMatrix<f64>, others: &[DMatrix<f64>]) -> DMatrix<f64> {
    let width = others.iter().map(DMatrix::nrows).sum();
    let mut sum = DMatrix::zeros(a.nrows(), width);
    let mut turned = DMatrix::zeros(COLUMNS, width);
    for begin in (0..a.ncols()).step_by(COLUMNS) {
        let count = COLUMNS.min(a.ncols() - begin);
        let mut place = 0;
        for other in others {
            other.columns(begin, count).transpose_to(&mut turned.view_mut((0, place), (count, other.nrows())));
            place += other.nrows();
        }
        sum.gemm(1.0, &a.columns(begin, count), &turned.rows(0, count), 1.0);
    }
    sum
}

/// What a linear refit of the base can absorb.
#[derive(Debug, Clone)]
pub(super) struct Absorber {
    factor: Option<Cholesky<f64, Dyn>>,
    /// Unknowns that rest on a bound and can absorb no more.
    held: Vec<usize>,
    /// Change of the unknowns in a refit of the base alone.
    pub(super) change: DVector<f64>,
    /// What is left of the residuals after it.
    pub(super) left: DVector<f64>,
}

impl Absorber {
    pub(super) fn new(lens: &Lens, held: Vec<usize>) -> Absorber {
        let mut normal = lens.normal.clone();
        for &index in &held {
            normal.row_mut(index).fill(0.0);
            normal.column_mut(index).fill(0.0);
            normal[(index, index)] = 1.0;
        }
        let largest = normal.diagonal().iter().fold(0.0_f64, |largest, d| largest.max(*d));
        for index in 0..normal.nrows() {
            normal[(index, index)] += 1e-11 * normal[(index, index)] + 1e-15 * largest + f64::MIN_POSITIVE;
        }
        let factor = if normal.is_empty() { None } else { normal.cholesky() };
        let mut absorber = Absorber { factor, held, change: DVector::zeros(0), left: lens.whitened.clone() };
        absorber.change = absorber.solve(lens.pull.clone());
        absorber.left -= lens.design.tr_mul(&absorber.change);
        absorber
    }

    /// The unknowns' change that answers a pull on them.
    pub(super) fn solve(&self, mut pull: DVector<f64>) -> DVector<f64> {
        self.held.iter().for_each(|&index| pull[index] = 0.0);
        match &self.factor {
            Some(factor) => factor.solve(&pull),
            None => DVector::zeros(pull.len()),
        }
    }

    /// Pulls in units in which their inner product is what is absorbed of one by the other.
    pub(super) fn absorbed(&self, mut pulls: DMatrix<f64>) -> DMatrix<f64> {
        self.held.iter().for_each(|&index| pulls.row_mut(index).fill(0.0));
        match &self.factor {
            Some(factor) => factor.l_dirty().solve_lower_triangular(&pulls).unwrap_or(pulls),
            None => DMatrix::zeros(0, pulls.ncols()),
        }
    }
}
