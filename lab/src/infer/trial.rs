//! A candidate for real: refitted, weighed, and judged on logs that the fit has not seen.

use std::sync::Arc;

use energy::{Channel, EffectSpec, Model, Parameter, ParameterSpec};

use super::candidate::{Candidate, is_nothing_by_default, refines, usual};
use super::descent::{Asked, descend_roughly};
use super::evidence::Evidence;
use super::frame::Frame;
use super::judge::ABSORBED;
use super::look::{ALIKE, TIE};
use super::noise::Noise;
use super::rough::Rough;
use super::score::Score;
use super::starts::look_for;
use super::state::{State, filters, likelihood, likelihood_of_log, residual, rms};

/// A refitted candidate.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The effect.
    pub spec: &'static EffectSpec,
    /// The model with it, at its best.
    pub state: State,
    /// Fall of the Bayesian information criterion.
    pub delta_bic: f64,
    /// Share of the effect that a refit of the base model could not absorb, 0..1.
    pub uniqueness: f64,
    /// Largest RMS, by log, by which it moves its own channel.
    pub change: f64,
    /// The held-out logs that it can predict; none where there is none.
    pub held: Option<Arc<Evidence>>,
    /// RMS on these, by channel; empty without such logs.
    pub holdout: Vec<(Channel, f64)>,
}

impl Trial {
    /// Refits the base model with the candidate.
    #[must_use]
    pub fn run(base: &State, candidate: &Candidate, score: &Score, holdout: Option<&Arc<Evidence>>) -> Trial {
        let sketch = sketch(&base.coarse(), candidate, score, f64::INFINITY);
        Trial::refit(base, score, sketch, holdout)
    }

    /// Refits the base model with an effect, beginning where that has led on coarser evidence.
    #[must_use]
    pub(super) fn refit(base: &State, score: &Score, sketch: State, holdout: Option<&Arc<Evidence>>) -> Trial {
        let state = sketch.on(Arc::clone(&base.frame.evidence));
        Trial::of(base, state.with_what_is_open_as_before(), score.spec, score.uniqueness, holdout)
    }

    /// Whether the effect could do with fewer numbers: one of its own rests at an end of its range, or is less than a
    /// deviation from where it does nothing or, where it only shapes the effect, from zero. One that is nothing by default
    /// refines the effect: without it, that is what it usually is. Without its only size there is no effect.
    #[must_use]
    pub fn has_a_number_to_spare(&self) -> bool {
        let (frame, held, sigmas) = (&self.state.frame, self.state.held(), self.state.sigmas());
        (0..frame.free.len()).any(|place| {
            let parameter = &frame.model.parameters()[frame.free[place]];
            let spec = self.spec.parameters.iter().find(|spec| parameter.effect == self.spec.id && spec.name == parameter.name);
            let sizes = self.spec.parameters.iter().filter(|spec| spec.null.is_some() && !is_nothing_by_default(spec)).count();
            let only_size = |spec: &ParameterSpec| spec.null.is_some() && sizes == 1;
            let idle = |spec: &ParameterSpec| !only_size(spec) && (self.state.x[place] - spec.null.unwrap_or(0.0)).abs() < sigmas[place];
            spec.is_some_and(|spec| !is_nothing_by_default(spec) && (held.contains(&place) || idle(spec)))
        })
    }

    /// Whether half of the effect's sizes or more rest at an end of their range where it is not nothing: as large as it would
    /// have to be it cannot be.
    #[must_use]
    pub fn is_beyond_its_range(&self) -> bool {
        let told = self.state.told();
        let (frame, held) = (&told.frame, told.held());
        let sizes = || {
            let own = |(place, &index): (usize, &usize)| {
                let parameter = &frame.model.parameters()[index];
                let spec = self.spec.parameters.iter().find(|spec| parameter.effect == self.spec.id && spec.name == parameter.name);
                Some((place, spec?.null?))
            };
            frame.free.iter().enumerate().filter_map(own)
        };
        let beyond = sizes().filter(|(place, null)| held.contains(place) && told.x[*place] != *null).count();
        beyond > 0 && 2 * beyond >= sizes().count()
    }

    /// Whether the other effect is this one under another name, or this one with more freedom: with the
    /// numbers that it has in common with this one, and the rest of its own at an end of their ranges,
    /// it predicts the same.
    #[must_use]
    pub fn is_also(&self, other: &Trial) -> bool {
        let (own, theirs) = (&self.state.frame, &other.state.frame);
        let shared = |name: &str| self.spec.parameters.iter().any(|parameter| parameter.name == name);
        let in_common = other.spec.parameters.iter().filter(|parameter| shared(parameter.name)).count();
        if self.spec.channel != other.spec.channel || in_common < self.spec.parameters.len() {
            return false;
        }
        let value = |wanted: &Parameter| {
            let effect = if wanted.effect == other.spec.id { self.spec.id } else { wanted.effect };
            let same = |&place: &usize| {
                let known = &own.model.parameters()[own.free[place]];
                known.effect == effect && known.name == wanted.name
            };
            (0..own.free.len()).find(same).map(|place| self.state.x[place])
        };
        let rest: Vec<usize> =
            (0..theirs.free.len()).filter(|&place| value(&theirs.model.parameters()[theirs.free[place]]).is_none()).collect();
        if rest.len() > REST_MAX {
            return false;
        }
        let expected = own.predict(&self.state.x);
        // Every corner of what is left: a bit for each, set for the upper end.
        (0..1_usize << rest.len()).any(|corner| {
            let number = |(place, &index): (usize, &usize)| {
                let parameter = &theirs.model.parameters()[index];
                let bit = rest.iter().position(|&one| one == place).map_or(0, |bit| corner >> bit & 1);
                value(parameter).unwrap_or(if bit == 1 { parameter.max } else { parameter.min })
            };
            let rough = self.state.x[own.free.len()..].iter().copied();
            let found = theirs.predict(&theirs.free.iter().enumerate().map(number).chain(rough).collect::<Vec<_>>());
            expected.iter().zip(&found).all(|(a, b)| (a - b).abs() <= SAME * (1.0 + a.abs()))
        })
    }

    pub(super) fn of(base: &State, state: State, spec: &'static EffectSpec, uniqueness: f64, holdout: Option<&Arc<Evidence>>) -> Trial {
        let state = as_plain_as_may_be(state, spec);
        let parameters = state.frame.model.parameters().iter().enumerate();
        let nulls = parameters.filter(|(_, parameter)| parameter.effect == spec.id).zip(spec.parameters);
        let nulls: Vec<(usize, f64)> = nulls.filter_map(|((index, _), spec)| spec.null.map(|null| (index, null))).collect();
        let told = state.told();
        let change = told.frame.change(&told.x, spec.channel, &nulls);
        let held = holdout.and_then(|evidence| evidence.that_judges(&state.frame.model));
        let holdout = held.as_ref().map_or_else(Vec::new, |evidence| held_out(state.told(), evidence));
        Trial { spec, delta_bic: state.delta_bic(base), uniqueness, change, held, holdout, state }
    }
}

/// The state without those numbers that refine an effect, where the logs do not speak for them. What is made of such a number
/// otherwise is noise: how a leak goes with the temperature is easily found in logs that hardly tell, and wrong at any other temperature.
pub(super) fn as_plain_as_may_be(state: State, spec: &EffectSpec) -> State {
    let refining: Vec<&str> = spec.parameters.iter().filter(|number| refines(spec, number)).map(|number| number.name).collect();
    let stands = |name: &str| state.frame.model.parameters().iter().any(|one| one.effect == spec.id && one.name == name && one.free);
    if !refining.iter().any(|name| stands(name)) || !act_through_sizes(&state, spec) {
        return state;
    }
    let model = Model::clone(&state.frame.model).unstated(spec, &refining);
    let frame = Arc::new(Frame::new(Arc::new(model), Arc::clone(&state.frame.evidence)));
    let start = frame.like(&state, None);
    let plain = State::fit(frame, &start, &state.noise);
    if plain.bic() < state.bic() + TIE { plain } else { state }
}

/// Whether the numbers that refine an effect do nothing where its sizes are nothing.
fn act_through_sizes(state: &State, spec: &EffectSpec) -> bool {
    let frame = &state.frame;
    let at = |refined: bool| {
        let mut x = state.x.clone();
        for (place, &index) in frame.free.iter().enumerate() {
            let parameter = &frame.model.parameters()[index];
            let number = spec.parameters.iter().find(|number| parameter.effect == spec.id && number.name == parameter.name);
            if let Some((number, null)) = number.and_then(|number| Some((number, number.null?))) {
                x[place] = if refined && refines(spec, number) { usual(number) } else { null };
            }
        }
        frame.predict(&x)
    };
    at(true).iter().zip(at(false)).all(|(with, without)| (with - without).abs() <= SAME * (1.0 + without.abs()))
}

/// The base model refitted with the candidate on the base's evidence, from where its score expects it and, if that ends
/// with less than the score promises, from its usual size, whichever is better. Where even what
/// is promised would cost more than a `rival`, the first refit is enough.
#[must_use]
pub(super) fn sketch(base: &State, candidate: &Candidate, score: &Score, rival: f64) -> State {
    let frame = Arc::new(Frame::new(Arc::clone(&candidate.model), Arc::clone(&base.frame.evidence)));
    let usual: Vec<f64> =
        candidate.spec.parameters.iter().zip(&score.expected).map(|(p, &e)| if p.null.is_some() { usual(p) } else { e }).collect();
    let from = |x: &[f64], own: &[f64]| start(&frame, base, x, candidate, own);
    // A second look is worth its time where the linear theory promised more, and that would do.
    let promised = base.cost - CONTENT * score.gain;
    let content = if promised < rival { promised } else { f64::INFINITY };
    if score.freedom == 0 {
        let start = beside_the_base(base, score, candidate, |x, own| from(x, own), &frame);
        let state = State::search(Arc::clone(&frame), &start, content);
        return if state.cost < base.cost - ALIKE { state.or_with_other_starts() } else { state };
    }
    let mut state = State::search(Arc::clone(&frame), &from(&score.base_x, &score.expected), content);
    let better = |state: State, other: Option<State>| other.filter(|other| other.cost < state.cost).unwrap_or(state);
    if state.cost >= content {
        let other = state.fit_elsewhere(&from(&score.base_x, &usual), &state.noise);
        state = better(state, other);
    }
    if score.uniqueness < ABSORBED {
        // The base model may have bent itself to do the effect's work: it is put back first.
        let other = state.search_elsewhere(&from(&base.frame.start(), &usual), content);
        state = better(state, other);
    }
    if state.cost < base.cost - ALIKE { state.or_with_other_starts() } else { state }
}

/// Shares of its usual size at which an effect is begun that the base does wholly, as it is.
const BEGUN_AT: [f64; 4] = [1.0, 0.3, 0.1, 0.03];
/// Rise of the cost up to which the base still makes up for it.
const MADE_UP_FOR: f64 = 100.0;

/// Where a refit begins of an effect whose work the base does wholly: as large as usual, or as large as the base can make up for in a straight line.
fn beside_the_base(
    base: &State,
    score: &Score,
    candidate: &Candidate,
    from: impl Fn(&[f64], &[f64]) -> Vec<f64>,
    frame: &Frame,
) -> Vec<f64> {
    let filters = filters(frame, &base.noise);
    let at_base = base.likelihood();
    let part = |share: f64| {
        let x: Vec<f64> = base.x.iter().zip(&score.base_x).map(|(x, moved)| x + share * (moved - x)).collect();
        let sized = |(spec, usual): (&ParameterSpec, &f64)| spec.null.map_or(*usual, |null| null + share * (usual - null));
        from(&x, &candidate.spec.parameters.iter().zip(&score.expected).map(sized).collect::<Vec<_>>())
    };
    let near = |x: &Vec<f64>| likelihood(frame, &residual(frame, x), &filters) < at_base + MADE_UP_FOR;
    BEGUN_AT.map(part).into_iter().find(near).unwrap_or_else(|| part(BEGUN_AT[BEGUN_AT.len() - 1]))
}

/// Cost of a first refit with the candidate at its usual size: cheap, and enough to see that an
/// effect does nothing for the base model.
#[must_use]
pub(super) fn glance(base: &State, candidate: &Candidate, score: &Score) -> f64 {
    let frame = Arc::new(Frame::new(Arc::clone(&candidate.model), Arc::clone(&base.frame.evidence)));
    let own: Vec<f64> = candidate.spec.parameters.iter().map(usual).collect();
    let start = start(&frame, base, &score.base_x, candidate, &own);
    State::fit(frame, &start, &base.noise).cost
}

/// Share by which predictions differ that are the same but for rounding.
const SAME: f64 = 1e-6;
/// Further numbers of an effect that are tried at the ends of their ranges.
const REST_MAX: usize = 3;
/// Share of the gain that the linear theory expects with which a refit is content.
const CONTENT: f64 = 0.9;

/// Clocks that are looked at, each way, and how many of them make a deviation.
const LOOKS: i32 = 8;
const LOOKS_PER_SIGMA: f64 = 4.0;

fn is_clock(what: Rough) -> bool {
    matches!(what, Rough::Clock(_))
}

/// What belongs to logs alone where each is explained best, whatever its clock shows at its start: at every time that it may show,
/// all else follows.
fn with_clocks(frame: &Frame, x: &[f64], noise: &[(Channel, Noise)], own: &[usize]) -> Vec<f64> {
    let filters = filters(frame, noise);
    let belongs = |place: usize| frame.known[place - frame.free.len()];
    let rest: Vec<usize> = own.iter().copied().filter(|&place| !is_clock(belongs(place).what)).collect();
    let mut best: Vec<(f64, Vec<f64>)> = vec![(f64::INFINITY, x.to_vec()); frame.evidence.logs.len()];
    for look in -LOOKS..=LOOKS {
        let mut tried = x.to_vec();
        let clocks = own.iter().copied().filter(|&place| is_clock(belongs(place).what));
        clocks.for_each(|place| tried[place] = belongs(place).sigma * f64::from(look) / LOOKS_PER_SIGMA);
        let there = descend_roughly(frame, &tried, noise, &rest, Asked::Never);
        for (log, best) in best.iter_mut().enumerate() {
            let cost = likelihood_of_log(frame, &there.residual, &filters, log);
            if cost < best.0 {
                *best = (cost, there.x.clone());
            }
        }
    }
    let mut x = x.to_vec();
    own.iter().for_each(|&place| {
        if let Some(log) = belongs(place).log() {
            x[place] = best[log].1[place];
        }
    });
    look_for(frame, &mut x, is_clock);
    descend_roughly(frame, &x, noise, own, Asked::Never).x
}

/// Unknowns at which a refit begins: the base model's, and the candidate's own.
fn start(frame: &Frame, base: &State, x: &[f64], candidate: &Candidate, own: &[f64]) -> Vec<f64> {
    let mut values = base.frame.values(x);
    values.splice(candidate.first..candidate.first, own.iter().copied());
    let free = frame.free.iter().map(|&index| values[index]);
    free.chain(x[base.frame.free.len()..].iter().copied()).collect()
}

/// RMS by channel on logs that the state has not seen. What belongs to one log alone (its state of
/// charge at the start) is asked of that log, within what is known of it; all else stays.
#[must_use]
pub fn held_out(state: &State, evidence: &Arc<Evidence>) -> Vec<(Channel, f64)> {
    let whole = evidence.whole.as_ref().unwrap_or(evidence);
    rms(whole, &held_out_residual(state, evidence))
}

/// Observed minus predicted on logs that the state has not seen, row by row; see [`held_out`].
#[must_use]
pub fn held_out_residual(state: &State, evidence: &Arc<Evidence>) -> Vec<f64> {
    let seen = &state.frame;
    let model = Model::clone(&seen.model).with_values(&seen.values(&state.x));
    let frame = Frame::new(Arc::new(model), Arc::clone(evidence));
    let mut x = frame.start();
    for (place, known) in frame.known.iter().enumerate().filter(|(_, known)| known.log().is_none()) {
        x[frame.free.len() + place] = seen.error(&state.x, known.what);
    }
    let own: Vec<usize> =
        (0..frame.known.len()).filter(|&place| frame.known[place].log().is_some()).map(|place| frame.free.len() + place).collect();
    let weights = state.weights();
    let of = |wanted| weights.iter().find(|(channel, _)| *channel == wanted).map(|(_, noise)| *noise);
    let noise: Vec<_> = evidence.floors.iter().map(|&(channel, floor)| (channel, of(channel).unwrap_or(Noise::white(floor)))).collect();
    let mut x = descend_roughly(&frame, &x, &noise, &own, Asked::Never).x;
    if frame.known.iter().any(|known| is_clock(known.what)) {
        x = with_clocks(&frame, &x, &noise, &own);
    }
    let whole = evidence.whole.as_ref().unwrap_or(evidence);
    residual(&Frame::new(Arc::clone(&frame.model), Arc::clone(whole)), &x)
}
