//! A model as it is, with the sensors and the starts of its logs at their best.
//!
//! What a file predicts is compared with readings whose sensors have offsets, and begins at charges that are known to a percent. Whoever
//! looks at that error asks first: is it the model's? Nothing of the model moves here.

use std::sync::Arc;

use energy::{Channel, Model};

use super::evidence::{Evidence, Segment};
use super::floors;
use super::frame::Frame;
use super::rough::{Known, Rough, rough};
use super::state::{State, residual};
use crate::prepare::Prepared;

/// The state of a model that holds still on these logs, all that is known of sensors and starts only roughly at its best; none where
/// that is known exactly.
#[must_use]
pub fn calibrated(model: &Model, values: &[f64], logs: &[Prepared]) -> Option<State> {
    let still = with_exact_table(model.clone().with_values(values).held());
    let evidence = Evidence::new(&still, logs.to_vec());
    if evidence.rows() == 0 || rough(&still, &evidence.logs).is_empty() {
        return None;
    }
    Some(State::of_model(Arc::new(still), Arc::new(evidence)).told().clone())
}

/// The state of a model of which these parameters move, and all that is known of sensors and starts only roughly; none where that is known exactly. A
/// parameter belongs to a table and a capacity: these hold still.
#[must_use]
pub fn fitted(model: &Model, free: &[usize], logs: &[Prepared]) -> Option<State> {
    let named: Vec<(&str, &str)> = free.iter().map(|&index| &model.parameters()[index]).map(|p| (p.effect, p.name)).collect();
    let moving = model.clone().held().freed(|parameter| named.contains(&(parameter.effect, parameter.name)));
    let moving = Arc::new(with_exact_table(moving));
    let evidence = Evidence::new(&moving, logs.to_vec());
    if evidence.rows() == 0 || rough(&moving, &evidence.logs).is_empty() {
        return None;
    }
    Some(floors::fitted(&moving, Arc::new(evidence), None).0.told().clone())
}

fn with_exact_table(mut model: Model) -> Model {
    (model.uncertainty.ocv_sigma_v, model.uncertainty.capacity_relative_sigma) = (0.0, 0.0);
    model
}

/// What model and logs state to be known only roughly, in a few words, and a fit takes as exact: but for the table and the capacity nothing, if
/// it is calibrated; empty where that is nothing.
#[must_use]
pub fn taken_as_exact(model: &Model, logs: &[Prepared], is_calibrated: bool) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let is_taken = |known: &Known| !is_calibrated || matches!(known.what, Rough::Capacity | Rough::Ocv(_));
    for known in rough(model, logs).into_iter().filter(is_taken) {
        let word = match known.what {
            Rough::Offset(channel) => format!("the offset of {}", channel.name()),
            Rough::Gain(channel) => format!("the gain of {}", channel.name()),
            Rough::Lag(channel) => format!("the delay of {}", channel.name()),
            Rough::Capacity => "the capacity".to_owned(),
            Rough::Ocv(_) => "the OCV table".to_owned(),
            Rough::SocInitial(_) => "the charge at the start".to_owned(),
            Rough::TemperatureInitial(_) => "the temperature at the start".to_owned(),
            Rough::Ambient(_) => "the temperature around".to_owned(),
            Rough::Unmeasured { .. } => "what flowed in gaps".to_owned(),
            Rough::Clock(_) => "the clock of formulas".to_owned(),
        };
        if !words.contains(&word) {
            words.push(word);
        }
    }
    words
}

/// RMS of what a state leaves of each channel of each log, row by row, in the channel's unit.
#[must_use]
pub fn rms_by_log(state: &State) -> Vec<(usize, Channel, f64)> {
    let evidence = state.frame.evidence.whole.as_ref().unwrap_or(&state.frame.evidence);
    let left = residual(&Frame::new(Arc::clone(&state.frame.model), Arc::clone(evidence)), &state.x);
    let of = |segment: &Segment| {
        let rows = &left[segment.range()];
        let squares: f64 = rows.iter().map(|left| left * left).sum();
        (segment.log, segment.channel, (squares / rows.len().max(1) as f64).sqrt())
    };
    evidence.segments.iter().map(of).collect()
}

/// Logs as they would read had their sensors no offset and no gain, beginning where the state has them begin, with what flowed in their gaps. Delays
/// stay.
#[must_use]
pub fn corrected(state: &State, logs: &[Prepared]) -> Vec<Prepared> {
    let error = |what| state.frame.error(&state.x, what);
    let read = |channel: Channel, values: &mut [f64], offset: f64| {
        let (offset, gain, dead_band) =
            (offset + error(Rough::Offset(channel)), 1.0 + error(Rough::Gain(channel)), state.frame.model.sensor(channel).dead_band);
        // What shows nothing up to some reading shows nothing of its offset either.
        values.iter_mut().filter(|value| **value != 0.0 || dead_band == 0.0).for_each(|value| *value = (*value - offset) / gain);
    };
    let of = |(index, log): (usize, &Prepared)| {
        let mut log = log.clone();
        for (channel, values) in &mut log.inputs {
            // Where the surroundings are only known by what was said of them, they are what moves.
            let around_k = if *channel == Channel::AmbientDegc { error(Rough::Ambient(index)) } else { 0.0 };
            read(*channel, values, -around_k);
        }
        log.targets.iter_mut().for_each(|target| read(target.channel, &mut target.observed, 0.0));
        for (number, piece) in log.unmeasured.clone().iter().enumerate() {
            log.flows(piece, error(Rough::Unmeasured { log: index, piece: number }));
        }
        log.start.soc += error(Rough::SocInitial(index));
        log.start.temperature_degc += error(Rough::TemperatureInitial(index));
        log.start.clock_s += error(Rough::Clock(index));
        log
    };
    logs.iter().enumerate().map(of).collect()
}
