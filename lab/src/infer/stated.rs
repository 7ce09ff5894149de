//! Whether what the model states only roughly would explain the logs without any effect, each number within its deviation.
//!
//! A search takes a number that is not marked free as exact, whatever deviation stands beside it: who wants it fitted says so. Several such
//! numbers that are each a little off may then be taken for an effect, and no single one of them explains it.

use std::sync::Arc;

use energy::{Model, Parameter};
use nalgebra::DMatrix;
use serde::Serialize;

use super::certainty::range_sigma;
use super::evidence::Evidence;
use super::frame::Frame;
use super::other_numbers::Asked;
use super::state::State;
use crate::prepare::Prepared;

/// Deviations of what is stated up to which a number is what it is said to be.
const WITHIN: f64 = 3.0;
/// How often what is stated and what the rows say are weighed against each other, the rows linear about where that led.
const ROUNDS: usize = 4;

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
    /// Standard deviation of that, with what is stated.
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
    let state = State::of_model(freed, Arc::clone(&given.frame.evidence));
    let stated: Vec<Option<&Parameter>> =
        state.frame.free.iter().map(|&index| Some(&model.parameters()[index]).filter(|one| is_rough(one))).collect();
    let Some((state, covariance)) = most_likely(state, &stated) else { return Vec::new() };
    let number = |(place, stated): (usize, &Option<&Parameter>)| {
        let stated = (*stated)?;
        let (number, sigma) = (format!("{}.{}", stated.effect, stated.name), covariance[(place, place)].max(0.0).sqrt());
        Some(Roughly { number, stated: stated.value, stated_sigma: stated.sigma, found: state.x[place], sigma })
    };
    let numbers: Vec<Roughly> = stated.iter().enumerate().filter_map(number).collect();
    let as_stated = |one: &Roughly| (one.found - one.stated).abs() <= WITHIN * one.stated_sigma;
    // Where no effect was found, to leave no more than nothing did is no merit.
    let is_found = found.frame.model.effects().count() > model.effects().count();
    let explains = if is_found { asked.leaves_no_more(&state) } else { asked.does_as_well(&state) };
    if explains && numbers.iter().all(as_stated) { numbers } else { Vec::new() }
}

/// The unknowns that are most likely by the rows and by what is `stated` of the free parameters, and their covariance; none where that is
/// nowhere to be found.
fn most_likely(mut state: State, stated: &[Option<&Parameter>]) -> Option<(State, DMatrix<f64>)> {
    let bounds = state.frame.bounds();
    // What nothing is stated of may be anywhere in its range.
    let deviation = |(place, stated): (usize, &Option<&Parameter>), frame: &Frame| match stated {
        Some(stated) => stated.sigma,
        None => range_sigma(frame, frame.free[place]),
    };
    let known: Vec<f64> = stated.iter().enumerate().map(|own| deviation(own, &state.frame).powi(-2)).collect();
    let information = |state: &State| {
        let mut information = state.normal.clone();
        known.iter().enumerate().for_each(|(place, known)| information[(place, place)] += known);
        information.cholesky()
    };
    for _ in 0..ROUNDS {
        let mut pull = state.pull.clone();
        for (place, stated) in stated.iter().enumerate() {
            pull[place] += stated.map_or(0.0, |stated| known[place] * (stated.value - state.x[place]));
        }
        let step = information(&state)?.solve(&pull);
        let moved = state.x.iter().zip(step.iter()).zip(&bounds).map(|((x, step), (min, max))| (x + step).clamp(*min, *max));
        state = state.at(&moved.collect::<Vec<_>>());
    }
    let covariance = information(&state)?.inverse();
    Some((state, covariance))
}
