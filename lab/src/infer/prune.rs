//! Effects that a later one made needless.
//!
//! A search adds the effect that explains most by itself. Where two are missing, or where the right one
//! only shows once its size is right, the first to be taken may be a stand-in: a slow polarisation for a
//! weak cell, say. So after every effect each of the earlier ones is left out once. What the logs do not
//! miss by more than they must speak for an effect that is added, goes. So do numbers that refine an effect.

use std::sync::Arc;

use super::evidence::Evidence;
use super::judge::threshold;
use super::look::{Outcome, Step};
use super::state::State;
use super::trial::{Trial, as_plain_as_may_be};

/// The way to the last state without the earlier effect that the logs miss least; none where they miss
/// every one of them.
pub(super) fn shorter(steps: &[Step], holdout: Option<&Arc<Evidence>>) -> Option<Vec<Step>> {
    let (newest, earlier) = steps.split_last()?;
    let last = &newest.trials[0].state;
    let without = |place: usize| (place, last.without(steps[place].trials[0].spec));
    let cost = |(place, state): &(usize, State)| state.bic() - last.bic() - threshold(steps[*place].scores.len());
    let needless = (0..earlier.len()).map(without).filter(|one| cost(one) < 0.0);
    let (place, left) = needless.min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
    let mut way: Vec<Step> = steps[..place].to_vec();
    let mut base = steps[place].base.clone();
    for (index, step) in steps.iter().enumerate().skip(place + 1) {
        let found = &step.trials[0];
        let state = if index + 1 == steps.len() { left.clone() } else { base.with(found.spec, &left, None)? };
        let trial = Trial::of(&base, state, found.spec, found.uniqueness, holdout);
        let next = trial.state.clone();
        // The first look at this base is told as it was, with what was taken in the end before all else.
        let before = match way.last() {
            Some(found) if index > place + 1 => Step { scores: Vec::new(), ..step.clone() }.after(&found.trials[0], base),
            _ => steps[place].clone(),
        };
        way.push(taken(before, trial));
        base = next;
    }
    Some(way)
}

/// The last trial without numbers that refine earlier effects, where it made them needless: while another effect is missing, a table may
/// bend to do its work. None where it made none so.
pub(super) fn plainer(steps: &[Step], holdout: Option<&Arc<Evidence>>) -> Option<Trial> {
    let (newest, earlier) = steps.split_last()?;
    let found = &newest.trials[0];
    let plain = earlier.iter().fold(found.state.clone(), |state, step| as_plain_as_may_be(state, step.trials[0].spec));
    let same = Arc::ptr_eq(&plain.frame, &found.state.frame);
    (!same).then(|| Trial::of(&newest.base, plain, found.spec, found.uniqueness, holdout))
}

/// A look whose best is this trial.
pub(super) fn taken(mut step: Step, trial: Trial) -> Step {
    let others = step.trials.iter().position(|known| known.spec.id == trial.spec.id);
    if let Some(place) = others {
        step.trials.remove(place);
        step.refusals.remove(place);
    }
    step.trials.insert(0, trial);
    step.refusals.insert(0, Vec::new());
    step.outcome = Outcome::Missing(Vec::new());
    step
}
