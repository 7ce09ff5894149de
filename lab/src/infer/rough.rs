//! What a model knows only roughly, and must not be explained by a missing effect.

use energy::{Channel, Facts, Model, Real};

use crate::prepare::Prepared;

/// One number that is known up to a normal deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rough {
    /// Constant offset of a sensor: what it shows beyond the truth, in the channel's unit. It shifts
    /// the prediction of a target and, the other way, an input.
    Offset(Channel),
    /// Gain of a sensor beyond 1.
    Gain(Channel),
    /// Time by which a target is read later than the inputs' intervals end, s.
    Lag(Channel),
    /// Capacity, as a share beyond the model's.
    Capacity,
    /// The open-circuit voltage at a knot, V per cell beyond the table.
    Ocv(usize),
    /// The state of charge at the first row of a log, beyond the log's fact.
    SocInitial(usize),
    /// The temperature at the first row of a log, beyond what its sensor showed, K.
    TemperatureInitial(usize),
}

/// A rough number and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Which number.
    pub what: Rough,
    /// Its standard deviation, > 0.
    pub sigma: f64,
}

impl Known {
    /// Whether the number belongs to one log alone.
    #[must_use]
    pub fn log(&self) -> Option<usize> {
        match self.what {
            Rough::SocInitial(log) | Rough::TemperatureInitial(log) => Some(log),
            _ => None,
        }
    }
}

/// Everything that the model and the logs state to be only roughly known.
#[must_use]
pub fn rough(model: &Model, logs: &[Prepared]) -> Vec<Known> {
    let mut all = Vec::new();
    let mut know = |what, sigma: f64| {
        if sigma > 0.0 {
            all.push(Known { what, sigma });
        }
    };
    for (&channel, sensor) in &model.sensors {
        let measured = |log: &Prepared| {
            log.targets.iter().any(|target| target.channel == channel) || log.inputs.iter().any(|(input, _)| *input == channel)
        };
        if logs.iter().any(measured) {
            know(Rough::Offset(channel), sensor.offset_sigma);
            know(Rough::Gain(channel), sensor.gain_sigma);
            know(Rough::Lag(channel), sensor.lag_sigma_s);
        }
    }
    if let Facts::Battery(facts) = &model.facts {
        know(Rough::Capacity, model.uncertainty.capacity_relative_sigma);
        for knot in 0..knots(facts.ocv.points().0).len() {
            know(Rough::Ocv(knot), model.uncertainty.ocv_sigma_v);
        }
        for (index, log) in logs.iter().enumerate() {
            if temperature_is_judged(log) {
                let sensor = model.sensor(Channel::TemperatureDegc);
                know(Rough::TemperatureInitial(index), sensor.floor().hypot(sensor.offset_sigma));
            }
            know(Rough::SocInitial(index), log.soc_initial_sigma.unwrap_or(model.uncertainty.soc_initial_sigma));
        }
    } else {
        // A square has twice the relative error of its root.
        know(Rough::Gain(Channel::BaySquaredCurrentA2), 2.0 * model.uncertainty.bay_current_relative_sigma);
    }
    all
}

/// Whether a battery's log measures its temperature and, beside it, what it follows from.
pub(super) fn temperature_is_judged(log: &Prepared) -> bool {
    let input = |wanted| log.inputs.iter().any(|(channel, _)| *channel == wanted);
    let target = log.targets.iter().any(|target| target.channel == Channel::TemperatureDegc);
    target || (input(Channel::AmbientDegc) && input(Channel::TemperatureDegc))
}

/// States of charge at which the error of an OCV table may differ: every 5 %, and closer to empty.
const KNOTS: [f64; 22] =
    [0.0, 0.025, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0];

/// States of charge between which the error of an OCV table runs straight: the table's own where
/// it has few.
#[must_use]
pub fn knots(table_soc: &[f64]) -> Vec<f64> {
    if table_soc.len() <= KNOTS.len() { table_soc.to_vec() } else { KNOTS.to_vec() }
}

/// The two knots about a state of charge with their weights, which sum to one; beyond the ends
/// the last knot alone.
#[must_use]
pub fn weights<S: Real>(knots: &[f64], soc: S) -> [(usize, S); 2] {
    let last = knots.len() - 1;
    let (one, none) = (S::from(1.0), S::from(0.0));
    if soc.re() <= knots[0] {
        return [(0, one), (0, none)];
    }
    if soc.re() >= knots[last] {
        return [(last, one), (last, none)];
    }
    let high = knots.partition_point(|&knot| knot <= soc.re());
    let share = (soc - knots[high - 1]) * (knots[high] - knots[high - 1]).recip();
    [(high - 1, one - share), (high, share)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correction_runs_straight_between_knots_and_stays_beyond_them() {
        let knots = [0.0, 0.5, 1.0];
        let at = |soc: f64| weights(&knots, soc).iter().map(|&(knot, weight)| [3.0, 1.0, 2.0][knot] * weight).sum::<f64>();
        assert_eq!([at(-0.1), at(0.0), at(0.25), at(0.75), at(1.0), at(1.2)], [3.0, 3.0, 2.0, 1.5, 2.0, 2.0]);
    }
}
