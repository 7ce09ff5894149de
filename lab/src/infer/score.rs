//! Every absent effect's claim on the residual, without a refit.
//!
//! With the design A (derivatives by all unknowns, in units of independent noise, priors below)
//! and the candidate's own derivatives S at its onset, `M = 1 - A (A'A)^-1 A'` takes away all that
//! a refit of the base model could absorb. Then (Rao's score test; lavaan's modification index)
//!
//! `T = r' M S (S' M S)^-1 S' M r`,  expected change `(S' M S)^-1 S' M r`,
//! uniqueness `sqrt(S' M S / S' S)`, confounding `|Sa' M Sb| / sqrt(Sa' M Sa  Sb' M Sb)`.
//!
//! The design is looked at twice: with the slow noise that the base model leaves, and with the
//! sensor's noise alone. The first asks whether the effect explains more than any slow
//! disturbance could, the second how much of the residual it explains.

use std::sync::Arc;

use energy::EffectSpec;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::candidate::Candidate;
use super::frame::Frame;
use super::noise::Filter;
use super::state::{State, Whitened};

/// One absent effect at its best shape.
#[derive(Debug, Clone)]
pub struct Score {
    /// The effect.
    pub spec: &'static EffectSpec,
    /// T, with the slow noise that the base model leaves.
    pub statistic: f64,
    /// T, with the sensor's noise alone.
    pub explained: f64,
    /// Numbers by which the effect was free to explain.
    pub freedom: usize,
    /// Share of the effect that a refit of the base model cannot absorb, 0..1.
    pub uniqueness: f64,
    /// Where the linear theory expects the effect's parameters.
    pub expected: Vec<f64>,
    /// What it would add to every row after a refit of the base, in units of independent noise.
    direction: DVector<f64>,
}

impl Score {
    /// How alike two effects look to these logs, 0..1.
    #[must_use]
    pub fn confounded(&self, other: &Score) -> f64 {
        let product = self.direction.norm() * other.direction.norm();
        if product > 0.0 { self.direction.dot(&other.direction).abs() / product } else { 0.0 }
    }
}

/// A state, ready to be asked for scores.
pub struct Scoring<'a> {
    state: &'a State,
    slow: Lens,
    white: Lens,
}

/// The rows through one kind of noise.
struct Lens {
    filters: Vec<Filter>,
    design: DMatrix<f64>,
    normal: Option<Cholesky<f64, Dyn>>,
    /// M r.
    left: DVector<f64>,
}

impl Lens {
    fn new(state: &State) -> Lens {
        let mut normal = state.design.tr_mul(&state.design);
        let largest = normal.diagonal().max();
        for index in 0..normal.nrows() {
            normal[(index, index)] += 1e-11 * normal[(index, index)] + 1e-15 * largest + f64::MIN_POSITIVE;
        }
        let mut lens =
            Lens { filters: state.filters(), design: state.design.clone(), normal: normal.cholesky(), left: state.whitened.clone() };
        lens.left = lens.project(&state.whitened);
        lens
    }

    /// M times a column.
    fn project(&self, column: &DVector<f64>) -> DVector<f64> {
        match &self.normal {
            Some(normal) => column - &self.design * normal.solve(&self.design.tr_mul(column)),
            None => column.clone(),
        }
    }
}

/// What one lens says of one onset.
struct Look {
    statistic: f64,
    freedom: usize,
    /// Change of each of the onset's own parameters.
    change: Vec<f64>,
    uniqueness: f64,
    direction: DVector<f64>,
}

impl<'a> Scoring<'a> {
    /// Of this state.
    #[must_use]
    pub fn new(state: &'a State) -> Self {
        let white = State::at(Arc::clone(&state.frame), state.x.clone(), State::white(&state.frame));
        Scoring { state, slow: Lens::new(state), white: Lens::new(&white) }
    }

    /// The best of a candidate's onsets; none when the logs do not excite it.
    #[must_use]
    pub fn score(&self, candidate: &Candidate) -> Option<Score> {
        let mut best: Option<Score> = None;
        for onset in &candidate.onsets {
            let Some(score) = self.onset(candidate, onset) else { continue };
            if best.as_ref().is_none_or(|best| score.explained > best.explained) {
                best = Some(score);
            }
        }
        best
    }

    fn onset(&self, candidate: &Candidate, onset: &[f64]) -> Option<Score> {
        let parameters = candidate.spec.parameters;
        let mut values = candidate.model.values();
        values[candidate.first..candidate.first + onset.len()].copy_from_slice(onset);
        let model = Arc::new(energy::Model::clone(&candidate.model).with_values(&values));
        let frame = Frame::new(model, Arc::clone(&self.state.frame.evidence));
        let mut x = frame.start();
        let known = self.state.frame.free.len();
        x[frame.free.len()..].copy_from_slice(&self.state.x[known..]);
        let own: Vec<usize> = (0..parameters.len()).filter(|&index| parameters[index].null.is_some()).collect();
        let unknown = |&index: &usize| frame.free.iter().position(|&free| free == candidate.first + index);
        let by: Vec<usize> = own.iter().filter_map(unknown).collect();
        let (_, columns) = frame.linearise(&x, &by);
        if columns.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let side = |&index: &usize| {
            let parameter = &parameters[index];
            let null = parameter.null.unwrap_or(parameter.default);
            (null, parameter.min - null, parameter.max - null)
        };
        let sides: Vec<(f64, f64, f64)> = own.iter().map(side).collect();
        let white = self.look(&self.white, &columns, &sides)?;
        let slow = self.look(&self.slow, &columns, &sides)?;
        let mut expected = onset.to_vec();
        for ((&index, (null, _, _)), change) in own.iter().zip(&sides).zip(&white.change) {
            expected[index] = null + change;
        }
        Some(Score {
            spec: candidate.spec,
            statistic: slow.statistic,
            explained: white.statistic,
            freedom: white.freedom,
            uniqueness: white.uniqueness,
            expected,
            direction: white.direction,
        })
    }

    fn look(&self, lens: &Lens, columns: &DMatrix<f64>, sides: &[(f64, f64, f64)]) -> Option<Look> {
        let rows = columns.nrows();
        let whitened = Whitened { frame: &self.state.frame, filters: &lens.filters };
        let mut seen = columns.clone().insert_rows(rows, lens.design.nrows() - rows, 0.0);
        for mut column in seen.column_iter_mut() {
            whitened.whiten(&mut column.as_mut_slice()[..rows]);
        }
        let raw: Vec<f64> = seen.column_iter().map(|column| column.norm_squared()).collect();
        let projected: Vec<DVector<f64>> = seen.column_iter().map(|column| lens.project(&column.into_owned())).collect();
        // Directions that the base absorbs to the last digits are not there.
        let mut active: Vec<usize> = (0..raw.len()).filter(|&c| projected[c].norm_squared() > 1e-8 * raw[c]).collect();
        loop {
            if active.is_empty() {
                return None;
            }
            let (change, freedom) = least(&projected, &lens.left, &active);
            // A size on the wrong side of null is not an effect.
            let wrong = |&place: &usize| {
                let (_, low, high) = sides[active[place]];
                (change[place] < 0.0 && low >= 0.0) || (change[place] > 0.0 && high <= 0.0)
            };
            let worst = (0..active.len()).filter(wrong).max_by(|&a, &b| {
                let size = |place: usize| change[place].abs() * projected[active[place]].norm();
                size(a).total_cmp(&size(b))
            });
            if let Some(place) = worst {
                active.remove(place);
                continue;
            }
            let mut all = vec![0.0; raw.len()];
            let mut direction = DVector::zeros(lens.left.len());
            let mut whole = DVector::zeros(lens.left.len());
            for (&column, &change) in active.iter().zip(&change) {
                let (_, low, high) = sides[column];
                all[column] = change.clamp(low, high);
                direction += &projected[column] * change;
                whole += seen.column(column) * change;
            }
            let statistic = lens.left.dot(&direction);
            let uniqueness = (direction.norm_squared() / whole.norm_squared().max(f64::MIN_POSITIVE)).sqrt().min(1.0);
            return Some(Look { statistic, freedom, change: all, uniqueness, direction });
        }
    }
}

/// Least squares of `left` in the active columns, without directions that they hardly have, and
/// how many directions they do have.
fn least(columns: &[DVector<f64>], left: &DVector<f64>, active: &[usize]) -> (Vec<f64>, usize) {
    let scale: Vec<f64> = active.iter().map(|&column| columns[column].norm()).collect();
    let gram = DMatrix::from_fn(active.len(), active.len(), |i, j| columns[active[i]].dot(&columns[active[j]]) / (scale[i] * scale[j]));
    let right = DVector::from_fn(active.len(), |i, _| columns[active[i]].dot(left) / scale[i]);
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
