//! What the noise of measured inputs does to what a model predicts.
//!
//! A model is driven by what was measured: a current, a speed, a pitch. The noise in them is not in what happened, so
//! that even the right model errs by it, resistance times noise for a current. Beside the noise of the sensor that shows the
//! target it belongs to the floor below which no model can come.
//!
//! It is seen in one more walk along the log with every input moved by its sensor's deviation, up or down as a
//! pseudo-random binary sequence says (the usual input where a response is to be identified: Ljung, System Identification,
//! 2nd ed. 1999, section 13.3), each input with a sequence of its own: what the predictions differ by is the sum of all. The rows
//! are moved two by two, the second the other way, so that nothing adds up: what noise does to a count of charge lasts, and is no
//! noise of a row. No formula per effect is needed.

use std::sync::Arc;

use energy::{Channel, Model};

use crate::measurement::usual_step_s;
use crate::predict::predict;
use crate::prepare::Prepared;

/// Share of a sensor's own floor that is nothing: noise is stated to two digits at best.
const NOTHING: f64 = 0.02;

/// Floor of a channel from that of its own sensor and what the noise of inputs adds to it, all in the channel's unit; 0 where
/// the sensor's is not known.
#[must_use]
pub fn with_inputs(own: f64, of_inputs: f64) -> f64 {
    let floor = own.hypot(of_inputs);
    if floor < (1.0 + NOTHING) * own || own == 0.0 { own } else { floor }
}

/// How many times as long as the row before a row may last to make up for it.
const ALIKE: f64 = 2.0;

/// Deviation that the noise of all measured inputs gives each predicted channel of a log from row to row, in the
/// channel's unit; 0 where no sensor's noise is stated, or no input moves.
#[must_use]
pub fn input_noise(model: &Arc<Model>, log: &Prepared, values: &[f64]) -> Vec<(Channel, f64)> {
    let targets = || log.targets.iter();
    let Some((moved, counts)) = moved(model, log) else { return targets().map(|target| (target.channel, 0.0)).collect() };
    let (still, moved) = (predict(model, log, values), predict(model, &moved, values));
    let of = |channel: Channel, used: &[bool]| -> Option<f64> {
        let pairs = moved.of(channel)?.iter().zip(still.of(channel)?).zip(used.iter().zip(&counts));
        let counted = pairs.filter(|(_, (used, counts))| **used && **counts);
        let (squares, rows) = counted.fold((0.0, 0.0), |(sum, rows), ((moved, still), _)| (sum + (moved - still).powi(2), rows + 1.0));
        (rows > 0.0).then(|| (squares / rows).sqrt())
    };
    targets().map(|target| (target.channel, of(target.channel, &target.used).unwrap_or(0.0))).collect()
}

/// The log with its inputs moved, and which of its rows show what that does; none where nothing is to be moved.
fn moved(model: &Model, log: &Prepared) -> Option<(Prepared, Vec<bool>)> {
    let mut any = false;
    let (mut moved, mut counts) = (log.clone(), vec![true; log.time_s.len()]);
    let lasts_s = |row: usize| log.time_s[row] - log.time_s[row - 1];
    let readings = |row: usize| log.readings.get(row).copied().unwrap_or(1.0);
    for (place, (channel, values)) in log.inputs.iter().enumerate() {
        let sigma = model.sensor(*channel).floor();
        if sigma == 0.0 {
            continue;
        }
        let mut signs = Signs::of(place);
        // A reading that stays the same errs by the same: that is no noise.
        let differs = |row: usize| values[row] != values[row - 1];
        let mut row = 1;
        while row < values.len() {
            let other = row + 1;
            let in_two = other < values.len() && differs(row) && differs(other);
            if in_two && (ALIKE.recip()..=ALIKE).contains(&(lasts_s(other) / lasts_s(row))) {
                let sign = signs.next();
                for (row, sign) in [(row, sign), (other, -sign)] {
                    moved.inputs[place].1[row] += sign * sigma / readings(row).sqrt();
                }
                any = true;
                row += 2;
                continue;
            }
            counts[row] &= !differs(row);
            row += 1;
        }
    }
    any.then_some((moved, counts))
}

/// So many mirrored pairs of draws of logs with as much noise in their inputs again, so that only what does not average out is left.
///
/// Least squares take an input that was measured for what happened, and so every number that multiplies it for a little less than it is, the more
/// the noise is beside what the input does (regression dilution: Fuller, Measurement Error Models, 1987, section 1.1). With as much noise again
/// the numbers move on by as much again (simulation and extrapolation: Cook and Stefanski, Journal of the American Statistical Association
/// 89, 1994, p. 1314). No formula per effect is needed.
pub(crate) fn noisier(model: &Model, logs: &[Prepared], pairs: usize) -> impl Iterator<Item = Vec<Prepared>> {
    let draws = (0..pairs).flat_map(|sequence| [(sequence, false), (sequence, true)]);
    draws.map(move |(sequence, mirrored)| logs.iter().map(|log| with_more_noise(model, log, sequence, mirrored)).collect())
}

/// The log with every reading of its inputs moved by its sensor's deviation, whichever way a sequence of this number says or, where
/// `mirrored`, the other way.
fn with_more_noise(model: &Model, log: &Prepared, sequence: usize, mirrored: bool) -> Prepared {
    let mut moved = log.clone();
    let lasts_s = |row: usize| log.time_s[row] - log.time_s[row - 1];
    let usual_s = usual_step_s(&log.time_s);
    for (place, (channel, values)) in moved.inputs.iter_mut().enumerate() {
        let sensor = model.sensor(*channel);
        let (sigma, measured) = (if mirrored { -sensor.floor() } else { sensor.floor() }, &log.inputs[place].1);
        let mut signs = Signs::of(sequence * log.inputs.len() + place);
        for row in 1..values.len() {
            let silent = sensor.dead_band > 0.0 && measured[row] == 0.0;
            let sign = signs.next();
            // A reading that stays the same errs by the same, and after a pause one reading does not stand for all of it.
            if measured[row] != measured[row - 1] && lasts_s(row) <= ALIKE * usual_s && !silent {
                values[row] += sign * sigma / log.readings.get(row).copied().unwrap_or(1.0).sqrt();
            }
        }
    }
    moved
}

/// A pseudo-random binary sequence: the highest bits of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
struct Signs(u64);

impl Signs {
    /// Of the input at this place: a sequence of its own, always the same.
    fn of(place: usize) -> Signs {
        Signs((place as u64 + 1).wrapping_mul(0xD134_2543_DE82_EF95))
    }

    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        if (mixed ^ (mixed >> 31)) >> 63 == 1 { 1.0 } else { -1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::{LogFacts, read_log};
    use crate::prepare::prepare;

    const MODEL: &str = "schema = 1\nsystem = \"battery\"\nname = \"t\"\n[battery]\nseries = 2\nparallel = 1\ncapacity_ah = 1.0\nfull_v_per_cell = 4.2\neod_v_per_cell = 3.0\ncharge_current_a = 1.0\ncharge_cutoff_a = 0.1\nocv = { soc = [0.0, 1.0], voltage_v = [3.0, 4.0] }\n[sensor.voltage_v]\nsigma = 1e-3\n[sensor.current_a]\nsigma = 0.02\n[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.1, source = \"t\" }\n[[effect]]\nid = \"rc1\"\nresistance_ohm = { value = 0.05, source = \"t\" }\ntau_s = { value = 600.0, source = \"t\" }\n";

    fn noise(current_a: impl Fn(u32) -> f64, log: impl Fn(&mut Prepared)) -> f64 {
        let model = Arc::new(Model::parse("m.toml", MODEL, &|_| Err(String::new())).unwrap());
        let rows: String = (0..2000).map(|row| format!("{row},{},7.8\n", current_a(row))).collect();
        let text = format!("time_s,current_a,voltage_v\n{rows}");
        let facts = LogFacts { soc_initial: Some(0.9), ..LogFacts::default() };
        let mut prepared = prepare(&model, &read_log("a.csv", text.as_bytes(), facts).unwrap()).unwrap();
        log(&mut prepared);
        input_noise(&model, &prepared, &model.values())[0].1
    }

    /// Two cells of 100 mohm: 0.2 ohm times 20 mA, the pair of 10 min too slow to add to it.
    #[test]
    fn noise_of_a_current_becomes_that_times_the_resistance() {
        let wavering = |row: u32| 0.3 + 1e-3 * f64::from(row % 7);
        let found = noise(wavering, |_| {});
        assert!((found / (0.2 * 0.02) - 1.0).abs() < 0.02, "{found}");
        // The mean of four readings is half as noisy.
        let found = noise(wavering, |log| log.readings = vec![4.0; 2000]);
        assert!((found / (0.1 * 0.02) - 1.0).abs() < 0.02, "{found}");
    }

    #[test]
    fn readings_that_stay_the_same_show_no_noise() {
        assert_eq!(noise(|_| 0.3, |_| {}), 0.0);
        assert_eq!(noise(|row| f64::from(row / 1000), |_| {}), 0.0);
    }

    /// After a month on a shelf one reading of noise would be a month of charge.
    #[test]
    fn noise_adds_up_to_no_charge() {
        let with_a_pause =
            noise(|row| 0.3 + 1e-3 * f64::from(row % 7), |log| log.time_s[1000..].iter_mut().for_each(|time_s| *time_s += 3e6));
        assert!((with_a_pause / (0.2 * 0.02) - 1.0).abs() < 0.02, "{with_a_pause}");
    }

    #[test]
    fn signs_are_balanced_and_of_no_memory() {
        let signs: Vec<f64> = {
            let mut signs = Signs::of(0);
            (0..20_000).map(|_| signs.next()).collect()
        };
        let mean = |lag: usize| signs.iter().zip(&signs[lag..]).map(|(a, b)| a * b).sum::<f64>() / 20_000.0;
        assert!((signs.iter().sum::<f64>() / 20_000.0).abs() < 0.03);
        assert!((1..10).all(|lag| mean(lag).abs() < 0.03));
        let other: Vec<f64> = {
            let mut signs = Signs::of(1);
            (0..20_000).map(|_| signs.next()).collect()
        };
        assert!((signs.iter().zip(&other).map(|(a, b)| a * b).sum::<f64>() / 20_000.0).abs() < 0.03);
    }
}
