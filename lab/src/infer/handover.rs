//! Another effect in the place of one that was found: does it do the same work?
//!
//! What imitates an effect (a gain of the ammeter, a fade of capacity) may lie in a valley that no way from the base
//! leads into: the base has bent itself to do without either, and the way to the one was open by chance. From where the
//! one is at its best, with both in the model, the way to the other is: the one is held to less and less of its size,
//! and all else follows.

use std::sync::Arc;

use energy::EffectSpec;

use super::descent::{Asked, descend};
use super::frame::Frame;
use super::state::State;

/// Shares of its size that an effect keeps on the way.
const SHARES: [f64; 2] = [0.5, 0.0];
/// Rise of the cost that says that the other does not take the work: three times what makes effects unlike.
const NOT_TAKEN_OVER: f64 = 30.0;

/// The base with another effect than the one that `has` has at its best, refitted from where that led; none where the
/// other does not take its work.
#[must_use]
pub(super) fn handed_over(base: &State, has: &State, effect: &EffectSpec, other: &EffectSpec) -> Option<State> {
    let evidence = &base.frame.evidence;
    let both = Frame::new(Arc::new(has.frame.model.with(other.id).ok()?), Arc::clone(evidence));
    let own = |unknown: usize| {
        let parameter = &both.model.parameters()[*both.free.get(unknown)?];
        effect.parameters.iter().find(|spec| parameter.effect == effect.id && spec.name == parameter.name)
    };
    let sizes: Vec<(usize, f64)> = (0..both.unknowns()).filter_map(|unknown| Some((unknown, own(unknown)?.null?))).collect();
    let others: Vec<usize> = (0..both.unknowns()).filter(|&unknown| own(unknown).is_none()).collect();
    let whole = both.like(has, None);
    let most = has.lens(&has.noise).cost + NOT_TAKEN_OVER;
    let (mut x, mut noise) = (whole.clone(), has.noise.clone());
    for share in SHARES {
        sizes.iter().for_each(|&(unknown, null)| x[unknown] = null + share * (whole[unknown] - null));
        let place = descend(&both, &x, &noise, &others, Asked::Always);
        if place.lens.cost > most {
            return None;
        }
        (x, noise) = (place.x, place.noise);
    }
    let alone = Frame::new(Arc::new(base.frame.model.with(other.id).ok()?), Arc::clone(evidence));
    let start = alone.as_in(&both, &x, None);
    Some(State::fit(Arc::new(alone), &start, &noise))
}
