//! Regimes of a battery.

use energy::Channel;

use super::bands::{Scale, between, by_number, named};
use super::{Columns, Dimension, Seen};

/// Edges between the bands of state of charge, %: dense near empty, where models fail first.
const SOC_EDGES_PERCENT: [f64; 6] = [5.0, 10.0, 15.0, 20.0, 40.0, 70.0];
/// Edges between the bands of current, in multiples of the capacity per hour (C-rate).
const RATE_EDGES: [f64; 2] = [0.3, 0.8];
/// Below this C-rate a battery rests.
const REST_RATE: f64 = 0.005;
/// A change of the C-rate by more than this between neighbouring rows is a step.
const STEP_RATE: f64 = 0.05;
/// Edges between the bands of time since the last step, s: a decade each.
const SINCE_STEP_EDGES_S: [f64; 4] = [2.0, 20.0, 200.0, 2000.0];

pub(super) fn dimensions(seen: &Seen<'_>) -> Vec<Dimension> {
    let capacity_ah = seen.model.battery().capacity_ah;
    let soc: Columns<'_> = seen.predictions.iter().map(|prediction| Some(prediction.soc.as_slice())).collect();
    let mut all = vec![between(Scale::percent("soc", " % SoC"), &SOC_EDGES_PERCENT, &soc)];
    if let Some(current_a) = seen.channel(Channel::CurrentA) {
        all.push(state(&current_a, capacity_ah));
        all.push(current(&current_a, capacity_ah));
        all.push(since_step(seen, &current_a, capacity_ah));
    }
    let number = |channel, scale| by_number(scale, &seen.channel(channel)?);
    let temperature = number(Channel::TemperatureDegc, Scale::of("temperature", " degC"));
    all.extend(temperature.or_else(|| number(Channel::AmbientDegc, Scale::of("ambient", " degC around it"))));
    all.extend(number(Channel::CycleCount, Scale::of("cycle", " cycles")));
    all.extend(number(Channel::AgeDays, Scale::of("age", " days of age")));
    all
}

fn state(current_a: &Columns<'_>, capacity_ah: f64) -> Dimension {
    let bands = [("rest", "at rest"), ("load", "under load"), ("charge", "in charge")];
    named("state", &bands, current_a, |current_a| match current_a / capacity_ah {
        rate if rate.abs() < REST_RATE => 0,
        rate if rate > 0.0 => 1,
        _ => 2,
    })
}

fn current(current_a: &Columns<'_>, capacity_ah: f64) -> Dimension {
    let [low, high] = RATE_EDGES;
    let sizes = [format!("< {low}C"), format!("{low}-{high}C"), format!("> {high}C")];
    let mut bands = vec!["rest".to_owned()];
    bands.extend(sizes.iter().map(|size| format!("discharge {size}")));
    bands.extend(sizes.iter().map(|size| format!("charge {size}")));
    let pairs: Vec<(&str, &str)> = bands.iter().map(|band| (band.as_str(), "")).collect();
    let mut dimension = named("current", &pairs, current_a, |current_a| {
        let rate = current_a / capacity_ah;
        let size = RATE_EDGES.partition_point(|&edge| edge <= rate.abs());
        match rate {
            rate if rate.abs() < REST_RATE => 0,
            rate if rate > 0.0 => 1 + size,
            _ => 4 + size,
        }
    });
    // Rest, discharge and charge as a whole are for `state` to say.
    let rates = [
        (vec![1], format!("at discharge below {low}C")),
        (vec![1, 2], format!("at discharge below {high}C")),
        (vec![2, 3], format!("at discharge above {low}C")),
        (vec![3], format!("at discharge above {high}C")),
        (vec![4], format!("at charge below {low}C")),
        (vec![4, 5], format!("at charge below {high}C")),
        (vec![5, 6], format!("at charge above {low}C")),
        (vec![6], format!("at charge above {high}C")),
    ];
    dimension.groups = rates.into();
    dimension
}

/// Time since the current last changed by a step; rows before the first one lie in no band.
fn since_step(seen: &Seen<'_>, current_a: &Columns<'_>, capacity_ah: f64) -> Dimension {
    let least_a = STEP_RATE * capacity_ah;
    let since: Vec<Option<Vec<f64>>> = seen
        .logs
        .iter()
        .zip(current_a)
        .map(|(log, current_a)| Some(time_since(&log.time_s, (*current_a)?, |before, now| (now - before).abs() > least_a)))
        .collect();
    let columns = since.iter().map(Option::as_deref).collect();
    let mut dimension = between(Scale::of("since step", " s after a step"), &SINCE_STEP_EDGES_S, &columns);
    // "within 20 s of a current step" says it better than "below".
    for (bands, words) in &mut dimension.groups {
        let edges = &SINCE_STEP_EDGES_S;
        let (first, last) = (bands[0], bands[bands.len() - 1]);
        *words = match (first, last) {
            (0, last) => format!("within {} s of a current step", edges[last]),
            (first, last) if last == edges.len() => format!("more than {} s after a current step", edges[first - 1]),
            (first, last) => format!("{} to {} s after a current step", edges[first - 1], edges[last]),
        };
    }
    dimension
}

/// Seconds at every row since what happened last, NaN before. The value of row k holds over
/// (t\[k-1\], t\[k\]], so that a step to it happened at t\[k-1\].
pub(super) fn time_since(time_s: &[f64], values: &[f64], happens: impl Fn(f64, f64) -> bool) -> Vec<f64> {
    let mut last_s = f64::NAN;
    let mut since = Vec::with_capacity(values.len());
    for row in 0..values.len() {
        // The first row's value holds over no interval.
        if row > 1 && happens(values[row - 1], values[row]) {
            last_s = time_s[row - 1];
        }
        since.push(time_s[row] - last_s);
    }
    since
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn soc_falls_into_its_band_even_outside_0_to_1() {
        let soc = [-0.02, 0.049, 0.05, 0.69, 0.7, 1.01];
        let dimension = between(Scale::percent("soc", " % SoC"), &SOC_EDGES_PERCENT, &vec![Some(&soc)]);
        assert_eq!(dimension.bands[..3], ["< 5 % SoC", "5 to 10 % SoC", "10 to 15 % SoC"]);
        assert_eq!(dimension.of_row, [[0, 0, 1, 5, 6, 6].map(Some)]);
        assert!(dimension.groups.contains(&(vec![0, 1], "below 10 % SoC".to_owned())));
    }

    #[test]
    fn current_is_sorted_by_sign_and_c_rate() {
        let current_a = [0.0, 0.2, 1.0, 2.0, -0.2, -1.0, -2.0];
        let dimension = current(&vec![Some(&current_a)], 2.0);
        assert_eq!(dimension.of_row, [[0, 1, 2, 3, 4, 5, 6].map(Some)]);
        assert_eq!(dimension.bands[3], "discharge > 0.8C");
        assert_eq!(state(&vec![Some(&current_a)], 2.0).of_row, [[0, 1, 1, 1, 2, 2, 2].map(Some)]);
    }

    #[test]
    fn a_step_happens_where_the_interval_of_its_row_begins() {
        let since = time_since(&[0.0, 10.0, 20.0, 30.0, 40.0], &[9.0, 1.0, 1.0, 0.0, 0.0], |before, now| before != now);
        assert!(since[..3].iter().all(|since| since.is_nan()));
        assert_eq!(since[3..], [10.0, 20.0]);
    }
}
