//! Long logs with fewer rows: steps in which nothing changes become one step.
//!
//! What is kept is exact for a model. The merged step has the time-weighted mean of its inputs,
//! so that no charge is lost; inputs may leave that mean by their sensor's noise only. Every kept
//! row is a measured one, whose voltage is compared at its own time: values are picked, not
//! averaged, since a mean over a step is no state that a model passes through, and since the
//! sensor floor of a row stays what it was.

mod hidden;

use energy::{Channel, Facts, Model, catalogue};
use hidden::Hidden;
pub(super) use hidden::jump;

use super::times::usual_step_s;
use super::{Column, Log};

/// How a log may lose rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Thinning {
    /// Every row stays.
    None,
    /// A log of more than [`LONG`] rows keeps those where something changes.
    WhereNothingChanges,
    /// Steps of up to this many seconds become one, whatever the inputs do, s.
    Every(f64),
}

/// Rows above which a log is thinned where nothing changes: below, time is not worth saving.
pub const LONG: usize = 20_000;

/// A step is at most this long, s.
const STEP_MAX_S: f64 = 60.0;
/// Nor longer than this share of the time since an input changed, so that relaxations keep their shape.
const STEP_SHARE: f64 = 0.05;
/// Nor moves more than this state of charge, over which resistances may change.
const STEP_SOC: f64 = 2e-3;
/// An input holds while it stays within this many deviations of its noise, and its quantum, of
/// its mean since it last changed. Noise alone goes so far once in a million rows.
const INPUT_SIGMAS: f64 = 5.0;
/// A row is kept when a target has left the last kept one by this many floors: something
/// happens there, whether a model knows of it or not.
const TARGET_FLOORS: f64 = 6.0;
/// A target measured in fewer rows than this share is kept wherever it is measured.
const SPARSE: f64 = 0.5;

/// Takes rows out of a log and notes how many.
pub fn thin(log: &mut Log, model: &Model, thinning: Thinning) {
    let rows = log.rows();
    let kept = match thinning {
        Thinning::None => return,
        Thinning::WhereNothingChanges if rows <= LONG => return,
        Thinning::WhereNothingChanges => Watch::of(log, model).kept(),
        Thinning::Every(step_s) => every(&log.time_s, step_s),
    };
    let why = match thinning {
        Thinning::Every(step_s) => format!("one per {step_s} s, as asked for"),
        _ if kept.len() * 10 > rows * 9 => {
            log.notes.push(format!(
                "{}: {} rows kept as {}, since inputs change at nearly all of them; --every SECONDS thins all the same",
                log.file,
                thousands(rows),
                thousands(kept.len())
            ));
            return;
        }
        _ => "those where inputs or targets change (--no-decimation keeps all)".to_owned(),
    };
    let inputs = inputs(log, model);
    let hidden = Hidden::of(log, model, &inputs, &kept);
    let time_s = &log.time_s;
    let pick = |values: &[f64]| kept.iter().map(|&row| values[row]).collect::<Vec<f64>>();
    for (channel, values) in &mut log.channels {
        *values = if inputs.contains(channel) { means(time_s, values, &kept) } else { pick(values) };
    }
    for column in log.extra.values_mut() {
        *column = match column {
            Column::Number(values) => Column::Number(pick(values)),
            Column::Text(texts) => Column::Text(kept.iter().map(|&row| std::mem::take(&mut texts[row])).collect()),
        };
    }
    if !log.compared.is_empty() {
        log.compared = kept.iter().map(|&row| log.compared[row]).collect();
    }
    log.time_s = pick(&log.time_s);
    log.readings = std::iter::once(1.0).chain(kept.windows(2).map(|pair| (pair[1] - pair[0]) as f64)).collect();
    log.notes.push(format!("{}: {} rows kept as {}, {why}", log.file, thousands(rows), thousands(kept.len())));
    match hidden.told(&log.file) {
        Some(told) => log.notes.push(told),
        None => hidden.leave_out(log, model),
    }
}

/// What the log holds that any effect of this system takes as an input. Also of effects that the
/// model lacks: it may gain them on this log.
fn inputs(log: &Log, model: &Model) -> Vec<Channel> {
    let system = model.system;
    let needed = |channel: Channel| {
        let by_effect = || catalogue().iter().any(|effect| effect.spec().system == system && effect.spec().needs.contains(&channel));
        system.inputs().contains(&channel) || by_effect()
    };
    let set = |channel: &Channel| !system.targets().contains(channel) && !system.computed().contains(channel) && needed(*channel);
    log.channels.keys().copied().filter(set).collect()
}

/// The last row of every stretch of up to `step_s`, and the first.
fn every(time_s: &[f64], step_s: f64) -> Vec<usize> {
    let mut kept = vec![0];
    for row in 1..time_s.len() {
        let begin = time_s[kept[kept.len() - 1]];
        // A hundredth of slack: sums of 0.1 s are not quite whole.
        if row + 1 == time_s.len() || time_s[row + 1] - begin > step_s * 1.01 {
            kept.push(row);
        }
    }
    kept
}

/// Means of an input over every kept step, weighted by time; missing where less than half of the
/// step is known.
fn means(time_s: &[f64], values: &[f64], kept: &[usize]) -> Vec<f64> {
    let step = |pair: &[usize]| {
        if pair[1] == pair[0] + 1 {
            return values[pair[1]];
        }
        let (mut known_s, mut sum) = (0.0, 0.0);
        for row in pair[0] + 1..=pair[1] {
            if !values[row].is_nan() {
                let dt_s = time_s[row] - time_s[row - 1];
                known_s += dt_s;
                sum += dt_s * values[row];
            }
        }
        let whole_s = time_s[pair[1]] - time_s[pair[0]];
        if 2.0 * known_s >= whole_s { sum / known_s } else { f64::NAN }
    };
    std::iter::once(values[0]).chain(kept.windows(2).map(step)).collect()
}

/// An input while its value holds: sum and count since it last changed.
struct Held<'a> {
    values: &'a [f64],
    tolerance: f64,
    sum: f64,
    count: f64,
}

impl Held<'_> {
    /// Whether the next row has the same value but for noise.
    fn holds(&self, next: usize) -> bool {
        let (next, mean) = (self.values[next], self.sum / self.count);
        next.is_nan() == mean.is_nan() && (next.is_nan() || (next - mean).abs() <= self.tolerance + 1e-9 * mean.abs())
    }
}

/// What is watched while going through a log.
struct Watch<'a> {
    time_s: &'a [f64],
    inputs: Vec<Held<'a>>,
    /// Values and how far they may leave the last kept one.
    targets: Vec<(&'a [f64], f64)>,
    /// Measured in few rows only.
    sparse: Vec<&'a [f64]>,
    texts: Vec<&'a [String]>,
    /// State of charge that one ampere-second moves, with the current.
    drain: Option<(&'a [f64], f64)>,
}

impl<'a> Watch<'a> {
    fn of(log: &'a Log, model: &Model) -> Watch<'a> {
        let mut watch =
            Watch { time_s: &log.time_s, inputs: Vec::new(), targets: Vec::new(), sparse: Vec::new(), texts: Vec::new(), drain: None };
        for channel in inputs(log, model) {
            let sensor = model.sensor(channel);
            let tolerance = INPUT_SIGMAS * sensor.sigma + sensor.quantum;
            watch.inputs.push(Held { values: &log.channels[&channel], tolerance, sum: 0.0, count: 0.0 });
        }
        for channel in model.system.targets() {
            let Some(values) = log.channels.get(channel) else { continue };
            let known = values.iter().filter(|value| !value.is_nan()).count();
            if (known as f64) < SPARSE * values.len() as f64 {
                watch.sparse.push(values);
            } else {
                let floor = model.sensor(*channel).floor();
                watch.targets.push((values, TARGET_FLOORS * if floor > 0.0 { floor } else { usual_difference(values) }));
            }
        }
        let texts = |column: &'a Column| if let Column::Text(texts) = column { Some(texts.as_slice()) } else { None };
        watch.texts = log.extra.values().filter_map(texts).collect();
        if let (Facts::Battery(facts), Some(current_a)) = (&model.facts, log.channels.get(&Channel::CurrentA)) {
            watch.drain = Some((current_a, 1.0 / (3600.0 * facts.capacity_ah)));
        }
        watch
    }

    fn kept(mut self) -> Vec<usize> {
        let rows = self.time_s.len();
        let (mut kept, mut changed_s, mut last, mut soc) = (vec![0], self.time_s[0], 0, 0.0);
        for row in 1..rows {
            for input in &mut self.inputs {
                input.sum += input.values[row];
                input.count += 1.0;
            }
            soc += self.drained(row);
            let next = row + 1;
            let changes = next < rows && !self.inputs.iter().all(|input| input.holds(next));
            if next < rows && !changes && self.quiet(last, row, next) && self.short(last, next, changed_s, soc) {
                continue;
            }
            kept.push(row);
            (last, soc) = (row, 0.0);
            if changes {
                changed_s = self.time_s[row];
                self.inputs.iter_mut().for_each(|input| (input.sum, input.count) = (0.0, 0.0));
            }
        }
        kept
    }

    fn drained(&self, row: usize) -> f64 {
        self.drain.map_or(0.0, |(current_a, soc_per_as)| (current_a[row] * soc_per_as * (self.time_s[row] - self.time_s[row - 1])).abs())
    }

    /// Whether the step from the last kept row may reach as far as the next one.
    fn short(&self, last: usize, next: usize, changed_s: f64, soc: f64) -> bool {
        let step_s = self.time_s[next] - self.time_s[last];
        let since_s = self.time_s[last] - changed_s;
        let drained = soc + self.drained(next);
        step_s <= STEP_MAX_S.min(STEP_SHARE * since_s) && (drained.is_nan() || drained <= STEP_SOC)
    }

    /// Whether nothing that is measured speaks for keeping this row.
    fn quiet(&self, last: usize, row: usize, next: usize) -> bool {
        // A peak of one row is back where it was by the next one.
        let still = |(values, tolerance): &(&[f64], f64)| {
            [row, next].map(|row| (values[row] - values[last]).abs()).iter().all(|moved| moved.is_nan() || moved <= tolerance)
        };
        self.targets.iter().all(still)
            && self.sparse.iter().all(|values| values[row].is_nan())
            && self.texts.iter().all(|texts| texts[next] == texts[row])
    }
}

/// The median of the differences between rows that differ.
fn usual_difference(values: &[f64]) -> f64 {
    let mut differences: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|d| *d > 0.0).collect();
    if differences.is_empty() {
        return 0.0;
    }
    let middle = differences.len() / 2;
    *differences.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Logs whose rows come at very different intervals, in words: rows count alike.
#[must_use]
pub fn uneven_sampling(logs: &[Log]) -> Option<String> {
    const UNEVEN: f64 = 5.0;
    let steps: Vec<(f64, &str)> = logs.iter().map(|log| (usual_step_s(&log.time_s), log.name.as_str())).collect();
    let shortest = steps.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let longest = steps.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (longest.0 > UNEVEN * shortest.0).then(|| {
        format!(
            "{} has a row per {} s and {} one per {} s: rows count alike, so the first weighs more per hour; --every {} evens them",
            shortest.1,
            super::times::short(shortest.0),
            longest.1,
            super::times::short(longest.0),
            super::times::short(longest.0)
        )
    })
}

/// `1,000,000`
pub(super) fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_model;
    use crate::measurement::{LogFacts, read_log};

    #[test]
    fn numbers_are_grouped() {
        assert_eq!([999, 1000, 41_230, 1_000_000].map(thousands), ["999", "1,000", "41,230", "1,000,000"]);
    }

    #[test]
    fn every_keeps_the_charge_and_the_last_row() {
        let text = "time_s,current_a,voltage_v\n0,9,4\n1,1,3.9\n2,2,3.8\n3,3,3.7\n4,,3.6\n5,5,3.5\n";
        let mut log = read_log("a.csv", text.as_bytes(), LogFacts::default()).unwrap();
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        thin(&mut log, &model, Thinning::Every(2.0));
        assert_eq!(log.time_s, [0.0, 2.0, 4.0, 5.0]);
        assert_eq!(log.channels[&Channel::CurrentA], [9.0, 1.5, 3.0, 5.0]);
        // 3.8 V answer to 2 A, not to the 1.5 A of that step.
        let voltage_v = &log.channels[&Channel::VoltageV];
        assert!(voltage_v[1].is_nan() && [voltage_v[0], voltage_v[2], voltage_v[3]] == [4.0, 3.6, 3.5], "{voltage_v:?}");
        assert_eq!(log.notes[log.notes.len() - 2], "a.csv: 6 rows kept as 4, one per 2 s, as asked for");
    }

    #[test]
    fn a_peak_of_one_row_stays() {
        let volts = |row: u32| if row == 15_000 { 3.4 } else { 3.9 };
        let rows: String = (0..LONG as u32 + 1).map(|row| format!("{row},1,{}\n", volts(row))).collect();
        let mut log = read_log("a.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), LogFacts::default()).unwrap();
        thin(&mut log, &load_model("enertech-lco-2280mah").unwrap().model, Thinning::WhereNothingChanges);
        assert!(log.rows() < 2000, "{} rows", log.rows());
        assert!(log.time_s.contains(&14_999.0) && log.time_s.contains(&15_000.0));
        assert_eq!(log.channels[&Channel::VoltageV].iter().copied().fold(f64::INFINITY, f64::min), 3.4);
    }

    #[test]
    fn means_that_hide_changes_of_an_input_are_told_and_those_of_a_steady_load_are_not() {
        let notes = |current: fn(u32) -> u32| {
            let rows: String = (0..1000).map(|row| format!("{row},{},3.9\n", current(row))).collect();
            let mut log = read_log("a.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), LogFacts::default()).unwrap();
            thin(&mut log, &load_model("enertech-lco-2280mah").unwrap().model, Thinning::Every(10.0));
            log.notes
        };
        let pulsed = notes(|row| row % 2);
        let told = pulsed.last().unwrap();
        assert!(
            told.contains("means hide changes of current_a: it jumps within 100 % of the steps") && told.contains("500 mA RMS"),
            "{told}"
        );
        // Two steps of a load in a thousand rows: two means of ten, one of which a step divides.
        let steady = notes(|row| row / 334);
        assert!(steady.iter().all(|note| !note.contains("hide")));
        assert_eq!(steady.last().unwrap(), "a.csv: 2 rows are not compared: an input jumps within their steps");
    }

    #[test]
    fn logs_of_unlike_sampling_are_told() {
        let log = |name: &str, step: u32| {
            let text = format!("time_s,current_a\n0,1\n{step},1\n{},1\n", 2 * step);
            read_log(name, text.as_bytes(), LogFacts::default()).unwrap()
        };
        let note = uneven_sampling(&[log("a.csv", 60), log("b.csv", 1)]).unwrap();
        assert!(note.starts_with("b has a row per 1 s and a one per 60 s:") && note.ends_with("--every 60 evens them"), "{note}");
        assert_eq!(uneven_sampling(&[log("a.csv", 2), log("b.csv", 1)]), None);
        assert_eq!(uneven_sampling(&[]), None);
    }
}
