use super::*;
use crate::load_model;
use crate::protection::{Measured, Protection};

fn model(name: &str) -> Arc<Model> {
    Arc::new(load_model(name, &|_| unreachable!("built in")).unwrap())
}

#[test]
fn usable_energy_falls_with_power_and_stays_below_the_stored_energy() {
    let pack = model("mds-3s4p-7600mah");
    let usable_wh = |power_w| remaining_wh(&pack, Estimate::exact(1.0), 25.0, power_w).value;
    assert!(usable_wh(5.0) < pack.battery().stored_wh());
    assert!(usable_wh(60.0) < usable_wh(30.0) && usable_wh(30.0) < usable_wh(5.0));
    // Kottas, chapter 6: 7.6 Ah at 11.1 V nominal is 84.4 Wh; LiCoO2 averages a little more.
    assert!((80.0..90.0).contains(&usable_wh(60.0)), "{}", usable_wh(60.0));
}

#[test]
fn a_worn_pack_gives_what_one_of_that_health_and_age_gives() {
    let new = model("mds-3s4p-7600mah");
    let usable_wh = |pack: &Arc<Model>| discharge(&mut Run::new(Arc::clone(pack), Start::at_soc(0.9)), 40.0).energy_wh;
    // Less capacity as an effect says it, and as the model of a worn pack has it.
    let weak = new.with("capacity_health").unwrap();
    let values = weak.parameters().iter().map(|own| if own.effect == "capacity_health" { 0.7 } else { own.value }).collect::<Vec<_>>();
    let (weak, worn) = (Arc::new(weak.with_values(&values)), Arc::new(new.worn(Estimate::new(0.7, 0.014), 0.0)));
    // The same current through the same resistance, for 0.7 of the time; the steps of the discharges are not the same.
    let [of_new, of_weak, of_worn] = [&new, &weak, &worn].map(usable_wh);
    assert!((of_worn / of_weak - 1.0).abs() < 1e-3 && (of_worn / (0.7 * of_new) - 1.0).abs() < 2e-3, "{of_worn} {of_weak} {of_new}");
    assert!((health(&weak, 0.0) - 0.7).abs() < 1e-12 && (worn.uncertainty.capacity_relative_sigma - 0.02).abs() < 1e-12);
    // A fade with cycles: those of a start, and those that the model of a worn pack has seen.
    let fading = Arc::new(new.with("capacity_fade").unwrap());
    let aged = Arc::new(fading.worn(Estimate::exact(1.0), 400.0));
    let by_start = Start { cycle_count: 400.0, ..Start::at_soc(0.9) };
    let started_wh = discharge(&mut Run::new(Arc::clone(&fading), by_start), 40.0).energy_wh;
    assert!((usable_wh(&aged) / started_wh - 1.0).abs() < 1e-9 && started_wh < 0.95 * usable_wh(&new));
    assert!((health(&fading, 400.0) - 0.92).abs() < 1e-9 && (health(&aged, 0.0) - 0.92).abs() < 1e-9);
}

#[test]
fn the_coarse_forecast_agrees_with_one_second_steps() {
    let pack = model("explorer-3s1p-1320mah");
    let coarse = discharge(&mut Run::new(Arc::clone(&pack), Start::at_soc(0.9)), 4.0);
    let mut fine = Run::new(Arc::clone(&pack), Start::at_soc(0.9));
    let mut seconds = 0.0;
    while fine.step_power(4.0, 1.0).is_ok() && fine.channels[Channel::VoltageV] >= pack.battery().eod_v() {
        seconds += 1.0;
    }
    assert!((coarse.time_s / seconds - 1.0).abs() < 1e-3, "{} against {seconds}", coarse.time_s);

    let coarse = charge(&mut Run::new(Arc::clone(&pack), Start::at_soc(0.1)), 0.98);
    let mut fine = Run::new(Arc::clone(&pack), Start::at_soc(0.1));
    let (mut seconds, mut energy_wh) = (0.0, 0.0);
    while fine.channels[Channel::Soc] < 0.98 {
        fine.step_charge(1.32, 12.6, 1.0);
        energy_wh -= fine.channels[Channel::PowerW] / S_PER_H;
        seconds += 1.0;
    }
    assert!((coarse.energy_wh / energy_wh - 1.0).abs() < 2e-3, "{} against {energy_wh}", coarse.energy_wh);
    assert!((coarse.time_s / seconds - 1.0).abs() < 1e-2, "{} against {seconds}", coarse.time_s);
}

/// In steps of a second, behind the protection as a pack has it, with its delays.
fn charged_behind_protection(pack: &Arc<Model>, temperature_degc: f64) -> (f64, f64) {
    let mut run = Run::new(Arc::clone(pack), Start { temperature_degc, ..Start::at_soc(0.1) });
    let mut protection = Protection::of(pack.battery());
    let (mut seconds, mut energy_wh) = (0.0, 0.0);
    while run.channels[Channel::Soc] < 0.98 && seconds < S_PER_DAY {
        if protection.allowed().charge.is_ok() {
            run.step_charge(1.32, 12.6, 1.0)
        } else {
            run.step_current(0.0, 1.0);
            0.0
        };
        energy_wh -= run.channels[Channel::PowerW] / S_PER_H;
        seconds += 1.0;
        let [cell_min_v, cell_max_v, current_a, temperature_degc] =
            [Channel::CellMinV, Channel::CellMaxV, Channel::TerminalCurrentA, Channel::CellDegc].map(|channel| run.channels[channel]);
        protection.step(1.0, &Measured { cell_min_v, cell_max_v, current_a, temperature_degc });
    }
    (seconds, energy_wh)
}

#[test]
fn a_pack_that_gets_too_hot_to_be_charged_rests_until_it_has_cooled_down() {
    let pack = model("explorer-3s1p-1320mah");
    let at = |temperature_degc| {
        let start = Start { temperature_degc, ..Start::at_soc(0.1) };
        let mut rests_s = 0.0;
        let charge = charge_within(&mut Run::new(Arc::clone(&pack), start), 0.98, f64::INFINITY, true, |dt_s, current_a, _| {
            if current_a == 0.0 {
                rests_s += dt_s;
            }
        });
        (charge, rests_s)
    };
    let (mild, no_rest_s) = at(25.0);
    assert_eq!((mild.stopped, no_rest_s), (None, 0.0));
    for degc in [39.2, 39.6] {
        let ((coarse, rests_s), (seconds, energy_wh)) = (at(degc), charged_behind_protection(&pack, degc));
        assert!(coarse.stopped.is_none() && rests_s > 300.0 && coarse.time_s > mild.time_s + 300.0, "{degc}: {coarse:?} {rests_s}");
        assert!((coarse.time_s / seconds - 1.0).abs() < 0.03, "{degc}: {} against {seconds}", coarse.time_s);
        assert!((coarse.energy_wh / energy_wh - 1.0).abs() < 5e-3, "{degc}: {} against {energy_wh}", coarse.energy_wh);
    }
}

#[test]
fn a_pack_that_stays_too_hot_or_too_cold_is_never_charged() {
    let pack = model("explorer-3s1p-1320mah");
    for (degc, why, reaches_soc) in [
        (-1.0, Trip::UnderTemperatureCharge, 0.09..0.1),
        // It warms itself, and cools down to 41 °C at best, where 40 is asked for.
        (41.0, Trip::OverTemperatureCharge, 0.2..0.97),
        (46.0, Trip::OverTemperatureCharge, 0.09..0.1),
    ] {
        let start = Start { temperature_degc: degc, ..Start::at_soc(0.1) };
        let charge = charge_within(&mut Run::new(Arc::clone(&pack), start), 0.98, f64::INFINITY, true, |_, _, _| {});
        assert_eq!((charge.stopped, charge.time_s), (Some(why), TIME_MAX_S), "{degc}: {charge:?}");
        assert!(reaches_soc.contains(&charge.soc), "{degc}: {charge:?}");
        assert!(charged_behind_protection(&pack, degc).0 >= S_PER_DAY, "{degc}");
    }
}

/// Robots' own loads may take all that there is.
#[test]
fn a_pack_for_which_nothing_is_left_is_never_charged() {
    let pack = model("explorer-3s1p-1320mah");
    let at = |power_w_max: f64, soc: f64| {
        charge_within(&mut Run::new(Arc::clone(&pack), Start::at_soc(soc)), 0.98, power_w_max, false, |_, _, _| {})
    };
    assert_eq!(at(0.0, 0.1), Charge { energy_wh: 0.0, time_s: TIME_MAX_S, soc: at(0.0, 0.1).soc, stopped: None });
    assert!((at(0.0, 0.1).soc - 0.1).abs() < 1e-3 && at(0.0, 0.99).time_s == 0.0);
    // 13 Wh at 1 W.
    assert!((11.0..15.0).contains(&(at(1.0, 0.1).time_s / S_PER_H)), "{:?}", at(1.0, 0.1));
}

/// A deviation a hundred times smaller must come out a hundred times smaller.
#[test]
fn usable_energy_is_smooth_in_what_it_hangs_on() {
    for (name, power_w) in [("explorer-3s1p-1320mah", 4.0), ("mds-3s4p-7600mah", 30.0), ("roomba-4s2p-2640mah", 15.0)] {
        let pack = model(name);
        let usable_wh = |soc: f64| discharge(&mut Run::new(Arc::clone(&pack), Start::at_soc(soc)), power_w).energy_wh;
        for soc in [0.3, 0.511, 0.62, 0.7477, 0.83, 0.9] {
            let slope = |step: f64| (usable_wh(soc + step) - usable_wh(soc - step)) / (2.0 * step);
            assert!((slope(1e-4) / slope(1e-2) - 1.0).abs() < 0.03, "{name} at {soc}: {} and {} Wh", slope(1e-4), slope(1e-2));
        }
    }
}

#[test]
fn an_empty_pack_has_nothing_left_and_a_full_one_takes_nothing() {
    let pack = model("explorer-3s1p-1320mah");
    assert!(discharge(&mut Run::new(Arc::clone(&pack), Start::at_soc(0.0)), 4.0).energy_wh < 0.05);
    assert_eq!(charge(&mut Run::new(pack, Start::at_soc(1.0)), 1.0).energy_wh, 0.0);
}

#[test]
fn the_docked_robots_own_load_equals_the_robot_model_at_standstill() {
    let standstill_w = power_w(&model("explorer-robot"), &[]).value;
    let station = model("mds-station");
    let own_load_w = station.parameter("robot_own_load", "own_load_w").unwrap().value;
    assert!((standstill_w - own_load_w).abs() < 0.01, "{standstill_w} and {own_load_w}");
}

#[test]
fn a_stations_power_is_explained_to_the_last_watt() {
    let mut run = Run::new(model("mds-station"), Start::at_soc(0.0));
    run.channels[Channel::ChargePowerW] = 40.0;
    run.channels[Channel::RobotsDocked] = 3.0;
    let shares: f64 = run.step_explained(1.0).iter().map(|(_, share)| share).sum();
    assert!((40.0 + shares - run.channels[Channel::PackPowerW]).abs() < 1e-12);
    // By hand: ((40 + 3 x 4.19) / 0.88) / 0.84 + 0.2 + 5.5.
    assert!((run.channels[Channel::PackPowerW] - ((40.0 + 12.57) / 0.88 / 0.84 + 5.7)).abs() < 1e-9);
}

#[test]
fn what_an_ammeter_shows_changes_nothing_of_what_is_delivered() {
    let true_one = model("explorer-3s1p-1320mah");
    let of = |pack: &Arc<Model>| {
        let steady = discharge(&mut Run::new(Arc::clone(pack), Start::at_soc(0.9)), 4.0);
        (steady.energy_wh, steady.time_s)
    };
    let (energy_wh, time_s) = of(&true_one);
    for (effect, value) in [("current_gain", 1.05), ("current_offset", 0.02)] {
        let off = true_one.with(effect).unwrap();
        let values = off.parameters().iter().map(|own| if own.effect == effect { value } else { own.value }).collect::<Vec<_>>();
        let told = of(&Arc::new(off.with_values(&values)));
        let apart = [told.0 / energy_wh, told.1 / time_s].map(|share| (share - 1.0).abs());
        assert!(apart.iter().all(|apart| *apart < 1e-6), "{effect}: {told:?} of {energy_wh} {time_s}");
    }
}
