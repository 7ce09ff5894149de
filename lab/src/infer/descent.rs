//! The way to the most likely unknowns: Gauss-Newton steps, with the noise asked for again after
//! each, and damping where a step leads up (see [`crate::fit`]).

use energy::Channel;
use nalgebra::{DMatrix, DVector};

use super::frame::Frame;
use super::lens::{Lens, sigma};
use super::noise::{Filter, Noise};
use super::state::{all, filters, likelihood, noises, observed};
use crate::fit::{damped_step, held, promised};

/// Steps after which the search gives up.
const STEPS_MAX: usize = 40;
/// Damping at which a step has become too short to matter.
const DAMPING_MAX: f64 = 1e14;
/// Fall of the cost that is not worth another step: in units of two log-likelihoods, and as a share
/// of the cost, which is far above its number of rows while the model is far from right.
const ENOUGH: (f64, f64) = (0.02, 1e-6);

/// The same where the way is looked for, and not its end: a fraction of what makes effects unlike.
const ON_THE_WAY: f64 = 0.2;

/// Share of its height above a valley's bottom by which a place on its slopes may differ from what the derivatives
/// there say. A place in another valley is as high as that only by chance; wider, and ways into neighbours are given
/// up, narrower, and the end of a way that is known is gone again.
const ON_THE_SLOPE: f64 = 0.2;

/// Where a search stands.
#[derive(Debug, Clone)]
pub(super) struct Place {
    pub(super) x: Vec<f64>,
    pub(super) noise: Vec<(Channel, Noise)>,
    /// Observed minus predicted.
    pub(super) residual: Vec<f64>,
    /// Derivatives of the predictions by the unknowns that move.
    pub(super) slopes: DMatrix<f64>,
    pub(super) lens: Lens,
    pub(super) derived: Derived,
}

/// Of what a place's derivatives are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Derived {
    /// Of this place, but that the open-circuit voltage is taken to be read at the mean charge.
    Nearly,
    /// Of this place.
    Here,
}

impl Place {
    /// At given unknowns and noise.
    pub(super) fn at(frame: &Frame, x: Vec<f64>, noise: Vec<(Channel, Noise)>, by: &[usize], least: Derived) -> Place {
        let filters = filters(frame, &noise);
        Place::through(frame, x, noise, filters, by, least)
    }

    /// The same where the noise's filters are known.
    fn through(frame: &Frame, x: Vec<f64>, noise: Vec<(Channel, Noise)>, filters: Vec<Filter>, by: &[usize], least: Derived) -> Place {
        let (residual, slopes, derived) = linearised(frame, &x, by, least);
        Place::of(frame, x, noise, filters, by, (residual, slopes, derived))
    }

    /// The same where residuals and derivatives are known as well.
    fn of(
        frame: &Frame,
        x: Vec<f64>,
        noise: Vec<(Channel, Noise)>,
        filters: Vec<Filter>,
        by: &[usize],
        (residual, slopes, derived): (Vec<f64>, DMatrix<f64>, Derived),
    ) -> Place {
        let lens = Lens::new(frame, &x, by, &slopes, &residual, filters);
        Place { x, noise, residual, slopes, lens, derived }
    }

    /// At given unknowns, with the noise that is left there.
    fn with_what_is_left(frame: &Frame, x: Vec<f64>, by: &[usize]) -> Place {
        let (residual, slopes, derived) = linearised(frame, &x, by, Derived::Nearly);
        let noise = noises(frame, &residual);
        let filters = filters(frame, &noise);
        Place::of(frame, x, noise, filters, by, (residual, slopes, derived))
    }

    /// The same place with derivatives of at least this kind.
    fn with_derivatives(self, frame: &Frame, by: &[usize], least: Derived) -> Place {
        if self.derived >= least { self } else { Place::through(frame, self.x, self.noise, self.lens.filters, by, least) }
    }
}

/// Observed minus predicted, and the derivatives of what is predicted.
fn linearised(frame: &Frame, x: &[f64], by: &[usize], least: Derived) -> (Vec<f64>, DMatrix<f64>, Derived) {
    let whole = least == Derived::Here || !frame.reads_curve();
    let (predicted, slopes) = if whole { frame.linearise(x, by) } else { frame.linearise_nearly(x, by) };
    let residual = observed(frame).zip(&predicted).map(|(observed, predicted)| observed - predicted).collect();
    (residual, slopes, if whole { Derived::Here } else { Derived::Nearly })
}

/// Whether the noise is asked for again on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Asked {
    /// It stays what it is.
    Never,
    /// After every step.
    Always,
}

/// A valley whose bottom is known: a way that leads into it need not be gone to its end.
#[derive(Debug)]
pub(super) struct Valley<'a> {
    x: &'a [f64],
    /// How steeply the cost rises.
    normal: &'a DMatrix<f64>,
    pull: &'a DVector<f64>,
    filters: Vec<Filter>,
    /// At the bottom.
    cost: f64,
}

impl<'a> Valley<'a> {
    /// About these unknowns and noise, with all unknowns.
    pub(super) fn new(
        frame: &Frame,
        x: &'a [f64],
        residual: &[f64],
        noise: &[(Channel, Noise)],
        (normal, pull): (&'a DMatrix<f64>, &'a DVector<f64>),
    ) -> Valley<'a> {
        let filters = filters(frame, noise);
        let cost = likelihood(frame, residual, &filters) + priors(frame, x, &all(frame));
        Valley { x, normal, pull, filters, cost }
    }

    /// Whether a place lies on its slopes: about as high above the bottom as the derivatives there say.
    fn holds(&self, frame: &Frame, x: &[f64], residual: &[f64]) -> bool {
        let way = DVector::from_iterator(x.len(), x.iter().zip(self.x).map(|(there, bottom)| there - bottom));
        let expected = way.dot(&(self.normal * &way)) - 2.0 * self.pull.dot(&way);
        let above = likelihood(frame, residual, &self.filters) + priors(frame, x, &all(frame)) - self.cost;
        above > -ENOUGH.0 && (above - expected).abs() < ON_THE_SLOPE * expected.max(above).max(1.0)
    }
}

/// The most likely values of some unknowns, from `start` on.
pub(super) fn descend(frame: &Frame, start: &[f64], noise: &[(Channel, Noise)], by: &[usize], asked: Asked) -> Place {
    descend_from(frame, Place::at(frame, within(frame, start, by), noise.to_vec(), by, Derived::Nearly), by, asked)
}

/// The same for who asks where the way ends, and not for the derivatives there.
pub(super) fn descend_roughly(frame: &Frame, start: &[f64], noise: &[(Channel, Noise)], by: &[usize], asked: Asked) -> Place {
    let place = Place::at(frame, within(frame, start, by), noise.to_vec(), by, Derived::Nearly);
    descend_until(frame, place, by, asked, Derived::Nearly, None).0
}

/// The same with the noise that is left at the start.
pub(super) fn descend_from_left(frame: &Frame, start: &[f64], by: &[usize]) -> Place {
    descend_from(frame, Place::with_what_is_left(frame, within(frame, start, by), by), by, Asked::Always)
}

/// The most likely values of all unknowns, unless they lie in a valley that is known. Without a noise, that which is
/// left at the start.
pub(super) fn descend_elsewhere(
    frame: &Frame,
    start: &[f64],
    noise: Option<&[(Channel, Noise)]>,
    asked: Asked,
    valley: &Valley<'_>,
) -> Option<Place> {
    let by = all(frame);
    let x = within(frame, start, &by);
    let residual = super::state::residual(frame, &x);
    if valley.holds(frame, &x, &residual) {
        return None;
    }
    let noise = noise.map_or_else(|| noises(frame, &residual), <[_]>::to_vec);
    let place = Place::at(frame, x, noise, &by, Derived::Nearly);
    let (place, ended) = descend_until(frame, place, &by, asked, Derived::Here, Some(valley));
    (ended == Ended::Below).then_some(place)
}

fn within(frame: &Frame, start: &[f64], by: &[usize]) -> Vec<f64> {
    let bounds = frame.bounds();
    let mut x = start.to_vec();
    by.iter().for_each(|&unknown| x[unknown] = x[unknown].clamp(bounds[unknown].0, bounds[unknown].1));
    x
}

/// The same from a place whose derivatives by these unknowns are known.
pub(super) fn descend_from(frame: &Frame, place: Place, by: &[usize], asked: Asked) -> Place {
    descend_until(frame, place, by, asked, Derived::Here, None).0
}

/// Where a way ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ended {
    /// Where nothing leads further down.
    Below,
    /// Where it led to what is known already.
    Known,
}

/// The same, until the way leads into a valley that is known, with derivatives of at least a kind at its end.
///
/// On the way, derivatives that are nearly right will do, as long as they lead down; better ones are asked for before it ends.
///
/// Nearly every step leads down, and the derivatives where it ends are asked for next: a walk that carries them from the first
/// spares one that shows the residuals alone. Not so once a step has failed, or where the way may end in a known valley.
fn descend_until(
    frame: &Frame,
    mut place: Place,
    by: &[usize],
    asked: Asked,
    least: Derived,
    known: Option<&Valley<'_>>,
) -> (Place, Ended) {
    let all = frame.bounds();
    let bounds: Vec<(f64, f64)> = by.iter().map(|&unknown| all[unknown]).collect();
    let (mut scale, mut damping) = (vec![0.0_f64; by.len()], 1e-4);
    let mut leads_down = known.is_none();
    for _ in 0..STEPS_MAX {
        let Place { x, lens, .. } = &place;
        let enough = if frame.evidence.shows_the_way { ON_THE_WAY } else { ENOUGH.0 } + ENOUGH.1 * lens.whitened.norm_squared();
        scale.iter_mut().zip(lens.normal.diagonal().iter()).for_each(|(scale, d)| *scale = scale.max(*d));
        let gradient = -&lens.pull;
        let here: Vec<f64> = by.iter().map(|&unknown| x[unknown]).collect();
        let moving: Vec<usize> = (0..by.len()).filter(|&index| held(here[index], bounds[index], gradient[index]).is_none()).collect();
        let mut next = None;
        while damping < DAMPING_MAX {
            let step = damped_step(&lens.normal, &gradient, &scale, damping, &moving, &here, &bounds);
            if promised(&lens.normal, &gradient, &step) < enough {
                break;
            }
            let mut tried = x.clone();
            for ((&unknown, step), (min, max)) in by.iter().zip(step.iter()).zip(&bounds) {
                tried[unknown] = (tried[unknown] + step).clamp(*min, *max);
            }
            let (residual, derivatives) = if leads_down {
                let (residual, slopes, derived) = linearised(frame, &tried, by, Derived::Nearly);
                (residual, Some((slopes, derived)))
            } else {
                (super::state::residual(frame, &tried), None)
            };
            let unlikely = likelihood(frame, &residual, &lens.filters);
            let cost = unlikely + priors(frame, &tried, by);
            leads_down &= cost < lens.cost;
            if cost < lens.cost {
                damping = (damping / 10.0).max(1e-15);
                next = Some((tried, residual, derivatives, cost, unlikely));
                break;
            }
            if place.derived < least {
                break;
            }
            damping *= 10.0;
        }
        let Some((x, residual, derivatives, cost, unlikely)) = next else {
            if place.derived >= least {
                break;
            }
            place = place.with_derivatives(frame, by, least);
            continue;
        };
        if known.is_some_and(|valley| valley.holds(frame, &x, &residual)) {
            return (place, Ended::Known);
        }
        let settled = lens.cost - cost <= enough;
        let Place { mut noise, lens: Lens { mut filters, .. }, derived: had, .. } = place;
        if asked == Asked::Always {
            let new = noises(frame, &residual);
            let through = super::state::filters(frame, &new);
            if likelihood(frame, &residual, &through) <= unlikely {
                (noise, filters) = (new, through);
            }
        }
        let wanted = if settled { least } else { Derived::Nearly };
        place = match derivatives {
            Some((slopes, derived)) if derived >= wanted => Place::of(frame, x, noise, filters, by, (residual, slopes, derived)),
            _ => Place::through(frame, x, noise, filters, by, wanted),
        };
        if settled && had >= least {
            break;
        }
    }
    (place.with_derivatives(frame, by, least), Ended::Below)
}

/// What is known of the rough numbers among these unknowns, against their values.
fn priors(frame: &Frame, x: &[f64], by: &[usize]) -> f64 {
    by.iter().filter_map(|&unknown| Some((x[unknown] / sigma(frame, unknown)?).powi(2))).sum()
}
