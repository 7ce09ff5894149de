//! One effect after the other, until the model is complete or nothing explains what is left.

use std::sync::Arc;

use energy::{Channel, EffectSpec, Model};

use super::candidate::{Candidate, Untested, candidates};
use super::evidence::Evidence;
use super::judge::{ABSORBED, Refusal, explained, hardly_moves, refusals, squares, threshold};
use super::prune::shorter;
use super::score::{Score, Scoring};
use super::state::State;
use super::trial::{Trial, held_out};

/// What is known after one look at every absent effect.
#[derive(Debug, Clone)]
pub struct Step {
    /// The model so far, fitted.
    pub base: State,
    /// RMS on held-out logs with the model so far, by channel; empty without such logs.
    pub base_holdout: Vec<(Channel, f64)>,
    /// Every absent effect that the logs excite, by how much it explains.
    pub scores: Vec<Score>,
    /// The best of them refitted, best first.
    pub trials: Vec<Trial>,
    /// Why each of them is not accepted; nothing where it is.
    pub refusals: Vec<Vec<Refusal>>,
    /// Effects that cannot be tried on these logs.
    pub untested: Vec<Untested>,
    /// The conclusion.
    pub outcome: Outcome,
}

/// The conclusion of one look.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// The model explains the logs.
    Complete,
    /// The first trial is missing; the logs cannot tell it from those of these places.
    Missing(Vec<usize>),
    /// The model does not explain the logs and no effect does.
    Unknown,
}

/// Effects within this of the best one's information criterion are as likely.
const ALIKE: f64 = 10.0;
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
/// Share by which an effect may do less well than another with more numbers.
const AS_WELL: f64 = 0.01;
/// Confounding from which on an effect looks like the best.
const LOOKS_ALIKE: f64 = 0.9;

/// Trials from whose end the base is refitted.
const BEGUN_FROM: usize = 2;
/// Fall of the cost that makes a base a better one, in units of two log-likelihoods.
const BETTER: f64 = 1.0;

impl Step {
    /// Looks at every effect that the base model lacks; once more where that shows that the base was not at its best: what looks
    /// like a gain of an effect may be that of a better place to begin.
    #[must_use]
    pub fn look(base: State, holdout: Option<&Arc<Evidence>>) -> Step {
        let step = Step::look_from(base, holdout);
        match step.better_base() {
            Some(base) => Step::look_from(base, holdout),
            None => step,
        }
    }

    /// The base refitted from where the best trials ended, where that is clearly better.
    fn better_base(&self) -> Option<State> {
        let gaining = self.trials.iter().filter(|trial| trial.delta_bic > 0.0).take(BEGUN_FROM);
        let best = gaining.map(|trial| self.base.begun_from(&trial.state)).min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        (best.cost < self.base.cost - BETTER).then_some(best)
    }

    fn look_from(base: State, holdout: Option<&Arc<Evidence>>) -> Step {
        let (able, untested) = candidates(&base.frame, &base.x);
        let scoring = Scoring::new(&base);
        let mut scored: Vec<(Score, &Candidate)> = able.iter().filter_map(|one| scoring.score(one).map(|score| (score, one))).collect();
        scored.sort_by(|a, b| b.0.gain.total_cmp(&a.0.gain));
        let (places, rest): (Vec<usize>, Vec<usize>) = {
            let wanted = worth_a_refit(&base, &scored, able.len());
            (0..scored.len()).partition(|place| wanted.contains(place))
        };
        let mut trials: Vec<Trial> = Vec::new();
        let refit = |place: usize, trials: &mut Vec<Trial>| {
            let (score, candidate) = &scored[place];
            let rival = trials.iter().map(|trial| trial.state.cost).fold(f64::INFINITY, f64::min) + 3.0 * ALIKE;
            trials.push(Trial::run(&base, candidate, score, rival, holdout));
        };
        places.into_iter().for_each(|place| refit(place, &mut trials));
        trials.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
        let base_holdout = holdout.map_or_else(Vec::new, |evidence| held_out(base.told(), evidence));
        // What looks like the best must be heard as well.
        if let Some(best) = trials.first().filter(|best| best.delta_bic > threshold(able.len())) {
            let best = scored.iter().map(|(score, _)| score).find(|score| score.spec.id == best.spec.id);
            let alike = |&place: &usize| best.is_some_and(|best| best.confounded(&scored[place].0) > LOOKS_ALIKE);
            let alike: Vec<usize> = rest.into_iter().filter(alike).take(LIKE_THE_BEST).collect();
            alike.into_iter().for_each(|place| refit(place, &mut trials));
            trials.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
        }
        // So must what the catalogue says is taken for it: from the base, which has bent itself to do without
        // either, the way to the one may be open and that to the other not.
        if let Some(best) = trials.first().filter(|best| best.delta_bic > threshold(able.len())).cloned() {
            let taken_for = |a: &EffectSpec, b: &EffectSpec| a.confused_with.iter().any(|(id, _)| *id == b.id);
            let others = scored.iter().map(|(score, _)| score).filter(|score| {
                let behind = |trial: &Trial| trial.spec.id != score.spec.id || best.delta_bic - trial.delta_bic > ALIKE;
                (taken_for(best.spec, score.spec) || taken_for(score.spec, best.spec)) && trials.iter().all(behind)
            });
            let others: Vec<Trial> = others.filter_map(|score| Trial::from_rival(&base, score, &best, holdout)).collect();
            for other in others {
                match trials.iter().position(|trial| trial.spec.id == other.spec.id) {
                    Some(place) if trials[place].delta_bic < other.delta_bic => trials[place] = other,
                    Some(_) => {}
                    None => trials.push(other),
                }
            }
            trials.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
        }
        let judge = |trial: Trial| {
            let refusals = refusals(&base, &trial, &base_holdout, holdout, able.len());
            (trial, refusals)
        };
        let mut judged: Vec<(Trial, Vec<Refusal>)> = trials.into_iter().map(judge).collect();
        // An effect that begins as something the base model has (a weak cell, as another charge at the
        // start) shows at its real size only: before nothing is found, those are tried as well.
        if judged.iter().all(|(_, refusals)| !refusals.is_empty()) && !explained(&base) {
            let tried = |place: usize| judged.iter().any(|(trial, _)| trial.spec.id == scored[place].0.spec.id);
            let begins_alike: Vec<usize> =
                (0..scored.len()).filter(|&place| scored[place].0.uniqueness < ABSORBED && !tried(place)).collect();
            let mut more = Vec::new();
            let promising = begins_alike.into_iter().filter(|&place| {
                let (score, candidate) = &scored[place];
                base.cost - Trial::glance(&base, candidate, score) > 0.5 * threshold(able.len())
            });
            promising.for_each(|place| refit(place, &mut more));
            more.sort_by(|a, b| b.delta_bic.total_cmp(&a.delta_bic));
            judged.extend(more.into_iter().map(judge));
        }
        // The accepted ones come first, and of those that do as well the simplest.
        judged.sort_by_key(|(_, refusals)| !refusals.is_empty());
        let accepted = judged.iter().take_while(|(_, refusals)| refusals.is_empty()).count();
        if let Some(simplest) = simplest(&judged[..accepted], holdout) {
            judged[..=simplest].rotate_right(1);
        }
        let (trials, refusals): (Vec<Trial>, Vec<Vec<Refusal>>) = judged.into_iter().unzip();
        let accepted = refusals.iter().take_while(|refusals| refusals.is_empty()).count();
        let outcome = match accepted {
            0 if explained(&base) => Outcome::Complete,
            0 => Outcome::Unknown,
            _ => {
                let first = &trials[0];
                let alike = |&place: &usize| {
                    let other = &trials[place];
                    // What was passed over as needlessly rich is no alternative; what does as well, or predicts the
                    // same with no more numbers, is one.
                    let ahead = other.delta_bic - first.delta_bic;
                    let same = hardly_moves(&first.state, &other.state);
                    let richer = other.state.freedom > first.state.freedom;
                    // With a number at the end of its range it has become the simpler one.
                    let degenerate = same && richer && other.is_at_an_end();
                    let likely = ahead.abs() < ALIKE && !degenerate || same && !richer;
                    likely && !first.is_also(other) && !other.is_also(first)
                };
                let alike: Vec<usize> = (1..accepted).filter(alike).collect();
                let by_another_name = |&place: &usize| alike.iter().any(|&one| one != place && trials[one].is_also(&trials[place]));
                let (_, alike): (Vec<usize>, Vec<usize>) = alike.iter().copied().partition(by_another_name);
                Outcome::Missing(alike)
            }
        };
        let scores = scored.into_iter().map(|(score, _)| score).collect();
        Step { base, base_holdout, scores, trials, refusals, untested, outcome }
    }
}

/// The effect that does as well as the first, and with fewer numbers: by a criterion less than a
/// hundredth below the first's, or predictions that hardly differ, with an error on held-out logs that is no larger. A table of
/// numbers finds something to do in the last rows before empty, where a tiny error of charge is one
/// of millivolts.
fn simplest(judged: &[(Trial, Vec<Refusal>)], holdout: Option<&Arc<Evidence>>) -> Option<usize> {
    let (first, _) = judged.first()?;
    let held = |trial: &Trial| holdout.map_or(1.0, |evidence| squares(evidence, &trial.holdout));
    let does_as_well = |&place: &usize| {
        let trial = &judged[place].0;
        let near = trial.delta_bic > (1.0 - AS_WELL) * first.delta_bic || hardly_moves(&first.state, &trial.state);
        near && held(trial) <= (1.0 + AS_WELL) * held(first) && trial.spec.parameters.len() < first.spec.parameters.len()
    };
    (1..judged.len()).filter(does_as_well).min_by_key(|&place| judged[place].0.spec.parameters.len())
}

/// Places of the scores, best gain first, whose effects are refitted for real.
fn worth_a_refit(base: &State, scored: &[(Score, &Candidate)], tried: usize) -> Vec<usize> {
    let by = |of: fn(&Score) -> f64, count: usize| {
        let mut places: Vec<usize> = (0..scored.len()).collect();
        places.sort_by(|&a, &b| of(&scored[b].0).total_cmp(&of(&scored[a].0)));
        places.truncate(count);
        places
    };
    let best_gain = scored.first().map_or(0.0, |(score, _)| score.gain);
    let most = scored.iter().map(|(score, _)| score.explained).fold(0.0, f64::max);
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
        let absorbed = |&place: &usize| scored[place].0.uniqueness < ABSORBED && scored[place].0.explained > SHARE * most;
        places.extend(by(|score| score.explained, scored.len()).into_iter().filter(explains).filter(absorbed).take(ABSORBED_MAX));
        // Or it does all of an effect's work already.
        let wholly = |&place: &usize| scored[place].0.freedom == 0;
        places.extend((0..scored.len()).filter(wholly).take(ABSORBED_MAX));
    }
    places
}

/// The whole search.
#[derive(Debug, Clone)]
pub struct Search {
    /// Every look, first to last.
    pub steps: Vec<Step>,
    /// The model at the end.
    pub last: State,
}

/// Most effects that are added.
const EFFECTS_MAX: usize = 8;

/// Adds effects until the model is complete or none is accepted.
#[must_use]
pub fn search(model: Arc<Model>, evidence: Arc<Evidence>, holdout: Option<&Arc<Evidence>>) -> Search {
    let mut state = State::of_model(model, evidence);
    let mut steps = Vec::new();
    for look in 0.. {
        let step = Step::look(state, holdout);
        let go_on = matches!(step.outcome, Outcome::Missing(_)) && look < EFFECTS_MAX;
        let last = if go_on { step.trials[0].state.clone() } else { step.base.clone() };
        steps.push(step);
        if !go_on {
            return Search { steps, last };
        }
        state = last;
        while let Some(way) = shorter(&steps, holdout) {
            steps = way;
            state = steps[steps.len() - 1].trials[0].state.clone();
        }
    }
    unreachable!("a search ends")
}
