//! How certain a fit's numbers are, and which it takes where the logs leave several.
//!
//! Some directions of the unknowns the rows say nothing of: a resistance at a charge that no log
//! reaches, or the sum of two effects that only act together. There the answer is what was known
//! before, as are its deviations: the model's own numbers with theirs, and no effect that was not
//! there, within its range. A table that was not there goes on as it is at the nearest place that the logs reach: a resistance over
//! charge does not end where they do.

use energy::{Parameter, System, find};
use nalgebra::{DMatrix, DVector};

use super::frame::Frame;
use super::state::State;
use crate::fit::uniform_sigma;

/// Share of the information in the clearest direction below which a direction is open.
const OPEN: f64 = 1e-12;

/// The directions of the unknowns, each unknown in units of what the rows say of it alone.
struct Directions {
    scale: Vec<f64>,
    /// Inverse information in the directions that the rows determine.
    inverse: DMatrix<f64>,
    /// The others, one column each.
    open: Vec<DVector<f64>>,
}

impl State {
    fn directions(&self) -> Directions {
        let normal = &self.normal;
        let scale: Vec<f64> = normal.diagonal().iter().map(|d| if *d > 0.0 { d.sqrt() } else { 1.0 }).collect();
        // A model of which nothing is free, on logs of which nothing is rough.
        if scale.is_empty() {
            return Directions { scale, inverse: DMatrix::zeros(0, 0), open: Vec::new() };
        }
        let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| normal[(i, j)] / (scale[i] * scale[j]));
        let eigen = scaled.symmetric_eigen();
        let floor = OPEN * eigen.eigenvalues.max().max(0.0);
        let (mut inverse, mut open) = (DMatrix::zeros(scale.len(), scale.len()), Vec::new());
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            if *value > floor {
                inverse += vector * vector.transpose() / *value;
            } else {
                open.push(vector.into_owned());
            }
        }
        Directions { scale, inverse, open }
    }

    /// Covariance of all unknowns; a direction of which the rows say nothing has none.
    #[must_use]
    pub fn covariance(&self) -> DMatrix<f64> {
        let Directions { scale, inverse, .. } = self.directions();
        DMatrix::from_fn(scale.len(), scale.len(), |i, j| inverse[(i, j)] / (scale[i] * scale[j]))
    }

    /// What was known of each unknown before: its value and deviation.
    fn before(&self) -> Vec<(f64, f64)> {
        let own = self.frame.free.iter().enumerate().map(|(place, &index)| {
            let (parameter, range) = (&self.frame.model.parameters()[index], range_sigma(&self.frame, index));
            let same = |known: &&Parameter| known.effect == parameter.effect && known.name == parameter.name;
            match self.frame.evidence.given.iter().find(same) {
                Some(given) if given.sigma > 0.0 => (given.value, given.sigma.min(range)),
                Some(given) => (given.value, range),
                None => (self.beside(place).unwrap_or_else(|| null(self.frame.model.system, parameter)), range),
            }
        });
        own.chain(self.frame.known.iter().map(|known| (0.0, known.sigma))).collect()
    }

    /// The number of the nearest place in the same table that the rows say something of, for a free parameter of which they say
    /// nothing; none where it is part of no table, or all of that is open.
    fn beside(&self, place: usize) -> Option<f64> {
        let free = &self.frame.free;
        let parameter = |place: usize| &self.frame.model.parameters()[free[place]];
        let is_open = |place: usize| self.normal[(place, place)].max(0.0).sqrt().recip() >= range_sigma(&self.frame, free[place]);
        let table = |place: usize| (parameter(place).effect, table_of(parameter(place).name));
        let (effect, own) = table(place);
        let alike = (0..free.len()).filter(|&other| own.is_some() && table(other) == (effect, own) && !is_open(other));
        if is_open(place) { alike.min_by_key(|other| other.abs_diff(place)).map(|other| self.x[other]) } else { None }
    }

    /// The open directions in the unknowns' own units, and the covariance along them.
    fn left_open(&self) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let Directions { scale, open, .. } = self.directions();
        if open.is_empty() {
            return None;
        }
        let along = DMatrix::from_fn(scale.len(), open.len(), |i, j| open[j][i] / scale[i]);
        let before = self.before();
        let weighed = DMatrix::from_fn(scale.len(), open.len(), |i, j| along[(i, j)] / before[i].1);
        let covariance = weighed.tr_mul(&weighed).cholesky()?.inverse();
        Some((along, covariance))
    }

    /// Standard deviation of each free parameter by itself: what the rows say of it and, along the
    /// directions that they leave open, what was known before; at most what its range says.
    #[must_use]
    pub fn sigmas(&self) -> Vec<f64> {
        let covariance = self.covariance();
        let open = self.left_open().map(|(along, covariance)| &along * covariance * along.transpose());
        let of = |(place, &index): (usize, &usize)| {
            let variance = covariance[(place, place)] + open.as_ref().map_or(0.0, |open| open[(place, place)]);
            variance.max(0.0).sqrt().min(range_sigma(&self.frame, index))
        };
        self.frame.free.iter().enumerate().map(of).collect()
    }

    /// The same fit with what the logs leave open as it was known before, as far as bounds allow.
    #[must_use]
    pub(super) fn with_what_is_open_as_before(self) -> State {
        let Some((along, covariance)) = self.left_open() else { return self };
        let pull =
            DVector::from_iterator(self.x.len(), self.before().iter().zip(&self.x).map(|((value, sigma), x)| (value - x) / sigma.powi(2)));
        let step = &along * (covariance * along.tr_mul(&pull));
        // As far as every number stays in its range.
        let room = |((x, step), (min, max)): ((&f64, &f64), (f64, f64))| match *step {
            step if step > 0.0 => (max - x) / step,
            step if step < 0.0 => (min - x) / step,
            _ => f64::INFINITY,
        };
        let bounds = self.frame.bounds();
        let share = self.x.iter().zip(step.iter()).zip(bounds.iter().copied()).map(room).fold(1.0_f64, f64::min).max(0.0);
        let moved = self.x.iter().zip(step.iter()).zip(bounds).map(|((x, step), (min, max))| (x + share * step).clamp(min, max));
        let x = moved.collect();
        self.moved_to(x)
    }
}

/// What the names of all numbers of a table have in common, such as `resistance_soc_` and `_ohm`: what stands around the place, which
/// is written in three digits; none where there are none.
fn table_of(name: &str) -> Option<(&str, &str)> {
    let first = name.as_bytes().windows(3).position(|three| three.iter().all(u8::is_ascii_digit))?;
    Some((&name[..first], &name[first + 3..]))
}

/// The number at which an effect is not there, or its own where it only shapes the effect.
fn null(system: System, parameter: &Parameter) -> f64 {
    let spec = find(system, parameter.effect).map(|(_, effect)| effect.spec());
    let own = spec.and_then(|spec| spec.parameters.iter().find(|one| one.name == parameter.name));
    own.and_then(|one| one.null).unwrap_or(parameter.value)
}

/// Standard deviation of a parameter of which nothing but its range is known.
pub(crate) fn range_sigma(frame: &Frame, index: usize) -> f64 {
    let parameter = &frame.model.parameters()[index];
    uniform_sigma((parameter.min, parameter.max))
}
