//! What a model knows only roughly, and must not be explained by a missing effect.

use energy::{Channel, Facts, Model};

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
    /// The temperature around a log's battery, beyond the log's fact, K.
    Ambient(usize),
    /// The mean current over a piece of a log's gaps, beyond what the row after the gap says, A.
    Unmeasured {
        /// The log.
        log: usize,
        /// Which of its pieces.
        piece: usize,
    },
    /// What the clock of formulas shows at the first row of a log, s.
    Clock(usize),
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
            Rough::SocInitial(log)
            | Rough::TemperatureInitial(log)
            | Rough::Ambient(log)
            | Rough::Unmeasured { log, .. }
            | Rough::Clock(log) => Some(log),
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
            if let Some(sigma_k) = log.ambient_sigma_k.filter(|_| model.predicts_temperature()) {
                know(Rough::Ambient(index), sigma_k);
            }
            know(Rough::SocInitial(index), log.soc_initial_sigma.unwrap_or(model.uncertainty.soc_initial_sigma));
            for (piece, unmeasured) in log.unmeasured.iter().enumerate() {
                know(Rough::Unmeasured { log: index, piece }, unmeasured.current_sigma_a);
            }
        }
    } else {
        // A square has twice the relative error of its root.
        know(Rough::Gain(Channel::BaySquaredCurrentA2), 2.0 * model.uncertainty.bay_current_relative_sigma);
    }
    if model.effects().any(|effect| effect.spec().tells_time()) {
        (0..logs.len()).for_each(|log| know(Rough::Clock(log), model.uncertainty.clock_sigma_s));
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

/// How far beyond its ends a table's error goes on to change: a cell that is charged to its limit, or
/// whose charge at the start was stated a little too high, is there for a while, and where a table's
/// last line leads is known no better than the table.
const BEYOND: f64 = 0.05;

/// States of charge at which the error of an OCV table is a number of its own: the table's own where it
/// has few, and one beyond each end.
#[must_use]
pub fn knots(table_soc: &[f64]) -> Vec<f64> {
    let own = if table_soc.len() <= KNOTS.len() { table_soc } else { &KNOTS };
    let ends = own.first().map(|first| first - BEYOND).into_iter();
    ends.chain(own.iter().copied()).chain(own.last().map(|last| last + BEYOND)).collect()
}

/// The knots about a state of charge with their weights, which sum to one: a cubic between two
/// knots with the slopes that their neighbours suggest (Catmull and Rom 1974, for uneven knots);
/// beyond the ends the last knot alone. A curve through a handful of points is smooth: with
/// straight lines, tables that err by 3 mV in waves of 25 % SoC would leave half a millivolt.
#[must_use]
pub fn weights(knots: &[f64], soc: f64) -> [(usize, f64); 4] {
    let Some(Between { before, low, high, after, width, t }) = between(knots, soc) else {
        let end = if soc <= knots[0] { 0 } else { knots.len() - 1 };
        return [(end, 1.0), (end, 0.0), (end, 0.0), (end, 0.0)];
    };
    let (t2, t3) = (t * t, t * t * t);
    // Hermite's cubic: what the values and the slopes at both ends count.
    let (value_low, value_high) = (t3 * 2.0 - t2 * 3.0 + 1.0, t2 * 3.0 - t3 * 2.0);
    let slope_low = (t3 - t2 * 2.0 + t) * (width / (knots[high] - knots[before]));
    let slope_high = (t3 - t2) * (width / (knots[after] - knots[low]));
    [(before, -slope_low), (low, value_low - slope_high), (high, value_high + slope_low), (after, slope_high)]
}

/// The value at `x` on straight lines through the points, which lie in order; beyond them the last.
pub(crate) fn straight(points: &[(f64, f64)], x: f64) -> f64 {
    let high = points.partition_point(|(at, _)| *at <= x);
    match (high.checked_sub(1).map(|low| points[low]), points.get(high)) {
        (Some((x0, y0)), Some((x1, y1))) => y0 + (y1 - y0) * (x - x0) / (x1 - x0),
        (Some((_, y)), None) | (None, Some(&(_, y))) => y,
        (None, None) => 0.0,
    }
}

/// Where a state of charge lies between two knots, with the next ones.
struct Between {
    before: usize,
    low: usize,
    high: usize,
    after: usize,
    width: f64,
    /// Share of the way from the lower knot to the higher.
    t: f64,
}

/// None beyond the ends.
fn between(knots: &[f64], soc: f64) -> Option<Between> {
    let last = knots.len() - 1;
    if !(soc > knots[0] && soc < knots[last]) {
        return None;
    }
    // Knots lie nearly evenly: from where an even grid would have it, it is a step or two.
    let mut low = (((soc - knots[0]) / (knots[last] - knots[0]) * last as f64) as usize).min(last - 1);
    while knots[low] > soc {
        low -= 1;
    }
    while knots[low + 1] <= soc {
        low += 1;
    }
    let high = low + 1;
    let width = knots[high] - knots[low];
    Some(Between { before: low.saturating_sub(1), low, high, after: (high + 1).min(last), width, t: (soc - knots[low]) / width })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(knots: &[f64], values: &[f64], soc: f64) -> f64 {
        weights(knots, soc).iter().map(|&(knot, weight)| values[knot] * weight).sum()
    }

    #[test]
    fn a_correction_goes_through_its_knots_and_stays_beyond_them() {
        let (knots, values) = ([0.0, 0.2, 0.5, 1.0], [3.0, -1.0, 1.0, 2.0]);
        let found = [-0.1, 0.0, 0.2, 0.5, 1.0, 1.2].map(|soc| at(&knots, &values, soc));
        assert!(found.iter().zip([3.0, 3.0, -1.0, 1.0, 2.0, 2.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }

    #[test]
    fn a_line_stays_a_line_and_a_wave_of_a_third_is_met_within_a_fiftieth() {
        let knots: Vec<f64> = (0..=20).map(|knot| f64::from(knot) * 0.05).collect();
        let wave = |soc: f64| (6.0 * std::f64::consts::PI * soc).sin();
        let (line, waves) = (knots.clone(), knots.iter().map(|&soc| wave(soc)).collect::<Vec<_>>());
        let between = (20..180).map(|place| f64::from(place) / 200.0);
        let errors = between.map(|soc| ((at(&knots, &line, soc) - soc).abs(), (at(&knots, &waves, soc) - wave(soc)).abs()));
        let worst = errors.fold((0.0, 0.0), |worst: (f64, f64), e| (worst.0.max(e.0), worst.1.max(e.1)));
        assert!(worst.0 < 1e-12 && worst.1 < 0.02, "{worst:?}");
    }
}
