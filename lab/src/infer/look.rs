//! One look at every effect that a model lacks: which of them is missing.

use std::sync::Arc;

use energy::{Channel, catalogue};

use super::anew::begun_anew;
use super::candidate::Untested;
use super::evidence::Evidence;
use super::judge::{Court, Refusal, STRONG, before_on, explained, explains_most, falls};
use super::judge::{hardly_moves, on_the_same_logs, refusals, squared, threshold};
use super::progress::{Progress, Told, silent};
use super::prune::taken;
use super::score::Score;
use super::sketch::{Sketch, Sketches, are_taken_for_each_other};
use super::state::State;
use super::trial::{Trial, held_out};

/// What is known after one look at every absent effect.
#[derive(Debug, Clone)]
pub struct Step {
    /// The model so far, fitted.
    pub base: State,
    /// The held-out logs that it can predict; none where there is none.
    pub held: Option<Arc<Evidence>>,
    /// RMS on these, by channel; empty without such logs.
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
    /// The effect of the first trial is missing; the logs cannot tell it from these.
    Missing(Vec<&'static str>),
    /// The model does not explain the logs and no effect does.
    Unknown,
}

/// Effects within this of the best one's information criterion are as likely.
pub(super) const ALIKE: f64 = 10.0;
/// Share by which an effect may do less well than another with more numbers.
pub(super) const AS_WELL: f64 = 0.01;
/// So many effects that only the error of the logs speaks against are looked beyond.
const JOINTLY: usize = 4;

impl Step {
    /// Looks at every effect that the base model lacks; once more where that shows that the base was not at its best: what looks
    /// like a gain of an effect may be that of a better place to begin.
    #[must_use]
    pub fn look(base: State, holdout: Option<&Arc<Evidence>>) -> Step {
        Step::look_and_tell(base, holdout, &silent)
    }

    /// The same, and says how far it is.
    #[must_use]
    pub fn look_and_tell(base: State, holdout: Option<&Arc<Evidence>>, told: Told<'_>) -> Step {
        told(Progress::stands(&base, &[]));
        let begun = squared(&base);
        Step::look_after(&begun, base, holdout, told)
    }

    /// The same where effects were found since every channel had so much squared error, in floors.
    pub(super) fn look_after(begun: &[f64], base: State, holdout: Option<&Arc<Evidence>>, told: Told<'_>) -> Step {
        let held = holdout.and_then(|all| all.that_judges(&base.frame.model));
        let from = |base: State| {
            let sketches = Sketches::new(&base, told);
            Step::of(base, sketches, begun, held.as_ref())
        };
        let sketches = Sketches::new(&base, told);
        let step = match sketches.better_base(&base) {
            Some(base) => from(base),
            None => Step::of(base, sketches, begun, held.as_ref()),
        };
        step.better_base().map_or(step, from).or_what_is_small(begun)
    }

    /// The same look with another base, which is a trial's model before it.
    pub(super) fn after(self, found: &Trial, base: State) -> Step {
        Step { held: found.held.clone(), base_holdout: found.holdout.clone(), base, ..self }
    }

    /// Whether a trial gains as much as the first, and was neither taken nor is among those that the logs cannot tell from it: another does as
    /// well.
    #[must_use]
    pub fn passes_over(&self, place: usize) -> bool {
        let Outcome::Missing(alike) = &self.outcome else { return false };
        place > 0
            && !alike.contains(&self.trials[place].spec.id)
            && self.refusals[place].is_empty()
            && self.trials[place].delta_bic >= self.trials[0].delta_bic
    }

    /// The base refitted from where an effect ended that is next to nothing and yet explains what the base does not, where
    /// that is clearly better: the base rested in a valley of its own.
    fn better_base(&self) -> Option<State> {
        let least = threshold(self.scores.len());
        let all = self.trials.iter().zip(&self.refusals);
        let idle = all.filter(|(trial, refusals)| refusals.contains(&Refusal::TooSmall) && trial.delta_bic > least);
        let best = idle.filter_map(|(trial, _)| self.base.begun_from(&trial.state)).min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        (best.cost < self.base.cost - least).then_some(best)
    }

    /// Where nothing is accepted and something is left: what would be too small to matter by itself, and yet is all that keeps the
    /// model from the sensors' floors.
    fn or_what_is_small(mut self, begun: &[f64]) -> Step {
        if self.outcome != Outcome::Unknown {
            return self;
        }
        let court = Court { holdout: self.held.as_ref(), tried: self.scores.len(), begun, whatever_size: true };
        let (trials, refused) = (std::mem::take(&mut self.trials), std::mem::take(&mut self.refusals));
        let judged = trials.into_iter().zip(refused).map(|(trial, refused)| {
            let counts = refused == [Refusal::TooSmall] && explained(&trial.state);
            let refused = if counts { refusals(&self.base, &trial, &self.base_holdout, court) } else { refused };
            (trial, refused)
        });
        let judged = judged.collect();
        (self.trials, self.refusals, self.outcome) = concluded(&self.base, judged);
        self
    }

    /// Refits and judges the most promising effects, the next ones as long as none is accepted.
    fn of(base: State, mut sketches: Sketches<'_>, begun: &[f64], holdout: Option<&Arc<Evidence>>) -> Step {
        let court = Court { holdout, tried: sketches.tried, begun, whatever_size: false };
        let base_holdout = holdout.map_or_else(Vec::new, |evidence| held_out(base.told(), evidence));
        let mut judged: Vec<(Trial, Vec<Refusal>)> = Vec::new();
        let judge = |sketches: &Sketches<'_>, wave: Vec<Sketch>, judged: &mut Vec<(Trial, Vec<Refusal>)>| {
            for sketch in wave {
                sketches.tell_refit(sketch.place);
                let trial = Trial::refit(&base, &sketches.scored[sketch.place].0, sketch.state, holdout);
                let refusals = refusals(&base, &trial, &base_holdout, court);
                judged.push((trial, refusals));
            }
            judged.iter().any(|(_, refusals)| refusals.is_empty())
        };
        let mut accepted = false;
        while !accepted && let Some(wave) = sketches.next_wave() {
            accepted = judge(&sketches, wave, &mut judged);
        }
        // An effect that begins as something the base model has (a weak cell, as another charge at the
        // start) shows at its real size only: before nothing is found, those are tried as well.
        if !accepted && !explained(&base) {
            sketches.draw_what_begins_alike();
            while !accepted && let Some(wave) = sketches.next_wave() {
                accepted = judge(&sketches, wave, &mut judged);
            }
        }
        // Another one may be the best on all of the evidence: what does its work must be heard as well.
        let best = judged.iter().filter(|(_, refusals)| refusals.is_empty()).max_by(|(a, _), (b, _)| a.delta_bic.total_cmp(&b.delta_bic));
        if let Some((best, _)) = best
            && let Some(place) = sketches.scored.iter().position(|(score, _)| score.spec.id == best.spec.id)
        {
            let as_good = judged.iter().filter(|(trial, _)| trial.delta_bic > best.delta_bic - ALIKE);
            let as_good: Vec<&str> = as_good.map(|(trial, _)| trial.spec.id).collect();
            sketches.draw_what_takes_over_from(place, &best.state.coarse(), &as_good);
            if let Some(wave) = sketches.next_wave() {
                judge(&sketches, wave, &mut judged);
            }
        }
        let accepted = judged.iter().enumerate().filter(|(_, (_, refusals))| refusals.is_empty()).map(|(place, (trial, _))| (place, trial));
        for (place, trial) in begun_anew(&base, &accepted.collect::<Vec<_>>(), holdout) {
            let refusals = refusals(&base, &trial, &base_holdout, court);
            judged[place] = (trial, refusals);
        }
        refuse_what_stands_for_something_small(&mut judged, court);
        let (trials, refusals, outcome) = concluded(&base, judged);
        let scores = sketches.scored.into_iter().map(|(score, _)| score).collect();
        Step { base, held: holdout.cloned(), base_holdout, scores, trials, refusals, untested: sketches.untested, outcome }
    }
}

impl Step {
    /// Two effects, where one alone is kept from being accepted by nothing but the other: what both are missing from hides in the
    /// held-out logs what either is worth there. Where the one would hardly help in the logs that were fitted either (an arm that lifts
    /// before each docking, where what docks then draws is missing too, leaves steps that contradict it), it must be accepted beside the other. Without
    /// held-out logs those that were fitted must speak for both.
    pub(super) fn jointly(&self, begun: &[f64], holdout: Option<&Arc<Evidence>>, told: Told<'_>) -> Option<[Step; 2]> {
        let least = STRONG * threshold(self.scores.len());
        let likely = |place: &usize| {
            let refused = &self.refusals[*place];
            self.trials[*place].delta_bic > least && !refused.iter().any(|one| matches!(one, Refusal::Evidence | Refusal::Range))
        };
        (0..self.trials.len()).filter(likely).take(JOINTLY).find_map(|place| {
            let one = &self.trials[place];
            let other = Step::look_after(begun, one.state.clone(), holdout, told);
            let Outcome::Missing(_) = other.outcome else { return None };
            let both = &other.trials[0];
            let most = explains_most(&self.base, &both.state);
            let helps = match &both.held {
                Some(held) => falls(held, most, &before_on(&self.base, self.held.as_ref(), &self.base_holdout, Some(held)), &both.holdout),
                None => falls(&self.base.frame.evidence, most, &self.base.told().rms(), &both.state.told().rms()),
            };
            let stands = || {
                let without = both.state.without(one.spec);
                let beside = Trial::of(&without, both.state.clone(), one.spec, one.uniqueness, holdout);
                let court = Court { holdout: beside.held.as_ref(), tried: self.scores.len(), begun, whatever_size: false };
                let before = court.holdout.map_or_else(Vec::new, |held| held_out(without.told(), held));
                refusals(&without, &beside, &before, court).is_empty()
            };
            (helps && (self.refusals[place] == [Refusal::Holdout] || stands())).then(|| [taken(self.clone(), one.clone()), other])
        })
    }
}

/// What was judged in the order in which it is told, and the conclusion.
fn concluded(base: &State, mut judged: Vec<(Trial, Vec<Refusal>)>) -> (Vec<Trial>, Vec<Vec<Refusal>>, Outcome) {
    // The accepted ones come first, and of those that do as well the simplest.
    judged.sort_by(|(a, _), (b, _)| b.delta_bic.total_cmp(&a.delta_bic));
    judged.sort_by_key(|(_, refusals)| !refusals.is_empty());
    only_once(&mut judged);
    let accepted = judged.iter().take_while(|(_, refusals)| refusals.is_empty()).count();
    if let Some(simplest) = simplest(&judged[..accepted]) {
        judged[..=simplest].rotate_right(1);
    }
    if let Some(first) = first_of_a_tie(&judged[..accepted]) {
        judged[..=first].rotate_right(1);
    }
    let (trials, refusals): (Vec<Trial>, Vec<Vec<Refusal>>) = judged.into_iter().unzip();
    let outcome = match accepted {
        0 if explained(base) => Outcome::Complete,
        0 => Outcome::Unknown,
        _ => Outcome::Missing(alternatives(&trials, &refusals).into_iter().map(|place| trials[place].spec.id).collect()),
    };
    (trials, refusals, outcome)
}

/// Something too small to matter may explain more than what is accepted, which then does what it can of the same work: unless it does
/// about as well, it is accepted only if it would be beside that, too.
fn refuse_what_stands_for_something_small(judged: &mut [(Trial, Vec<Refusal>)], court: Court<'_>) {
    let small = judged.iter().filter(|(_, refusals)| refusals[..] == [Refusal::TooSmall]).map(|(trial, _)| trial);
    let Some(small) = small.max_by(|a, b| a.delta_bic.total_cmp(&b.delta_bic)).cloned() else { return };
    let as_well = small.delta_bic - ALIKE.max(AS_WELL * small.delta_bic);
    for (trial, refused) in judged.iter_mut().filter(|(trial, refusals)| refusals.is_empty() && trial.delta_bic < as_well) {
        let Some(state) = small.state.with(trial.spec, &trial.state, None) else { continue };
        let beside = Trial::of(&small.state, state, trial.spec, trial.uniqueness, small.held.as_ref());
        // Where no held-out log has the columns of both, nothing judges the two together.
        if small.held.is_some() && beside.held.is_none() {
            continue;
        }
        *refused = refusals(&small.state, &beside, &small.holdout, Court { holdout: small.held.as_ref(), ..court });
    }
}

/// Keeps of every effect the first.
fn only_once(judged: &mut Vec<(Trial, Vec<Refusal>)>) {
    let mut seen: Vec<&str> = Vec::new();
    judged.retain(|(trial, _)| {
        let new = !seen.contains(&trial.spec.id);
        seen.push(trial.spec.id);
        new
    });
}

/// Places of the trials that the logs cannot tell from the first: accepted ones, and what predicts the same, does as well and is
/// refused for nothing but that it is smaller than a decision would notice.
pub(super) fn alternatives(trials: &[Trial], refusals: &[Vec<Refusal>]) -> Vec<usize> {
    let first = &trials[0];
    let alike = |&place: &usize| {
        let other = &trials[place];
        // What was passed over as needlessly rich is no alternative; what does as well, or predicts the
        // same with no more numbers, is one.
        let ahead = other.delta_bic - first.delta_bic;
        let same = hardly_moves(&first.state, &other.state);
        if !refusals[place].is_empty() {
            return refusals[place] == [Refusal::TooSmall] && ahead > -ALIKE && same;
        }
        let richer = other.state.freedom > first.state.freedom;
        // With a number that does nothing it has become the simpler one, unless it explains more than such numbers do: its
        // others are then not those of the simpler one.
        let spared = other.state.freedom.saturating_sub(first.state.freedom) as f64;
        let degenerate = same && richer && other.has_a_number_to_spare() && first.state.cost - other.state.cost < spared;
        // Nor has one been passed over for nothing of which the catalogue says that it is taken for the first, and the logs that it does better.
        let likely =
            ahead.abs() < ALIKE && !degenerate || same && !richer || ahead > ALIKE && are_taken_for_each_other(first.spec, other.spec);
        likely && !first.is_also(other) && !other.is_also(first)
    };
    let alike: Vec<usize> = (1..trials.len()).filter(alike).collect();
    let by_another_name = |place: &usize| alike.iter().any(|one| one != place && trials[*one].is_also(&trials[*place]));
    alike.iter().copied().filter(|place| !by_another_name(place)).collect()
}

/// The effect that does as well as the first, and with fewer numbers: by a criterion less than a
/// hundredth below the first's, or predictions that hardly differ, with an error on held-out logs that is no larger. A table of
/// numbers finds something to do in the last rows before empty, where a tiny error of charge is one
/// of millivolts.
fn simplest(judged: &[(Trial, Vec<Refusal>)]) -> Option<usize> {
    let (first, _) = judged.first()?;
    let no_worse = |trial: &Trial| {
        let (own, of_first) = on_the_same_logs(trial, first);
        own <= (1.0 + AS_WELL) * of_first
    };
    let does_as_well = |&place: &usize| {
        let trial = &judged[place].0;
        let near = trial.delta_bic > (1.0 - AS_WELL) * first.delta_bic || hardly_moves(&first.state, &trial.state);
        near && no_worse(trial) && trial.spec.parameters.len() < first.spec.parameters.len()
    };
    (1..judged.len()).filter(does_as_well).min_by_key(|&place| judged[place].0.spec.parameters.len())
}

/// Difference of the criterion that rounding can make.
pub(super) const TIE: f64 = 0.1;

/// Of those that do as well as the first but for rounding, the one with the fewest numbers, then the first of the catalogue: which
/// name stands for a set must not hang on the last digits.
fn first_of_a_tie(judged: &[(Trial, Vec<Refusal>)]) -> Option<usize> {
    let (first, _) = judged.first()?;
    let order = |trial: &Trial| {
        let place = catalogue().iter().position(|effect| std::ptr::eq(effect.spec(), trial.spec));
        (trial.spec.parameters.len(), place)
    };
    let tied = |&place: &usize| (judged[place].0.delta_bic - first.delta_bic).abs() < TIE;
    (0..judged.len()).filter(tied).min_by_key(|&place| order(&judged[place].0))
}
