//! What the logs cannot tell from an effect that was found, in the model at the end.
//!
//! A look at all absent effects tells the best from the others beside what was found before it. What was found after it may tell two
//! that were alike, may leave two alike that were not, and may have brought another effect into its place: only the last model says
//! which of them are alike. So each effect that was found hands its work over once more, to what the catalogue says is taken for it
//! and to what was like it when it was found.

use std::sync::Arc;

use energy::EffectSpec;

use super::evidence::Evidence;
use super::handover::handed_over;
use super::judge::{Court, explained, refusals};
use super::look::{ALIKE, Outcome, Step, alternatives};
use super::sketch::are_taken_for_each_other;
use super::state::State;
use super::trial::{Trial, held_out};

/// The effects that were found, each with what the logs cannot tell from it in the last model. Only where several were found, and only
/// in a model that explains the logs: where it does not, what does as well mostly bends to what no effect explains.
pub(super) fn undecided(steps: Vec<Step>, last: &State, begun: &[f64], holdout: Option<&Arc<Evidence>>) -> Vec<Step> {
    if steps.len() < 2 || !explained(last) {
        return steps;
    }
    let tried: Vec<&'static EffectSpec> = steps[0].scores.iter().map(|score| score.spec).collect();
    let coarse = last.coarse();
    let court = Court { holdout, tried: tried.len(), begun, whatever_size: false };
    let decide = |step: Step| {
        let outcome = Outcome::Missing(alike(&step, &tried, (last, &coarse), court));
        Step { outcome, ..step }
    };
    steps.into_iter().map(decide).collect()
}

/// What the logs cannot tell from the effect of this step, the last model being known on all and on coarser evidence.
fn alike(step: &Step, tried: &[&'static EffectSpec], (last, coarse): (&State, &State), court: Court<'_>) -> Vec<&'static str> {
    let (spec, uniqueness) = (step.trials[0].spec, step.trials[0].uniqueness);
    let has = |id: &str| last.frame.model.effects().any(|effect| effect.spec().id == id);
    let was_alike = |id: &str| matches!(&step.outcome, Outcome::Missing(others) if others.contains(&id));
    let asked = tried.iter().filter(|other| !has(other.id) && (are_taken_for_each_other(spec, other) || was_alike(other.id)));
    let asked: Vec<&'static EffectSpec> = asked.copied().collect();
    if asked.is_empty() {
        return Vec::new();
    }
    let coarsely_without = coarse.without(spec);
    let takes_over = |other: &'static EffectSpec| {
        let handed = handed_over(&coarsely_without, coarse, spec, other);
        // What was like it when it was found is known to do its work, whatever a way between the two leads to.
        let known = step.trials.iter().find(|trial| was_alike(other.id) && trial.spec.id == other.id);
        let begun = known.and_then(|trial| coarsely_without.with(other, &trial.state, None));
        let state = handed.into_iter().chain(begun).min_by(|a, b| a.bic().total_cmp(&b.bic()))?;
        (state.bic() < coarse.bic() + NEARLY * ALIKE).then(|| (other, state.on(Arc::clone(&last.frame.evidence))))
    };
    let others: Vec<(&EffectSpec, State)> = asked.into_iter().filter_map(takes_over).collect();
    if others.is_empty() {
        return Vec::new();
    }
    let without = last.without(spec);
    let before = court.holdout.map_or_else(Vec::new, |held| held_out(without.told(), held));
    let trial = |spec, state| Trial::of(&without, state, spec, uniqueness, court.holdout);
    let others = others.into_iter().map(|(other, state)| trial(other, state));
    let (mut trials, mut refused) = (vec![trial(spec, last.clone())], vec![Vec::new()]);
    for other in others {
        refused.push(refusals(&without, &other, &before, court));
        trials.push(other);
    }
    alternatives(&trials, &refused).into_iter().map(|place| trials[place].spec.id).collect()
}

/// Times the difference that makes effects unlike by which another may do less well on coarser evidence.
const NEARLY: f64 = 3.0;
