//! What is seen of onsets through one kind of noise.

use nalgebra::{DMatrix, DVector};

use crate::infer::candidate::acts_through_others;
use crate::infer::lens::{Absorber, Lens, product_all, square, whiten_all};
use crate::infer::state::State;

/// An own parameter that has a null.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    /// Where it does nothing.
    pub(super) null: f64,
    /// Reach below and above that.
    pub(super) low: f64,
    pub(super) high: f64,
    /// Its usual size, from there.
    pub(super) usual: f64,
    /// Whether it refines the effect.
    pub(super) refines: bool,
}

/// The rows through one kind of noise, and what a refit leaves of them.
pub(super) struct View {
    pub(super) lens: Lens,
    pub(super) base: Absorber,
}

impl View {
    pub(super) fn new(state: &State, lens: Lens) -> View {
        View { base: Absorber::new(&lens, state.held()), lens }
    }
}

/// An onset of a candidate: what it adds to the rows, one row of the matrix for each of its own
/// parameters that have a null.
pub(super) struct Onset {
    pub(super) at: Vec<f64>,
    pub(super) slopes: DMatrix<f64>,
}

/// What one view says of one onset.
pub(super) struct Look {
    pub(super) statistic: f64,
    pub(super) freedom: usize,
    /// Change of each of the onset's own parameters; of those, as the view has it.
    pub(super) change: Vec<f64>,
    pub(super) free: DVector<f64>,
    pub(super) uniqueness: f64,
    /// The onset's rows through the view's noise, and how they pull on the base's unknowns.
    pub(super) seen: DMatrix<f64>,
    pub(super) cross: DMatrix<f64>,
}

impl View {
    /// What is seen of each onset; none where nothing is. How all of them pull on the base's unknowns is one product: the base's
    /// design is far larger than any of them and gone through once.
    pub(super) fn looks<'a>(&self, state: &State, onsets: impl Iterator<Item = (&'a Onset, &'a [Side])>) -> Vec<Option<Look>> {
        let (onsets, sides): (Vec<&Onset>, Vec<&[Side]>) = onsets.unzip();
        let through = |onset: &&Onset| whiten_all(&state.frame, &self.lens.filters, onset.slopes.clone());
        let seen: Vec<DMatrix<f64>> = onsets.iter().map(through).collect();
        let crosses = product_all(&self.lens.design, &seen);
        let mut first = 0;
        let look = |(seen, sides): (DMatrix<f64>, &[Side])| {
            let cross = crosses.columns(first, seen.nrows()).into_owned();
            first += seen.nrows();
            self.look(seen, cross, sides)
        };
        seen.into_iter().zip(sides).map(look).collect()
    }

    fn look(&self, seen: DMatrix<f64>, cross: DMatrix<f64>, sides: &[Side]) -> Option<Look> {
        let base = &self.base;
        let whole = square(&seen);
        let absorbed = base.absorbed(cross.clone());
        let unique = &whole - absorbed.tr_mul(&absorbed);
        let right = &seen * &base.left;
        // Directions that the base absorbs to the last digits are not there.
        let count = whole.nrows();
        let quiet = acts_through_others((0..count).map(|c| (sides[c].refines, whole[(c, c)] * sides[c].usual.powi(2))));
        let mut active: Vec<usize> = (0..count).filter(|&c| unique[(c, c)] > 1e-8 * whole[(c, c)] && !quiet[c]).collect();
        loop {
            if active.is_empty() {
                return None;
            }
            let (change, freedom) = least(&unique, &right, &active);
            // A size on the wrong side of null is not an effect.
            let wrong = |&place: &usize| {
                let Side { low, high, .. } = sides[active[place]];
                (change[place] < 0.0 && low >= 0.0) || (change[place] > 0.0 && high <= 0.0)
            };
            let worst = (0..active.len()).filter(wrong).max_by(|&a, &b| {
                let size = |place: usize| change[place].abs() * unique[(active[place], active[place])].sqrt();
                size(a).total_cmp(&size(b))
            });
            if let Some(place) = worst {
                active.remove(place);
                continue;
            }
            let (mut all, mut free) = (vec![0.0; count], DVector::zeros(count));
            for (&place, &change) in active.iter().zip(&change) {
                let Side { low, high, .. } = sides[place];
                all[place] = change.clamp(low, high);
                free[place] = change;
            }
            let (statistic, left, size) = (right.dot(&free), (&unique * &free).dot(&free), (&whole * &free).dot(&free));
            let uniqueness = (left.max(0.0) / size.max(f64::MIN_POSITIVE)).sqrt().min(1.0);
            return Some(Look { statistic, freedom, change: all, free, uniqueness, seen, cross });
        }
    }
}

/// Sizes of the active parameters that explain most, without directions that they hardly have, and
/// how many directions they do have.
fn least(unique: &DMatrix<f64>, right: &DVector<f64>, active: &[usize]) -> (Vec<f64>, usize) {
    let scale: Vec<f64> = active.iter().map(|&place| unique[(place, place)].sqrt()).collect();
    let gram = DMatrix::from_fn(active.len(), active.len(), |i, j| unique[(active[i], active[j])] / (scale[i] * scale[j]));
    let right = DVector::from_fn(active.len(), |i, _| right[active[i]] / scale[i]);
    let eigen = gram.symmetric_eigen();
    let mut change = DVector::zeros(active.len());
    let mut freedom = 0;
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > 1e-6 {
            change += vector * (vector.dot(&right) / value);
            freedom += 1;
        }
    }
    (change.iter().zip(&scale).map(|(change, scale)| change / scale).collect(), freedom)
}
