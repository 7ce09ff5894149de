//! Regimes of a charging station.

use energy::Channel;

use super::bands::{Scale, between, by_number, named};
use super::battery::time_since;
use super::{Columns, Dimension, Seen};

/// A fall of the charge power by more than this share per minute is the taper of a charge at
/// constant voltage; at constant current the power stands or rises a little.
const TAPER_PER_MIN: f64 = 0.005;
/// Time on each side over which the slope is taken, s.
const WINDOW_S: f64 = 120.0;
/// A change of the power by more than this share between neighbouring rows is a robot that came
/// or went, not a slope.
const JUMP: f64 = 0.1;
/// Edges between the bands of time since the selector switched, s.
const SINCE_SWITCH_EDGES_S: [f64; 2] = [20.0, 200.0];

pub(super) fn dimensions(seen: &Seen<'_>) -> Vec<Dimension> {
    let number = |channel, scale| by_number(scale, &seen.channel(channel)?);
    let lift = [("lift at rest", "with the lift at rest"), ("lift moving", "with the lift moving")];
    let all = [
        number(Channel::RobotsDocked, Scale::count("docked", " robot docked", " robots docked")),
        number(Channel::RobotsCharging, Scale::count("charging", " robot charging", " robots charging")),
        number(Channel::ChargePowerW, Scale::of("charge power", " W of charge power")),
        seen.channel(Channel::ChargePowerW).map(|power_w| phase(seen, &power_w)),
        seen.channel(Channel::LiftActive).map(|active| named("lift", &lift, &active, |active| usize::from(active > 0.0))),
        seen.channel(Channel::SelectorEvents).map(|events| selector(seen, &events)),
        number(Channel::AmbientDegc, Scale::of("ambient", " degC around it")),
    ];
    all.into_iter().flatten().collect()
}

fn phase(seen: &Seen<'_>, power_w: &Columns<'_>) -> Dimension {
    let bands =
        [("none", "with no robot charging"), ("CC", "in constant-current charge"), ("CV", "in the taper of the charge (constant voltage)")];
    let phases: Vec<Option<Vec<f64>>> =
        seen.logs.iter().zip(power_w).map(|(log, power_w)| Some(phases(&log.time_s, (*power_w)?))).collect();
    named("phase", &bands, &phases.iter().map(Option::as_deref).collect(), |phase| phase as usize)
}

/// Phase of charge at every row: 0 none, 1 constant current, 2 constant voltage.
fn phases(time_s: &[f64], power_w: &[f64]) -> Vec<f64> {
    let mut phases = vec![0.0; power_w.len()];
    let mut begin = 0;
    while begin < power_w.len() {
        let same = |row: usize| power_w[row] > 0.0 && (power_w[row] - power_w[row - 1]).abs() <= JUMP * power_w[row - 1].abs();
        let end = (begin + 1..power_w.len()).find(|&row| !same(row)).unwrap_or(power_w.len());
        if power_w[begin] > 0.0 {
            for (row, phase) in phases[begin..end].iter_mut().enumerate() {
                *phase = if falls(&time_s[begin..end], &power_w[begin..end], row) { 2.0 } else { 1.0 };
            }
        }
        begin = end;
    }
    phases
}

/// Whether the power falls about this row: the mean of the later half of the window against that
/// of the earlier one.
fn falls(time_s: &[f64], power_w: &[f64], row: usize) -> bool {
    let from = time_s.partition_point(|&at| at < time_s[row] - WINDOW_S);
    let to = time_s.partition_point(|&at| at <= time_s[row] + WINDOW_S);
    let middle = from.midpoint(to);
    if to - from < 2 {
        return false;
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (before, after) = (mean(&power_w[from..middle]), mean(&power_w[middle..to]));
    let minutes = (mean(&time_s[middle..to]) - mean(&time_s[from..middle])) / 60.0;
    (before - after) / before > TAPER_PER_MIN * minutes
}

fn selector(seen: &Seen<'_>, events: &Columns<'_>) -> Dimension {
    let since = |(log, events): (&crate::prepare::Prepared, &Option<&[f64]>)| {
        // Before the first switch there is none to be near to.
        let since = time_since(&log.time_s, (*events)?, |_, now| now > 0.0);
        Some(since.into_iter().map(|since| if since.is_nan() { f64::MAX } else { since }).collect())
    };
    let since: Vec<Option<Vec<f64>>> = seen.logs.iter().zip(events).map(since).collect();
    let columns = since.iter().map(Option::as_deref).collect();
    let mut dimension = between(Scale::of("selector", " s after a switch"), &SINCE_SWITCH_EDGES_S, &columns);
    let [near, far] = SINCE_SWITCH_EDGES_S;
    dimension.groups = vec![
        (vec![0], format!("within {near} s of a switch of packs")),
        (vec![0, 1], format!("within {far} s of a switch of packs")),
        (vec![2], format!("more than {far} s from a switch of packs")),
    ];
    dimension
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_charge_that_tapers_is_told_from_one_that_stands() {
        let time_s: Vec<f64> = (0..120).map(|k| 30.0 * f64::from(k)).collect();
        let power = |k: i32| match k {
            0..20 => 0.0,
            20..70 => 10.0 + 0.01 * f64::from(k),
            // A second robot comes: a jump, not a slope.
            70..80 => 20.0,
            _ => 20.0 * (-f64::from(k - 80) * 30.0 / 1200.0).exp(),
        };
        let power_w: Vec<f64> = (0..120).map(power).collect();
        let phases = phases(&time_s, &power_w);
        assert!(phases[..20].iter().all(|&phase| phase == 0.0));
        assert!(phases[20..76].iter().all(|&phase| phase == 1.0), "{phases:?}");
        assert!(phases[82..].iter().all(|&phase| phase == 2.0), "{phases:?}");
    }
}
