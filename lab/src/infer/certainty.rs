//! How certain a fit's numbers are, and which it takes where the logs leave several.
//!
//! Some directions of the unknowns the rows say nothing of: a resistance at a charge that no log
//! reaches, or the sum of two effects that only act together. There the answer is what was known
//! before, as are its deviations: the model's own numbers with theirs, and no effect that was not
//! there, within its range. A table that was not there goes on as it is at the nearest place that the logs reach: a resistance over
//! charge does not end where they do.

use energy::{ParameterSpec, find};
use nalgebra::{DMatrix, DVector};

use super::frame::Frame;
use super::state::State;
use crate::fit::uniform_sigma;

/// Share of the information in the clearest direction below which a direction is open.
const OPEN: f64 = 1e-12;
/// Steps towards what was known before, at most.
const NEARER: usize = 8;
/// Parts of such a step that are tried.
const PARTS: [f64; 3] = [1.0, 0.5, 0.2];
/// Deviations from which on a number is far from what was stated of it.
const STRAYED: f64 = 2.0;
/// Deviations of what was known before that are no step.
const NEAR: f64 = 0.05;

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
            match self.frame.evidence.given(parameter) {
                Some(given) if given.sigma > 0.0 => (given.value, given.sigma.min(range)),
                Some(given) => (given.value, range),
                None => self.beside(place).map_or_else(|| unknown(&self.frame, index, self.is_open(place)), |value| (value, range)),
            }
        });
        own.chain(self.frame.known.iter().map(|known| (0.0, known.sigma))).collect()
    }

    /// The number of the nearest place in the same table that the rows say something of, for a free parameter of which they say
    /// nothing; none where it is part of no table, or all of that is open.
    fn beside(&self, place: usize) -> Option<f64> {
        let free = &self.frame.free;
        let parameter = |place: usize| &self.frame.model.parameters()[free[place]];
        let table = |place: usize| (parameter(place).effect, table_of(parameter(place).name));
        let (effect, own) = table(place);
        let alike = (0..free.len()).filter(|&other| own.is_some() && table(other) == (effect, own) && !self.is_open(other));
        if self.is_open(place) { alike.min_by_key(|other| other.abs_diff(place)).map(|other| self.x[other]) } else { None }
    }

    /// Whether the rows say nothing of a free parameter, even with all others as they are.
    fn is_open(&self, place: usize) -> bool {
        self.normal[(place, place)].max(0.0).sqrt().recip() >= range_sigma(&self.frame, self.frame.free[place])
    }

    /// The number of a free parameter as it was stated, with its deviation: where the rows know it less well, even with all others as
    /// they are, and do not speak against it. A log without load has no say about a resistance that was measured elsewhere.
    #[must_use]
    pub(crate) fn better_as_stated(&self, place: usize) -> Option<(f64, f64)> {
        let parameter = &self.frame.model.parameters()[self.frame.free[place]];
        let given = self.frame.evidence.given(parameter).filter(|given| given.sigma > 0.0)?;
        let of_rows = self.normal[(place, place)].max(0.0).sqrt().recip();
        let apart = (self.x[place] - given.value).abs();
        let stated = given.sigma.min(range_sigma(&self.frame, self.frame.free[place]));
        (of_rows >= stated && apart <= STRAYED * of_rows.hypot(stated)).then_some((given.value, stated))
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
        self.sigmas_of(&self.covariance())
    }

    /// The same as rows bear it out (see [`State::covariance_by_rows`]).
    #[must_use]
    pub fn sigmas_by_rows(&self) -> Vec<f64> {
        self.sigmas_of(&self.covariance_by_rows())
    }

    fn sigmas_of(&self, covariance: &DMatrix<f64>) -> Vec<f64> {
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
        let mut state = self;
        for _ in 0..NEARER {
            match state.nearer_to_before() {
                Some(nearer) => state = nearer,
                None => break,
            }
        }
        state
    }

    /// A state that explains the rows as well, and is nearer to what was known before; none where that is no nearer to speak of. What is
    /// open may bend: then it is followed a part of the way, and where a number has left what was stated of it, all else is fitted again
    /// from there.
    fn nearer_to_before(&self) -> Option<State> {
        let (along, covariance) = self.left_open()?;
        let before = self.before();
        let pull = DVector::from_iterator(self.x.len(), before.iter().zip(&self.x).map(|((value, sigma), x)| (value - x) / sigma.powi(2)));
        let step = &along * (covariance * along.tr_mul(&pull));
        // As far as every number stays in its range.
        let room = |((x, step), (min, max)): ((&f64, &f64), (f64, f64))| match *step {
            step if step > 0.0 => (max - x) / step,
            step if step < 0.0 => (min - x) / step,
            _ => f64::INFINITY,
        };
        let bounds = self.frame.bounds();
        let share = self.x.iter().zip(step.iter()).zip(bounds.iter().copied()).map(room).fold(1.0_f64, f64::min).max(0.0);
        let strayed = self.strayed();
        let length = step.iter().zip(&before).map(|(step, (_, sigma))| (share * step / sigma).powi(2)).sum::<f64>().sqrt();
        if length < NEAR {
            return None;
        }
        let moved = |part: f64| {
            let to = self.x.iter().zip(step.iter()).zip(&bounds).map(|((x, step), (min, max))| (x + part * share * step).clamp(*min, *max));
            let to: Vec<f64> = to.collect();
            self.moved_to(&to).or_else(|| if strayed { self.refitted_from(&to) } else { None })
        };
        let far = |state: &State| state.x.iter().zip(&before).map(|(x, (value, sigma))| ((x - value) / sigma).powi(2)).sum::<f64>();
        PARTS.into_iter().find_map(moved).filter(|nearer| far(nearer) < far(self) - NEAR * NEAR)
    }

    /// Whether a number that was given with a deviation is far from where it was given.
    fn strayed(&self) -> bool {
        let given = |index: usize| self.frame.evidence.given(&self.frame.model.parameters()[index]);
        let far = |(&index, x): (&usize, &f64)| {
            given(index).is_some_and(|given| given.sigma > 0.0 && (x - given.value).abs() > STRAYED * given.sigma)
        };
        self.frame.free.iter().zip(&self.x).any(far)
    }
}

/// What the names of all numbers of a table have in common, such as `resistance_soc_` and `_ohm`: what stands around the place, which
/// is written in three digits; none where there are none.
fn table_of(name: &str) -> Option<(&str, &str)> {
    let first = name.as_bytes().windows(3).position(|three| three.iter().all(u8::is_ascii_digit))?;
    Some((&name[..first], &name[first + 3..]))
}

/// What a number of an effect that was not there is taken for, and how surely: that at which it does nothing where the rows say nothing of it, and
/// the usual one where they know it together with others of the effect. It may then be anywhere in its range, which may lie all on one side.
fn unknown(frame: &Frame, index: usize, is_open: bool) -> (f64, f64) {
    let parameter = &frame.model.parameters()[index];
    let spec = find(frame.model.system, parameter.effect).map(|(_, effect)| effect.spec());
    let own = spec.and_then(|spec| spec.parameters.iter().find(|one| one.name == parameter.name));
    match own {
        Some(ParameterSpec { null: Some(null), .. }) if is_open => (*null, range_sigma(frame, index)),
        own => {
            let value = own.map_or(parameter.value, |own| own.default);
            let (below, above) = (value - parameter.min, parameter.max - value);
            (value, ((below.powi(3) + above.powi(3)) / (3.0 * (below + above))).sqrt())
        }
    }
}

/// Standard deviation of a parameter of which nothing but its range is known.
pub(crate) fn range_sigma(frame: &Frame, index: usize) -> f64 {
    let parameter = &frame.model.parameters()[index];
    uniform_sigma((parameter.min, parameter.max))
}
