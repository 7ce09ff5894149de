//! An earlier effect gives way to another that does better beside the later ones.
//!
//! A search adds the effect that explains most by itself. Where two are missing, that may be one that stands in for both as
//! far as it can: the curve of a charger for the robots' own load and the contacts of bays behind it. Once the second is found
//! the stand-in is not needless, so that nothing prunes it, but what it stood for would do better in its place. So after every
//! effect each of the earlier ones hands its work over to what the catalogue says is taken for it.
//!
//! Only in a model that explains the logs. Where it does not, what does better in the place of an effect mostly bends to what
//! no effect explains: of 12 electrochemical cells four then got a wrong name behind it, and with models that explain none did.

use std::sync::Arc;

use energy::EffectSpec;

use super::evidence::Evidence;
use super::handover::handed_over;
use super::judge::explained;
use super::look::{Outcome, Step};
use super::progress::Told;
use super::prune::taken;
use super::sketch::{BETTER, are_taken_for_each_other};
use super::state::State;
use super::trial::Trial;

/// The way to the last state with another effect in the place of an earlier one, where that does better; none where nothing
/// does.
pub(super) fn exchanged(steps: &[Step], holdout: Option<&Arc<Evidence>>) -> Option<Vec<Step>> {
    let (newest, earlier) = steps.split_last()?;
    let last = &newest.trials[0].state;
    if earlier.is_empty() || !explained(last) {
        return None;
    }
    let coarse = last.coarse();
    let others = (0..earlier.len()).filter_map(|place| Some((place, in_place_of(&steps[place], &coarse)?)));
    let (place, (effect, state)) = others.min_by(|(_, (_, a)), (_, (_, b))| a.bic().total_cmp(&b.bic()))?;
    let state = state.on(Arc::clone(&last.frame.evidence));
    if last.bic() - state.bic() < BETTER {
        return None;
    }
    along(steps, place, effect, &state, holdout)
}

/// The way with another effect in the place of the last but one, of fewer numbers, that is taken for it, and what then comes next, where
/// these two do better; none where they do not. What has many numbers may do the work of two that have one each (a ladder that of a
/// resistance and a polarisation that wore), and then none of these two could take its place by itself.
pub(super) fn begun_otherwise(steps: &[Step], begun: &[f64], holdout: Option<&Arc<Evidence>>, told: Told<'_>) -> Option<Vec<Step>> {
    let [earlier @ .., before, newest] = steps else { return None };
    let (first, last) = (&before.trials[0], &newest.trials[0].state);
    let is_simpler =
        |trial: &Trial| trial.spec.parameters.len() < first.spec.parameters.len() && are_taken_for_each_other(trial.spec, first.spec);
    let accepted = before.trials.iter().zip(&before.refusals).filter(|(trial, refused)| refused.is_empty() && is_simpler(trial));
    let two = accepted.filter_map(|(trial, _)| {
        let next = Step::look_after(begun, trial.state.clone(), holdout, told);
        let does_better = matches!(next.outcome, Outcome::Missing(_)) && next.trials[0].state.bic() < last.bic() - BETTER;
        does_better.then(|| (trial.clone(), next))
    });
    let (trial, next) = two.min_by(|(_, a), (_, b)| a.trials[0].state.bic().total_cmp(&b.trials[0].state.bic()))?;
    Some(earlier.iter().cloned().chain([taken(before.clone(), trial), next]).collect())
}

/// The best of what is taken for the effect of this step, in its place in the last model; none where none does better.
fn in_place_of(step: &Step, last: &State) -> Option<(&'static EffectSpec, State)> {
    let spec = step.trials[0].spec;
    let has = |id: &str| last.frame.model.effects().any(|effect| effect.spec().id == id);
    let alike = step.scores.iter().map(|score| score.spec).filter(|other| are_taken_for_each_other(spec, other));
    let alike: Vec<&'static EffectSpec> = alike.filter(|other| !has(other.id)).collect();
    if alike.is_empty() {
        return None;
    }
    let without = last.without(spec);
    let states = alike.into_iter().filter_map(|other| Some((other, handed_over(&without, last, spec, other)?)));
    let better = states.filter(|(_, state)| state.bic() < last.bic() - BETTER);
    better.min_by(|(_, a), (_, b)| a.bic().total_cmp(&b.bic()))
}

/// The way from a step on with another effect taken there, all numbers beginning where the last state has them.
fn along(steps: &[Step], place: usize, effect: &'static EffectSpec, last: &State, holdout: Option<&Arc<Evidence>>) -> Option<Vec<Step>> {
    let mut way = steps[..place].to_vec();
    let mut base = steps[place].base.clone();
    for (index, step) in steps.iter().enumerate().skip(place) {
        let (spec, uniqueness) = match index == place {
            true => (effect, step.scores.iter().find(|score| score.spec.id == effect.id)?.uniqueness),
            false => (step.trials[0].spec, step.trials[0].uniqueness),
        };
        let state = if index + 1 == steps.len() { last.clone() } else { base.with(spec, last, None)? };
        let trial = Trial::of(&base, state, spec, uniqueness, holdout);
        if trial.is_beyond_its_range() {
            return None;
        }
        let next = trial.state.clone();
        let before = match way.last() {
            Some(found) if index > place => step.clone().after(&found.trials[0], base),
            _ => step.clone(),
        };
        way.push(taken(before, trial));
        base = next;
    }
    Some(way)
}
