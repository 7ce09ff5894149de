//! Steps of an input that fall within a row.
//!
//! Many loggers write the mean of a current over a row beside the voltage at its end. Where a load switches in between, that voltage answers to the current
//! that the load stepped to, and the mean is neither that one nor the one before: the row would say that a battery answers to half a step as to a
//! whole one. That is seen where the current holds before and after, and the voltage has gone further than the current's share of the step; one of
//! which the logger writes the mean as well has not. Where a current changes all the time nothing tells the one from the other.
//!
//! Where all steps leave the same share in their rows, it is no chance: one sensor is later than the other by that much, and such rows are all that shows
//! it. They stay.

use std::collections::BTreeSet;

use energy::{Channel, Model};

use super::log::Log;
use super::thin::{jump, thousands};
use super::times::short;
use crate::rounding::floor_between;

/// A row is compared as long as what it measured is off by fewer floors.
const FLOORS: f64 = 6.0;
/// Deviation of the shares of so many steps from which on they lie at random: shares that do have 1 / sqrt(12) = 0.29, and less than this once in
/// seventy times.
const AT_RANDOM: f64 = 0.1;
const SEVERAL: usize = 5;
/// So many of them are told by their times.
const TOLD: usize = 3;

/// Takes out what was measured at the end of a row within which an input of the system stepped, and notes it.
pub fn leave_out_edges(log: &mut Log, model: &Model) {
    let system = model.system;
    for &channel in system.inputs().iter().filter(|channel| !system.targets().contains(channel)) {
        let Some(values) = log.channels.get(&channel) else { continue };
        let edges = edges(values, jump(values, model, channel));
        let mut rows = BTreeSet::new();
        for (&target, measured) in
            log.channels.iter_mut().filter(|(target, _)| system.targets().contains(target) && answers_at_once(**target))
        {
            let stated = model.sensor(target).floor();
            let floor = if stated > 0.0 { stated } else { floor_between(&(0..measured.len()).collect::<Vec<_>>(), measured) };
            let ahead: Vec<(usize, f64)> = edges.iter().copied().filter(|edge| is_ahead(measured, *edge, floor)).collect();
            if ahead.len() >= SEVERAL && deviation(&ahead) < AT_RANDOM {
                continue;
            }
            ahead.iter().for_each(|&(row, _)| measured[row] = f64::NAN);
            rows.extend(ahead.iter().map(|(row, _)| *row));
        }
        if rows.is_empty() {
            continue;
        }
        let mut times: Vec<String> = rows.iter().take(TOLD).map(|&row| short(log.time_s[row])).collect();
        if rows.len() > TOLD {
            times.push("...".to_owned());
        }
        let (what, [them, their]) = match rows.len() {
            1 => ("1 row is".to_owned(), ["it", "its"]),
            count => (format!("{} rows are", thousands(count)), ["them", "their"]),
        };
        let note = format!(
            "{}: {what} not compared: {} steps within {them}, and what is measured at {their} end answers to what it stepped to (at {} s)",
            log.file,
            channel.name(),
            times.join(", ")
        );
        log.notes.push(note);
    }
}

/// Whether what a channel shows answers to an input of the same moment; a temperature needs its time.
pub(super) fn answers_at_once(channel: Channel) -> bool {
    channel != Channel::TemperatureDegc
}

/// Whether something measured at the end of a row has gone further than the input's share of its step: it is nearer to the whole step, and by
/// more than noise.
fn is_ahead(measured: &[f64], (row, share): (usize, f64), floor: f64) -> bool {
    let step = measured[row + 1] - measured[row - 1];
    let ahead = (measured[row] - measured[row - 1] - share * step) * step.signum();
    ahead > (FLOORS * floor).max(0.5 * (1.0 - share) * step.abs())
}

fn deviation(edges: &[(usize, f64)]) -> f64 {
    let count = edges.len() as f64;
    let mean = edges.iter().map(|(_, share)| share).sum::<f64>() / count;
    (edges.iter().map(|(_, share)| (share - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt()
}

/// Rows between two values that hold, of neither of them, with the share of the step that they show.
fn edges(values: &[f64], least: f64) -> Vec<(usize, f64)> {
    let holds = |a: f64, b: f64| (b - a).abs() <= least;
    let edge = |row: usize| {
        let (before, within, after) = (values[row - 1], values[row], values[row + 1]);
        let parts = [within - before, after - within];
        let between = parts.iter().all(|part| part.abs() > least) && parts[0] * parts[1] > 0.0;
        let held = row < 2 || holds(values[row - 2], before);
        let goes_on = row + 2 >= values.len() || holds(after, values[row + 2]);
        (held && goes_on && between).then(|| (row, parts[0] / (after - before)))
    };
    (1..values.len().saturating_sub(1)).filter_map(edge).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_model;
    use crate::measurement::{LogFacts, read_log};

    /// A log of one row a second, in which a load of 2 A switches every 50 s, so many seconds after a row; of voltages at the end of each row, or
    /// of their means.
    fn log(late_s: &[f64], means: bool) -> Log {
        let mut text = "time_s,current_a,voltage_v,temperature_degc\n".to_owned();
        for row in 0..(50 * late_s.len() + 50) {
            let (spell, second) = (row / 50, row % 50);
            let on = |spell: usize| if spell % 2 == 1 { 2.0 } else { 0.0 };
            let within = second == 0 && spell > 0;
            let mean_a = if within { on(spell - 1) * late_s[spell - 1] + on(spell) * (1.0 - late_s[spell - 1]) } else { on(spell) };
            text += &format!("{row},{mean_a},{},25\n", 3.8 - 1e-4 * row as f64 - 0.05 * if means { mean_a } else { on(spell) });
        }
        read_log("log.csv", text.as_bytes(), LogFacts::default()).unwrap()
    }

    fn left_out(late_s: &[f64], means: bool) -> Vec<usize> {
        let model = load_model("enertech-lco-2280mah").unwrap().model;
        let mut log = log(late_s, means);
        leave_out_edges(&mut log, &model);
        assert!(log.channels[&Channel::TemperatureDegc].iter().all(|value| value.is_finite()));
        let volts = &log.channels[&Channel::VoltageV];
        let rows: Vec<usize> = (0..volts.len()).filter(|&row| volts[row].is_nan()).collect();
        assert_eq!(rows.is_empty(), log.notes.iter().all(|note| !note.contains("steps within")), "{:?}", log.notes);
        rows
    }

    #[test]
    fn what_is_measured_after_a_step_within_its_row_is_not_compared() {
        assert_eq!(left_out(&[0.6], false), [50]);
        assert_eq!(left_out(&[0.6, 0.1, 0.4, 0.9], false), [50, 100, 150, 200]);
        // At the beginning or the end of a row there is nothing to see.
        assert_eq!(left_out(&[0.0, 0.3, 0.01], false), [100]);
    }

    /// Its temperature goes up by the last digit here and there, and no sensor is stated.
    #[test]
    fn a_temperature_answers_to_no_moment() {
        let mut log = log(&[0.6, 0.1, 0.4], false);
        log.channels.get_mut(&Channel::TemperatureDegc).unwrap()[50] = 25.1;
        let mut model = Model::clone(&load_model("enertech-lco-2280mah").unwrap().model);
        model.sensors.clear();
        leave_out_edges(&mut log, &model);
        assert!(log.channels[&Channel::TemperatureDegc].iter().all(|value| value.is_finite()));
        assert!(log.channels[&Channel::VoltageV][50].is_nan());
    }

    #[test]
    fn means_of_both_belong_together() {
        assert!(left_out(&[0.6, 0.1, 0.4, 0.9], true).is_empty());
    }

    #[test]
    fn steps_that_all_come_as_late_are_those_of_another_clock() {
        assert!(left_out(&[0.3, 0.3, 0.32, 0.29, 0.31], false).is_empty());
    }

    #[test]
    fn a_ramp_and_a_pulse_are_no_steps() {
        let ramp: Vec<f64> = (0..20).map(f64::from).collect();
        assert_eq!(edges(&ramp, 0.5), []);
        let pulse = [0.0, 0.0, 1.0, 0.0, 0.0];
        assert_eq!(edges(&pulse, 0.05), []);
        assert_eq!(edges(&[0.0, f64::NAN, 0.5, 1.0, 1.0], 0.05), []);
    }
}
