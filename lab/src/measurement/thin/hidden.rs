//! What is lost where several readings of an input become their mean.

use std::collections::BTreeSet;

use energy::{Channel, Model};

use super::super::Log;
use super::{INPUT_SIGMAS, means, thousands};
use crate::report::quantity::{quantity, unit_of};

/// Share of the kept rows that may be left out for that; more would leave too little, and it is told instead.
const HIDDEN: f64 = 1.0 / 3.0;
/// Change of an input, as a share of its range, that is a jump, if it is more than its sensor's noise.
const JUMP: f64 = 0.02;

/// Change of an input from which on it has jumped, in its unit.
pub(in crate::measurement) fn jump(values: &[f64], model: &Model, channel: Channel) -> f64 {
    let sensor = model.sensor(channel);
    let known = || values.iter().filter(|value| !value.is_nan());
    let range = known().fold(f64::NEG_INFINITY, |most, &v| most.max(v)) - known().fold(f64::INFINITY, |least, &v| least.min(v));
    (INPUT_SIGMAS * sensor.sigma + sensor.quantum).max(JUMP * range)
}

/// What means of inputs hide.
pub(super) struct Hidden {
    /// Kept rows since the last of which an input has jumped and is not what it was on average, by input, and by how much all of its
    /// readings differ from the means that stand for them, RMS.
    edges: Vec<(Channel, Vec<usize>, f64)>,
    /// Kept rows, without the first.
    steps: usize,
}

impl Hidden {
    pub(super) fn of(log: &Log, model: &Model, inputs: &[Channel], kept: &[usize]) -> Hidden {
        let of = |&channel: &Channel| {
            let values = &log.channels[&channel];
            let most = jump(values, model, channel);
            let (mut edges, mut squares, mut readings) = (Vec::new(), 0.0, 0.0);
            for (place, (pair, mean)) in kept.windows(2).zip(means(&log.time_s, values, kept).into_iter().skip(1)).enumerate() {
                let step = &values[pair[0] + 1..=pair[1]];
                let off = step.iter().map(|value| (value - mean).powi(2)).filter(|square| !square.is_nan());
                (squares, readings) = off.fold((squares, readings), |(sum, count), square| (sum + square, count + 1.0));
                let jumps = step.windows(2).any(|pair| (pair[1] - pair[0]).abs() > most);
                if jumps && (values[pair[1]] - mean).abs() > most {
                    edges.push(place + 1);
                }
            }
            (channel, edges, (squares / f64::max(readings, 1.0)).sqrt())
        };
        Hidden { edges: inputs.iter().map(of).collect(), steps: kept.len().saturating_sub(1) }
    }

    /// In words, where it is much: whatever answers a change within a step is then compared with the answer to its mean.
    pub(super) fn told(&self, file: &str) -> Option<String> {
        let (channel, edges, rms) = self.edges.iter().max_by_key(|(_, edges, _)| edges.len())?;
        let share = edges.len() as f64 / self.steps.max(1) as f64;
        (share > HIDDEN).then(|| {
            format!(
                "{file}: means hide changes of {}: it jumps within {:.0} % of the steps, and differs from its means by {} RMS over all. What \
                 answers within a step is told wrongly; fewer seconds, or every row, show it",
                channel.name(),
                100.0 * share,
                quantity(*rms, unit_of(channel.name()))
            )
        })
    }

    /// Few jumps: what was measured right after one answers to more than the mean of its step, and is not compared with that.
    pub(super) fn leave_out(&self, log: &mut Log, model: &Model) {
        let rows: BTreeSet<usize> = self.edges.iter().flat_map(|(_, edges, _)| edges.iter().copied()).collect();
        for (_, values) in log.channels.iter_mut().filter(|(channel, _)| model.system.targets().contains(channel)) {
            rows.iter().for_each(|&row| values[row] = f64::NAN);
        }
        if !rows.is_empty() {
            let count = if rows.len() == 1 { "1 row is".to_owned() } else { format!("{} rows are", thousands(rows.len())) };
            log.notes.push(format!("{}: {count} not compared: an input jumps within their steps", log.file));
        }
    }
}
