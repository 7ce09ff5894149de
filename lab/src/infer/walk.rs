//! One walk of a model along one log, with everything that is uncertain about it in play.

use std::sync::Arc;

use energy::effect::Lane;
use energy::{Channel, Channels, Model, Run, Start};

use crate::prepare::predicted_channels;

/// An input with what its sensor may have multiplied and added.
pub(super) struct Drive<'a, S> {
    channel: Channel,
    values: &'a [f64],
    /// Offset, and one over the gain; none when the sensor is taken at its word.
    shift: Option<(S, S)>,
    /// Its sensor shows 0 for readings up to here, whatever it adds.
    dead_band: f64,
}

/// The inputs of a log that the model does not predict itself.
pub(super) fn drives<'a, S: Lane>(
    model: &Model,
    inputs: &'a [(Channel, Vec<f64>)],
    shift: impl Fn(Channel) -> Option<(S, S)>,
) -> Vec<Drive<'a, S>> {
    let predicted = predicted_channels(model);
    let inputs = inputs.iter().filter(|(channel, _)| !predicted.contains(channel));
    let drive = |(channel, values): &'a (Channel, Vec<f64>)| Drive {
        channel: *channel,
        values,
        shift: shift(*channel).map(|(offset, gain)| (offset, (gain + 1.0).recip())),
        dead_band: model.sensor(*channel).dead_band,
    };
    inputs.map(drive).collect()
}

/// Steps the model along the log and shows the channels of every row.
pub(super) fn walk<S: Lane>(
    model: &Arc<Model>,
    parameters: Vec<S>,
    start: Start<S>,
    time_s: &[f64],
    drives: &[Drive<'_, S>],
    mut at: impl FnMut(usize, &Channels<S>),
) {
    let mut run = Run::with_parameters(Arc::clone(model), parameters, start);
    for row in 0..time_s.len() {
        for drive in drives {
            let value = drive.values[row];
            run.channels[drive.channel] = match drive.shift {
                None => S::from(value),
                Some(_) if value == 0.0 && drive.dead_band > 0.0 => S::from(0.0),
                Some((offset, inverse)) => (S::from(value) - offset) * inverse,
            };
        }
        if row > 0 {
            run.step(time_s[row] - time_s[row - 1]);
        }
        at(row, &run.channels);
    }
}
