//! Whether logs that begin elsewhere than they say would explain themselves, without any effect.
//!
//! A search allows a charge at the start three of its stated deviations, and surroundings that are stated without one none; what
//! would need more is taken for an effect of the battery. It may as well be a start that somebody got wrong, and only they can know.

use std::ops::RangeInclusive;
use std::sync::Arc;

use energy::{Channel, Model, System};
use serde::Serialize;

use super::evidence::Evidence;
use super::judge::explained;
use super::other_numbers::Asked;
use super::rough::Rough;
use super::state::State;
use crate::prepare::Prepared;

/// Times the stated deviation of a start that are allowed here, and at least any charge within three of them: a log that begins half full may
/// be said to begin full.
const WIDER: f64 = 10.0;
const WIDE_SOC: f64 = 1.0 / 3.0;
/// A charge is told to so many thousandths, and is no better known than that.
const LEAST_SOC: f64 = 0.001;
/// By so much a gauge's charge may lie below empty or beyond full.
const OVERSHOOT: f64 = 0.05;
/// Stated deviations up to which a start is as stated.
const AS_STATED: f64 = 3.0;

/// As far as the surroundings may be off here, K.
const WIDE_K: f64 = 10.0;

/// A log that would begin at another charge, or in other surroundings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OtherStart {
    /// The log.
    pub log: String,
    /// Which fact of it: `soc_initial`, 0..1, or `ambient_degc`.
    pub fact: &'static str,
    /// As it is said to be.
    pub stated: f64,
    /// As it would have to be.
    pub found: f64,
}

/// Logs that would have to begin elsewhere for the model as given to explain them all, or as well as what was `found`; empty where that is
/// no explanation, or a start within what is stated is one. It is asked of the charge first, and of the surroundings if that explains nothing.
#[must_use]
pub fn other_starts(model: &Arc<Model>, logs: &[Prepared], found: &State) -> Vec<OtherStart> {
    if model.system != System::Battery {
        return Vec::new();
    }
    let given = State::of_model(Arc::clone(model), Arc::new(Evidence::new(model, logs.to_vec())));
    let Some(asked) = Asked::between(&given, found) else { return Vec::new() };
    let stated = |log: &Prepared| log.soc_initial_sigma.unwrap_or(model.uncertainty.soc_initial_sigma).max(LEAST_SOC);
    let charge = Fact {
        name: "soc_initial",
        rough: Rough::SocInitial,
        stated: &|log| Some(log.start.soc),
        sigma: &stated,
        possible: -OVERSHOOT..=1.0 + OVERSHOOT,
    };
    let wider = |log: &Prepared| Prepared { soc_initial_sigma: Some((WIDER * stated(log)).max(WIDE_SOC)), ..log.clone() };
    let found = charge.elsewhere(model, logs, &asked, &wider);
    if !found.is_empty() || !model.predicts_temperature() {
        return found;
    }
    // Stated without a deviation it may be off by what a reading may.
    let floor_k = model.sensor(Channel::TemperatureDegc).floor();
    let stated = |log: &Prepared| log.ambient_sigma_k.unwrap_or(floor_k);
    let constant = |log: &Prepared| input(log, Channel::AmbientDegc).and_then(|degc| degc.first().copied());
    let around = Fact {
        name: "ambient_degc",
        rough: Rough::Ambient,
        stated: &constant,
        sigma: &stated,
        possible: f64::NEG_INFINITY..=f64::INFINITY,
    };
    let wider = |log: &Prepared| Prepared { ambient_sigma_k: Some((WIDER * stated(log)).max(WIDE_K)), ..log.clone() };
    around.elsewhere(model, logs, &asked, &wider)
}

/// Something that is stated of a log.
struct Fact<'a> {
    name: &'static str,
    rough: fn(usize) -> Rough,
    stated: &'a dyn Fn(&Prepared) -> Option<f64>,
    sigma: &'a dyn Fn(&Prepared) -> f64,
    /// What it can be.
    possible: RangeInclusive<f64>,
}

impl Fact<'_> {
    /// Logs of which it would have to be another, where knowing it worse explains all of them.
    fn elsewhere(&self, model: &Arc<Model>, logs: &[Prepared], asked: &Asked, wider: &dyn Fn(&Prepared) -> Prepared) -> Vec<OtherStart> {
        let state = State::of_model(Arc::clone(model), Arc::new(Evidence::new(model, logs.iter().map(wider).collect())));
        if !explained(&state) && !asked.does_as_well(&state) {
            return Vec::new();
        }
        let of_log = |(index, log)| Some((log, (self.stated)(log)?, state.frame.error(&state.x, (self.rough)(index))));
        let starts: Vec<(&Prepared, f64, f64)> = logs.iter().enumerate().filter_map(of_log).collect();
        if starts.iter().any(|(_, stated, shift)| !self.possible.contains(&(stated + shift))) {
            return Vec::new();
        }
        let others = starts.into_iter().filter(|(log, _, shift)| shift.abs() > AS_STATED * (self.sigma)(log));
        others.map(|(log, stated, shift)| OtherStart { log: log.name.clone(), fact: self.name, stated, found: stated + shift }).collect()
    }
}

/// The values of an input of a log.
fn input(log: &Prepared, channel: Channel) -> Option<&[f64]> {
    log.inputs.iter().find(|(known, _)| *known == channel).map(|(_, values)| values.as_slice())
}
