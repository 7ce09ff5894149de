//! Logs that another number of the model, or of a sensor, would explain without any effect.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::infer::other_numbers::{OtherNumber, other_numbers};
use lab::infer::stated::{Roughly, within_stated};
use lab::measurement::{Log, LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

/// A cell whose resistance is stated, and not to be fitted.
fn cell(resistance_ohm: f64) -> Arc<Model> {
    made_up::model(&format!(
        "[sensor.voltage_v]\nsigma = 1e-3\n[sensor.current_a]\nsigma = 1e-3\n[uncertainty]\nsoc_initial_sigma = 5e-3\n\
         [[effect]]\nid = \"ohmic\"\nresistance_ohm = {{ value = {resistance_ohm}, source = \"t\" }}\n"
    ))
}

/// Logs of a truth, whose voltage is read `late` rows late.
fn logs(base: &Arc<Model>, truth: &Arc<Model>, late: usize) -> Vec<Prepared> {
    let rows: String = (0..1800).map(|row| format!("{row},{},3.9\n", [1.5, 0.0, 0.5, -0.8, 2.1][row / 50 % 5])).collect();
    let facts = LogFacts { soc_initial: Some(0.95), ..LogFacts::default() };
    let log = read_log("blocks.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), facts).unwrap();
    let seen = predict(truth, &prepare(truth, &log).unwrap(), &truth.values());
    let noisy = |seed: u128| {
        let (mut log, noise, mut random): (Log, _, _) = (log.clone(), Normal::new(0.0, 1e-3).unwrap(), Pcg64::new(seed, 0));
        let volts = seen.of(Channel::VoltageV).unwrap();
        let read = (0..volts.len()).map(|row| volts[row.saturating_sub(late)] + noise.sample(&mut random)).collect();
        log.channels.insert(Channel::VoltageV, read);
        prepare(base, &log).unwrap()
    };
    vec![noisy(1), noisy(2)]
}

fn told(base: &Arc<Model>, logs: &[Prepared]) -> Vec<OtherNumber> {
    let search = search(Arc::clone(base), Arc::new(Evidence::new(base, logs.to_vec())), None);
    other_numbers(base, logs, search.last.told())
}

#[test]
fn a_stated_number_that_is_wrong_is_told_beside_what_stands_in_for_it() {
    let (base, truth) = (cell(0.05), cell(0.08));
    let told = told(&base, &logs(&base, &truth, 0));
    let [number] = &told[..] else { panic!("{told:?}") };
    assert_eq!((&number.numbers[..], number.stated), (&["ohmic.resistance_ohm".to_owned()][..], 0.05));
    assert!((number.found - 0.08).abs() < 4.0 * number.sigma && number.sigma < 1e-4 && number.explained > 0.99, "{number:?}");
}

#[test]
fn a_voltage_that_is_read_two_rows_late_is_told_to_be_late() {
    let base = cell(0.08);
    let told = told(&base, &logs(&base, &base, 2));
    // That the voltage is late or that the current is early is one thing, as long as nothing else is measured.
    let [current, voltage] = &told[..] else { panic!("{told:?}") };
    assert_eq!(voltage.numbers, ["sensor.voltage_v.lag_s"]);
    assert_eq!((&current.numbers[..], current.found), (&["sensor.current_a.lag_s".to_owned()][..], -2.0));
    // The voltage of the first rows is that of the rest before; a delay of whole rows has a kink at its best.
    assert!((voltage.found - 2.0).abs() < 0.05, "{voltage:?}");
}

/// What is told of a station, of which the power into its robots is read so many rows after everything else, in such units and with such an offset.
fn told_of_a_station(late: usize, units: f64, offset_w: f64) -> Vec<OtherNumber> {
    let base = "schema = 1\nsystem = \"station\"\nname = \"t\"\n[sensor.pack_power_w]\nsigma = 0.05\n[[effect]]\nid = \"charger_efficiency\"\n\
                efficiency = { value = 0.88, source = \"t\", sigma = 0.01 }\n[[effect]]\nid = \"robot_own_load\"\n\
                own_load_w = { value = 4.2, source = \"t\" }\n";
    let base = Arc::new(Model::parse("station.toml", base, &|_| Err("no table".to_owned())).unwrap());
    let into_w = |row: usize| f64::from([0, 14, 30, 9, 0, 22][row / 70 % 6]);
    let docked = |row: usize| [0, 1, 2, 1, 1, 2][(row + 35) / 70 % 6];
    let read = |late: usize, units: f64, offset_w: f64| {
        let shown = |row: usize| units * into_w(row.saturating_sub(late)) + offset_w;
        let line = |row: usize| format!("{},{},{},12.0,20\n", 5 * row, shown(row), docked(row));
        let rows: String = (0..1500).map(line).collect();
        let text = format!("time_s,charge_power_w,robots_docked,pack_voltage_v,pack_power_w\n{rows}");
        read_log("station.csv", text.as_bytes(), LogFacts::default()).unwrap()
    };
    let shown = predict(&base, &prepare(&base, &read(0, 1.0, 0.0)).unwrap(), &base.values());
    let (noise, mut random) = (Normal::new(0.0, 0.05).unwrap(), Pcg64::new(1, 0));
    let mut log = read(late, units, offset_w);
    let values = shown.of(Channel::PackPowerW).unwrap().iter().map(|watts| watts + noise.sample(&mut random)).collect();
    log.channels.insert(Channel::PackPowerW, values);
    told(&base, &[prepare(&base, &log).unwrap()])
}

#[test]
fn an_input_that_is_read_late_is_told_to_be_late() {
    let told = told_of_a_station(3, 1.0, 0.0);
    let number = &told[0];
    assert_eq!((&number.numbers[..], number.stated, number.found), (&["sensor.charge_power_w.lag_s".to_owned()][..], 0.0, 15.0));
    assert!(number.explained > 0.99 && (number.sigma - 5.0 / 12.0_f64.sqrt()).abs() < 0.01, "{number:?}");
}

/// Milliwatts: no way leads there from watts, step by step.
#[test]
fn an_input_that_is_read_in_another_unit_is_told_to_be() {
    let told = told_of_a_station(0, 1000.0, 0.0);
    let gain = told.iter().find(|number| number.numbers == ["gain of charge_power_w"]).unwrap_or_else(|| panic!("{told:?}"));
    assert!((gain.found - 1000.0).abs() < 4.0 * gain.sigma && gain.sigma < 10.0 && gain.explained > 0.99, "{gain:?}");
}

#[test]
fn an_input_that_is_read_with_an_offset_is_told_to_be() {
    let told = told_of_a_station(0, 1.0, 2.0);
    let offset = told.iter().find(|number| number.numbers == ["offset of charge_power_w"]).unwrap_or_else(|| panic!("{told:?}"));
    assert!((offset.found - 2.0).abs() < 4.0 * offset.sigma && offset.sigma < 0.1 && offset.explained > 0.99, "{offset:?}");
}

#[test]
fn an_effect_that_no_number_stands_in_for_is_told_alone() {
    let base = cell(0.05);
    let mut truth = base.with("hysteresis").unwrap();
    truth = truth.with("rc1").unwrap();
    assert_eq!(told(&base, &logs(&base, &Arc::new(truth), 0)), []);
}

/// Two numbers that are stated with deviations, and not to be fitted.
fn roughly_stated(resistance_ohm: f64, tau_s: f64) -> Arc<Model> {
    made_up::model(&format!(
        "[sensor.voltage_v]\nsigma = 1e-3\n[[effect]]\nid = \"ohmic\"\nresistance_ohm = {{ value = {resistance_ohm}, source = \"t\", sigma = 4e-3 }}\n\
         [[effect]]\nid = \"rc1\"\nresistance_ohm = {{ value = 0.03, source = \"t\" }}\ntau_s = {{ value = {tau_s}, source = \"t\", sigma = 8.0 }}\n"
    ))
}

#[test]
fn numbers_that_are_each_off_by_no_more_than_is_stated_are_told_together() {
    let within = |truth: Arc<Model>| -> Vec<Roughly> {
        let base = roughly_stated(0.05, 40.0);
        let logs = logs(&base, &truth, 0);
        let search = search(Arc::clone(&base), Arc::new(Evidence::new(&base, logs.clone())), None);
        within_stated(&base, &logs, search.last.told())
    };
    let told = within(roughly_stated(0.057, 52.0));
    let [resistance, tau] = &told[..] else { panic!("{told:?}") };
    assert_eq!((&*resistance.number, resistance.stated, resistance.stated_sigma), ("ohmic.resistance_ohm", 0.05, 4e-3));
    assert!((resistance.found - 0.057).abs() < 4.0 * resistance.sigma && resistance.sigma < 1e-3, "{resistance:?}");
    assert!((tau.found - 52.0).abs() < 4.0 * tau.sigma && tau.sigma < 2.0, "{tau:?}");
    // Seven deviations are another resistance, and not what was said of it.
    assert_eq!(within(roughly_stated(0.08, 52.0)), Vec::new());
    // Readings that jump by themselves are nothing that numbers explain, and no effect does: then nothing is told either.
    let base = roughly_stated(0.05, 40.0);
    let mut logs = logs(&base, &base, 0);
    for target in logs.iter_mut().flat_map(|log| &mut log.targets) {
        target.observed.iter_mut().step_by(7).for_each(|volts| *volts -= 0.02);
    }
    let search = search(Arc::clone(&base), Arc::new(Evidence::new(&base, logs.clone())), None);
    assert_eq!(within_stated(&base, &logs, search.last.told()), Vec::new());
}

/// A robot that rolls, climbs and speeds up with one mass, and drags.
fn cart(mass_kg: f64, force_n: f64) -> Arc<Model> {
    let mass = format!("mass_kg = {{ value = {mass_kg}, source = \"scale\", sigma = 0.3 }}");
    let text = format!(
        r#"
schema = 1
system = "robot"
name = "cart"
[sensor.power_w]
sigma = 0.1
[[effect]]
id = "idle"
idle_w = {{ value = 12.0, source = "t" }}
[[effect]]
id = "rolling"
rolling_coefficient = {{ value = 0.018, source = "t", sigma = 0.002 }}
{mass}
[[effect]]
id = "slope"
{mass}
[[effect]]
id = "acceleration"
{mass}
[[effect]]
id = "dry_friction"
force_n = {{ value = {force_n}, source = "t", sigma = 0.5 }}
"#
    );
    Arc::new(Model::parse("cart.toml", &text, &|_| Err("no table".to_owned())).unwrap())
}

fn drives(base: &Arc<Model>, truth: &Arc<Model>) -> Vec<Prepared> {
    let row = |row: usize| {
        let (speed, pitch) = ([0.0, 0.4, 0.9, 1.3, 0.6][row / 40 % 5], [0.0, 0.03, -0.02, 0.06][row / 90 % 4]);
        format!("{row},{speed},0,{pitch},{},0,20\n", [0.0, 0.1, -0.1, 0.2][row / 17 % 4])
    };
    let header = "time_s,speed_mps,yaw_rate_radps,pitch_rad,accel_mps2,payload_kg,power_w\n";
    let text = format!("{header}{}", (0..2000).map(row).collect::<String>());
    let log = read_log("drive.csv", text.as_bytes(), LogFacts::default()).unwrap();
    let shown = predict(truth, &prepare(truth, &log).unwrap(), &truth.values());
    let noisy = |seed: u128| {
        let (mut log, noise, mut random): (Log, _, _) = (log.clone(), Normal::new(0.0, 0.1).unwrap(), Pcg64::new(seed, 0));
        let values = shown.of(Channel::PowerW).unwrap().iter().map(|watts| watts + noise.sample(&mut random)).collect();
        log.channels.insert(Channel::PowerW, values);
        prepare(base, &log).unwrap()
    };
    vec![noisy(1), noisy(2)]
}

/// The masses of rolling, slope and acceleration are one number. Were each another, that of rolling alone could stand in for a force that is
/// wrong, and that is not what a mass in the file would do.
#[test]
fn a_number_that_stands_in_several_places_is_told_as_the_one_that_it_is() {
    let all = |base: Arc<Model>, truth: Arc<Model>| -> Vec<(String, f64, f64)> {
        let told = told(&base, &drives(&base, &truth));
        told.into_iter().map(|number| (number.numbers.join(" "), number.found, number.sigma)).collect()
    };
    let of_force = all(cart(25.0, 7.0), cart(25.0, 4.0));
    assert!(of_force.iter().any(|(name, found, _)| name == "dry_friction.force_n" && (found - 4.0).abs() < 0.05), "{of_force:?}");
    assert!(!of_force.iter().any(|(name, ..)| name.contains("mass_kg")), "{of_force:?}");
    let of_mass = all(cart(25.0, 4.0), cart(30.0, 4.0));
    let mass = of_mass.iter().find(|(name, ..)| name == "rolling.mass_kg slope.mass_kg acceleration.mass_kg");
    assert!(mass.is_some_and(|(_, found, sigma)| (found - 30.0).abs() < 4.0 * sigma && *sigma < 0.1), "{of_mass:?}");
}

/// A force that is six deviations off is not within what is stated, also where the masses, left to themselves, could be anything.
#[test]
fn what_is_stated_holds_each_number_to_its_own_deviation() {
    let within = |force_n: f64| {
        let (base, truth) = (cart(25.0, 7.0), cart(25.0, force_n));
        let logs = drives(&base, &truth);
        let search = search(Arc::clone(&base), Arc::new(Evidence::new(&base, logs.clone())), None);
        within_stated(&base, &logs, search.last.told())
    };
    assert_eq!(within(4.0), Vec::new());
    let told = within(6.2);
    let force = told.iter().find(|one| one.number == "dry_friction.force_n").unwrap_or_else(|| panic!("{told:?}"));
    assert!((force.found - 6.2).abs() < 3.0 * force.sigma && force.sigma < 0.5, "{told:?}");
    assert!(told.iter().all(|one| (one.found - one.stated).abs() <= 3.0 * one.stated_sigma), "{told:?}");
}
