//! Where an error lies is said for all three systems, on logs with an error at a known place.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;

use crate::commands::{Outcome, lab_in};

/// Compares a log with a model, both given as text.
fn compare(model: &str, log: &str, more: &[&str]) -> Outcome {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("model.toml"), model).unwrap();
    fs::write(directory.path().join("run.csv"), log).unwrap();
    let arguments = ["compare", "--format", "json", "--model", "model.toml", "--log", "run.csv"];
    lab_in(directory.path(), &[&arguments[..], more].concat())
}

/// The sentence about the worst place, and the names of all regimes.
fn place(outcome: &Outcome) -> (String, Vec<String>) {
    assert_eq!(outcome.code, 1, "{}", outcome.stderr);
    let json = outcome.json();
    let mut names: Vec<String> =
        json["regimes"].as_array().unwrap().iter().map(|band| band["dimension"].as_str().unwrap().to_owned()).collect();
    names.dedup();
    (json["words"][1].as_str().unwrap().to_owned(), names)
}

/// Noise of a known seedless kind: fast, small, and never the same for long.
fn wiggle(k: u32) -> f64 {
    0.01 * (f64::from(k) * 1.3).sin() + 0.01 * (f64::from(k * k % 97) / 97.0 - 0.5)
}

#[test]
fn a_battery_that_fails_when_low_and_loaded() {
    let model = "schema = 1\nsystem = \"battery\"\nname = \"cell\"\n[sensor.voltage_v]\nsigma = 0.001\n[battery]\nseries = 1\nparallel = 1\n\
                 capacity_ah = 1.0\nfull_v_per_cell = 4.0\neod_v_per_cell = 3.0\ncharge_current_a = 1.0\ncharge_cutoff_a = 0.1\n\
                 ocv = { soc = [0.0, 1.0], voltage_v = [3.0, 4.0] }\n";
    let (mut soc, mut log) = (1.0, "time_s,current_a,voltage_v\n0,0,4.0\n".to_owned());
    for k in 1..1400_u32 {
        let current_a = if k % 60 < 30 { 0.5 } else { 0.0 };
        soc -= current_a * 10.0 / 3600.0;
        let lacks_v = if soc < 0.15 && current_a > 0.0 { 0.05 } else { 0.0 };
        let _ = writeln!(log, "{},{current_a},{}", k * 10, 3.0 + soc - lacks_v + 0.1 * wiggle(k));
        if soc < 0.03 {
            break;
        }
    }
    let (words, names) = place(&compare(model, &log, &["--soc-initial", "1"]));
    assert!(words.contains("lies below 15 % SoC under load, in"), "{words}");
    // One log, no temperature, no cycles: those regimes are not there.
    assert_eq!(names, ["soc", "state", "current", "since step"]);
}

#[test]
fn a_robot_that_fails_uphill() {
    let model = "schema = 1\nsystem = \"robot\"\nname = \"robot\"\n[sensor.power_w]\nsigma = 0.02\n\
                 [[effect]]\nid = \"idle\"\nidle_w = { value = 4.0, source = \"test\" }\n";
    let mut log = "time_s,power_w,speed_mps,pitch_rad,camera_on,payload_kg,floor_class\n".to_owned();
    for k in 0..2000_u32 {
        let speed_mps = if k % 50 < 20 { 0.0 } else { 0.25 };
        let pitch_rad = 0.05 * f64::from(k / 250 % 3) - 0.05;
        let camera = k / 130 % 2;
        let climb_w = if pitch_rad > 0.01 && speed_mps > 0.0 { 1.5 } else { 0.0 };
        let _ = writeln!(log, "{k},{},{speed_mps},{pitch_rad},{camera},0,0", 4.0 + climb_w + wiggle(k));
    }
    let (words, names) = place(&compare(model, &log, &[]));
    assert!(words.contains("uphill") && words.contains("while driving"), "{words}");
    assert_eq!(names, ["speed", "slope", "camera"]);
}

#[test]
fn a_station_that_fails_while_its_lift_moves() {
    let model = energy::built_in("mds-station").unwrap();
    let header = "time_s,pack_power_w,charge_power_w,robots_docked,robots_charging,bay_squared_current_a2,lift_active,selector_events\n";
    let line = |k: u32| {
        let lift = u32::from(k % 200 < 20);
        let charge_w = if k < 800 { 10.0 } else { 10.0 * (-f64::from(k - 800) / 400.0).exp() };
        format!(
            "{},{},{charge_w},1,1,0,{lift},0\n",
            5 * k,
            30.0 + 60.0 * f64::from(lift) + wiggle(k) + 0.02 * (f64::from(k) / 40.0 * TAU).sin()
        )
    };
    let log = (0..1600).map(line).fold(header.to_owned(), |log, line| log + &line);
    let outcome = compare(model, &log, &[]);
    let json = outcome.json();
    let names: Vec<&str> = json["regimes"].as_array().unwrap().iter().map(|band| band["dimension"].as_str().unwrap()).collect();
    assert!(names.contains(&"lift") && names.contains(&"phase") && names.contains(&"charge power"), "{names:?}");
    assert!(!names.contains(&"docked"), "one robot is always docked");
    let phases: Vec<&str> = json["regimes"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|band| band["dimension"] == "phase")
        .map(|band| band["band"].as_str().unwrap())
        .collect();
    assert_eq!(phases, ["CC", "CV"]);
}
