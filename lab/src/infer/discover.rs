//! One effect after the other, until the model is complete or nothing explains what is left.

use std::sync::Arc;

use energy::Model;

use super::evidence::Evidence;
use super::exchange::{begun_otherwise, exchanged};
use super::floors::{fitted, resettled};
use super::judge::squared;
use super::look::{Outcome, Step};
use super::progress::{Progress, Told, silent};
use super::prune::{plainer, shorter};
use super::state::State;
use super::trial::Trial;
use super::undecided::undecided;

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

/// Adds effects until the model is complete or none is accepted. Where noise of inputs counts for more or less with what was
/// found than it did at the beginning, that is all done again.
#[must_use]
pub fn search(model: Arc<Model>, evidence: Arc<Evidence>, holdout: Option<&Arc<Evidence>>) -> Search {
    search_and_tell(model, evidence, holdout, &silent)
}

/// The same, and says how far it is.
#[must_use]
pub fn search_and_tell(model: Arc<Model>, evidence: Arc<Evidence>, holdout: Option<&Arc<Evidence>>, told: Told<'_>) -> Search {
    let (base, held) = fitted(&model, evidence, holdout);
    let found = climb(base, held.as_ref(), told);
    let found = match resettled(&found.last, held.as_ref()) {
        Some((evidence, held)) => climb(State::of_model(model, evidence), held.as_ref(), told),
        None => found,
    };
    Search { last: found.last.undiluted(), ..found }
}

/// Adds effect after effect to a fitted model.
fn climb(base: State, holdout: Option<&Arc<Evidence>>, told: Told<'_>) -> Search {
    told(Progress::stands(&base, &[]));
    let mut state = base;
    let mut steps: Vec<Step> = Vec::new();
    for look in 0.. {
        let begun = squared(steps.first().map_or(&state, |first| &first.base));
        let step = Step::look_after(&begun, state.clone(), holdout, told);
        let found = match step.outcome {
            Outcome::Missing(_) if look < EFFECTS_MAX => Some(vec![step.clone()]),
            Outcome::Unknown if look < EFFECTS_MAX => step.jointly(&begun, holdout, told).map(Vec::from),
            _ => None,
        };
        if let Some(found) = found {
            steps.extend(found);
            (steps, state) = reviewed(steps, &begun, holdout, told);
        } else if look < EFFECTS_MAX
            && let Some(way) = shorter(&from_where_it_ended(&steps, &state, &step, holdout), holdout)
        {
            (steps, state) = reviewed(way, &begun, holdout, told);
        } else {
            let last = step.base.clone();
            let mut steps = undecided(steps, &last, &begun, holdout);
            steps.push(step);
            return Search { steps, last };
        }
        told(Progress::stands(&steps[0].base, &steps));
    }
    unreachable!("a search ends")
}

/// The way so far from where the last look left its base, if that moved it: at its best, what was found before may be needless. Nothing
/// where it did not.
fn from_where_it_ended(steps: &[Step], before: &State, look: &Step, holdout: Option<&Arc<Evidence>>) -> Vec<Step> {
    let mut way = steps.to_vec();
    match way.last_mut() {
        Some(newest) if look.base.x != before.x => {
            let found = &newest.trials[0];
            newest.trials[0] = Trial::of(&newest.base, look.base.clone(), found.spec, found.uniqueness, holdout);
            way
        }
        _ => Vec::new(),
    }
}

/// What was found without what became needless, and with what does better in the place of another; and where that ends.
fn reviewed(steps: Vec<Step>, begun: &[f64], holdout: Option<&Arc<Evidence>>, told: Told<'_>) -> (Vec<Step>, State) {
    told(Progress::Reviewing);
    let briefly = |mut steps: Vec<Step>| {
        while let Some(way) = shorter(&steps, holdout) {
            steps = way;
        }
        steps
    };
    let mut steps = briefly(steps);
    let other_way = exchanged(&steps, holdout).or_else(|| {
        let steps = briefly(begun_otherwise(&steps, begun, holdout, told)?);
        exchanged(&steps, holdout).or(Some(steps))
    });
    steps = other_way.unwrap_or(steps);
    let mut state = steps[steps.len() - 1].trials[0].state.clone();
    if let Some(trial) = plainer(&steps, holdout)
        && let Some(newest) = steps.last_mut()
    {
        state = trial.state.clone();
        newest.trials[0] = trial;
    }
    (steps, state)
}
