//! What a coordinator asks of a robot: what it draws, and what a metre costs.

use energy::forecast::propagate_loads;
use energy::{Channel, Estimate};

use super::{Figure, Seen, input, integral};
use crate::predict::predict;
use crate::prepare::Prepared;

/// Way below which energy per metre means nothing, m.
const WAY_M: f64 = 1.0;

pub(super) fn figures(seen: Seen<'_>) -> Vec<Figure> {
    let mut time_s = 0.0;
    let energy_j = propagate_loads(seen.model, |model, values| {
        let of = |log: &Prepared| {
            let prediction = predict(model, log, values);
            prediction.of(Channel::PowerW).map_or((0.0, 0.0), |power_w| integral(log, |row| Some(power_w[row]).filter(|w| w.is_finite())))
        };
        let (energy_j, lasted_s) = seen.logs.iter().map(of).fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
        time_s = lasted_s;
        energy_j
    });
    if time_s <= 0.0 {
        return Vec::new();
    }
    let per = |amount: f64| Estimate::new(energy_j.value / amount, energy_j.sigma / amount);
    let mut all = vec![Figure { name: "mean_power_w", what: "mean power on the logs".to_owned(), estimate: per(time_s) }];
    let way = |log: &Prepared| input(log, Channel::SpeedMps).map_or(0.0, |speed| integral(log, |row| Some(speed[row].abs())).0);
    let way_m: f64 = seen.logs.iter().map(way).sum();
    if way_m > WAY_M {
        all.push(Figure { name: "energy_per_way_j_per_m", what: "energy per metre on the logs".to_owned(), estimate: per(way_m) });
    }
    all
}
