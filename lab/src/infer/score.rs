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

use super::candidate::{Candidate, refines, usual};
use super::frame::Frame;
use super::lens::{product, whiten_all};
use super::state::{State, filters, likelihood, noises, observed};
use crate::prepare::predicted_channels;

mod view;

use view::{Look, Onset, Side, View};

/// One absent effect at its best shape.
#[derive(Debug, Clone)]
pub struct Score {
    /// The effect.
    pub spec: &'static EffectSpec,
    /// T, with the slow noise that the base model leaves.
    pub statistic: f64,
    /// T, with the sensor's noise alone.
    pub explained: f64,
    /// Numbers by which the effect was free to explain; none where the base does all of its work, or more.
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
    /// Sum of the squares of what a refit of the base would leave of that.
    unique2: f64,
}

impl Score {
    /// How alike two effects look to these logs, 0..1.
    #[must_use]
    pub fn confounded(&self, other: &Score) -> f64 {
        let scale = (self.unique2 * other.unique2).max(0.0).sqrt();
        let product = self.whole.dot(&other.whole) - self.absorbed.dot(&other.absorbed);
        if scale > 0.0 { (product.abs() / scale).min(1.0) } else { 0.0 }
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

/// A candidate that is asked about: which of its own parameters have a null, and their sides.
struct Asked<'a> {
    candidate: &'a Candidate,
    own: Vec<usize>,
    sides: Vec<Side>,
}

impl<'a> Asked<'a> {
    fn of(candidate: &'a Candidate) -> Self {
        let parameters = candidate.spec.parameters;
        let own: Vec<usize> = (0..parameters.len()).filter(|&index| parameters[index].null.is_some()).collect();
        let side = |&index: &usize| {
            let null = parameters[index].null.unwrap_or(parameters[index].default);
            let usual = usual(&parameters[index]) - null;
            let refines = refines(candidate.spec, &parameters[index]);
            Side { null, low: parameters[index].min - null, high: parameters[index].max - null, usual, refines }
        };
        Asked { sides: own.iter().map(side).collect(), own, candidate }
    }
}

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
        self.score_all(std::slice::from_ref(candidate)).pop().flatten()
    }

    /// The same of many candidates.
    #[must_use]
    pub(super) fn score_all(&self, candidates: &[Candidate]) -> Vec<Option<Score>> {
        let asked: Vec<Asked<'_>> = candidates.iter().map(Asked::of).collect();
        let onsets: Vec<Vec<Onset>> = asked.iter().zip(self.shapes(&asked)).map(|(asked, shapes)| self.onsets(asked, &shapes)).collect();
        let looks = self.looks(&asked, &onsets);
        let best_of = |((asked, onsets), looks): ((&Asked<'_>, &Vec<Onset>), Vec<Seen>)| {
            let places = best(&looks);
            if places.is_empty() {
                let first = onsets.iter().find(|onset| onset.slopes.iter().any(|slope| *slope != 0.0));
                return first.map(|onset| self.absorbed(asked, onset));
            }
            let scores = places.into_iter().map(|place| self.of(asked, &looks[place]));
            scores.max_by(|a, b| a.gain.total_cmp(&b.gain))
        };
        asked.iter().zip(&onsets).zip(looks).map(best_of).collect()
    }

    /// The shapes of each candidate that are looked at: all of few, and of many the best on coarser evidence.
    fn shapes(&self, asked: &[Asked<'_>]) -> Vec<Vec<Vec<f64>>> {
        let mut shapes: Vec<Vec<Vec<f64>>> = asked.iter().map(|asked| asked.candidate.onsets.clone()).collect();
        let Some(coarse) = &self.coarse else { return shapes };
        let (many, of_many): (Vec<&mut Vec<Vec<f64>>>, Vec<Asked<'_>>) = shapes
            .iter_mut()
            .zip(asked)
            .filter(|(shapes, _)| shapes.len() > SHAPES)
            .map(|(shapes, asked)| (shapes, Asked::of(asked.candidate)))
            .unzip();
        let onsets: Vec<Vec<Onset>> = of_many.iter().zip(&many).map(|(asked, shapes)| coarse.onsets(asked, shapes)).collect();
        for (shapes, looks) in many.into_iter().zip(coarse.looks(&of_many, &onsets)) {
            let best = best(&looks);
            match best.is_empty() {
                true => shapes.truncate(1),
                false => *shapes = best.into_iter().map(|place| looks[place].at.clone()).collect(),
            }
        }
        shapes
    }

    /// What is seen of the onsets of each candidate that can be seen.
    fn looks(&self, asked: &[Asked<'_>], onsets: &[Vec<Onset>]) -> Vec<Vec<Seen>> {
        let all = || asked.iter().zip(onsets).flat_map(|(asked, onsets)| onsets.iter().map(|onset| (onset, asked.sides.as_slice())));
        let mut white = self.white.looks(self.state, all()).into_iter();
        let mut slow = self.slow.as_ref().map(|slow| slow.looks(self.state, all()).into_iter());
        let mut look = |onset: &Onset| {
            let (white, slow) = (white.next()?, slow.as_mut().map(Iterator::next));
            let white = white?;
            let statistic = match slow {
                Some(slow) => slow??.statistic,
                None => white.statistic,
            };
            Some(Seen { white, statistic, at: onset.at.clone() })
        };
        onsets.iter().map(|onsets| onsets.iter().filter_map(&mut look).collect()).collect()
    }

    /// Of an effect that the base model, bent as it is, does altogether or even overdoes: the logs say nothing of it beside
    /// the base, and a refit that puts the base back may.
    fn absorbed(&self, Asked { candidate, own, .. }: &Asked<'_>, onset: &Onset) -> Score {
        let View { lens, base } = &self.white;
        let parameters = candidate.spec.parameters;
        let sizes = own.iter().map(|&index| usual(&parameters[index]) - parameters[index].null.unwrap_or(0.0));
        let seen = whiten_all(&self.state.frame, &lens.filters, onset.slopes.clone());
        let sizes = DVector::from_iterator(own.len(), sizes);
        let pull = product(&lens.design, &seen) * &sizes;
        let absorbed = base.absorbed(DMatrix::from_column_slice(pull.len(), 1, pull.as_slice())).norm_squared();
        let whole = seen.tr_mul(&sizes).norm_squared();
        let rows = lens.whitened.len();
        Score {
            spec: candidate.spec,
            statistic: 0.0,
            explained: 0.0,
            freedom: 0,
            uniqueness: (1.0 - absorbed / whole.max(f64::MIN_POSITIVE)).max(0.0).sqrt(),
            expected: parameters.iter().map(usual).collect(),
            base_x: self.changed(&-base.solve(pull)),
            gain: 0.0,
            whole: DVector::zeros(rows),
            absorbed: DVector::zeros(self.state.x.len()),
            unique2: 0.0,
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
    fn onsets(&self, Asked { candidate, own, .. }: &Asked<'_>, shapes: &[Vec<f64>]) -> Vec<Onset> {
        let shows_the_same = predicted_channels(&candidate.model) == predicted_channels(&self.state.frame.model);
        let (only, parameters) = (if let [only] = own[..] { Some(only) } else { None }, candidate.spec.parameters);
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

    fn of(&self, Asked { candidate, own, sides }: &Asked<'_>, Seen { white, statistic, at }: &Seen) -> Score {
        let mut expected = at.clone();
        for ((&index, Side { null, .. }), change) in own.iter().zip(sides).zip(&white.change) {
            expected[index] = null + change;
        }
        let View { lens, base } = &self.white;
        let whole = white.seen.tr_mul(&white.free);
        let pull = &white.cross * &white.free;
        let change = &base.change - base.solve(pull.clone());
        let left = &lens.whitened - &whole - lens.design.tr_mul(&change);
        // Noise that is asked for again never makes much of what explains next to nothing.
        let worth = white.statistic.max(*statistic) > WORTH_ASKING;
        let absorbed = base.absorbed(DMatrix::from_column_slice(pull.len(), 1, pull.as_slice())).column(0).into_owned();
        Score {
            spec: candidate.spec,
            gain: if worth { self.linear_cost - left_cost(self.state, &left, &change) } else { *statistic },
            base_x: self.changed(&change),
            statistic: *statistic,
            explained: white.statistic,
            freedom: white.freedom,
            uniqueness: white.uniqueness,
            expected,
            unique2: whole.norm_squared() - absorbed.norm_squared(),
            absorbed,
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
        residual[segment.range()].iter_mut().zip(&segment.worth).for_each(|(r, worth)| *r *= floor / worth.sqrt());
    }
    let noise = noises(frame, &residual);
    let free = frame.free.len();
    let known = frame.known.iter().enumerate();
    let priors: f64 = known.map(|(place, known)| ((state.x[free + place] + change[free + place]) / known.sigma).powi(2)).sum();
    likelihood(frame, &residual, &filters(frame, &noise)) + priors
}
