//! Signs that a current has another unit or sign than the model's, before physics is blamed.

use energy::{BatteryFacts, Channel, Facts, Model};

use super::{Prepared, Target, prepare};
use crate::measurement::{Column, Log};
use crate::report::quantity::digits;

/// Charge beyond empty or full that no gain, offset or capacity explains, share of the capacity.
const BEYOND: f64 = 0.5;
/// Steps of the current that count, in multiples of the capacity per hour, and how many of them tell.
const STEP_C: f64 = 0.1;
const STEPS_MIN: usize = 5;
/// Correlation of steps of voltage and current from which on a voltage rises with a discharge.
const RISES: f64 = 0.5;
/// How much more the voltage moves in the row after such a step, in squares, where that row is the one that the step belongs to.
const LATER: f64 = 4.0;

/// Steps of a current, and what the voltage does at them: sums of squares and products.
#[derive(Default)]
struct Steps {
    count: usize,
    of_current: f64,
    of_voltage: f64,
    of_both: f64,
}

impl Steps {
    fn add(&mut self, step_a: f64, step_v: Option<f64>) {
        let Some(step_v) = step_v else { return };
        self.count += 1;
        self.of_current += step_a * step_a;
        self.of_voltage += step_v * step_v;
        self.of_both += step_a * step_v;
    }

    /// Nothing where too few tell.
    fn correlation(&self) -> f64 {
        if self.count < STEPS_MIN {
            return 0.0;
        }
        self.of_both / (self.of_current * self.of_voltage).sqrt().max(f64::MIN_POSITIVE)
    }
}

/// What is odd about a battery log's current, in words; nothing where nothing is, or the log does not fit the model.
#[must_use]
pub fn odd_current(model: &Model, log: &Log) -> Option<String> {
    let Facts::Battery(facts) = &model.facts else { return None };
    let prepared = prepare(model, log).ok()?;
    let current_a = prepared.inputs.iter().find(|(channel, _)| *channel == Channel::CurrentA).map(|(_, values)| values)?;
    let voltage_v = prepared.targets.iter().find(|target| target.channel == Channel::VoltageV).map(|target| &target.observed);
    let (mut soc, mut low, mut high) = (prepared.start.soc, f64::INFINITY, f64::NEG_INFINITY);
    let (mut at_once, mut a_row_later) = (Steps::default(), Steps::default());
    for row in 1..prepared.time_s.len() {
        soc -= current_a[row] * prepared.flowed_s(row) / 3600.0 / facts.capacity_ah;
        (low, high) = (low.min(soc), high.max(soc));
        let step_a = current_a[row] - current_a[row - 1];
        if step_a.abs() > STEP_C * facts.capacity_ah {
            let step_v =
                |row: usize| voltage_v.and_then(|volts| Some(volts.get(row)? - volts[row - 1])).filter(|step_v| step_v.is_finite());
            at_once.add(step_a, step_v(row));
            a_row_later.add(step_a, step_v(row + 1));
        }
    }
    if a_row_later.correlation() < -RISES && a_row_later.of_voltage > LATER * at_once.of_voltage {
        return Some(format!(
            "{}: at {} steps of current_a the voltage moves one row later: a row must show the current that has flowed until its time. A mean over an \
             interval belongs to its end (label=\"right\" in pandas' resample)",
            log.file, a_row_later.count
        ));
    }
    if at_once.correlation() > RISES {
        return Some(format!(
            "{}: at {} steps of current_a the voltage moves the same way: positive must be discharging, as --column current_a=SOURCE*-1 makes it",
            log.file, at_once.count
        ));
    }
    if let Some(fall_v) = goes_against(&prepared, current_a, facts) {
        return Some(format!(
            "{}: the voltage falls by {fall_v:.2} V per cell where current_a charges, or rises where it discharges: positive must be discharging, as \
             --column current_a=SOURCE*-1 makes it",
            log.file
        ));
    }
    let odd = if low < -BEYOND { low } else { high };
    // Cyclers that write no sign have a column with the direction.
    let is_unsigned =
        log.extra.values().any(|column| matches!(column, Column::Text(_))) && current_a.iter().all(|current_a| *current_a >= 0.0);
    let unsigned = if is_unsigned {
        ". It is never negative: where it has no sign, --charging COLUMN=VALUE says in which rows it charges"
    } else {
        ""
    };
    (low < -BEYOND || high > 1.0 + BEYOND).then(|| {
        format!(
            "{}: current_a takes the charge from {:.0} % to {:.0} % of {} Ah: it must be in A and positive while discharging, time_s in s, and soc_initial and capacity_ah those of this battery{unsigned}",
            log.file,
            100.0 * prepared.start.soc,
            100.0 * odd,
            facts.capacity_ah
        )
    })
}

/// By how much a voltage goes the other way than the charge, V per cell, where that is more than anything but another sign explains.
fn goes_against(prepared: &Prepared, current_a: &[f64], facts: &BatteryFacts) -> Option<f64> {
    // What flowed in a gap nobody knows.
    let target = prepared.targets.iter().find(|target| target.channel == Channel::VoltageV).filter(|_| prepared.unmeasured.is_empty())?;
    let mut charge = 0.0;
    let charges: Vec<f64> = (0..prepared.time_s.len())
        .map(|row| {
            charge -= if row == 0 { 0.0 } else { current_a[row] * prepared.flowed_s(row) / 3600.0 / facts.capacity_ah };
            charge
        })
        .collect();
    let gentle = |row: &usize| target.used[*row] && current_a[*row].abs() <= QUICK_C * facts.capacity_ah;
    let rows: Vec<usize> = (1..charges.len()).filter(gentle).collect();
    // Where little passes, a cell that recovers from what was before goes further than its charge.
    let ends = rows.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &row| (charges[row].min(low), charges[row].max(high)));
    if ends.1 - ends.0 < HARDLY_PASSED {
        return None;
    }
    let against_v = -moved_with(&charges, current_a, &target.observed, &rows) / f64::from(facts.series);
    (against_v > FIRST_V).then_some(against_v)
}

/// Volts per cell that the first voltage may lie beside the open-circuit voltage without a remark: what a current of [`QUICK_C`] or less
/// costs in a cell in any good condition.
const FIRST_V: f64 = 0.25;
const QUICK_C: f64 = 1.5;
/// Share of the charge up to whose passing a voltage that goes too far is told: what passes more shows itself where the charge ends.
const HARDLY_PASSED: f64 = 0.15;

/// What is odd about how a battery log's voltage goes with the charge that is said to be there, in words.
#[must_use]
pub fn odd_voltage(model: &Model, log: &Log) -> Option<String> {
    let Facts::Battery(facts) = &model.facts else { return None };
    let prepared = prepare(model, log).ok()?;
    let current_a = prepared.inputs.iter().find(|(channel, _)| *channel == Channel::CurrentA).map(|(_, values)| values)?;
    let target = prepared.targets.iter().find(|target| target.channel == Channel::VoltageV)?;
    let cells = f64::from(facts.series);
    let gentle = |row: &usize| current_a[*row].abs() <= QUICK_C * facts.capacity_ah;
    // After a gap nobody knows how full it is.
    let known_until_s = prepared.unmeasured.first().map_or(f64::INFINITY, |piece| piece.from_s);
    let first = (0..prepared.time_s.len()).find(|row| target.used[*row] && gentle(row) && prepared.time_s[*row] <= known_until_s)?;
    let passed = |row: usize| current_a[row] * prepared.flowed_s(row) / 3600.0 / facts.capacity_ah;
    let soc = prepared.start.soc - (1..=first).map(passed).sum::<f64>();
    let (shown, open) = (target.observed[first] / cells, facts.ocv.voltage_v(soc));
    if facts.series > 1 && (target.observed[first] - open).abs() <= FIRST_V {
        return Some(format!(
            "{}: its first voltages are {:.2} V, as those of one cell: voltage_v must be that of all {} in series, as --column voltage_v=SOURCE*{} makes it",
            log.file, target.observed[first], facts.series, facts.series
        ));
    }
    if let Some((from, to)) = falls_without_current(current_a, target).filter(|(from, to)| (from - to).abs() > FIRST_V * cells) {
        return Some(format!(
            "{}: current_a is 0 in every row, and the voltage goes from {:.2} to {:.2} V per cell: is it the right column, and was the current measured at all?",
            log.file,
            from / cells,
            to / cells
        ));
    }
    let times = (target.observed[first] / open).round();
    if facts.series == 1 && times >= 2.0 && (target.observed[first] / times - open).abs() <= FIRST_V {
        return Some(format!(
            "{}: its first voltages are {:.2} V, as those of {times} cells in series: is `series` of the model right? {times} would fit",
            log.file, target.observed[first]
        ));
    }
    if (shown - open).abs() > FIRST_V {
        return Some(format!(
            "{}: its first voltages are {shown:.2} V per cell, and a cell that is {:.0} % full has {open:.2} V at rest: does the log begin elsewhere than soc_initial says, or in the middle?",
            log.file,
            100.0 * soc
        ));
    }
    let mut charge = prepared.start.soc;
    let charges: Vec<f64> = (0..prepared.time_s.len())
        .map(|row| {
            charge -= if row == 0 { 0.0 } else { passed(row) };
            charge
        })
        .collect();
    let gentle: Vec<usize> = (1..prepared.time_s.len()).filter(|row| target.used[*row]).filter(gentle).collect();
    let ends = |values: &[f64]| {
        gentle.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &row| (values[row].min(low), values[row].max(high)))
    };
    let (volts, (emptiest, fullest)) = (ends(&target.observed), ends(&charges));
    let moved_v = moved_with(&charges, current_a, &target.observed, &gentle).abs() / cells;
    let open_v = facts.ocv.voltage_v(fullest.clamp(0.0, 1.0)) - facts.ocv.voltage_v(emptiest.clamp(0.0, 1.0));
    (prepared.unmeasured.is_empty() && fullest - emptiest < HARDLY_PASSED && moved_v > open_v + FIRST_V).then(|| {
        format!(
            "{}: the voltage goes from {:.2} to {:.2} V per cell while {} % of the charge passes: time_s must be in s, current_a in A, and capacity_ah that of this battery, in Ah",
            log.file,
            volts.1 / cells,
            volts.0 / cells,
            digits(100.0 * (fullest - emptiest))
        )
    })
}

/// Rows at either end of a log that say together where its voltage begins and ends: single ones may be no readings.
const AT_AN_END: usize = 9;

/// Where a voltage begins and ends, medians over a few rows, in a log whose current is nothing in every row.
fn falls_without_current(current_a: &[f64], target: &Target) -> Option<(f64, f64)> {
    let known: Vec<f64> = target.observed.iter().copied().filter(|volts| volts.is_finite()).collect();
    let is_long = known.len() > 2 * AT_AN_END && current_a.iter().all(|current_a| *current_a == 0.0);
    let median = |values: &[f64]| {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    is_long.then(|| (median(&known[..AT_AN_END]), median(&known[known.len() - AT_AN_END..])))
}

/// How far a voltage rises with the charge over these rows, V: by least squares beside what it moves with the current.
fn moved_with(charges: &[f64], current_a: &[f64], voltage_v: &[f64], rows: &[usize]) -> f64 {
    let mean = |values: &[f64]| rows.iter().map(|&row| values[row]).sum::<f64>() / rows.len().max(1) as f64;
    let means = [mean(charges), mean(current_a), mean(voltage_v)];
    let of = |a: (&[f64], f64), b: (&[f64], f64)| rows.iter().map(|&row| (a.0[row] - a.1) * (b.0[row] - b.1)).sum::<f64>();
    let (charge, current, voltage) = ((charges, means[0]), (current_a, means[1]), (voltage_v, means[2]));
    let (qq, ii, qi) = (of(charge, charge), of(current, current), of(charge, current));
    let (qv, iv) = (of(charge, voltage), of(current, voltage));
    // A current that holds says nothing of its own.
    let slope = if ii > 0.0 && qq * ii - qi * qi > 1e-9 * qq * ii { (qv * ii - iv * qi) / (qq * ii - qi * qi) } else { qv / qq };
    let (low, high) =
        rows.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &row| (charges[row].min(low), charges[row].max(high)));
    if qq > 0.0 { slope * (high - low) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_model;
    use crate::measurement::{LogFacts, read_log};

    /// An hour of pulses of so much current, or one discharge, as another sign or unit tells it.
    fn odd(pulses: bool, factor: f64) -> Option<String> {
        let row = |second: u32| {
            let current_a = if pulses && (second / 60).is_multiple_of(2) { 0.0 } else { 2.0 };
            format!("{second},{},{}\n", factor * current_a, 4.0 - 1e-4 * f64::from(second) - 0.07 * current_a)
        };
        let text = (0..3600).map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
        let facts = LogFacts { soc_initial: Some(0.95), ..LogFacts::default() };
        let log = read_log("log.csv", text.as_bytes(), facts).unwrap();
        odd_current(&load_model("enertech-lco-2280mah").unwrap().model, &log)
    }

    /// A discharge at 1 C, from full in truth, of which the log begins somewhere and counts time in some unit.
    fn voltage(begins_s: u32, second: f64) -> Option<String> {
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        let Facts::Battery(facts) = &model.facts else { panic!("a battery") };
        let current_a = facts.capacity_ah;
        let row = |now: u32| {
            let voltage_v = facts.ocv.voltage_v(1.0 - f64::from(now) / 3600.0) - 0.05 * current_a;
            format!("{},{current_a},{voltage_v}\n", f64::from(now - begins_s) * second)
        };
        let text = (begins_s..3500).step_by(10).map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
        let facts = LogFacts { soc_initial: Some(1.0), ..LogFacts::default() };
        odd_voltage(&model, &read_log("log.csv", text.as_bytes(), facts).unwrap())
    }

    #[test]
    fn a_log_that_begins_in_the_middle_or_counts_minutes_is_told_and_a_right_one_is_not() {
        assert_eq!(voltage(0, 1.0), None);
        assert!(voltage(1800, 1.0).unwrap().contains("in the middle?"), "{:?}", voltage(1800, 1.0));
        assert!(voltage(0, 1.0 / 60.0).unwrap().contains(" % of the charge passes: time_s must be in s"));
    }

    /// An hour at 0.5 C with steps, as a model of another capacity sees it, or as an ammeter shows it that was not connected.
    fn of_capacity(capacity_ah: f64, factor: f64) -> Option<String> {
        let mut model = Model::clone(&load_model("enertech-lco-2280mah").unwrap().model);
        let Facts::Battery(facts) = &mut model.facts else { panic!("a battery") };
        let (true_ah, mut soc) = (facts.capacity_ah, 0.95);
        let row = |now: u32| {
            let current_a = true_ah * if (now / 30).is_multiple_of(2) { 0.3 } else { 0.7 };
            soc -= 10.0 * current_a / 3600.0 / true_ah;
            format!("{},{},{}\n", 10 * now, factor * current_a, facts.ocv.voltage_v(soc) - 0.05 * current_a)
        };
        let text = (0..360).map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
        facts.capacity_ah = capacity_ah;
        let facts = LogFacts { soc_initial: Some(0.95), ..LogFacts::default() };
        odd_voltage(&model, &read_log("log.csv", text.as_bytes(), facts).unwrap())
    }

    #[test]
    fn a_capacity_in_mah_and_an_ammeter_that_shows_nothing_are_told() {
        assert_eq!(of_capacity(2.28, 1.0), None);
        let told = of_capacity(2280.0, 1.0).unwrap();
        assert!(told.contains("while 0.0510 % of the charge passes") && told.ends_with("that of this battery, in Ah"), "{told}");
        assert!(of_capacity(2.28, 0.0).unwrap().contains("current_a is 0 in every row"), "{:?}", of_capacity(2.28, 0.0));
    }

    #[test]
    fn a_voltage_of_one_cell_of_several_is_told() {
        let model = load_model("explorer-3s1p-1320mah").unwrap().model;
        let Facts::Battery(facts) = &model.facts else { panic!("a battery") };
        let told = |cells: f64| {
            let row = |second: u32| format!("{second},0.1,{}\n", cells * facts.ocv.voltage_v(0.8 - f64::from(second) / 60_000.0));
            let text = (0..600).map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
            let facts = LogFacts { soc_initial: Some(0.8), ambient_degc: Some(25.0), ..LogFacts::default() };
            odd_voltage(&model, &read_log("log.csv", text.as_bytes(), facts).unwrap())
        };
        assert_eq!(told(3.0), None);
        assert!(told(1.0).unwrap().contains("that of all 3 in series, as --column voltage_v=SOURCE*3 makes it"), "{:?}", told(1.0));
    }

    /// Ten minutes at 2 A, then 50 of which nothing is known, and one more row, charging at 4 A: for 50 min that were 150 % of the charge.
    #[test]
    fn what_flowed_in_a_gap_is_no_odd_current_and_no_odd_voltage() {
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        let told = |rows: &str| {
            let facts = LogFacts { soc_initial: Some(0.95), ..LogFacts::default() };
            let log = read_log("log.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), facts).unwrap();
            (odd_current(&model, &log), odd_voltage(&model, &log))
        };
        let known: String = (0..600).map(|second| format!("{second},2,{}\n", 4.0 - 1e-4 * f64::from(second))).collect();
        assert_eq!(told(&format!("{known}3600,-4,3.4\n")), (None, None));
        // The other way round: nothing is known before the gap but the start.
        let after: String = (3600..4200).map(|second| format!("{second},{},3.4\n", if second == 3600 { -4 } else { 0 })).collect();
        assert_eq!(told(&format!("0,2,4.0\n{after}")), (None, None));
    }

    #[test]
    fn a_current_that_stands_in_the_row_before_its_own_is_told_as_that_and_not_as_of_another_sign() {
        // Means over 10 s of a current that is switched every minute, a row early; a voltage that relaxes, and a little noise.
        let told = |early: u32| {
            let row = |n: u32| {
                let on = |n: u32| f64::from((n / 6) % 2);
                let relaxed: f64 = (0..6).map(|back| on(n.saturating_sub(back)) * 0.6_f64.powi(back as i32)).sum();
                let noise = 1e-4 * f64::from((n * 7919) % 11);
                format!("{},{},{}\n", 10 * n, 2.0 * on(n + early), 3.9 - 0.07 * 2.0 * on(n) - 0.02 * relaxed + noise)
            };
            let text = (0..360).map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
            let facts = LogFacts { soc_initial: Some(0.95), ..LogFacts::default() };
            odd_current(&load_model("enertech-lco-2280mah").unwrap().model, &read_log("log.csv", text.as_bytes(), facts).unwrap())
        };
        assert_eq!(told(0), None);
        assert!(told(1).unwrap().contains("the voltage moves one row later"), "{:?}", told(1));
    }

    #[test]
    fn a_current_of_another_sign_or_unit_is_told_and_a_right_one_is_not() {
        assert_eq!((odd(true, 1.0), odd(false, 1.0)), (None, None));
        assert!(odd(true, -1.0).unwrap().contains("the voltage moves the same way"));
        assert!(
            odd(false, -1.0).unwrap().contains("the voltage falls by 0.36 V per cell where current_a charges"),
            "{:?}",
            odd(false, -1.0)
        );
        assert!(odd(false, 1000.0).unwrap().contains("must be in A"));
    }
}
