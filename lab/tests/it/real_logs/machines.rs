//! Motors and converters.

use super::rows::{Csv, write};
use super::{Set, real};

/// What a winding of the Robotino's 24 V motors is taken to be: nominal, and only a scale for what follows.
const WINDING_OHM: f64 = 5.0;
const VOLT_PER_RADPS: f64 = 0.06;

/// Robotino, an omnidirectional robot on three floors: each run's mean motor currents, as the electric power `I (k omega + R I)` of
/// three motors. The model knows a constant.
pub fn robotino() -> Option<Set> {
    let csv = Csv::read(&real("robotino_omni_surface_motor_current")?.join("steady_state_summary.csv"));
    let model = "schema = 1\nsystem = \"robot\"\nname = \"robotino\"\nsource = \"github BrOleg5/research-wheel-slippage (Apache-2.0)\"\n\
                 [sensor.power_w]\nsigma = 0.1\n[[effect]]\nid = \"idle\"\nidle_w = { value = 3.0, source = \"guess\", free = true }\n";
    let mut set = Set::new("robotino, every second direction held out", model);
    let motor_w = |row: &Vec<String>, motor: u32| {
        let current_a = csv.number(row, &format!("m{motor}_current_a")).abs();
        let speed_radps = csv.number(row, &format!("m{motor}_speed_rad_s")).abs();
        current_a * (VOLT_PER_RADPS * speed_radps + WINDING_OHM * current_a)
    };
    let class = |row: &Vec<String>| ["table", "brown", "gray"].iter().position(|floor| *floor == csv.text(row, "surface")).unwrap() as f64;
    for part in [0, 1] {
        let own: Vec<&Vec<String>> = csv.cells.iter().skip(part).step_by(2).collect();
        // The first row of a log says what comes before it and never counts.
        let rows: Vec<Vec<f64>> = [own[0]]
            .into_iter()
            .chain(own.iter().copied())
            .enumerate()
            .map(|(place, row)| {
                let power_w = (1..=3).map(|motor| motor_w(row, motor)).sum();
                vec![10.0 * place as f64, csv.number(row, "set_speed_mps"), class(row), power_w]
            })
            .collect();
        let log = write(set.directory.path(), &format!("runs{part}"), "time_s,speed_mps,floor_class,power_w", &rows, "");
        if part == 0 { set.train.push(log) } else { set.holdout.push(log) }
    }
    Some(set)
}

#[test]
fn a_robots_motors_tell_its_floors_apart() {
    let Some(set) = robotino() else { return };
    let answer = set.discover();
    assert_eq!(answer.names("selected").first(), Some(&"floor"));
    // Another program, in amperes: a constant 0.63, with the floor 0.17.
    for (before, after) in [answer.train(), answer.held_out()] {
        assert!(after < 0.17 / 0.63 * before, "{before} {after}");
    }
}

/// Input of the converter: not recorded, within what its line regulation was measured at; it scales what follows.
const INPUT_V: f64 = 20.0;

/// A 12 V buck-boost supply under five loads, as a station that feeds bays through a loss in proportion.
pub fn dcdc() -> Option<Set> {
    let csv = Csv::read(&real("dcdc_12v_buckboost")?.join("load_regulation.csv"));
    let model = "schema = 1\nsystem = \"station\"\nname = \"buckboost\"\nsource = \"github jorge-pais/PE_universal12Vsupply (CERN-OHL-P-2.0)\"\n\
                 [sensor.pack_power_w]\nsigma = 0.05\nquantum = 0.2\n[[effect]]\nid = \"charger_efficiency\"\n\
                 efficiency = { value = 0.9, sigma = 0.1, source = \"guess\", free = true }\n";
    let mut set = Set::new("DC/DC, five loads", model);
    let row = |(place, row): (usize, &Vec<String>)| {
        vec![10.0 * place as f64, csv.number(row, "pout_w"), INPUT_V * csv.number(row, "iin_a"), INPUT_V]
    };
    let rows: Vec<Vec<f64>> = [&csv.cells[0]].into_iter().chain(&csv.cells).enumerate().map(row).collect();
    set.train.push(write(set.directory.path(), "loads", "time_s,charge_power_w,pack_power_w,pack_voltage_v", &rows, ""));
    Some(set)
}

#[test]
fn a_converter_takes_something_without_a_load() {
    let Some(set) = dcdc() else { return };
    let answer = set.discover();
    assert!(answer.names_any(&["converter_efficiency", "hotel"]), "{}", answer.json["selected"]);
    // Another program: in proportion 60 mA, with a constant 4.
    let (before, after) = answer.train();
    assert!((before / INPUT_V - 60e-3).abs() < 1e-3 && after < INPUT_V * 4.5e-3, "{before} {after}");
}
