//! What a coordinator asks of a station: what a service costs, and how many a pack pays for.

use std::sync::Arc;

use energy::forecast::remaining_wh;
use energy::service::{Circumstances, Handling, overhead_per_h, service_energy};
use energy::units::{REFERENCE_DEGC, S_PER_H};
use energy::{Channel, Estimate, Model};

use super::{Figure, Seen, input, integral};
use crate::load_model;
use crate::prepare::Prepared;

/// The robot's battery and the station's pack to which the numbers refer: a log of a station says
/// what its bays take, and not of what.
const BATTERY: &str = "explorer-3s1p-1320mah";
const PACK: &str = "mds-3s4p-7600mah";
/// A service: from nearly empty to nearly full.
const FROM: f64 = 0.1;
const TO: f64 = 0.98;
/// The lift's movements for it.
const HANDLING: Handling = Handling { load_s: 30.0, unload_s: 30.0, swap_s: 60.0 };

pub(super) fn figures(seen: Seen<'_>) -> Vec<Figure> {
    let known = |name| load_model(name).ok().map(|source| source.model);
    let (Some(battery), Some(pack)) = (known(BATTERY), known(PACK)) else { return Vec::new() };
    let around = circumstances(seen.logs, &pack);
    let recharge = service_energy(seen.model, HANDLING, &battery, Estimate::exact(FROM), TO, &around);
    let (service, hours) = (recharge.need.estimate(), recharge.charge_s / S_PER_H);
    let overhead = overhead_per_h(seen.model, around.pack_v);
    // Robots that charge side by side share what the station takes anyway.
    let whole = recharge.need.plus(&overhead.scaled(hours / around.at_once)).estimate();
    let drawn_w = around.at_once * whole.value / hours.max(1e-9);
    let usable = remaining_wh(&pack, Estimate::exact(1.0), REFERENCE_DEGC, drawn_w);
    let count = usable.value / whole.value;
    let relative = (usable.sigma / usable.value).hypot(whole.sigma / whole.value);
    let side_by_side = if around.at_once > 1.0 { format!(", {} at once", around.at_once) } else { String::new() };
    let service_words = format!("energy per service of {BATTERY} from {:.0} to {:.0} %{side_by_side}", FROM * 100.0, TO * 100.0);
    vec![
        Figure { name: "energy_per_service_wh", what: service_words, estimate: service },
        Figure { name: "overhead_w", what: "power that it takes while it services nobody".to_owned(), estimate: overhead.estimate() },
        Figure {
            name: "robots_per_pack_count",
            what: format!("such services per {PACK}{side_by_side}"),
            estimate: Estimate::new(count, count * relative),
        },
    ]
}

/// As the logs show it: the most robots that charged at once, and the mean voltage of the pack.
fn circumstances(logs: &[Prepared], pack: &Arc<Model>) -> Circumstances {
    let of = |channel| logs.iter().filter_map(move |log| Some((log, input(log, channel)?)));
    let at_once = of(Channel::RobotsCharging).flat_map(|(_, values)| values).fold(1.0, |most: f64, &robots| most.max(robots));
    let volts = of(Channel::PackVoltageV).map(|(log, values)| integral(log, |row| Some(values[row])));
    let (sum, time_s) = volts.fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
    let middle_v = f64::from(pack.battery().series) * pack.battery().ocv.voltage_v(0.5);
    Circumstances { pack_v: if time_s > 0.0 { sum / time_s } else { middle_v }, at_once: at_once.round(), ..Circumstances::ALONE }
}
