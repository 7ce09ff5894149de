//! A log as a model sees it: inputs without holes, where to start, what to judge.

mod error;
mod late;
mod needs;
mod plausible;
mod still;
mod zeros;

pub use error::{Missing, PrepareError};
pub use needs::needed_inputs;
pub use plausible::{odd_current, odd_voltage};
pub use zeros::counted_as_zero;

use std::borrow::Cow;
use std::collections::BTreeSet;

use energy::{Channel, Facts, Model, Start, System, catalogue};

use crate::measurement::{History, Log, Unmeasured, for_missing};
use needs::{lacked_too, lacking};

/// What a model predicts and a log has measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// The channel.
    pub channel: Channel,
    /// Measurements, NaN where missing.
    pub observed: Vec<f64>,
    /// Rows that count: measured, preceded by an interval, and with every needed input known.
    pub used: Vec<bool>,
    /// The known floor of the target's own sensor, in the channel's unit; 0 when the model states none.
    pub floor: f64,
}

/// A log made ready for one model.
#[derive(Debug, Clone, PartialEq)]
pub struct Prepared {
    /// Name of the log.
    pub name: String,
    /// Time, s.
    pub time_s: Vec<f64>,
    /// How many readings of its inputs each row holds the mean of; empty where each holds one.
    pub readings: Vec<f64>,
    /// Inputs; the value at row k holds over (t\[k-1\], t\[k\]]. A missing value is the next known
    /// one, since that holds since the last known one.
    pub inputs: Vec<(Channel, Vec<f64>)>,
    /// Pieces of the gaps of a battery's current, in order: what [`Self::inputs`] says there is a guess.
    pub unmeasured: Vec<Unmeasured>,
    /// Where the log starts.
    pub start: Start,
    /// Standard deviation of the state of charge there, when the log states one.
    pub soc_initial_sigma: Option<f64>,
    /// Standard deviation of the temperature of the surroundings, K, where the log states it and it is not exact.
    pub ambient_sigma_k: Option<f64>,
    /// What the log has measured of that which the model predicts.
    pub targets: Vec<Target>,
    /// What alone is to be judged; everything when empty.
    pub only: Vec<Channel>,
    /// Columns of the log that are no channels: one of them may be what a model needs, under another name.
    pub others: Vec<String>,
}

impl Prepared {
    /// How long the current of a row is known to have flowed before it, s: what is not measured does not count.
    pub(crate) fn flowed_s(&self, row: usize) -> f64 {
        let (from_s, to_s) = (self.time_s[row - 1], self.time_s[row]);
        let within = |piece: &Unmeasured| (piece.to_s.min(to_s) - piece.from_s.max(from_s)).max(0.0);
        to_s - from_s - self.unmeasured.iter().map(within).sum::<f64>()
    }

    /// In a piece of a gap flowed so much more current than its rows say, A: each says the mean of what has flowed since the one before. What a battery
    /// shows at the end of one that is only partly of the gap is not judged, since that row's own current is another.
    pub(crate) fn flows(&mut self, piece: &Unmeasured, more_a: f64) {
        let Some((_, current_a)) = self.inputs.iter_mut().find(|(channel, _)| *channel == Channel::CurrentA) else { return };
        for (row, current_a) in current_a.iter_mut().enumerate().skip(1) {
            let (from_s, to_s) = (self.time_s[row - 1], self.time_s[row]);
            let share = (piece.to_s.min(to_s) - piece.from_s.max(from_s)).max(0.0) / (to_s - from_s);
            *current_a += share * more_a;
            if share > 0.0 && piece.to_s < to_s && more_a != 0.0 {
                self.targets.iter_mut().for_each(|target| target.used[row] = false);
            }
        }
    }

    /// The same log if what was read of an input had been true so much earlier, s. Where nothing was read so late, nothing is judged.
    #[must_use]
    pub(crate) fn with_late_input(&self, channel: Channel, late_s: f64) -> Prepared {
        let mut moved = self.clone();
        for (_, values) in moved.inputs.iter_mut().filter(|(known, _)| *known == channel) {
            let true_then = late::intervals(&self.time_s, values, late_s);
            for target in &mut moved.targets {
                target.used.iter_mut().zip(&true_then).for_each(|(used, value)| *used &= value.is_finite());
            }
            *values = held(&true_then).unwrap_or_default();
        }
        moved
    }

    /// The log with a channel, target or input, as so many times what was read.
    pub(crate) fn with_scaled(&self, channel: Channel, factor: f64) -> Prepared {
        let mut scaled = self.clone();
        let inputs = scaled.inputs.iter_mut().filter(|(known, _)| *known == channel).map(|(_, values)| values);
        let targets = scaled.targets.iter_mut().filter(|target| target.channel == channel).map(|target| &mut target.observed);
        inputs.chain(targets).flatten().for_each(|value| *value *= factor);
        scaled
    }
}

/// Channels that this model predicts. Temperature is predicted only when an effect moves it;
/// otherwise a measured temperature is an input.
#[must_use]
pub fn predicted_channels(model: &Model) -> Vec<Channel> {
    let targets = model.system.targets().iter().copied();
    targets.filter(|&channel| channel != Channel::TemperatureDegc || model.predicts_temperature()).collect()
}

/// So many columns that only its models need show that a log is one of a system, even if what they predict was not measured.
const OWN_COLUMNS: usize = 3;
/// Slack beyond the ends of the OCV table that a rest voltage may have, V per cell.
const REST_SLACK_V: f64 = 0.1;

/// Makes a log ready for a model.
///
/// # Errors
/// Names the missing column and who needs it, or what is not known about the start.
pub fn prepare(model: &Model, log: &Log) -> Result<Prepared, PrepareError> {
    let predicted = predicted_channels(model);
    let computed = |channel: Channel| predicted.contains(&channel) || model.system.computed().contains(&channel);
    let needed = needed_inputs(model);
    let mut known = vec![true; log.rows()];
    let mut inputs = Vec::new();
    for (&channel, read) in log.channels.iter().filter(|(channel, _)| !computed(**channel)) {
        let values = &*when_true(model, log, channel, read, late::intervals);
        let needed_by = needed.iter().find(|(needed, _)| *needed == channel).map(|(_, by)| by);
        match (held(values), needed_by) {
            (Some(mut held), _) => {
                still::steadied(model.sensor(channel), &log.readings, &mut held);
                inputs.push((channel, held));
                if needed_by.is_some() {
                    known.iter_mut().zip(values).for_each(|(known, value)| *known &= value.is_finite());
                }
            }
            (None, Some(by)) => {
                return Err(PrepareError::EmptyChannel { file: log.file.clone(), channel: channel.name(), needed_by: by.clone() });
            }
            (None, None) => {}
        }
    }
    if let (Some(ambient_degc), false) = (log.facts.ambient_degc, log.channels.contains_key(&Channel::AmbientDegc)) {
        inputs.push((Channel::AmbientDegc, vec![ambient_degc; log.rows()]));
    }
    let missing = lacking(log, needed, |channel| inputs.iter().any(|(present, _)| *present == channel));
    if !missing.is_empty() {
        let columns = log.columns().collect::<Vec<_>>().join(", ");
        return Err(PrepareError::MissingChannels { file: log.file.clone(), missing, columns, facts: format!("{}.toml", log.name) });
    }
    let targets = predicted.iter().filter_map(|&channel| {
        let held = if model.system == System::Battery { late::instants } else { late::intervals };
        let observed = when_true(model, log, channel, log.channels.get(&channel)?, held).into_owned();
        let used: Vec<bool> = (0..log.rows()).map(|row| row > 0 && observed[row].is_finite() && known[row] && log.compares(row)).collect();
        used.contains(&true).then(|| Target { channel, observed, used, floor: model.sensor(channel).floor() })
    });
    let targets = targets.collect();
    let start = start(model, log, &inputs)?;
    Ok(Prepared {
        name: log.name.clone(),
        time_s: log.time_s.clone(),
        readings: log.readings.clone(),
        inputs,
        unmeasured: if model.system == System::Battery { log.unmeasured.clone() } else { Vec::new() },
        start,
        soc_initial_sigma: log.facts.soc_initial_sigma,
        ambient_sigma_k: ambient_sigma_k(model, log),
        targets,
        only: Vec::new(),
        others: log.extra.keys().cloned().collect(),
    })
}

/// What was read of a channel, where its sensor is stated to be late moved by that in the way of `moved`.
fn when_true<'a>(
    model: &Model,
    log: &Log,
    channel: Channel,
    read: &'a [f64],
    moved: fn(&[f64], &[f64], f64) -> Vec<f64>,
) -> Cow<'a, [f64]> {
    match model.sensor(channel).lag_s {
        0.0 => Cow::Borrowed(read),
        late_s => Cow::Owned(moved(&log.time_s, read, late_s)),
    }
}

/// How well a log's fact about the temperature of its surroundings is known, K.
fn ambient_sigma_k(model: &Model, log: &Log) -> Option<f64> {
    let facts = &log.facts;
    let sensor = model.sensor(Channel::TemperatureDegc);
    let read = || facts.ambient_is_read.then(|| sensor.floor().hypot(sensor.offset_sigma));
    let stated = facts.ambient_degc.and_then(|_| facts.ambient_sigma_k.or_else(read));
    stated.filter(|&sigma_k| sigma_k > 0.0 && !log.channels.contains_key(&Channel::AmbientDegc))
}

/// Like [`prepare`], keeps only the targets named in `only` (all when empty), and refuses a log in
/// which none of them was measured.
///
/// # Errors
/// As [`prepare`]; further names what could have been compared.
pub fn prepare_to_judge(model: &Model, log: &Log, only: &[Channel]) -> Result<Prepared, PrepareError> {
    let wanted = |channel: Channel| only.is_empty() || only.contains(&channel);
    let predicted: Vec<Channel> = predicted_channels(model).into_iter().filter(|&channel| wanted(channel)).collect();
    let measured: Vec<Channel> = predicted.iter().copied().filter(|channel| log.channels.contains_key(channel)).collect();
    let names = |channels: &[Channel], between: &str| channels.iter().map(|channel| channel.name()).collect::<Vec<_>>().join(between);
    // What the model could not be judged by is told before what it lacks to predict it.
    if measured.is_empty() {
        let near = predicted.iter().map(|channel| for_missing(channel.name(), log.columns())).find(|(hint, _)| hint.contains('?'));
        let near = near.map(|(hint, flag)| format!("{hint} Map it with {flag}."));
        let of_another = if near.is_none() { of_another_system(model.system, log) } else { None };
        let hint = of_another.unwrap_or_else(|| near.unwrap_or_else(|| ".".to_owned()) + &lacked_too(model, log));
        return Err(PrepareError::NoTarget {
            file: log.file.clone(),
            system: model.system.name(),
            predicted: names(&predicted, ", "),
            hint,
            columns: log.columns().collect::<Vec<_>>().join(", "),
        });
    }
    if !measured.iter().any(|channel| log.channels[channel].iter().skip(1).any(|value| value.is_finite())) {
        return Err(PrepareError::EmptyTargets { file: log.file.clone(), columns: names(&measured, "`, `") });
    }
    let mut prepared = prepare(model, log)?;
    prepared.targets.retain(|target| wanted(target.channel));
    prepared.only = only.to_vec();
    if prepared.targets.is_empty() {
        return Err(PrepareError::NoCommonRow { file: log.file.clone(), columns: names(&measured, "`, `") });
    }
    Ok(prepared)
}

/// Says whose log it may be, when it holds what models of another system predict, and little that goes into the asked one's.
fn of_another_system(system: System, log: &Log) -> Option<String> {
    let own = system.inputs().iter().filter(|channel| log.channels.contains_key(channel)).count();
    let needs =
        |other: System| catalogue().iter().map(|effect| effect.spec()).filter(move |spec| spec.system == other).flat_map(|spec| spec.needs);
    let of_its_effects: BTreeSet<&Channel> = needs(system).filter(|channel| log.channels.contains_key(channel)).collect();
    if own + of_its_effects.len() >= OWN_COLUMNS {
        return None;
    }
    let others = [System::Battery, System::Robot, System::Station].into_iter().filter(|other| *other != system);
    let has = |other: System| other.targets().iter().find(|channel| log.channels.contains_key(channel)).map(|channel| (other, channel));
    let (other, channel) = others.filter_map(has).next()?;
    Some(format!("; this looks like the log of a {}, whose models predict {}.", other.name(), channel.name()))
}

/// The values with every hole filled by the next known value, at the end by the last one.
pub(crate) fn held(values: &[f64]) -> Option<Vec<f64>> {
    let mut next = *values.iter().rev().find(|value| value.is_finite())?;
    let mut filled = values.to_vec();
    for value in filled.iter_mut().rev() {
        if value.is_finite() {
            next = *value;
        } else {
            *value = next;
        }
    }
    Some(filled)
}

fn start(model: &Model, log: &Log, inputs: &[(Channel, Vec<f64>)]) -> Result<Start, PrepareError> {
    let first = |channel| log.channels.get(&channel).and_then(|values| values.iter().copied().find(|value| value.is_finite()));
    let temperature_degc = first(Channel::TemperatureDegc).or(first(Channel::AmbientDegc)).or(log.facts.ambient_degc);
    let input = |wanted| inputs.iter().find(|(channel, _)| *channel == wanted).map(|(_, values)| values[0]);
    let mut start = Start::at_soc(0.0);
    start.temperature_degc = temperature_degc.unwrap_or(start.temperature_degc);
    start.cycle_count = input(Channel::CycleCount).unwrap_or(start.cycle_count);
    start.history = log.facts.history.map_or(0.0, |history| match history {
        History::Discharged => 1.0,
        History::Charged => -1.0,
    });
    start.age_days = input(Channel::AgeDays).unwrap_or(start.age_days);
    let Facts::Battery(facts) = &model.facts else { return Ok(start) };
    start.soc = match (log.facts.soc_initial, log.facts.rest_voltage_v) {
        (Some(soc), _) => soc,
        (None, Some(rest_v)) => {
            let per_cell_v = rest_v / f64::from(facts.series);
            let (_, table_v) = facts.ocv.points();
            let (low_v, high_v) = (table_v[0], table_v[table_v.len() - 1]);
            if !(low_v - REST_SLACK_V..=high_v + REST_SLACK_V).contains(&per_cell_v) {
                return Err(PrepareError::RestVoltage { file: log.file.clone(), rest_v, per_cell_v, low_v, high_v });
            }
            facts.ocv.soc(per_cell_v)
        }
        (None, None) => {
            // A gauge that speaks later says nothing of the start.
            let soc = log.channels.get(&Channel::Soc).and_then(|soc| soc.first().copied()).filter(|soc| (0.0..=1.0).contains(soc));
            return Err(PrepareError::NoStart { file: log.file.clone(), facts: format!("{}.toml", log.name), soc });
        }
    };
    Ok(start)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_model;
    use crate::measurement::{LogFacts, read_log};

    fn log(text: &str, facts: LogFacts) -> Log {
        read_log("run.csv", text.as_bytes(), facts).unwrap()
    }

    fn full() -> LogFacts {
        LogFacts { soc_initial: Some(1.0), ..LogFacts::default() }
    }

    #[test]
    fn a_missing_input_is_named_with_who_needs_it_and_what_comes_near() {
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        let error = prepare(&model, &log("time_s,current\n0,1\n1,1\n", full())).unwrap_err().to_string();
        assert!(error.contains("no column `current_a`, which every battery model needs; did you mean `current`?"), "{error}");
        let robot = load_model("explorer-robot").unwrap().model;
        let error = prepare(&robot, &log("time_s,speed_kmh\n0,1\n1,1\n", LogFacts::default())).unwrap_err().to_string();
        assert!(error.contains("no column `speed_mps`, which effect `motion` needs; did you mean `speed_kmh`?"), "{error}");
        assert!(error.contains("--column speed_mps=speed_kmh/3.6"), "{error}");
    }

    #[test]
    fn a_gauge_that_speaks_later_does_not_offer_where_a_log_begins() {
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        let told = |first: &str| {
            let text = format!("time_s,current_a,voltage_v,soc\n0,1,4.1,{first}\n1,1,4.0,0.5\n2,1,4.0,0.5\n");
            prepare(&model, &log(&text, LogFacts::default())).unwrap_err().to_string()
        };
        assert!(told("0.6").ends_with("begins at 0.6: --soc-initial 0.6"), "{}", told("0.6"));
        assert!(told("").ends_with("in run.toml"), "{}", told(""));
    }

    #[test]
    fn the_first_row_unmeasured_rows_and_rows_of_unknown_current_do_not_count() {
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        let text = "time_s,current_a,voltage_v\n0,1,4.1\n1,,4.0\n2,2,\n3,2,4.0\n4,,\n";
        let prepared = prepare_to_judge(&model, &log(text, full()), &[]).unwrap();
        assert_eq!(prepared.targets[0].used, [false, false, false, true, false]);
        assert_eq!(prepared.inputs, [(Channel::CurrentA, vec![1.0, 2.0, 2.0, 2.0, 2.0])]);
    }

    #[test]
    fn what_flowed_in_a_gap_is_the_charge_of_the_row_after_it_whose_reading_is_not_judged() {
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        let text = "time_s,current_a,voltage_v\n0,1,4.1\n10,1,4.0\n20,1,4.0\n120,1,3.9\n130,1,3.9\n";
        let mut prepared = prepare_to_judge(&model, &log(text, full()), &[]).unwrap();
        // The last 10 s of 100 are that row's own: 2 A more for 90 s are 180 As.
        prepared.flows(&Unmeasured { from_s: 20.0, to_s: 110.0, gap: 0, current_sigma_a: 1.0 }, 2.0);
        let more_as: Vec<f64> =
            prepared.inputs[0].1.iter().zip([0.0, 10.0, 10.0, 100.0, 10.0]).map(|(value, dt_s)| (value - 1.0) * dt_s).collect();
        assert!(more_as.iter().zip([0.0, 0.0, 0.0, 180.0, 0.0]).all(|(more, told): (&f64, f64)| (more - told).abs() < 1e-9), "{more_as:?}");
        assert_eq!(prepared.targets[0].used, [false, true, true, false, true]);
    }

    #[test]
    fn a_reading_that_is_stated_to_be_late_is_compared_with_what_was_true_before_it() {
        let mut model = Model::clone(&load_model("enertech-lco-2280mah").unwrap().model);
        let mut sensor = |channel, lag_s| {
            let sensor = model.sensors.get(&channel).copied().unwrap_or(energy::Sensor::PERFECT);
            model.sensors.insert(channel, energy::Sensor { lag_s, ..sensor });
        };
        sensor(Channel::VoltageV, 1.0);
        sensor(Channel::CurrentA, 0.5);
        let text = "time_s,current_a,voltage_v\n0,1,4.1\n1,1,4.0\n2,2,3.9\n3,2,3.8\n";
        let prepared = prepare_to_judge(&model, &log(text, full()), &[]).unwrap();
        assert_eq!(prepared.targets[0].observed[..3], [4.0, 3.9, 3.8]);
        assert_eq!(prepared.targets[0].used, [false, true, true, false]);
        assert_eq!(prepared.inputs, [(Channel::CurrentA, vec![1.0, 1.5, 2.0, 2.0])]);
    }

    #[test]
    fn the_start_comes_from_the_fact_or_the_rest_voltage_or_is_asked_for() {
        let model = load_model("explorer-3s1p-1320mah").unwrap().model;
        let text = "time_s,current_a,voltage_v,ambient_degc,cycle_count\n0,1,12,20,0\n1,1,12,20,0\n";
        let error = prepare(&model, &log(text, LogFacts::default())).unwrap_err().to_string();
        assert!(error.contains("--soc-initial") && error.contains("run.toml"), "{error}");
        let rest = |volts| LogFacts { rest_voltage_v: Some(volts), ..LogFacts::default() };
        let middle_v = 3.0 * model.battery().ocv.voltage_v(0.5_f64);
        let prepared = prepare(&model, &log(text, rest(middle_v))).unwrap();
        assert!((prepared.start.soc - 0.5).abs() < 1e-9);
        assert_eq!(prepared.start.temperature_degc, 20.0);
        let error = prepare(&model, &log(text, rest(3.9))).unwrap_err().to_string();
        assert!(error.contains("1.300 V per cell"), "{error}");
    }
}
