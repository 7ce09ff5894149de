//! Every promising effect refitted on coarser evidence: which of them are worth a refit on all of it.
//!
//! A refit goes most of its way far from where it ends, and some go it several times, from different beginnings. Means
//! of more rows show the way as well, at a fraction of the cost; only what ends near the best there is refitted and
//! judged on the evidence itself.

use std::collections::BTreeSet;

use energy::EffectSpec;

use super::candidate::{Candidate, Untested, candidates};
use super::handover::handed_over;
use super::judge::{ABSORBED, explained, threshold};
use super::look::ALIKE;
use super::progress::{Progress, Told};
use super::score::{Score, Scoring};
use super::state::State;
use super::trial::{glance, sketch};

/// Effects that are refitted: the best by what a linear refit promises, by the score against slow
/// noise, and by what they explain where no slow noise excuses it.
const REFITTED: usize = 4;
const BY_STATISTIC: usize = 1;
const BY_EXPLAINED: usize = 2;
/// Of those that a refit of the base absorbs nearly whole, and of those that look like the best.
const ABSORBED_MAX: usize = 4;
const LIKE_THE_BEST: usize = 3;
/// Share of what the best explains that such an effect must explain to be refitted.
const SHARE: f64 = 0.1;
/// Confounding from which on an effect looks like the best.
const LOOKS_ALIKE: f64 = 0.9;

/// Confounding with the best from which on an effect may do its work.
const MAY_DO_THE_WORK: f64 = 0.4;

/// Trials from whose end the base is refitted.
const BEGUN_FROM: usize = 2;
/// Fall of the cost that makes a base a better one, in units of two log-likelihoods.
pub(super) const BETTER: f64 = 1.0;

/// Share of the best gain on coarser evidence from which on an effect may be the best on all of it. Means of many rows
/// take something of a quick effect, and steps as long as they bend a curved one a little.
const MAY_BE_BEST: f64 = 0.7;

/// One effect on coarser evidence.
pub(super) struct Sketch {
    /// Place of its score.
    pub(super) place: usize,
    /// The base model with it, at its best there.
    pub(super) state: State,
    /// Fall of the Bayesian information criterion there.
    pub(super) delta_bic: f64,
}

/// The absent effects of a base, and how the promising ones do on coarser evidence.
pub(super) struct Sketches<'a> {
    /// Every absent effect that the logs excite, by how much it explains.
    pub(super) scored: Vec<(Score, Candidate)>,
    /// Effects that cannot be tried on these logs.
    pub(super) untested: Vec<Untested>,
    /// How many of the others were asked about.
    pub(super) tried: usize,
    /// The base on coarser evidence.
    base: State,
    /// Those that were not yet taken, best first.
    drawn: Vec<Sketch>,
    /// Places of effects whose work was handed over.
    handed_over: Vec<usize>,
    /// Places of all that were drawn.
    seen: Vec<usize>,
    /// Who is told which is drawn.
    told: Told<'a>,
}

impl<'a> Sketches<'a> {
    /// Of this base: what is worth a refit by its score, then what looks like the best of that.
    pub(super) fn new(base: &State, told: Told<'a>) -> Sketches<'a> {
        told(Progress::Asking);
        let (able, untested) = candidates(&base.frame, &base.x);
        let coarse = base.coarse();
        let scoring = Scoring::with_coarse(base, &coarse);
        let scores = scoring.score_all(&able);
        let mut scored: Vec<(Score, Candidate)> = scores.into_iter().zip(able).filter_map(|(score, one)| Some((score?, one))).collect();
        scored.sort_by(|a, b| b.0.gain.total_cmp(&a.0.gain));
        // What does nothing at all beside this base was no question, nor is what stands in for effects that the columns of the logs leave out
        // a further one than these.
        let tried = scored.iter().filter(|(_, candidate)| !candidate.stands_in).count();
        let worth = worth_a_refit(base, &scored, tried);
        let (drawn, handed_over, seen) = (Vec::new(), Vec::new(), Vec::new());
        let mut sketches = Sketches { scored, untested, tried, base: coarse, drawn, handed_over, seen, told };
        let places: Vec<usize> = (0..sketches.scored.len()).filter(|place| worth.contains(place)).collect();
        sketches.draw(&places);
        sketches.draw_what_looks_like_the_best();
        sketches.draw_what_is_taken_for_the_best();
        sketches.draw_what_takes_over_from_the_best();
        sketches
    }

    fn draw(&mut self, places: &[usize]) {
        for &place in places {
            self.tell(place);
            let (score, candidate) = &self.scored[place];
            let rival = self.drawn.iter().map(|one| one.state.cost).fold(f64::INFINITY, f64::min) + 3.0 * ALIKE;
            let state = sketch(&self.base, candidate, score, rival);
            self.keep(place, state);
        }
        self.drawn.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
    }

    /// Says that an effect is tried, which may be asked a second time from another beginning.
    fn tell(&self, place: usize) {
        let before: BTreeSet<usize> = self.seen.iter().copied().filter(|&seen| seen != place).collect();
        (self.told)(Progress::Trying { effect: self.scored[place].0.spec.id, number: before.len() + 1, of: self.scored.len() });
    }

    /// Says that one is refitted on all of the evidence.
    pub(super) fn tell_refit(&self, place: usize) {
        (self.told)(Progress::Refitting { effect: self.scored[place].0.spec.id });
    }

    fn keep(&mut self, place: usize, state: State) {
        self.seen.push(place);
        self.drawn.push(Sketch { place, delta_bic: state.delta_bic(&self.base), state });
    }

    fn best(&self) -> Option<&Sketch> {
        self.drawn.first().filter(|best| best.delta_bic > threshold(self.tried))
    }

    /// What looks like the best must be heard as well.
    fn draw_what_looks_like_the_best(&mut self) {
        let Some(best) = self.best().map(|best| &self.scored[best.place].0) else { return };
        let alike = |place: &usize| !self.seen.contains(place) && best.confounded(&self.scored[*place].0) > LOOKS_ALIKE;
        let alike: Vec<usize> = (0..self.scored.len()).filter(alike).take(LIKE_THE_BEST).collect();
        self.draw(&alike);
    }

    /// So must what the catalogue says is taken for it: from the base, which has bent itself to do without
    /// either, the way to the one may be open and that to the other not.
    fn draw_what_is_taken_for_the_best(&mut self) {
        let Some(best) = self.best() else { return };
        let spec = self.scored[best.place].0.spec;
        let (begin, delta_bic) = (best.state.clone(), best.delta_bic);
        for place in 0..self.scored.len() {
            let other = self.scored[place].0.spec;
            let known = self.drawn.iter().position(|one| one.place == place);
            let behind = known.is_none_or(|known| delta_bic - self.drawn[known].delta_bic > ALIKE);
            if !behind || other.id == spec.id || !are_taken_for_each_other(spec, other) {
                continue;
            }
            self.tell(place);
            let Some(state) = self.base.with(other, &begin, known.map(|known| &self.drawn[known].state)) else { continue };
            self.keep_the_better(place, state);
        }
        self.drawn.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
    }

    /// So must what can take over the work of the best step by step: from the base, the way to the one was open and that to
    /// the other may not have been.
    fn draw_what_takes_over_from_the_best(&mut self) {
        if let Some((place, state)) = self.best().map(|best| (best.place, best.state.clone())) {
            self.draw_what_takes_over_from(place, &state, &[]);
        }
    }

    /// Draws what takes over the work of an effect that is at its best on coarser evidence, but for what is known to do as
    /// well; once for each effect.
    pub(super) fn draw_what_takes_over_from(&mut self, place_of_best: usize, has: &State, as_good: &[&str]) {
        if self.handed_over.contains(&place_of_best) {
            return;
        }
        self.handed_over.push(place_of_best);
        let spec = self.scored[place_of_best].0.spec;
        for place in 0..self.scored.len() {
            let score = &self.scored[place].0;
            let known = self.drawn.iter().position(|one| one.place == place);
            let behind = known.is_none_or(|known| self.drawn[known].state.cost > has.cost + ALIKE);
            // What a refit of the base absorbs nearly whole looks like everything and nothing, and of what it does wholly only the catalogue says anything.
            let may = match score.freedom {
                0 => are_taken_for_each_other(spec, score.spec),
                _ => score.uniqueness < ABSORBED || score.confounded(&self.scored[place_of_best].0) > MAY_DO_THE_WORK,
            };
            if place == place_of_best || !behind || !may || as_good.contains(&score.spec.id) {
                continue;
            }
            self.tell(place);
            let Some(state) = handed_over(&self.base, has, spec, score.spec) else { continue };
            self.keep_the_better(place, state);
        }
        self.drawn.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
    }

    /// Keeps a refit of an effect, unless a better one is known.
    fn keep_the_better(&mut self, place: usize, state: State) {
        match self.drawn.iter().position(|one| one.place == place) {
            Some(known) if self.drawn[known].state.cost > state.cost => {
                self.drawn.remove(known);
                self.keep(place, state);
            }
            Some(_) => {}
            None => self.keep(place, state),
        }
    }

    /// Effects that a refit of the base absorbs nearly whole, where a first refit is promising.
    pub(super) fn draw_what_begins_alike(&mut self) {
        let promising = |&place: &usize| {
            let (score, candidate) = &self.scored[place];
            let absorbed = score.uniqueness < ABSORBED && !self.seen.contains(&place);
            absorbed && self.base.cost - glance(&self.base, candidate, score) > 0.5 * threshold(self.tried)
        };
        let places: Vec<usize> = (0..self.scored.len()).filter(promising).collect();
        self.draw(&places);
    }

    /// The best of those that are left, and all that may turn out to be as good; none when no other can be accepted.
    pub(super) fn next_wave(&mut self) -> Option<Vec<Sketch>> {
        let least = threshold(self.tried) - ALIKE;
        let best = self.drawn.first().filter(|best| best.delta_bic > least)?.delta_bic;
        let least = least.max(MAY_BE_BEST * best - 3.0 * ALIKE);
        let count = self.drawn.iter().take_while(|one| one.delta_bic > least).count();
        Some(self.drawn.drain(..count).collect())
    }

    /// The base refitted from where the best ended, where that is clearly better.
    pub(super) fn better_base(&self, base: &State) -> Option<State> {
        let gaining = self.drawn.iter().filter(|one| one.delta_bic > 0.0).take(BEGUN_FROM);
        let best = gaining.filter_map(|one| self.base.begun_from(&one.state)).min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        let better = |better: &State, than: &State| better.cost < than.cost - BETTER;
        if !better(&best, &self.base) {
            return None;
        }
        Some(best.on(base.frame.evidence.clone())).filter(|best| better(best, base))
    }
}

/// Whether the catalogue says that one of two effects is taken for the other.
pub(super) fn are_taken_for_each_other(one: &EffectSpec, other: &EffectSpec) -> bool {
    let says = |a: &EffectSpec, b: &EffectSpec| a.confused_with.iter().any(|(id, _)| *id == b.id);
    says(one, other) || says(other, one)
}

/// Places of the scores, best gain first, whose effects are refitted for real.
fn worth_a_refit(base: &State, scored: &[(Score, Candidate)], tried: usize) -> Vec<usize> {
    let by = |of: fn(&Score) -> f64, count: usize| {
        let mut places: Vec<usize> = (0..scored.len()).collect();
        places.sort_by(|&a, &b| of(&scored[b].0).total_cmp(&of(&scored[a].0)));
        places.truncate(count);
        places
    };
    let best_gain = scored.first().map_or(0.0, |(score, _)| score.gain);
    let near = (0..scored.len()).filter(|&place| {
        let gain = scored[place].0.gain;
        place < REFITTED && gain > 0.3 * best_gain || gain > best_gain - 2.0 * ALIKE
    });
    let weighty = |&place: &usize| scored[place].0.gain.max(scored[place].0.statistic) > 0.5 * threshold(tried);
    let mut places: Vec<usize> = near.chain(by(|score| score.statistic, BY_STATISTIC)).filter(weighty).collect();
    if !explained(base) {
        let explains = |&place: &usize| scored[place].0.explained > 10.0 * threshold(tried);
        places.extend(by(|score| score.explained, BY_EXPLAINED).into_iter().filter(explains));
        // The base model may have bent itself to absorb an effect.
        let most = scored.iter().map(|(score, _)| score.explained).fold(0.0, f64::max);
        let absorbed = |&place: &usize| scored[place].0.uniqueness < ABSORBED && scored[place].0.explained > SHARE * most;
        places.extend(by(|score| score.explained, scored.len()).into_iter().filter(explains).filter(absorbed).take(ABSORBED_MAX));
        // Or it does all of an effect's work already, or more.
        let (wholly, overdone): (Vec<usize>, Vec<usize>) =
            (0..scored.len()).filter(|&place| scored[place].0.freedom == 0).partition(|&place| scored[place].0.uniqueness < ABSORBED);
        places.extend([wholly, overdone].into_iter().flat_map(|places| places.into_iter().take(ABSORBED_MAX)));
    }
    places
}
