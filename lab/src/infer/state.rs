//! The best unknowns and the most likely noise for one list of effects, and the evidence for it.
//!
//! Minimises `(y - f(x))' V^-1 (y - f(x)) + (known errors / their sigmas)^2` over the unknowns and
//! the slow part of V in turn. The evidence is the likelihood with everything that is only roughly
//! known integrated out (Laplace's method, exact for a linear model):
//!
//! `-2 ln L = ln |V| + r' V^-1 r + sum (nu / sigma)^2 + ln |1 + S H S|`,
//!
//! with H the information about the rough numbers nu and S the diagonal of their sigmas.

use std::sync::{Arc, OnceLock};

use energy::{Channel, EffectSpec, Model, ParameterSpec};
use nalgebra::{DMatrix, DVector};

use super::candidate::usual;
use super::descent::{Asked, Derived, Place, Valley, descend, descend_elsewhere, descend_from_left, descend_roughly};
use super::evidence::{Evidence, Segment};
use super::frame::Frame;
use super::lens::Lens;
use super::noise::{Filter, Noise, Rows, estimate};
use super::starts::look_for_starts;

/// A frame at its most likely unknowns.
#[derive(Debug, Clone)]
pub struct State {
    /// Model and logs.
    pub frame: Arc<Frame>,
    /// The unknowns.
    pub x: Vec<f64>,
    /// Observed minus predicted, by judged row.
    pub residual: Vec<f64>,
    /// Noise by channel.
    pub noise: Vec<(Channel, Noise)>,
    /// Minus twice the logarithm of the evidence, without its constant.
    pub cost: f64,
    /// Information about the unknowns, with what is known of the rough numbers.
    pub normal: DMatrix<f64>,
    /// Half the fall of the cost along each unknown: nil but for those that rest on a bound.
    pub(super) pull: DVector<f64>,
    /// Derivatives of the predictions: one row per unknown, one column per judged row.
    slopes: Arc<DMatrix<f64>>,
    /// Free parameters on which the logs have a say.
    pub freedom: usize,
    /// RMS by channel over all rows, once somebody has asked.
    rms: OnceLock<Vec<(Channel, f64)>>,
    /// See [`State::told`].
    pub(super) least_squares: OnceLock<Box<State>>,
    /// See [`State::coarse`].
    on_coarser: OnceLock<Box<State>>,
}

/// Slow noise, in floors, that needs no second look.
const SLIGHT: f64 = 0.3;
/// Rise of the cost that makes a state no worse.
const AS_GOOD: f64 = 0.02;
/// Deviations from which on what a log says of its own start is asked again.
const ODD: f64 = 2.0;
impl State {
    /// The model on its evidence, its free parameters and all that is roughly known at their best. The way
    /// there is looked for on coarser evidence, where it has any.
    #[must_use]
    pub fn of_model(model: Arc<Model>, evidence: Arc<Evidence>) -> State {
        let frame = Frame::new(model, evidence);
        let rough = Arc::new(frame.coarse());
        let rough = State::search(Arc::clone(&rough), &rough.start(), f64::NEG_INFINITY).or_with_other_starts().or_with_other_delays();
        rough.on(frame.evidence)
    }

    /// The same model fitted to other evidence of the same logs, beginning here.
    #[must_use]
    pub(super) fn on(self, evidence: Arc<Evidence>) -> State {
        if Arc::ptr_eq(&self.frame.evidence, &evidence) {
            return self;
        }
        let frame = Frame::new(Arc::clone(&self.frame.model), evidence);
        State::fit(Arc::new(frame), &self.x, &self.noise)
    }

    /// The state on coarser evidence.
    #[must_use]
    pub(super) fn coarse(&self) -> State {
        State::clone(self.on_coarser.get_or_init(|| Box::new(self.clone().on(self.frame.coarse().evidence))))
    }

    /// Fits all unknowns, beginning at `start`: once with the noise that is left there and, where
    /// that ends with slow noise, once more from where the sensors' noise alone leads. Slow noise
    /// excuses what it has to explain: from either side the search may come to rest too early. A
    /// cost below `content` needs no second look.
    #[must_use]
    pub fn search(frame: Arc<Frame>, start: &[f64], content: f64) -> State {
        let place = descend_from_left(&frame, start, &all(&frame));
        State::of(frame, place).or_from_white(content)
    }

    /// The same, unless it leads to where this state is.
    pub(super) fn search_elsewhere(&self, start: &[f64], content: f64) -> Option<State> {
        Some(self.fit_elsewhere_from_left(start)?.or_from_white(content))
    }

    fn or_from_white(self, content: f64) -> State {
        if self.cost < content || !self.is_slow() {
            return self;
        }
        let frame = &self.frame;
        let again = || {
            let white = descend_roughly(frame, &self.x, &State::white(frame), &all(frame), Asked::Never);
            self.fit_elsewhere(&white.x, &noises(frame, &white.residual))
        };
        match again() {
            Some(again) if again.cost < self.cost => again,
            _ => self,
        }
    }

    /// Where this state lies.
    pub(super) fn valley(&self) -> Valley<'_> {
        Valley::new(&self.frame, &self.x, &self.residual, &self.noise, (&self.normal, &self.pull))
    }

    /// Fits all unknowns, beginning at `start` and with this noise, unless that leads to where this state is.
    pub(super) fn fit_elsewhere(&self, start: &[f64], noise: &[(Channel, Noise)]) -> Option<State> {
        let place = descend_elsewhere(&self.frame, start, Some(noise), Asked::Always, &self.valley())?;
        Some(State::of(Arc::clone(&self.frame), place))
    }

    /// The same with the noise that is left at the start.
    fn fit_elsewhere_from_left(&self, start: &[f64]) -> Option<State> {
        let place = descend_elsewhere(&self.frame, start, None, Asked::Always, &self.valley())?;
        Some(State::of(Arc::clone(&self.frame), place))
    }

    /// This state with one more effect, all numbers beginning where another state has them, and those that
    /// it lacks at their usual size; none where that leads to a state that is known.
    #[must_use]
    pub(super) fn with(&self, effect: &EffectSpec, like: &State, known: Option<&State>) -> Option<State> {
        let model = self.frame.model.with(effect.id).ok()?;
        let frame = Arc::new(Frame::new(Arc::new(model), Arc::clone(&self.frame.evidence)));
        let start = frame.like(like, Some(effect));
        match known {
            Some(known) => known.fit_elsewhere(&start, &like.noise),
            None => Some(State::fit(frame, &start, &like.noise)),
        }
    }

    /// This state without one of its effects, all other numbers beginning where it has them.
    #[must_use]
    pub(super) fn without(&self, effect: &EffectSpec) -> State {
        let model = self.frame.model.without(|id| id == effect.id);
        let frame = Arc::new(Frame::new(Arc::new(model), Arc::clone(&self.frame.evidence)));
        let start = frame.like(self, None);
        State::fit(frame, &start, &self.noise)
    }

    /// This state refitted from where another ended.
    #[must_use]
    pub(super) fn begun_from(&self, other: &State) -> Option<State> {
        self.fit_elsewhere(&self.frame.like(other, None), &other.noise)
    }

    /// The better of this state and those that begin elsewhere, where it leaves slow noise. How far a
    /// log's own start is off has valleys of its own: near empty and near full the open-circuit
    /// voltage bends, and a charge beyond full can do the work of a missing transient.
    #[must_use]
    pub(super) fn or_with_other_starts(self) -> State {
        if !self.is_slow() {
            return self;
        }
        let first = self.frame.free.len();
        let own = |place: usize| self.frame.known[place - first].log().is_some();
        let odd = |place: usize| own(place) && self.x[place].abs() > ODD * self.frame.known[place - first].sigma;
        let all = first..self.x.len();
        let mut others = Vec::new();
        if all.clone().any(odd) {
            let mut told = self.x.clone();
            all.clone().filter(|&place| own(place)).for_each(|place| told[place] = 0.0);
            others.extend(self.fit_elsewhere(&told, &self.noise));
        }
        let mut looked = self.x.clone();
        looked[first..].fill(0.0);
        look_for_starts(&self.frame, &mut looked);
        others.extend(self.fit_elsewhere_from_left(&looked));
        others.into_iter().fold(self, |best, other| if other.cost < best.cost { other } else { best })
    }

    /// Fits all unknowns, beginning at `start` and with this noise.
    #[must_use]
    pub fn fit(frame: Arc<Frame>, start: &[f64], noise: &[(Channel, Noise)]) -> State {
        let place = descend(&frame, start, noise, &all(&frame), Asked::Always);
        State::of(frame, place)
    }

    pub(super) fn of(frame: Arc<Frame>, Place { x, noise, residual, slopes, lens, .. }: Place) -> State {
        let free = frame.free.len();
        let sigmas: Vec<f64> = frame.known.iter().map(|known| known.sigma).collect();
        // 1 + S H S: the information holds the priors' share, 1/sigma^2, which becomes the 1.
        let inner = DMatrix::from_fn(sigmas.len(), sigmas.len(), |i, j| lens.normal[(free + i, free + j)] * sigmas[i] * sigmas[j]);
        let integrated = inner.cholesky().map_or(0.0, |cholesky| 2.0 * cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>());
        let (cost, freedom) = (lens.cost + integrated, freedom(&lens.normal, free));
        State {
            frame,
            x,
            residual,
            noise,
            cost,
            normal: lens.normal,
            pull: lens.pull,
            slopes: Arc::new(slopes),
            freedom,
            rms: OnceLock::new(),
            least_squares: OnceLock::new(),
            on_coarser: OnceLock::new(),
        }
    }

    /// The state at other unknowns, through the same noise.
    pub(super) fn at(&self, x: &[f64]) -> State {
        let place = Place::at(&self.frame, x.to_vec(), self.noise.clone(), &all(&self.frame), Derived::Here);
        State::of(Arc::clone(&self.frame), place)
    }

    /// The same, where they explain the rows as well; none where they do not.
    pub(super) fn moved_to(&self, x: &[f64]) -> Option<State> {
        Some(self.at(x)).filter(|moved| moved.cost <= self.cost + AS_GOOD)
    }

    /// The same fitted again from there.
    pub(super) fn refitted_from(&self, x: &[f64]) -> Option<State> {
        Some(State::fit(Arc::clone(&self.frame), x, &self.noise)).filter(|again| again.cost <= self.cost + AS_GOOD)
    }

    /// Where a search stands that has come here.
    pub(super) fn place(&self) -> Place {
        Place {
            x: self.x.clone(),
            noise: self.noise.clone(),
            residual: self.residual.clone(),
            slopes: DMatrix::clone(&self.slopes),
            lens: self.lens(&self.noise),
            derived: Derived::Here,
        }
    }

    /// The rows through this state's noise, or another.
    pub(super) fn lens(&self, noise: &[(Channel, Noise)]) -> Lens {
        Lens::new(&self.frame, &self.x, &all(&self.frame), &self.slopes, &self.residual, filters(&self.frame, noise))
    }

    /// Whether slow noise is left that is worth a second look.
    pub(super) fn is_slow(&self) -> bool {
        self.noise.iter().any(|(channel, noise)| noise.slow >= SLIGHT * self.frame.evidence.floor(*channel))
    }

    /// Minus twice the logarithm of how likely the rows are.
    pub(super) fn likelihood(&self) -> f64 {
        likelihood(&self.frame, &self.residual, &filters(&self.frame, &self.noise))
    }

    /// Unknowns that rest on a bound.
    pub(super) fn held(&self) -> Vec<usize> {
        let bounds = self.frame.bounds();
        (0..self.x.len()).filter(|&index| self.x[index] <= bounds[index].0 || self.x[index] >= bounds[index].1).collect()
    }

    /// Noise that has no slow part yet.
    #[must_use]
    pub fn white(frame: &Frame) -> Vec<(Channel, Noise)> {
        frame.evidence.floors.iter().map(|&(channel, floor)| (channel, Noise::white(floor))).collect()
    }

    /// RMS of the residuals of each channel over all rows of all logs.
    #[must_use]
    pub fn rms(&self) -> Vec<(Channel, f64)> {
        let of_rows = || match &self.frame.evidence.whole {
            Some(whole) => rms(whole, &residual(&self.frame.by_rows(), &self.x)),
            None => rms(&self.frame.evidence, &self.residual),
        };
        self.rms.get_or_init(of_rows).clone()
    }

    /// Bayesian information criterion: lower is better.
    #[must_use]
    pub fn bic(&self) -> f64 {
        self.cost + self.freedom as f64 * (self.frame.evidence.rows() as f64).ln()
    }

    /// Fall of the criterion from a base that lacks some of this model's effects. What takes the meaning from numbers that
    /// the base has is no simpler for it.
    pub(super) fn delta_bic(&self, base: &State) -> f64 {
        let simpler = base.freedom.saturating_sub(self.freedom) as f64;
        base.bic() - self.bic() - simpler * (self.frame.evidence.rows() as f64).ln()
    }
}

/// Where a number of an effect begins that nothing is known of.
pub(super) type Beginning = fn(&ParameterSpec) -> f64;

impl Frame {
    /// Unknowns of this frame as another state has them; those that it lacks at an effect's usual size, or the model's own.
    pub(super) fn like(&self, other: &State, effect: Option<&EffectSpec>) -> Vec<f64> {
        self.as_in(&other.frame, &other.x, effect.map(|effect| (effect, usual as Beginning)))
    }

    /// The same of another frame at its unknowns, with a beginning for the numbers of an effect that it lacks.
    pub(super) fn as_in(&self, other: &Frame, x: &[f64], effect: Option<(&EffectSpec, Beginning)>) -> Vec<f64> {
        let (known, values) = (other.model.parameters(), other.values(x));
        let value = |index: &usize| {
            let parameter = &self.model.parameters()[*index];
            let place = known.iter().position(|one| one.effect == parameter.effect && one.name == parameter.name);
            let own = || {
                let (effect, begins) = effect.filter(|(effect, _)| parameter.effect == effect.id)?;
                effect.parameters.iter().find(|own| own.name == parameter.name).map(begins)
            };
            place.map_or_else(|| own().unwrap_or(parameter.value), |place| values[place])
        };
        let rough = self.known.iter().map(|known| other.error(x, known.what));
        self.free.iter().map(value).chain(rough).collect()
    }
}

pub(super) fn all(frame: &Frame) -> Vec<usize> {
    (0..frame.unknowns()).collect()
}

/// Directions of the free parameters that the rows determine, once what is rough is allowed for.
fn freedom(normal: &DMatrix<f64>, free: usize) -> usize {
    if free == 0 {
        return 0;
    }
    let known = normal.nrows() - free;
    let mut own = normal.view((0, 0), (free, free)).into_owned();
    if let Some(cholesky) = normal.view((free, free), (known, known)).into_owned().cholesky() {
        let cross = normal.view((free, 0), (known, free)).into_owned();
        own -= cross.tr_mul(&cholesky.solve(&cross));
    }
    // What does nothing has no scale either.
    let told: Vec<usize> = (0..free).filter(|&index| normal[(index, index)] > f64::MIN_POSITIVE.sqrt()).collect();
    if told.is_empty() {
        return 0;
    }
    let scale = |index: usize| normal[(index, index)].sqrt();
    let scaled = |i: usize, j: usize| own[(told[i], told[j])] / (scale(told[i]) * scale(told[j]));
    let scaled = DMatrix::from_fn(told.len(), told.len(), scaled);
    scaled.symmetric_eigenvalues().iter().filter(|value| **value > DETERMINED).count()
}

/// Share of a direction's information that must be left by all others for it to count as free.
const DETERMINED: f64 = 1e-9;

pub(super) fn observed(frame: &Frame) -> impl Iterator<Item = f64> + '_ {
    frame.evidence.segments.iter().flat_map(|segment| segment.observed.iter().copied())
}

/// RMS by channel of residuals, by judged row.
pub(super) fn rms(evidence: &Evidence, residual: &[f64]) -> Vec<(Channel, f64)> {
    let of = |&(channel, _): &(Channel, f64)| {
        let rows = evidence.segments.iter().filter(|segment| segment.channel == channel).flat_map(Segment::range);
        let (count, squares) = rows.fold((0, 0.0), |(count, sum), row| (count + 1, sum + residual[row].powi(2)));
        (channel, (squares / f64::from(count.max(1))).sqrt())
    };
    evidence.floors.iter().map(of).collect()
}

pub(super) fn residual(frame: &Frame, x: &[f64]) -> Vec<f64> {
    observed(frame).zip(frame.predict(x)).map(|(observed, predicted)| observed - predicted).collect()
}

pub(super) fn filters(frame: &Frame, noise: &[(Channel, Noise)]) -> Vec<Filter> {
    let of = |wanted| noise.iter().find(|(channel, _)| *channel == wanted).map_or(Noise::white(1.0), |(_, noise)| *noise);
    frame.evidence.segments.iter().map(|segment| of(segment.channel).filter(&segment.time_s, &segment.worth)).collect()
}

/// The most likely noise of every channel.
pub(super) fn noises(frame: &Frame, residual: &[f64]) -> Vec<(Channel, Noise)> {
    let of = |&(channel, floor): &(Channel, f64)| {
        let segments = frame.evidence.segments.iter().filter(|segment| segment.channel == channel);
        let logs: Vec<Rows<'_>> =
            segments.map(|segment| (segment.time_s.as_slice(), segment.worth.as_slice(), &residual[segment.range()])).collect();
        (channel, estimate(floor, &logs))
    };
    frame.evidence.floors.iter().map(of).collect()
}

pub(super) fn likelihood(frame: &Frame, residual: &[f64], filters: &[Filter]) -> f64 {
    (0..frame.evidence.logs.len()).map(|log| likelihood_of_log(frame, residual, filters, log)).sum()
}

pub(super) fn likelihood_of_log(frame: &Frame, residual: &[f64], filters: &[Filter], log: usize) -> f64 {
    let of = |(segment, filter): (&Segment, &Filter)| filter.log_variance + filter.squares(&residual[segment.range()]);
    frame.evidence.segments.iter().zip(filters).filter(|(segment, _)| segment.log == log).map(of).sum()
}
