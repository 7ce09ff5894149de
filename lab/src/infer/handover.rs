//! Another effect in the place of one that was found: does it do the same work?
//!
//! What imitates an effect (a gain of the ammeter, a fade of capacity) may lie in a valley that no way from the base
//! leads into: the base has bent itself to do without either, and the way to the one was open by chance. From where the
//! one is at its best, with the other at its onset, the way to the other is: the one is held to less and less of its size,
//! and all else follows. Derivatives there tell beforehand of most others that they will not do.

use std::sync::Arc;

use energy::{EffectSpec, ParameterSpec};
use nalgebra::{DMatrix, DVector};

use super::candidate::{acts_through_others, onset, refines, usual};
use super::descent::{Asked, Derived, Place, descend_roughly};
use super::frame::Frame;
use super::lens::Lens;
use super::state::{State, all};

/// Shares of its size that an effect keeps on the way.
const SHARES: [f64; 2] = [0.5, 0.0];
/// Rise of the cost that says that the other does not take the work: three times what makes effects unlike.
const NOT_TAKEN_OVER: f64 = 30.0;
/// Share of what the effect is worth of which the same is said.
const HARDLY_LESS: f64 = 0.5;
/// Times that rise which derivatives may be wrong by.
const BY_DERIVATIVES: f64 = 4.0;

/// The base with another effect than the one that `has` has at its best, refitted from where that led; none where the
/// other does not take its work.
#[must_use]
pub(super) fn handed_over(base: &State, has: &State, effect: &'static EffectSpec, other: &'static EffectSpec) -> Option<State> {
    let evidence = &base.frame.evidence;
    let both = Frame::new(Arc::new(has.frame.model.with(other.id).ok()?), Arc::clone(evidence));
    let spec_of = |unknown: usize, effect: &'static EffectSpec| {
        let parameter = &both.model.parameters()[*both.free.get(unknown)?];
        effect.parameters.iter().find(|spec| parameter.effect == effect.id && spec.name == parameter.name)
    };
    let sizes_of = |effect| (0..both.unknowns()).filter_map(move |unknown| Some((unknown, spec_of(unknown, effect)?)));
    let sizes: Vec<(usize, f64)> = sizes_of(effect).filter_map(|(unknown, spec)| Some((unknown, spec.null?))).collect();
    let whole = both.as_in(&has.frame, &has.x, Some((other, onset)));
    let at_best = has.lens(&has.noise).cost;
    let rise = NOT_TAKEN_OVER.min(HARDLY_LESS * (base.cost - has.cost));
    let kept = |share: f64| -> Vec<(usize, f64)> {
        sizes.iter().map(|&(unknown, null)| (unknown, (1.0 - share) * (null - whole[unknown]))).collect()
    };
    let place = Place::at(&both, whole.clone(), has.noise.clone(), &all(&both), Derived::Nearly);
    // What acts through another's size waits until that is there.
    let new: Vec<(usize, &ParameterSpec)> = sizes_of(other).filter(|(_, spec)| spec.null.is_some()).collect();
    let square = |&(unknown, spec): &(usize, &ParameterSpec)| {
        let size = usual(spec) - spec.null.unwrap_or_default();
        (refines(other, spec), place.lens.normal[(unknown, unknown)] * size.powi(2))
    };
    let quiet = acts_through_others(new.iter().map(square));
    let waits = |unknown: usize| new.iter().zip(&quiet).any(|(&(one, _), quiet)| one == unknown && *quiet);
    let others: Vec<usize> = (0..both.unknowns()).filter(|&unknown| spec_of(unknown, effect).is_none() && !waits(unknown)).collect();
    if expected(&place.lens, &kept(SHARES[0]), &others) > at_best + BY_DERIVATIVES * rise {
        return None;
    }
    let way = |asked: Asked| {
        let (mut x, mut noise) = (whole.clone(), has.noise.clone());
        for share in SHARES {
            kept(share).into_iter().for_each(|(unknown, change)| x[unknown] = whole[unknown] + change);
            let place = descend_roughly(&both, &x, &noise, &others, asked);
            if place.lens.cost > at_best + rise {
                return None;
            }
            (x, noise) = (place.x, place.noise);
        }
        Some((x, noise))
    };
    // Slow noise that is asked for before the other has grown may take the work from it.
    let (x, noise) = way(Asked::Always).or_else(|| way(Asked::Never))?;
    let alone = Frame::new(Arc::new(base.frame.model.with(other.id).ok()?), Arc::clone(evidence));
    let start = alone.as_in(&both, &x, None);
    Some(State::fit(Arc::new(alone), &start, &noise))
}

/// The cost that derivatives by all unknowns expect where some of them change by so much and the others follow.
fn expected(lens: &Lens, changes: &[(usize, f64)], others: &[usize]) -> f64 {
    let mut change = DVector::zeros(lens.pull.len());
    changes.iter().for_each(|&(unknown, by)| change[unknown] = by);
    let answer = &lens.normal * &change;
    let alone = lens.cost + change.dot(&answer) - 2.0 * change.dot(&lens.pull);
    // In units of what each unknown says by itself; what says nothing stays.
    let scale = |unknown: usize| lens.normal[(unknown, unknown)].sqrt().max(f64::MIN_POSITIVE);
    let mut normal =
        DMatrix::from_fn(others.len(), others.len(), |i, j| lens.normal[(others[i], others[j])] / (scale(others[i]) * scale(others[j])));
    (0..others.len()).for_each(|index| normal[(index, index)] += NEGLIGIBLE);
    let pull = DVector::from_iterator(others.len(), others.iter().map(|&unknown| (lens.pull[unknown] - answer[unknown]) / scale(unknown)));
    normal.cholesky().map_or(alone, |factor| alone - pull.dot(&factor.solve(&pull)))
}

/// Share of an unknown's information that is added so that what others say as well can be solved for.
const NEGLIGIBLE: f64 = 1e-9;
