//! Whether what the model states only roughly would explain the logs without any effect, each number within its deviation.
//!
//! A search takes a number that is not marked free as exact, whatever deviation stands beside it: who wants it fitted says so. Several such
//! numbers that are each a little off may then be taken for an effect, and no single one of them explains it.

use std::sync::Arc;

use energy::{Model, Parameter};
use serde::Serialize;

use super::evidence::Evidence;
use super::other_numbers::Asked;
use super::state::State;
use crate::prepare::Prepared;

/// Deviations, of what is stated and of what was found together, up to which a number is what it is said to be.
const WITHIN: f64 = 3.0;

/// A number as it would have to be.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Roughly {
    /// Where it stands in the model file: `effect.parameter`.
    pub number: String,
    /// As it is stated.
    pub stated: f64,
    /// With that deviation.
    pub stated_sigma: f64,
    /// As it would have to be.
    pub found: f64,
    /// Standard deviation of that.
    pub sigma: f64,
}

/// All numbers that are stated with a deviation and are not free, as they would explain the logs nearly as well as what was `found`, and
/// without it; empty where they do not, or one of them would have to be another than is stated.
#[must_use]
pub fn within_stated(model: &Arc<Model>, logs: &[Prepared], found: &State) -> Vec<Roughly> {
    let is_rough = |parameter: &Parameter| !parameter.free && parameter.sigma > 0.0 && parameter.max > parameter.min;
    if model.parameters().iter().filter(|parameter| is_rough(parameter)).count() < 2 {
        return Vec::new();
    }
    let given = State::of_model(Arc::clone(model), Arc::new(Evidence::new(model, logs.to_vec())));
    let Some(asked) = Asked::between(&given, found) else { return Vec::new() };
    let freed = Arc::new(Model::clone(model).freed(is_rough));
    let state = State::of_model(freed, Arc::clone(&given.frame.evidence)).with_what_is_open_as_before();
    let number = |(&index, sigma): (&usize, f64)| {
        let parameter = &model.parameters()[index];
        let place = state.frame.free.iter().position(|&free| free == index)?;
        is_rough(parameter).then(|| Roughly {
            number: format!("{}.{}", parameter.effect, parameter.name),
            stated: parameter.value,
            stated_sigma: parameter.sigma,
            found: state.x[place],
            sigma,
        })
    };
    let numbers: Vec<Roughly> = state.frame.free.iter().zip(state.sigmas()).filter_map(number).collect();
    let as_stated = |one: &Roughly| (one.found - one.stated).abs() <= WITHIN * one.stated_sigma.hypot(one.sigma);
    // Where no effect was found, to leave no more than nothing did is no merit.
    let is_found = found.frame.model.effects().count() > model.effects().count();
    let explains = if is_found { asked.leaves_no_more(&state) } else { asked.does_as_well(&state) };
    if explains && numbers.iter().all(as_stated) { numbers } else { Vec::new() }
}
