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
use nalgebra::{DMatrix, DVector};

use super::candidate::{Candidate, usual};
use super::frame::Frame;
use super::lens::{Absorber, Lens, product, square, whiten_all};
use super::state::{State, filters, likelihood, noises, observed};
use crate::prepare::predicted_channels;

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
    /// Where it expects the base model's own unknowns beside the effect.
    pub base_x: Vec<f64>,
    /// How much better than the base model the logs could be explained, in units of twice the
    /// log-likelihood, each with the slow noise that it leaves.
    pub gain: f64,
    /// What it would add to every row, in units of independent noise, and what of that a refit of
    /// the base would absorb, in units in which it can be subtracted.
    whole: DVector<f64>,
    absorbed: DVector<f64>,
}

impl Score {
    /// How alike two effects look to these logs, 0..1.
    #[must_use]
    pub fn confounded(&self, other: &Score) -> f64 {
        let product = |a: &Score, b: &Score| a.whole.dot(&b.whole) - a.absorbed.dot(&b.absorbed);
        let scale = (product(self, self) * product(other, other)).max(0.0).sqrt();
        if scale > 0.0 { (product(self, other).abs() / scale).min(1.0) } else { 0.0 }
    }
}

/// A state, ready to be asked for scores.
pub struct Scoring<'a> {
    state: &'a State,
    /// None where no slow noise is left.
    slow: Option<View>,
    white: View,
    /// Cost of the base model, refitted as the linear theory would.
    linear_cost: f64,
    /// The same on coarser evidence, which tells the best of many shapes.
    coarse: Option<Box<Scoring<'a>>>,
}

/// The rows through one kind of noise, and what a refit leaves of them.
struct View {
    lens: Lens,
    base: Absorber,
}

impl View {
    fn new(state: &State, lens: Lens) -> View {
        View { base: Absorber::new(&lens, state.held()), lens }
    }
}

/// An onset of a candidate: what it adds to the rows, one row of the matrix for each of its own
/// parameters that have a null.
struct Onset {
    at: Vec<f64>,
    slopes: DMatrix<f64>,
}

/// What one view says of one onset.
struct Look {
    statistic: f64,
    freedom: usize,
    /// Change of each of the onset's own parameters; of those, as the view has it.
    change: Vec<f64>,
    free: DVector<f64>,
    uniqueness: f64,
    /// The onset's rows through the view's noise, and how they pull on the base's unknowns.
    seen: DMatrix<f64>,
    cross: DMatrix<f64>,
}

/// What is seen of an onset: with the sensors' noise alone, and the statistic beside slow noise.
struct Seen {
    white: Look,
    statistic: f64,
    at: Vec<f64>,
}

/// Shapes from which on coarser evidence is asked first.
const SHAPES: usize = 3;

/// What an effect must explain, in units of twice the log-likelihood, to be asked which slow noise
/// it leaves.
const WORTH_ASKING: f64 = 6.0;

/// Usual sizes, as multiples, at which an effect is looked at that does nothing at its onset.
const SIZES: [f64; 4] = [0.3, 1.0, 3.0, 10.0];

/// Null, and the reach below and above it, of each own parameter.
type Sides = [(f64, f64, f64)];

impl<'a> Scoring<'a> {
    /// Of this state.
    #[must_use]
    pub fn new(state: &'a State) -> Self {
        let white = View::new(state, state.lens(&State::white(&state.frame)));
        let slow = state.is_slow().then(|| View::new(state, state.lens(&state.noise)));
        let mut scoring = Scoring { state, slow, white, linear_cost: 0.0, coarse: None };
        scoring.linear_cost = left_cost(state, &scoring.white.base.left, &scoring.white.base.change);
        scoring
    }

    /// The same, with the state on coarser evidence.
    #[must_use]
    pub(super) fn with_coarse(state: &'a State, coarse: &'a State) -> Self {
        let coarse = coarse.frame.evidence.shows_the_way.then(|| Box::new(Scoring::new(coarse)));
        Scoring { coarse, ..Scoring::new(state) }
    }

    /// The best of a candidate's onsets; none when the logs do not excite it.
    #[must_use]
    pub fn score(&self, candidate: &Candidate) -> Option<Score> {
        let own: Vec<usize> =
            (0..candidate.spec.parameters.len()).filter(|&index| candidate.spec.parameters[index].null.is_some()).collect();
        let side = |&index: &usize| {
            let parameter = &candidate.spec.parameters[index];
            let null = parameter.null.unwrap_or(parameter.default);
            (null, parameter.min - null, parameter.max - null)
        };
        let sides: Vec<(f64, f64, f64)> = own.iter().map(side).collect();
        let shapes = match &self.coarse {
            Some(coarse) if candidate.onsets.len() > SHAPES => {
                let onsets = coarse.onsets(candidate, &own, &candidate.onsets);
                let looks = coarse.looks(&onsets, &sides);
                let best: Vec<Vec<f64>> = best(&looks).into_iter().map(|place| looks[place].at.clone()).collect();
                if best.is_empty() { candidate.onsets[..1].to_vec() } else { best }
            }
            _ => candidate.onsets.clone(),
        };
        let onsets = self.onsets(candidate, &own, &shapes);
        let looks = self.looks(&onsets, &sides);
        let places = best(&looks);
        if places.is_empty() {
            let first = onsets.iter().find(|onset| onset.slopes.iter().any(|slope| *slope != 0.0));
            return first.map(|onset| self.absorbed(candidate, &own, onset));
        }
        let scores = places.into_iter().map(|place| self.of(candidate, &own, &sides, &looks[place]));
        scores.max_by(|a, b| a.gain.total_cmp(&b.gain))
    }

    /// What is seen of onsets that can be seen.
    fn looks(&self, onsets: &[Onset], sides: &Sides) -> Vec<Seen> {
        let seen = |view: &View, onset: &Onset| view.look(self.state, onset, sides);
        let look = |onset: &Onset| {
            let white = seen(&self.white, onset)?;
            let statistic = match &self.slow {
                Some(slow) => seen(slow, onset)?.statistic,
                None => white.statistic,
            };
            Some(Seen { white, statistic, at: onset.at.clone() })
        };
        onsets.iter().filter_map(look).collect()
    }

    /// Of an effect that the base model, bent as it is, does altogether: the logs say nothing of it beside
    /// the base, and a refit that puts the base back may.
    fn absorbed(&self, candidate: &Candidate, own: &[usize], onset: &Onset) -> Score {
        let View { lens, base } = &self.white;
        let parameters = candidate.spec.parameters;
        let sizes = own.iter().map(|&index| usual(&parameters[index]) - parameters[index].null.unwrap_or(0.0));
        let seen = whiten_all(&self.state.frame, &lens.filters, onset.slopes.clone());
        let pull = product(&lens.design, &seen) * DVector::from_iterator(own.len(), sizes);
        let rows = lens.whitened.len();
        Score {
            spec: candidate.spec,
            statistic: 0.0,
            explained: 0.0,
            freedom: 0,
            uniqueness: 0.0,
            expected: parameters.iter().map(usual).collect(),
            base_x: self.changed(&-base.solve(pull)),
            gain: 0.0,
            whole: DVector::zeros(rows),
            absorbed: DVector::zeros(self.state.x.len()),
        }
    }

    /// The state's unknowns after a change of them.
    fn changed(&self, change: &DVector<f64>) -> Vec<f64> {
        let bounds = self.state.frame.bounds();
        self.state.x.iter().zip(change.iter()).zip(bounds).map(|((x, change), (min, max))| (x + change).clamp(min, max)).collect()
    }

    /// What each of a candidate's onsets adds to the rows. An effect of one size is walked at its
    /// onset, and what that changes divided by the size; the others with their derivatives. An effect
    /// that does not begin with its size (a delay far below a step does nothing) is looked at where it
    /// has usual ones.
    fn onsets(&self, candidate: &Candidate, own: &[usize], shapes: &[Vec<f64>]) -> Vec<Onset> {
        let shows_the_same = predicted_channels(&candidate.model) == predicted_channels(&self.state.frame.model);
        let (only, parameters) = (if let [only] = own { Some(*only) } else { None }, candidate.spec.parameters);
        let secant = only.filter(|_| shows_the_same);
        let mut all = Vec::new();
        for at in shapes {
            let onset = self.onset(candidate, own, secant, at.clone());
            let begins = onset.slopes.iter().any(|slope| *slope != 0.0);
            match secant {
                Some(only) if !begins => {
                    let null = parameters[only].null.unwrap_or(0.0);
                    for times in SIZES {
                        let mut at = at.clone();
                        at[only] = (null + times * (usual(&parameters[only]) - null)).clamp(parameters[only].min, parameters[only].max);
                        all.push(self.onset(candidate, own, secant, at));
                    }
                }
                _ => all.push(onset),
            }
        }
        all.retain(|onset| onset.slopes.iter().all(|slope| slope.is_finite()));
        all
    }

    fn onset(&self, candidate: &Candidate, own: &[usize], secant: Option<usize>, at: Vec<f64>) -> Onset {
        let known = self.state.frame.free.len();
        let mut values = candidate.model.values();
        values[candidate.first..candidate.first + at.len()].copy_from_slice(&at);
        let model = Arc::new(energy::Model::clone(&candidate.model).with_values(&values));
        let frame = Frame::new(model, Arc::clone(&self.state.frame.evidence));
        let mut x = frame.start();
        x[frame.free.len()..].copy_from_slice(&self.state.x[known..]);
        let slopes = if let Some(only) = secant {
            let size = at[only] - candidate.spec.parameters[only].null.unwrap_or(0.0);
            let before = observed(&self.state.frame).zip(&self.state.residual).map(|(observed, residual)| observed - residual);
            let slopes = frame.predict(&x).into_iter().zip(before).map(|(after, before)| {
                let change = after - before;
                // Rounding is no change.
                if change.abs() < 1e-13 * before.abs() { 0.0 } else { change / size }
            });
            DMatrix::from_iterator(1, self.state.residual.len(), slopes)
        } else {
            let unknown = |index: &usize| frame.free.iter().position(|&free| free == candidate.first + index);
            let by: Vec<usize> = own.iter().filter_map(unknown).collect();
            frame.linearise(&x, &by).1
        };
        Onset { at, slopes }
    }

    fn of(&self, candidate: &Candidate, own: &[usize], sides: &Sides, Seen { white, statistic, at }: &Seen) -> Score {
        let mut expected = at.clone();
        for ((&index, (null, _, _)), change) in own.iter().zip(sides).zip(&white.change) {
            expected[index] = null + change;
        }
        let View { lens, base } = &self.white;
        let whole = white.seen.tr_mul(&white.free);
        let pull = &white.cross * &white.free;
        let change = &base.change - base.solve(pull.clone());
        let left = &lens.whitened - &whole - lens.design.tr_mul(&change);
        // Noise that is asked for again never makes much of what explains next to nothing.
        let worth = white.statistic.max(*statistic) > WORTH_ASKING;
        Score {
            spec: candidate.spec,
            gain: if worth { self.linear_cost - left_cost(self.state, &left, &change) } else { *statistic },
            base_x: self.changed(&change),
            statistic: *statistic,
            explained: white.statistic,
            freedom: white.freedom,
            uniqueness: white.uniqueness,
            expected,
            absorbed: base.absorbed(DMatrix::from_column_slice(pull.len(), 1, pull.as_slice())).column(0).into_owned(),
            whole,
        }
    }
}

/// The one or two that explain most, beside the sensors' noise alone and beside slow noise.
fn best(looks: &[Seen]) -> Vec<usize> {
    let best = |by: fn(&Seen) -> f64| (0..looks.len()).max_by(|&a, &b| by(&looks[a]).total_cmp(&by(&looks[b])));
    let mut places: Vec<usize> = best(|look| look.white.statistic).into_iter().chain(best(|look| look.statistic)).collect();
    places.dedup();
    places
}

/// Twice the negative log-likelihood of residuals in units of the sensors' noise, with the most
/// likely slow noise beside it, after a change of the state's unknowns.
pub(super) fn left_cost(state: &State, left: &DVector<f64>, change: &DVector<f64>) -> f64 {
    let (frame, evidence) = (&state.frame, &state.frame.evidence);
    let mut residual = left.as_slice().to_vec();
    for segment in &evidence.segments {
        let floor = evidence.floor(segment.channel);
        residual[segment.range()].iter_mut().zip(&segment.counts).for_each(|(r, count)| *r *= floor / count.sqrt());
    }
    let noise = noises(frame, &residual);
    let free = frame.free.len();
    let known = frame.known.iter().enumerate();
    let priors: f64 = known.map(|(place, known)| ((state.x[free + place] + change[free + place]) / known.sigma).powi(2)).sum();
    likelihood(frame, &residual, &filters(frame, &noise)) + priors
}

impl View {
    fn look(&self, state: &State, onset: &Onset, sides: &Sides) -> Option<Look> {
        let View { lens, base } = self;
        let seen = whiten_all(&state.frame, &lens.filters, onset.slopes.clone());
        let cross = product(&lens.design, &seen);
        let whole = square(&seen);
        let absorbed = base.absorbed(cross.clone());
        let unique = &whole - absorbed.tr_mul(&absorbed);
        let right = &seen * &base.left;
        // Directions that the base absorbs to the last digits are not there.
        let count = whole.nrows();
        let mut active: Vec<usize> = (0..count).filter(|&c| unique[(c, c)] > 1e-8 * whole[(c, c)]).collect();
        loop {
            if active.is_empty() {
                return None;
            }
            let (change, freedom) = least(&unique, &right, &active);
            // A size on the wrong side of null is not an effect.
            let wrong = |&place: &usize| {
                let (_, low, high) = sides[active[place]];
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
                let (_, low, high) = sides[place];
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
