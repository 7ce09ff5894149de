//! A formula for a residual that no effect of the catalogue explains: a proposal, never a finding.
//!
//! Forward selection over a dictionary of terms. Each term is put into the model as an expression
//! of size 0, so that its derivatives are those of the model with it, whatever the system does
//! with the channel that it adds to. What a refit of the base could absorb is projected out, as in
//! [`super::score`]; the best terms are refitted with their shapes free. One is kept when the
//! information criterion falls by more than the number of terms tried excuses, and the error on
//! logs that the fit has not seen falls.

mod cheapest;
pub mod dictionary;
mod periodic;
pub mod switch;

use std::sync::Arc;

use energy::{Channel, Model};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use self::dictionary::{COEFFICIENTS, Term, dictionary, rhythm};
use self::periodic::{CLOCK, at_one_phase, period_s, set_clocks};
use self::switch::{Switching, comes_and_goes};
use super::evidence::Evidence;
use super::floors::resettled;
use super::frame::Frame;
use super::judge::explained;
use super::lens::{Absorber, Lens, product, square, whiten_all};
use super::score::left_cost;
use super::state::{State, noises};
use super::trial::held_out;

/// Most terms of a proposal.
const TERMS_MAX: usize = 3;
/// Terms in one walk: as many as one dual number has derivatives to spare.
const TOGETHER: usize = 4;
/// Terms that are weighed with the noise they leave, and that are refitted.
const WEIGHED: usize = 12;
const REFITTED: usize = 3;
/// Fall of the information criterion that a term must bring, were it the only one tried.
const DELTA_BIC: f64 = 10.0;
/// Share by which a proposal must lower the held-out error, and by which each further term must.
pub const HOLDOUT_FALL: f64 = 0.05;
const FURTHER_FALL: f64 = 0.02;
/// The same for something periodic, of which every held-out log is asked for its phase: half of the squares. What
/// comes and goes without a period has one by chance, and that explains less.
const PERIODIC_FALL: f64 = 0.3;

/// Means that a period must have, or rows are looked at one by one.
const MEANS: f64 = 4.0;

/// RMS of each channel.
type ByChannel = Vec<(Channel, f64)>;

/// One term of a proposal.
#[derive(Debug, Clone)]
pub struct Proposed {
    /// Name of its expression in the model.
    pub name: String,
    /// What it would mean.
    pub words: String,
    /// The input of its low-passed copy, if it has one.
    pub slow: Option<String>,
    /// Fall of the information criterion that it brought.
    pub delta_bic: f64,
}

/// What came of the search.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// The model before, fitted.
    pub base: State,
    /// Its RMS on the held-out logs, by channel.
    pub base_holdout: Vec<(Channel, f64)>,
    /// The model with the terms, fitted; the base when there are none.
    pub state: State,
    /// Its RMS on the held-out logs, by channel.
    pub holdout: Vec<(Channel, f64)>,
    /// The terms, as they were found; none when nothing is proposed.
    pub terms: Vec<Proposed>,
    /// How many terms were tried.
    pub tried: usize,
    /// Dominant period of the base's residual, s.
    pub period_s: Option<f64>,
    /// What comes and goes at times that no formula says, where that leaves far less than any formula that was found.
    pub switching: Option<Switching>,
    /// The held-out logs, on the floors by which it was judged.
    pub judged_by: Arc<Evidence>,
}

impl Proposal {
    /// The input of the low-passed copy of the term of that name, if it has one.
    #[must_use]
    pub fn slow(&self, name: &str) -> Option<&str> {
        self.terms.iter().find(|term| term.name == name)?.slow.as_deref()
    }

    /// A refitted term that brings more than the number of those tried excuses, and does so on logs that the fit has not seen; with its RMS there.
    fn holds<'t>(&self, state: State, term: &'t Term, tried: usize, holdout: &Arc<Evidence>) -> Option<(State, &'t Term, ByChannel)> {
        if self.state.bic() - state.bic() < DELTA_BIC + 2.0 * (tried as f64).ln() {
            return None;
        }
        let training = &self.state.frame.evidence;
        if error(training, &state.rms()) >= error(training, &self.state.rms()) {
            return None;
        }
        let wanted = match () {
            () if term.period_s.is_some() => PERIODIC_FALL,
            () if self.terms.is_empty() => HOLDOUT_FALL,
            () => FURTHER_FALL,
        };
        let after = held_out(&state, holdout);
        (error(holdout, &after) <= (1.0 - wanted) * error(holdout, &self.holdout)).then_some((state, term, after))
    }

    /// Drops earlier terms whose work the newest does: a multiple of the true period, say, once that was found.
    fn drop_what_became_needless(&mut self, holdout: &Arc<Evidence>) {
        let Some(newest) = self.terms.last().map(|term| term.name.clone()) else { return };
        for name in loose(&self.state).into_iter().filter(|name| *name != newest) {
            let (frame, x) = extended(&self.state, fitted(&self.state).without(|id| id == name));
            let without = State::fit(Arc::new(frame), &x, &self.state.noise);
            if without.bic() < self.state.bic() {
                self.terms.retain(|term| term.name != name);
                self.holdout = held_out(&without, holdout);
                self.state = without;
            }
        }
    }
}

/// Looks for terms that lower the error on `holdout`.
#[must_use]
pub fn propose(model: Arc<Model>, evidence: &Arc<Evidence>, holdout: &Arc<Evidence>) -> Proposal {
    let fitted = |evidence: Arc<Evidence>| {
        let frame = Arc::new(Frame::new(Arc::clone(&model), evidence));
        let state = State::fit(Arc::clone(&frame), &frame.start(), &State::white(&frame));
        // Where nothing was to be moved, the noise that is left is still to be asked for.
        let settled = State::fit(Arc::clone(&frame), &state.x, &noises(&frame, &state.residual));
        if settled.cost < state.cost { settled } else { state }
    };
    let (mut base, mut holdout) = (fitted(evidence.for_formulas(&model)), holdout.for_formulas(&model));
    if let Some((evidence, Some(held))) = resettled(&base, Some(&holdout)) {
        (base, holdout) = (fitted(evidence), held);
    }
    // A mean over a good part of a period hides what has one.
    let hides = |period_s: f64| period_s < MEANS * base.frame.evidence.longest_mean_s();
    let whole = |evidence: &Arc<Evidence>| Arc::clone(evidence.whole.as_ref().unwrap_or(evidence));
    if period_s(&base).is_some_and(hides) {
        (base, holdout) = (fitted(whole(&base.frame.evidence)), whole(&holdout));
    }
    let holdout = &holdout;
    let base_holdout = held_out(&base, holdout);
    let mut found = Proposal {
        state: base.clone(),
        holdout: base_holdout.clone(),
        terms: Vec::new(),
        tried: 0,
        period_s: None,
        switching: None,
        base_holdout,
        base,
        judged_by: Arc::clone(holdout),
    };
    while found.terms.len() < TERMS_MAX && !explained(&found.state) {
        let look = Look::new(&found.state);
        let period_s = period_s(&found.state);
        let terms = dictionary(&found.state.frame, period_s);
        if found.terms.is_empty() {
            (found.tried, found.period_s) = (terms.len(), period_s);
        }
        let Some((state, term, after)) =
            look.best(&terms).into_iter().find_map(|(state, term)| found.holds(state, term, terms.len(), holdout))
        else {
            break;
        };
        let (delta_bic, name) = (found.state.bic() - state.bic(), next_name(&found.state.frame.model));
        let (state, after) = at_one_phase(&found.state, &state, term, &name, holdout).unwrap_or((state, after));
        let words = term.words.clone() + &rhythm(|wanted| Some(state.x[unknown(&state.frame, &name, wanted)?]));
        found.terms.push(Proposed { name, words, slow: term.slow.clone(), delta_bic });
        (found.state, found.holdout) = (state, after);
        found.drop_what_became_needless(holdout);
    }
    if !explained(&found.state)
        && let Some(switching) = comes_and_goes(&found.base, holdout)
    {
        // The mean of what comes and goes is a formula, too, and a poor one.
        let with_formula = found.holdout.iter().find(|(channel, _)| *channel == switching.judged);
        if with_formula.is_none_or(|(_, rms)| switching.holdout.1 < (1.0 - PERIODIC_FALL) * rms) {
            found.terms.clear();
            (found.state, found.holdout) = (found.base.clone(), found.base_holdout.clone());
            found.switching = Some(switching);
        }
    }
    found
}

/// RMS over all channels, in floors.
#[must_use]
pub fn error(evidence: &Evidence, rms: &[(Channel, f64)]) -> f64 {
    let rows = |channel| evidence.segments.iter().filter(|segment| segment.channel == channel).map(|s| s.rows.len()).sum::<usize>() as f64;
    let squares: f64 = rms.iter().map(|&(channel, rms)| rows(channel) * (rms / evidence.floor(channel)).powi(2)).sum();
    (squares / rms.iter().map(|&(channel, _)| rows(channel)).sum::<f64>().max(1.0)).sqrt()
}

/// How names of proposals begin.
const PREFIX: &str = "proposal_";

/// The first name of a proposal that the model has not.
fn next_name(model: &Model) -> String {
    let taken = |name: &String| model.effects().any(|effect| effect.spec().id == name.as_str());
    (1..).map(|number| format!("{PREFIX}{number}")).find(|name| !taken(name)).expect("numbers do not end")
}

/// A state through the sensors' own noise, without what a refit could absorb.
struct Look<'a> {
    state: &'a State,
    lens: Lens,
    base: Absorber,
    /// The same through the slow noise that is left: in which what jumps stands out of what drifts.
    slow: Lens,
}

impl<'a> Look<'a> {
    fn new(state: &'a State) -> Look<'a> {
        let lens = state.lens(&State::white(&state.frame));
        Look { state, base: Absorber::new(&lens, state.held()), lens, slow: state.lens(&state.noise) }
    }

    /// The terms that leave the best models, refitted, the best first; none when no term says anything.
    fn best<'t>(&self, terms: &'t [Term]) -> Vec<(State, &'t Term)> {
        let (periodic, others): (Vec<&Term>, Vec<&Term>) = terms.iter().partition(|term| term.period_s.is_some());
        let mut scored: Vec<(Seen, &Term)> = periodic.into_par_iter().filter_map(|term| Some((self.at_its_phases(term)?, term))).collect();
        let others: Option<Vec<_>> = others.par_chunks(TOGETHER).map(|terms| self.scores(terms)).collect();
        let Some(others) = others else { return Vec::new() };
        scored.extend(others.into_iter().flatten());
        scored.sort_by(|a, b| b.0.gain.total_cmp(&a.0.gain));
        // Of one form at several shapes only the best goes on.
        let mut forms: Vec<(Channel, &[String])> = Vec::new();
        scored.retain(|(_, term)| {
            let new = !forms.contains(&(term.channel, term.parts.as_slice()));
            forms.push((term.channel, &term.parts));
            new
        });
        scored.truncate(WEIGHED);
        let rows = self.state.frame.evidence.rows() as f64;
        let weigh = |left: &Left, term: &Term| self.cost(left) + rows.ln() * term.parts.len() as f64;
        let mut weighed: Vec<(f64, Seen, &Term)> = scored.into_iter().map(|(seen, term)| (weigh(&seen.left, term), seen, term)).collect();
        weighed.sort_by(|a, b| a.0.total_cmp(&b.0));
        weighed.truncate(REFITTED);
        let name = next_name(&self.state.frame.model);
        let refitted = weighed.into_par_iter().filter_map(|(_, Seen { sizes, clocks_s, .. }, term)| {
            let (frame, mut x) = extended(self.state, with_term(self.state, term, name.clone(), &sizes)?);
            set_clocks(&frame, &mut x, &clocks_s);
            let state = State::search(Arc::new(frame), &x, f64::NEG_INFINITY);
            Some((if term.period_s.is_some() { state.or_with_other_starts() } else { state }, term))
        });
        let is_sound = |(state, _): &(State, &Term)| state.bic().is_finite() && !loose(state).contains(&name);
        let mut sound: Vec<(State, &Term)> = refitted.filter(is_sound).collect();
        sound.sort_by(|(a, _), (b, _)| a.bic().total_cmp(&b.bic()));
        sound
    }

    /// What a linear refit with each of some terms says, those left out that say nothing; none where a term goes into no model.
    fn scores<'t>(&self, terms: &[&'t Term]) -> Option<Vec<(Seen, &'t Term)>> {
        let names: Vec<String> = (0..terms.len()).map(|index| format!("term_{index}")).collect();
        let mut model = fitted(self.state);
        for (term, name) in terms.iter().zip(&names) {
            model = model.with_expression(&term.definition(name.clone(), &vec![0.0; term.parts.len()])).ok()?;
        }
        let (frame, x) = extended(self.state, model);
        let score = |(term, name): (&&'t Term, &String)| {
            let by: Vec<usize> = COEFFICIENTS[..term.parts.len()].iter().filter_map(|k| unknown(&frame, name, k)).collect();
            let (_, columns) = frame.linearise(&x, &by);
            Some((self.gain(columns)?, *term))
        };
        Some(terms.iter().zip(&names).filter_map(score).collect())
    }

    /// Fall of the squared residual by these rows of derivatives, their sizes, and what they leave
    /// with the change of the base's unknowns beside them.
    fn gain(&self, slopes: DMatrix<f64>) -> Option<Seen> {
        if slopes.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let Look { lens, base, .. } = self;
        let seen = whiten_all(&self.state.frame, &lens.filters, slopes);
        let (whole, cross) = (square(&seen), product(&lens.design, &seen));
        let absorbed = base.absorbed(cross.clone());
        let unique = &whole - absorbed.tr_mul(&absorbed);
        // What the base absorbs to the last digits is not there.
        if (0..whole.nrows()).any(|row| unique[(row, row)] <= 1e-6 * whole[(row, row)]) {
            return None;
        }
        let right = &seen * &base.left;
        let sizes = unique.cholesky()?.solve(&right);
        let change = &base.change - base.solve(&cross * &sizes);
        let left = &lens.whitened - seen.tr_mul(&sizes) - lens.design.tr_mul(&change);
        let left = Left { rows: left, change };
        Some(Seen { gain: right.dot(&sizes), sizes: sizes.as_slice().to_vec(), left, clocks_s: Vec::new() })
    }

    /// Twice the negative log-likelihood of what is left, with the most likely slow noise beside it.
    fn cost(&self, left: &Left) -> f64 {
        left_cost(self.state, &left.rows, &left.change)
    }
}

/// What a linear refit with a term says of it.
struct Seen {
    /// Fall of the squared residual, in units of the sensors' noise.
    gain: f64,
    /// Its coefficients.
    sizes: Vec<f64>,
    left: Left,
    /// What the clock of each log shows at its start, s; none where the term does not ask.
    clocks_s: Vec<f64>,
}

/// What a linear refit leaves.
struct Left {
    /// In units of the sensors' noise.
    rows: DVector<f64>,
    /// Change of the base's unknowns.
    change: DVector<f64>,
}

/// Deviations that the size of every proposed term must be away from none.
const DETERMINED: f64 = 3.0;

/// Proposed terms whose size the logs do not tell, or whose shape rests on a bound: such a one
/// trades with another, or stands in for a simpler one. The edges of a switch may be as sharp as
/// they come.
fn loose(state: &State) -> Vec<String> {
    let (frame, covariance, bounds) = (&state.frame, state.covariance(), state.frame.bounds());
    let tells = |place: usize| state.x[place].abs() > DETERMINED * covariance[(place, place)].max(0.0).sqrt();
    let on_bound = |effect: &str| {
        frame.free.iter().enumerate().any(|(place, &index)| {
            let (parameter, (min, max), x) = (&frame.model.parameters()[index], bounds[place], state.x[place]);
            parameter.effect == effect && parameter.name != dictionary::EDGE && (x <= min || x >= max)
        })
    };
    let names = frame.model.effects().map(|effect| effect.spec().id).filter(|id| id.starts_with(PREFIX));
    let is_loose = |effect: &&str| on_bound(effect) || !COEFFICIENTS.iter().filter_map(|k| unknown(frame, effect, k)).any(tells);
    names.filter(is_loose).map(str::to_owned).collect()
}

/// The model with its free parameters where the fit has them.
fn fitted(state: &State) -> Model {
    let mut values = state.frame.model.values();
    state.frame.free.iter().zip(&state.x).for_each(|(&index, &value)| values[index] = value);
    Model::clone(&state.frame.model).with_values(&values)
}

/// The fitted model with a term of these sizes.
fn with_term(state: &State, term: &Term, name: String, sizes: &[f64]) -> Option<Model> {
    let mut model = fitted(state).with_expression(&term.definition(name, sizes)).ok()?;
    if let Some(period_s) = term.period_s {
        model.uncertainty.clock_sigma_s = model.uncertainty.clock_sigma_s.max(CLOCK * period_s);
    }
    Some(model)
}

/// A model with more or less in it on the same logs, and where its unknowns begin.
fn extended(state: &State, model: Model) -> (Frame, Vec<f64>) {
    let frame = Frame::new(Arc::new(model), Arc::clone(&state.frame.evidence));
    let x = frame.as_in(&state.frame, &state.x, None);
    (frame, x)
}

/// Place among the unknowns of a parameter.
fn unknown(frame: &Frame, effect: &str, name: &str) -> Option<usize> {
    let parameters = frame.model.parameters();
    frame.free.iter().position(|&index| parameters[index].effect == effect && parameters[index].name == name)
}
