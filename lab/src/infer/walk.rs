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

/// A time over which the current was not measured.
pub(super) struct Unread<S> {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    /// What flowed beyond what the log says, A.
    pub(super) beyond_a: S,
}

/// Steps the model along the log and shows the channels of every row. `unread` lies in order.
pub(super) fn walk<S: Lane>(
    model: &Arc<Model>,
    parameters: Vec<S>,
    start: Start<S>,
    time_s: &[f64],
    drives: &[Drive<'_, S>],
    mut unread: &[Unread<S>],
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
            let begin_s = through(&mut run, &mut unread, time_s[row - 1], time_s[row]);
            run.step(time_s[row] - begin_s);
        }
        at(row, &run.channels);
    }
}

/// Steps through the part of a row over which its current was not measured, and takes off what lies behind. Returns where the
/// rest of the row begins, s: the reading at its end is one of the current that was measured.
fn through<S: Lane>(run: &mut Run<S>, unread: &mut &[Unread<S>], mut now_s: f64, end_s: f64) -> f64 {
    while let Some((piece, rest)) = unread.split_first()
        && piece.from_s < end_s
    {
        let measured_a = run.channels[Channel::CurrentA];
        if piece.from_s > now_s {
            run.step(piece.from_s - now_s);
            now_s = piece.from_s;
        }
        let until_s = piece.to_s.min(end_s);
        if until_s > now_s {
            run.channels[Channel::CurrentA] = measured_a + piece.beyond_a;
            run.step(until_s - now_s);
            run.channels[Channel::CurrentA] = measured_a;
            now_s = until_s;
        }
        if piece.to_s > end_s {
            break;
        }
        *unread = rest;
    }
    now_s
}
