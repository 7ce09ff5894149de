//! Walks a model along a log, with plain numbers or with exact derivatives.

use std::sync::Arc;

use energy::effect::Lane;
use energy::real::{Derived, HalfDual, LANES};
use energy::{Channel, Channels, Model, Run, System};

use crate::prepare::{Prepared, predicted_channels};

/// What a model says about a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// State of charge at every row; empty for systems without one.
    pub soc: Vec<f64>,
    /// Every predicted channel; NaN at a row that says nothing.
    pub channels: Vec<(Channel, Vec<f64>)>,
}

impl Prediction {
    /// The predicted values of a channel.
    #[must_use]
    pub fn of(&self, channel: Channel) -> Option<&[f64]> {
        self.channels.iter().find(|(known, _)| *known == channel).map(|(_, values)| values.as_slice())
    }
}

/// Predicts every row with the given parameter values (in the order of [`Model::parameters`]).
///
/// The first row of a battery is its rested state. A robot or station has none: no interval
/// precedes its first row, which stays NaN.
#[must_use]
pub fn predict(model: &Arc<Model>, prepared: &Prepared, values: &[f64]) -> Prediction {
    let mut run = Run::with_parameters(Arc::clone(model), values.to_vec(), prepared.start);
    let battery = model.system == System::Battery;
    let rows = prepared.time_s.len();
    let mut soc = Vec::with_capacity(if battery { rows } else { 0 });
    let mut channels: Vec<_> = predicted_channels(model).into_iter().map(|channel| (channel, Vec::with_capacity(rows))).collect();
    walk(prepared, &mut run, |row, now| {
        if battery {
            soc.push(now[Channel::Soc]);
        }
        for (channel, values) in &mut channels {
            values.push(if row == 0 && !battery { f64::NAN } else { now[*channel] });
        }
    });
    Prediction { soc, channels }
}

/// What a model says of one channel of a log, and how that goes with its parameters.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sensitivities {
    /// Predicted values by row, as in [`Prediction`].
    pub predicted: Vec<f64>,
    /// Their derivatives: for each parameter, one number per row.
    pub by: Vec<Vec<f64>>,
}

/// The log's target channels, in their order, with their derivatives by the parameters of the given indices, of which there is at least
/// one: one walk for so many of them as there are lanes.
#[must_use]
pub fn sensitivities(model: &Arc<Model>, prepared: &Prepared, values: &[f64], by: &[usize]) -> Vec<Sensitivities> {
    let mut answer = vec![Sensitivities::default(); prepared.targets.len()];
    for chunk in by.chunks(LANES) {
        let walked = if chunk.len() <= HalfDual::LANES { walked::<2> } else { walked::<4> };
        walked(model, prepared, values, chunk, &mut answer);
    }
    answer
}

/// One walk, by no more parameters than a number has lanes.
fn walked<const PAIRS: usize>(model: &Arc<Model>, prepared: &Prepared, values: &[f64], by: &[usize], answer: &mut [Sensitivities])
where
    Derived<PAIRS>: Lane,
{
    let (rows, battery) = (prepared.time_s.len(), model.system == System::Battery);
    let mut parameters: Vec<Derived<PAIRS>> = values.iter().map(|&value| Derived::from(value)).collect();
    for (lane, &index) in by.iter().enumerate() {
        parameters[index] = Derived::variable(values[index], lane);
    }
    let mut run = Run::with_parameters(Arc::clone(model), parameters, prepared.start.lifted());
    let is_first = answer.iter().all(|of_target| of_target.by.is_empty());
    let mut columns = vec![vec![Vec::with_capacity(rows); by.len()]; prepared.targets.len()];
    walk(prepared, &mut run, |row, now| {
        for ((target, of_target), lanes) in prepared.targets.iter().zip(answer.iter_mut()).zip(&mut columns) {
            let shown = &now[target.channel];
            if is_first {
                of_target.predicted.push(if row == 0 && !battery { f64::NAN } else { shown.re });
            }
            for (column, by_lane) in lanes.iter_mut().zip(shown.lanes()) {
                column.push(*by_lane);
            }
        }
    });
    for (of_target, new) in answer.iter_mut().zip(columns) {
        of_target.by.extend(new);
    }
}

fn walk<S: Lane>(prepared: &Prepared, run: &mut Run<S>, mut at: impl FnMut(usize, &Channels<S>)) {
    for row in 0..prepared.time_s.len() {
        for (channel, values) in &prepared.inputs {
            run.channels[*channel] = S::from(values[row]);
        }
        if row > 0 {
            run.step(prepared.time_s[row] - prepared.time_s[row - 1]);
        }
        at(row, &run.channels);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::{LogFacts, read_log};
    use crate::prepare::prepare;

    const MODEL: &str = "schema = 1\nsystem = \"battery\"\nname = \"t\"\n[battery]\nseries = 2\nparallel = 1\ncapacity_ah = 1.0\nfull_v_per_cell = 4.2\neod_v_per_cell = 3.0\ncharge_current_a = 1.0\ncharge_cutoff_a = 0.1\nocv = { soc = [0.0, 1.0], voltage_v = [3.0, 4.0] }\n[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.1, source = \"t\" }\n[[effect]]\nid = \"rc1\"\nresistance_ohm = { value = 0.05, source = \"t\" }\ntau_s = { value = 60.0, source = \"t\" }\n";

    fn setting() -> (Arc<Model>, Prepared) {
        let model = Model::parse("m.toml", MODEL, &|_| Err(String::new())).unwrap();
        let facts = LogFacts { soc_initial: Some(0.9), ..LogFacts::default() };
        let text = "time_s,current_a,voltage_v\n0,9,7.8\n36,1,7.5\n72,0,7.6\n";
        let prepared = prepare(&model, &read_log("a.csv", text.as_bytes(), facts).unwrap()).unwrap();
        (Arc::new(model), prepared)
    }

    #[test]
    fn the_current_of_a_row_holds_over_the_interval_before_it() {
        let (model, prepared) = setting();
        let prediction = predict(&model, &prepared, &[0.1, 0.0, 60.0]);
        // The 9 A of the first row flow over no interval; 36 s of 1 A take 1 % of 1 Ah.
        assert!((prediction.soc[1] - 0.89).abs() < 1e-12 && (prediction.soc[2] - 0.89).abs() < 1e-12);
        let voltage_v = prediction.of(Channel::VoltageV).unwrap();
        let expected_v = [7.8, 2.0 * (3.89 - 0.1), 2.0 * 3.89];
        assert!(voltage_v.iter().zip(expected_v).all(|(v, e)| (v - e).abs() < 1e-12), "{voltage_v:?}");
    }

    #[test]
    fn sensitivities_agree_with_differences() {
        let (model, prepared) = setting();
        let values = model.values();
        let exact = sensitivities(&model, &prepared, &values, &[0, 1, 2]);
        assert_eq!(exact[0].predicted, predict(&model, &prepared, &values).of(Channel::VoltageV).unwrap());
        for index in 0..3 {
            let h = 1e-6 * values[index];
            let at = |shift: f64| {
                let mut moved = values.clone();
                moved[index] += shift;
                predict(&model, &prepared, &moved).of(Channel::VoltageV).unwrap().to_vec()
            };
            for (row, (above, below)) in at(h).iter().zip(at(-h)).enumerate() {
                assert!((exact[0].by[index][row] - (above - below) / (2.0 * h)).abs() < 1e-6);
            }
        }
    }
}
