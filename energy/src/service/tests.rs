use super::*;
use crate::load::Terminals as _;
use crate::load_model;

fn model(name: &str) -> Arc<Model> {
    Arc::new(load_model(name, &|_| unreachable!("built in")).unwrap())
}

/// A station whose converters and chargers have curves, on wires, with contacts.
fn curved() -> Arc<Model> {
    let text = r#"
        schema = 1
        system = "station"
        name = "curved"
        effect = [
            { id = "robot_own_load", own_load_w = { value = 4.19, sigma = 0.1, source = "test" } },
            { id = "charger_curve", standby_w = { value = 0.1, sigma = 0.02, source = "test" } },
            { id = "bay_contact", contact_ohm = { value = 0.1, sigma = 0.03, source = "test" } },
            { id = "converter_curve", series_ohm = { value = 0.3, sigma = 0.05, source = "test" } },
            { id = "hotel", hotel_w = { value = 5.5, sigma = 0.2, source = "test" } },
            { id = "lift", lift_w = { value = 8.0, sigma = 1.0, source = "test" } },
            { id = "pack_wiring", wiring_ohm = { value = 0.05, sigma = 0.01, source = "test" } },
        ]
    "#;
    Arc::new(Model::parse("curved", text, &|_| unreachable!("no file")).unwrap())
}

const HANDLING: Handling = Handling { load_s: 30.0, unload_s: 30.0, swap_s: 60.0 };

fn service(station: &Arc<Model>, soc: Estimate, around: &Circumstances) -> Recharge {
    service_energy(station, HANDLING, &model("explorer-3s1p-1320mah"), soc, 0.98, around)
}

/// One second after the other: `robots` are lifted in one by one, charge together and are lifted
/// out. Gives the energy per robot beyond the idle station's, Wh, and the time on the charger, s.
fn simulated(station: &Arc<Model>, robots: usize, around: &Circumstances) -> (f64, f64) {
    let mut load = Run::new(Arc::clone(station), Start::at_soc(0.0));
    let nothing = Situation { pack_v: around.pack_v, ..Situation::default() };
    let idle_w = power_w(&mut load, &nothing);
    let mut battery = Run::new(model("explorer-3s1p-1320mah"), Start::at_soc(0.1));
    let n = robots as f64;
    let (mut energy_j, mut charge_s) = (0.0, 0.0);
    for (docked, seconds) in [(0.0, 30.0 * n), (1.0, 30.0 * n)] {
        energy_j += (power_w(&mut load, &Situation { docked, lift: 1.0, ..nothing }) - idle_w) * seconds;
    }
    while battery.channels[Channel::Soc] < 0.98 {
        // The converter's limit, met by what each robot may take.
        let before_v = battery.channels[Channel::TerminalVoltageV];
        let at = |charge_w: f64| Situation { charge_w, docked: n, charging: n, ..nothing };
        let limit_w =
            if around.converter_w_max.is_finite() { charge_w_within(&mut load, around.converter_w_max, at) } else { f64::INFINITY };
        let current_a = -battery.step_charge((limit_w / n / before_v).min(1.32), 12.6, 1.0);
        let charge_w = -battery.channels[Channel::PowerW];
        let now = Situation { charge_w: n * charge_w, docked: n, charging: n, squared_a2: n * current_a.powi(2), ..nothing };
        energy_j += power_w(&mut load, &now) - idle_w;
        charge_s += 1.0;
    }
    (energy_j / 3600.0 / n, charge_s)
}

#[test]
fn the_breakdown_sums_to_the_whole() {
    let around = Circumstances { pack_v: 11.4, at_once: 3.0, ..Circumstances::ALONE };
    for station in [model("mds-station"), model("mds-station-path-selection"), curved()] {
        let recharge = service(&station, Estimate::new(0.1, 0.01), &around);
        let sum: f64 = recharge.breakdown_wh.values().sum();
        assert!((sum - recharge.need.mean_wh).abs() < 1e-9, "{}: {sum} and {}", station.name, recharge.need.mean_wh);
        let own = if station.name.ends_with("selection") { "path_selection" } else { "robot_own_load" };
        assert!(recharge.breakdown_wh[own] > 3.0, "{:?}", recharge.breakdown_wh);
    }
}

#[test]
fn without_effects_a_service_costs_what_goes_into_the_battery() {
    let station = Arc::new(model("mds-station").without(|_| true));
    let recharge = service(&station, Estimate::exact(0.1), &Circumstances::ALONE);
    assert!((recharge.need.mean_wh - recharge.breakdown_wh["charge"]).abs() < 1e-9);
    // 0.88 x 1.32 Ah at 11.1 V nominal is 12.9 Wh; charging voltage is a little higher.
    assert!((12.9..15.0).contains(&recharge.need.mean_wh), "{}", recharge.need.mean_wh);
}

#[test]
fn the_forecast_is_what_a_simulated_service_takes() {
    let limited = Circumstances { pack_v: 11.4, at_once: 3.0, converter_w_max: 40.0, ..Circumstances::ALONE };
    let three = Circumstances { converter_w_max: f64::INFINITY, ..limited };
    let one = Circumstances { at_once: 1.0, ..three };
    for station in [model("mds-station"), curved()] {
        for around in [one, three, limited] {
            let recharge = service(&station, Estimate::exact(0.1), &around);
            let (simulated_wh, charge_s) = simulated(&station, around.at_once as usize, &around);
            let off = recharge.need.mean_wh / simulated_wh - 1.0;
            assert!(off.abs() < 0.01, "{} {around:?}: {} Wh against {simulated_wh}", station.name, recharge.need.mean_wh);
            assert!((recharge.need.mean_wh - simulated_wh).abs() < recharge.need.estimate().sigma, "{around:?}: {recharge:?}");
            assert!((recharge.charge_s / charge_s - 1.0).abs() < 0.015, "{around:?}: {} s against {charge_s}", recharge.charge_s);
        }
    }
}

/// What path selection spares the station's pack while a robot is docked, Wh, in closed form:
/// `P_own t (1 / eta_charger - 1) / eta_converter`.
fn saving_wh(docked_s: f64) -> f64 {
    4.19 * docked_s / S_PER_H * (1.0 / 0.88 - 1.0) / 0.84
}

#[test]
fn three_explorers_empty_one_full_pack_and_path_selection_saves_a_fortieth() {
    // Kottas, chapter 6: loading, charging from 10 % and unloading three Explorers empties one
    // full 7600 mAh pack of 84 Wh; the hotel's 5.7 W for an hour is part of it.
    let around = Circumstances { at_once: 3.0, ..Circumstances::ALONE };
    let battery = model("explorer-3s1p-1320mah");
    let full = |station: &Arc<Model>| service_energy(station, HANDLING, &battery, Estimate::exact(0.1), 1.0, &around);
    let (direct, selected) = (full(&model("mds-station")), full(&model("mds-station-path-selection")));
    let whole_wh = 3.0 * direct.need.mean_wh + 5.7 * (direct.charge_s + 180.0) / S_PER_H;
    assert!((78.0..92.0).contains(&whole_wh), "{whole_wh}");
    let saved_wh = direct.need.mean_wh - selected.need.mean_wh;
    let by_hand_wh = saving_wh(direct.charge_s + 30.0);
    assert!((saved_wh / by_hand_wh - 1.0).abs() < 0.02, "{saved_wh} and {by_hand_wh}: the charge's end is inside a step");
}

#[test]
fn a_shared_limit_lengthens_the_charge_and_the_own_load_runs_on() {
    let free = Circumstances { at_once: 3.0, ..Circumstances::ALONE };
    let tight = Circumstances { converter_w_max: 40.0, ..free };
    let station = model("mds-station");
    let (free, tight) = (service(&station, Estimate::exact(0.1), &free), service(&station, Estimate::exact(0.1), &tight));
    // By hand: 40 W x 0.88 - 3 x 4.19 W = 22.6 W, 7.5 W each instead of about 16: about 14.3 Wh in
    // 1.9 h instead of just under one.
    assert!((1.7..2.0).contains(&(tight.charge_s / S_PER_H)), "{}", tight.charge_s);
    assert!(tight.charge_s > 1.8 * free.charge_s && tight.need.mean_wh > free.need.mean_wh + 4.0);
}

#[test]
fn who_comes_too_hot_or_too_cold_is_charged_where_it_is_neither() {
    let station = model("mds-station");
    let at = |temperature_degc: f64, ambient_degc: f64| {
        let around = Circumstances { temperature_degc, ambient_degc, ..Circumstances::ALONE };
        service(&station, Estimate::exact(0.1), &around)
    };
    let mild = at(25.0, 25.0);
    // From the yard into the hall, and from hard work: each rests until it may be charged.
    for (temperature_degc, ambient_degc) in [(-2.0, 20.0), (46.0, 30.0)] {
        let waits = at(temperature_degc, ambient_degc);
        assert!(waits.stopped.is_none() && waits.charge_s > mild.charge_s + 120.0, "{waits:?}");
        assert!(waits.charge_s < mild.charge_s + 3600.0, "{waits:?}");
    }
    // Where it is as hot or as cold, that never ends.
    for degc in [-2.0, 46.0] {
        assert!(at(degc, degc).stopped.is_some());
    }
}

#[test]
fn packs_alone_share_a_limit_without_any_robots_load() {
    // Two behind chargers of 88 % share 30 W: 13.2 W each, until the voltage is full.
    let two = Circumstances { pack_v: 11.4, at_once: 2.0, converter_w_max: 30.0, ..Circumstances::ALONE };
    let charge = pack_energy(&model("mds-station"), &model("explorer-3s1p-1320mah"), Estimate::exact(0.2), 0.8, &two);
    let mean_w = charge.breakdown_wh["charge"] / (charge.charge_s / S_PER_H);
    assert!((mean_w - 13.2).abs() < 0.1, "{mean_w}");
}

#[test]
fn a_doubtful_state_of_charge_is_the_services_own_doubt() {
    let station = model("mds-station");
    let sure = service(&station, Estimate::exact(0.3), &Circumstances::ALONE);
    let doubtful = service(&station, Estimate::new(0.3, 0.05), &Circumstances::ALONE);
    assert_eq!(sure.need.shared_wh, doubtful.need.shared_wh);
    // A twentieth of 1.32 Ah at some 12 V through 0.88 x 0.84, with the own load of its three
    // minutes: 0.79 Wh + 0.28 Wh = 1.35 Wh at the pack.
    let added_wh = (doubtful.need.own_variance - sure.need.own_variance).sqrt();
    assert!((1.2..1.5).contains(&added_wh), "{added_wh}");
}

#[test]
fn the_other_power_path_differs_by_what_the_charger_loses_on_the_own_load() {
    let direct = model("mds-station");
    assert_eq!(
        (power_path(&direct), power_path(&model("mds-station-path-selection"))),
        (Some(PowerPath::Direct), Some(PowerPath::Selected))
    );
    let selected = Arc::new(with_other_path(&direct).unwrap());
    let around = Circumstances::ALONE;
    let service = |station: &Arc<Model>| {
        let handling = Handling { load_s: 0.0, unload_s: 0.0, swap_s: 0.0 };
        service_energy(station, handling, &model("explorer-3s1p-1320mah"), Estimate::exact(0.1), 0.98, &around)
    };
    let saved_wh = service(&direct).need.mean_wh - service(&selected).need.mean_wh;
    let by_hand_wh = saving_wh(service(&direct).charge_s);
    assert!((saved_wh - by_hand_wh).abs() < 1e-6, "{saved_wh} {by_hand_wh}");
    assert!(with_other_path(&direct.without(|id| id == "robot_own_load")).is_none());
}
