//! Once more from other beginnings, where what was found leaves something.
//!
//! An effect is tried beside a base that has bent itself to do without, and the way to its own best may be closed from there:
//! a weak cell whose deficit the logs' own charges and the gains of their sensors have taken over rests far from where it does
//! best, and a fade whose knee lies before all logs has one slope where it should have two. That something is left then says
//! either that more is missing, or that this is the wrong valley. All numbers put back to where nothing is known yet, and the
//! effect put back to its usual size in each of its shapes, lead into the other one, if there is one.

use std::sync::Arc;

use energy::EffectSpec;

use super::candidate::{onsets, usual};
use super::evidence::Evidence;
use super::judge::explained;
use super::look::ALIKE;
use super::state::State;
use super::trial::Trial;

/// Of the accepted effects by place, those that do as well as the best and come to more from another beginning; none where
/// the best leaves nothing unexplained.
pub(super) fn begun_anew(base: &State, accepted: &[(usize, &Trial)], holdout: Option<&Arc<Evidence>>) -> Vec<(usize, Trial)> {
    let best = accepted.iter().max_by(|(_, a), (_, b)| a.delta_bic.total_cmp(&b.delta_bic));
    let Some((_, best)) = best.filter(|(_, best)| !explained(&best.state)) else { return Vec::new() };
    let near = accepted.iter().filter(|(_, trial)| trial.delta_bic > best.delta_bic - ALIKE);
    let renewed = |(place, trial): &(usize, &Trial)| {
        let state = anew(&trial.state, trial.spec)?.with_what_is_open_as_before();
        Some((*place, Trial::of(base, state, trial.spec, trial.uniqueness, holdout)))
    };
    near.filter_map(renewed).collect()
}

/// The same model from other beginnings, where one ends in a valley that is clearly deeper: what ends about as deep is the same one.
fn anew(state: &State, effect: &EffectSpec) -> Option<State> {
    let coarse = state.coarse();
    // The whole way is gone: what looks like the slope of the valley that is known may lie above another.
    let own = State::search(Arc::clone(&coarse.frame), &coarse.frame.start(), f64::NEG_INFINITY).or_with_other_starts();
    let shaped =
        shapes(effect).into_iter().filter_map(|shape| coarse.search_elsewhere(&put_back(&coarse, effect, &shape), f64::NEG_INFINITY));
    let best = shaped.fold(own, |best, other| if other.cost < best.cost { other } else { best });
    let best = (best.cost < coarse.cost - ALIKE).then(|| best.on(Arc::clone(&state.frame.evidence)))?;
    (best.cost < state.cost - ALIKE).then_some(best)
}

/// The effect's numbers at its usual size, in every shape that is looked at; none where its size is all there is.
fn shapes(effect: &EffectSpec) -> Vec<Vec<f64>> {
    let sized = |point: Vec<f64>| {
        effect.parameters.iter().zip(point).map(|(own, value)| if own.null.is_some() { usual(own) } else { value }).collect()
    };
    onsets(effect).into_iter().skip(1).map(sized).collect()
}

/// The unknowns of a state with the numbers of one effect put to others.
fn put_back(state: &State, effect: &EffectSpec, numbers: &[f64]) -> Vec<f64> {
    let mut x = state.x.clone();
    for (place, &index) in state.frame.free.iter().enumerate() {
        let parameter = &state.frame.model.parameters()[index];
        let own = effect.parameters.iter().position(|own| parameter.effect == effect.id && own.name == parameter.name);
        if let Some(own) = own {
            x[place] = numbers[own];
        }
    }
    x
}
