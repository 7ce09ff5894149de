//! Floors of evidence, as far as they hang on the model: what the noise of measured inputs does.
//!
//! How much a current's noise moves a voltage is known once the resistance is. So a model is fitted, the floors are
//! asked of it, and where that moves one the fit is made again.

use std::sync::Arc;

use energy::{Channel, Model};

use super::evidence::Evidence;
use super::state::State;
use crate::input_noise::{input_noise, with_inputs};

/// Share by which a floor may be off: as much as a channel that counts as explained may lie above it.
const OFF: f64 = 0.05;

/// Logs that are learned from and, if any, logs that judge, on floors of one model.
pub(super) type Settled = (Arc<Evidence>, Option<Arc<Evidence>>);

/// The model at its best, its free parameters and all that is roughly known, on floors that it agrees with; and the logs
/// that judge on such floors.
#[must_use]
pub fn fitted(model: &Arc<Model>, evidence: Arc<Evidence>, holdout: Option<&Arc<Evidence>>) -> (State, Option<Arc<Evidence>>) {
    let state = State::of_model(Arc::clone(model), evidence);
    match resettled(&state, holdout) {
        Some((evidence, holdout)) => (State::of_model(Arc::clone(model), evidence), holdout),
        None => (state, holdout.cloned()),
    }
}

/// The logs on the floors that a fitted model gives them; none where those are as they were.
pub(super) fn resettled(state: &State, holdout: Option<&Arc<Evidence>>) -> Option<Settled> {
    let (told, evidence) = (state.told(), &state.frame.evidence);
    let model = &told.frame.model;
    let values = told.frame.values(&told.x);
    let of = |evidence: &Arc<Evidence>| evidence.floors_of(model, &values);
    // What the model cannot predict says nothing of what it makes of its inputs' noise.
    let of_held = |all: &Arc<Evidence>| all.that_judges(model).map_or_else(|| all.floors.clone(), |able| of(&able));
    let (seen, held) = (of(evidence), holdout.map(of_held));
    let moves = |evidence: &Evidence, after: &[(Channel, f64)]| {
        evidence.floors.iter().zip(after).any(|((_, before), (_, after))| (after / before - 1.0).abs() > OFF)
    };
    let held = holdout.zip(held);
    if !moves(evidence, &seen) && !held.as_ref().is_some_and(|(evidence, floors)| moves(evidence, floors)) {
        return None;
    }
    Some((Arc::new(evidence.with_floors(&seen)), held.map(|(evidence, floors)| Arc::new(evidence.with_floors(&floors)))))
}

impl Evidence {
    /// Floors by channel with what the noise of inputs does to this model, at these values of its parameters.
    pub(super) fn floors_of(&self, model: &Arc<Model>, values: &[f64]) -> Vec<(Channel, f64)> {
        let of_inputs = of_inputs(self, model, values);
        let with = |&(channel, own): &(Channel, f64)| {
            let added = of_inputs.iter().find(|(of, _)| *of == channel).map_or(0.0, |(_, noise)| *noise);
            (channel, with_inputs(own, added))
        };
        self.own_floors.iter().map(with).collect()
    }
}

/// What the noise of inputs does to each channel, over all logs.
fn of_inputs(evidence: &Evidence, model: &Arc<Model>, values: &[f64]) -> Vec<(Channel, f64)> {
    let by_log: Vec<_> = evidence.logs.iter().map(|log| input_noise(model, log, values)).collect();
    let of = |channel: Channel| {
        let (mut squares, mut rows) = (0.0, 0.0);
        for segment in evidence.segments.iter().filter(|segment| segment.channel == channel) {
            let noise = by_log[segment.log].iter().find(|(of, _)| *of == channel).map_or(0.0, |(_, noise)| *noise);
            let count = segment.rows.len() as f64;
            squares += count * noise * noise;
            rows += count;
        }
        if rows > 0.0 { (squares / rows).sqrt() } else { 0.0 }
    };
    evidence.own_floors.iter().map(|&(channel, _)| (channel, of(channel))).collect()
}
