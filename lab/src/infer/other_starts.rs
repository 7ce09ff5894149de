//! Whether logs that begin elsewhere than they say would explain themselves, without any effect.
//!
//! A search allows a charge at the start three of its stated deviations; what would need more is taken for an effect of the
//! battery. It may as well be a start that somebody got wrong, and only they can know.

use std::sync::Arc;

use energy::{Model, System};
use serde::Serialize;

use super::evidence::Evidence;
use super::judge::explained;
use super::rough::Rough;
use super::state::State;
use crate::prepare::Prepared;

/// Times the stated deviation of a start, and least charge, that are allowed here.
const WIDER: f64 = 10.0;
const WIDE_SOC: f64 = 0.1;
/// Stated deviations up to which a start is as stated.
const AS_STATED: f64 = 3.0;

/// A log that would begin at another charge.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OtherStart {
    /// The log.
    pub log: String,
    /// State of charge at its start, 0..1, as it is said to be.
    pub stated: f64,
    /// As it would have to be.
    pub found: f64,
}

/// Logs that would have to begin elsewhere for the model as given to explain them all; empty where that is no explanation, or a start
/// within what is stated is one.
#[must_use]
pub fn other_starts(model: &Arc<Model>, logs: &[Prepared]) -> Vec<OtherStart> {
    if model.system != System::Battery {
        return Vec::new();
    }
    let stated = |log: &Prepared| log.soc_initial_sigma.unwrap_or(model.uncertainty.soc_initial_sigma);
    let wider = |log: &Prepared| Prepared { soc_initial_sigma: Some((WIDER * stated(log)).max(WIDE_SOC)), ..log.clone() };
    let state = State::of_model(Arc::clone(model), Arc::new(Evidence::new(model, logs.iter().map(wider).collect())));
    if !explained(&state) {
        return Vec::new();
    }
    let other = |(index, log): (usize, &Prepared)| {
        let shift = state.frame.error(&state.x, Rough::SocInitial(index));
        let start = log.start.soc;
        (shift.abs() > AS_STATED * stated(log)).then(|| OtherStart { log: log.name.clone(), stated: start, found: start + shift })
    };
    logs.iter().enumerate().filter_map(other).collect()
}
