//! Which other effects do for some logs what the hidden one does: nobody can tell them apart there.

use energy::{EffectSpec, ParameterSpec};

use crate::draft::Draft;
use crate::plan::effects;
use crate::refit::leaves;
use crate::world::Course;

/// Rounds of least squares: more than a size needs, since an effect begins where it does next to nothing.
const ROUNDS: usize = 6;
/// Deviations from the truth, of all rows together and each with its sensor's white noise, up to which nobody can tell.
const UNSEEN: f64 = 1.0;
/// Share of its usual size at which an effect begins.
const BEGINS: f64 = 1e-3;
/// Share of its range that is a usual size where none is stated.
const USUAL: f64 = 0.05;

/// Every effect that the base lacks and with which its refit leaves nothing of the truth that could be seen. One whose refit
/// does not get there by plain least squares is not among them.
#[must_use]
pub fn stand_ins(base: &Draft, courses: &[Course]) -> Vec<&'static str> {
    let absent = effects().into_iter().filter(|spec| spec.system == base.system && !base.has(spec.id));
    absent.filter(|spec| stands_in(base, courses, spec)).map(|spec| spec.id).collect()
}

fn stands_in(base: &Draft, courses: &[Course], spec: &'static EffectSpec) -> bool {
    let begin: Vec<(&'static str, f64)> = spec.parameters.iter().map(|parameter| (parameter.name, begins(parameter))).collect();
    leaves(&base.with(spec.id, &begin), courses, ROUNDS).deviations < UNSEEN
}

fn begins(parameter: &ParameterSpec) -> f64 {
    match parameter.null {
        None => parameter.default,
        Some(null) if parameter.default == null => null + BEGINS * USUAL * (parameter.max - null),
        Some(null) => null + BEGINS * (parameter.default - null),
    }
}
