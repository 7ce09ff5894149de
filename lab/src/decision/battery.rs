//! What a coordinator asks of a battery: how much it delivers, and for how long.

use energy::forecast::remaining_from;
use energy::units::S_PER_H;
use energy::{Channel, Estimate, Start};

use super::{Figure, Seen, input, integral};
use crate::predict::predict;
use crate::prepare::Prepared;
use crate::report::quantity::quantity;

/// Charge below which nothing is left to decide.
const LEFT_SOC: f64 = 0.05;

pub(super) fn figures(seen: Seen<'_>) -> Vec<Figure> {
    let (Some(load_w), Some(last)) = (mean_discharge_w(seen.logs), seen.logs.last()) else { return Vec::new() };
    let at = format!("at {}", quantity(load_w, "W"));
    let usual = usual(seen.logs);
    let full = remaining_from(seen.model, Estimate::exact(1.0), usual, load_w);
    let from_full = format!("{at} and {:.0} degC", usual.temperature_degc);
    let mut all = vec![
        Figure { name: "usable_energy_wh", what: format!("usable energy from full {from_full}"), estimate: full },
        Figure { name: "run_time_full_s", what: format!("run time from full {from_full}"), estimate: time_s(full, load_w) },
    ];
    let soc = predict(seen.model, last, &seen.model.values()).soc.last().copied();
    if let Some(soc) = soc.filter(|soc| *soc > LEFT_SOC) {
        let sigma = last.soc_initial_sigma.unwrap_or(seen.model.uncertainty.soc_initial_sigma);
        let left = remaining_from(seen.model, Estimate::new(soc, sigma), last.start, load_w);
        let what = format!("run time left after {} (charge {:.0} %) {at}", last.name, soc * 100.0);
        all.push(Figure { name: "run_time_left_s", what, estimate: time_s(left, load_w) });
    }
    all
}

/// As warm as the logs found the battery on average, and as old as the oldest of them: whatever their order.
fn usual(logs: &[Prepared]) -> Start {
    let starts = || logs.iter().map(|log| log.start);
    let age = |a: &Start, b: &Start| a.age_days.total_cmp(&b.age_days).then(a.cycle_count.total_cmp(&b.cycle_count));
    let oldest = starts().max_by(age).unwrap_or_else(|| Start::at_soc(1.0));
    let temperature_degc = starts().map(|start| start.temperature_degc).sum::<f64>() / logs.len().max(1) as f64;
    Start { temperature_degc, ..oldest }
}

fn time_s(energy_wh: Estimate, load_w: f64) -> Estimate {
    Estimate::new(energy_wh.value / load_w * S_PER_H, energy_wh.sigma / load_w * S_PER_H)
}

/// Mean power of the logs while they discharge, by their own measurements.
fn mean_discharge_w(logs: &[Prepared]) -> Option<f64> {
    let of = |log: &Prepared| {
        let current_a = input(log, Channel::CurrentA)?;
        let voltage_v = &log.targets.iter().find(|target| target.channel == Channel::VoltageV)?.observed;
        let power = |row: usize| {
            let power_w = current_a[row] * voltage_v[row];
            (power_w.is_finite() && power_w > 0.0).then_some(power_w)
        };
        Some(integral(log, power))
    };
    let (sum, time_s) = logs.iter().filter_map(of).fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    (time_s > 0.0 && sum > 0.0).then(|| sum / time_s)
}
