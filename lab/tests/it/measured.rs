//! The shipped Enertech discharges against `tests/reference/ohmic_least_squares.py`, which printed:
//!
//! ```text
//! ohmic ohm: 0.067892
//!   0p5c: rows 731, RMS without resistance 80.287 mV, with 25.695 mV
//!   1c: rows 362, RMS without resistance 161.576 mV, with 41.623 mV
//! ohmic_soc ohm: 0.178540, 0.120622, 0.089910, 0.073173, 0.063753, 0.060260, 0.047043
//!   0p5c: rows 731, RMS without resistance 80.287 mV, with 5.186 mV
//!   1c: rows 362, RMS without resistance 161.576 mV, with 6.309 mV
//! ```

use std::fs;

use serde_json::Value;

use crate::commands::{lab, lab_in, measured};

const BOTH: [&str; 3] = ["--log", "discharge-0p5c.csv", "discharge-1c.csv"];

fn with<'a>(first: &[&'a str], rest: &[&'a str]) -> Vec<&'a str> {
    first.iter().chain(&BOTH).chain(rest).copied().collect()
}

fn close(value: &Value, expected: f64, tolerance: f64) {
    let value = value.as_f64().unwrap();
    assert!((value - expected).abs() <= tolerance, "{value} instead of {expected}");
}

#[test]
fn compare_agrees_with_numpy_and_says_where_the_error_lies() {
    let outcome = lab(&with(&["compare", "--model", "enertech-lco-2280mah"], &["--format", "json"]));
    assert_eq!(outcome.code, 1, "{}", outcome.stderr);
    let json = outcome.json();
    assert_eq!(json["verdict"], "leaves_error");
    assert_eq!((&json["errors"][0]["rows"], &json["errors"][1]["rows"]), (&Value::from(731), &Value::from(362)));
    // The built-in resistance is rounded to 0.0679 ohm, which moves RMS by less than a microvolt.
    close(&json["errors"][0]["rms"], 25.695e-3, 2e-6);
    close(&json["errors"][1]["rms"], 41.623e-3, 2e-6);
    let words = json["words"].as_array().unwrap();
    assert!(words.iter().any(|words| words.as_str().unwrap().contains("lies below 10 % SoC")), "{words:?}");
    let shares: f64 =
        json["regimes"].as_array().unwrap().iter().filter(|r| r["dimension"] == "soc").map(|r| r["share"].as_f64().unwrap()).sum();
    assert!((shares - 1.0).abs() < 1e-9);
}

#[test]
fn fit_of_r0_agrees_with_numpy_and_changes_only_its_numbers() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("fitted.toml");
    let out = out.to_str().unwrap();
    let outcome = lab(&with(&["fit", "--model", "enertech-lco-2280mah"], &["-o", out, "--date", "2026-11-21", "--format", "json"]));
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let json = outcome.json();
    close(&json["parameters"][0]["value"], 0.067_892, 1e-6);
    close(&json["logs"][0]["rms_after"], 25.695e-3, 1e-6);
    close(&json["logs"][1]["rms_after"], 41.623e-3, 1e-6);
    // The residuals of so poor a model follow each other all along: 1093 rows are worth a few.
    assert!(json["logs"][0]["lag1"].as_f64().unwrap() > 0.95);
    assert!(json["parameters"][0]["sigma"].as_f64().unwrap() > 5e-3);

    let (before, after) = (energy::built_in("enertech-lco-2280mah").unwrap(), fs::read_to_string(out).unwrap());
    let changed: Vec<&str> = after.lines().filter(|line| !before.lines().any(|old| old == *line)).collect();
    assert_eq!(changed.len(), 3, "{changed:#?}");
    assert!(changed[0].starts_with("# Points of ") && changed[1].starts_with("ocv = { soc = [0, 0.005,"), "{changed:#?}");
    let source =
        format!("source = \"fitted by lab {} on discharge-0p5c, discharge-1c, 2026-11-21\", free = true }}", env!("CARGO_PKG_VERSION"));
    assert!(changed[2].starts_with("resistance_ohm = { value = 0.067892") && changed[2].ends_with(&source), "{changed:#?}");

    let again = lab(&with(&["compare", "--model", out], &["--format", "json"]));
    close(&again.json()["errors"][0]["rms"], 25.695e-3, 1e-6);
}

#[test]
fn fit_of_resistance_over_soc_agrees_with_numpy_and_the_error_falls() {
    let directory = tempfile::tempdir().unwrap();
    let text = energy::built_in("enertech-lco-2280mah").unwrap();
    let text = text.split("[[effect]]").next().unwrap().to_owned() + "[[effect]]\nid = \"ohmic_soc\"\n";
    let table = "enertech-lco-2280mah-ocv.csv";
    fs::write(directory.path().join("cell.toml"), text).unwrap();
    fs::write(directory.path().join(table), energy::built_in(table).unwrap()).unwrap();
    let logs = ["discharge-0p5c.csv", "discharge-1c.csv"].map(|log| measured().join(log).display().to_string());
    let common =
        ["fit", "--model", "cell.toml", "--free", "ohmic_soc", "--format", "json", "-o", "fitted.toml", "--log", &logs[0], &logs[1]];
    let outcome = lab_in(directory.path(), &common);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let json = outcome.json();
    let expected_ohm = [0.178_540, 0.120_622, 0.089_910, 0.073_173, 0.063_753, 0.060_260, 0.047_043];
    for (parameter, expected_ohm) in json["parameters"].as_array().unwrap().iter().zip(expected_ohm) {
        close(&parameter["value"], expected_ohm, 1e-6);
    }
    for (log, (before, after)) in json["logs"].as_array().unwrap().iter().zip([(80.287e-3, 5.186e-3), (161.576e-3, 6.309e-3)]) {
        close(&log["rms_before"], before, 1e-6);
        close(&log["rms_after"], after, 1e-6);
    }
    // Beside the model it came from, the fitted one goes on naming the table's file.
    assert!(fs::read_to_string(directory.path().join("fitted.toml")).unwrap().contains("ocv_csv = "));
}

#[test]
fn a_prediction_is_a_log_that_the_model_explains() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("predicted.csv");
    let out = out.to_str().unwrap();
    let outcome = lab(&["predict", "--model", "enertech-lco-2280mah", "--log", "discharge-1c.csv", "-o", out]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    assert!(outcome.stdout.contains("706 rows of soc, voltage_v"), "{}", outcome.stdout);
    let first: Vec<String> = fs::read_to_string(out).unwrap().lines().take(2).map(str::to_owned).collect();
    assert_eq!(first[0], "time_s,current_a,temperature_degc,soc,voltage_v");
    let again = lab(&["compare", "--model", "enertech-lco-2280mah", "--log", out, "--soc-initial", "1"]);
    assert_eq!(again.code, 0, "{}{}", again.stdout, again.stderr);
    assert!(again.stdout.contains("The model explains the logs"), "{}", again.stdout);
}

#[test]
fn the_same_fit_twice_prints_the_same() {
    let run = || lab(&with(&["fit", "--model", "enertech-lco-2280mah"], &[])).stdout;
    assert_eq!(run(), run());
}

#[test]
fn the_shipped_facts_are_what_the_logs_show() {
    for log in ["discharge-0p1c.csv", "discharge-0p5c.csv", "discharge-1c.csv"] {
        // Rested at the start: the voltage gives the same state of charge as the fact.
        let text = fs::read_to_string(measured().join(log)).unwrap();
        let first_v: f64 = text.lines().nth(1).unwrap().split(',').nth(2).unwrap().parse().unwrap();
        let model = lab::load_model("enertech-lco-2280mah").unwrap().model;
        assert!((model.battery().ocv.soc(first_v) - 1.0).abs() < 2e-3, "{log}");
    }
}

/// The built-in cell with its table in the text, changed by `edit`, and the two logs.
fn in_a_copy(edit: impl Fn(String) -> String, arguments: &[&str]) -> crate::commands::Outcome {
    let directory = tempfile::tempdir().unwrap();
    let table = "enertech-lco-2280mah-ocv.csv";
    fs::write(directory.path().join(table), energy::built_in(table).unwrap()).unwrap();
    fs::write(directory.path().join("cell.toml"), edit(energy::built_in("enertech-lco-2280mah").unwrap().to_owned())).unwrap();
    let logs = ["discharge-0p5c.csv", "discharge-1c.csv"].map(|log| measured().join(log).display().to_string());
    lab_in(directory.path(), &[arguments, &["--model", "cell.toml", "--log", &logs[0], &logs[1]]].concat())
}

#[test]
fn parameters_that_only_count_together_are_named_together() {
    let outcome = in_a_copy(|text| text + "\n[[effect]]\nid = \"ohmic_soc\"\n", &["fit", "--free", "ohmic_soc"]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let expected = "These logs determine ohmic.resistance_ohm, ohmic_soc.resistance_soc_000_ohm,";
    assert!(outcome.stdout.contains(expected) && outcome.stdout.contains("--fix ohmic.resistance_ohm"), "{}", outcome.stdout);
}

#[test]
fn a_parameter_at_its_bound_is_named() {
    let outcome = in_a_copy(|text| text.replace("free = true", "free = true, max = 0.068").replace("0.0679", "0.03"), &["fit"]);
    assert!(!outcome.stdout.contains("rests on"), "{}", outcome.stdout);
    let outcome = in_a_copy(|text| text.replace("free = true", "free = true, max = 0.05").replace("0.0679", "0.03"), &["fit"]);
    assert!(outcome.stdout.contains("ohmic.resistance_ohm rests on its greatest plausible value, 50.0 mohm"), "{}", outcome.stdout);
}

#[test]
fn without_a_known_sensor_there_is_no_verdict() {
    let without = |text: String| text.replace("[sensor.voltage_v]\nsigma = 5e-4\nquantum = 1e-5\n", "");
    let outcome = in_a_copy(without, &["compare"]);
    assert_eq!(outcome.code, 2, "{}", outcome.stderr);
    assert!(outcome.stdout.contains("No verdict: the model states no sensor floor for voltage_v"), "{}", outcome.stdout);
    // A fit needs no floor for one channel: weights do not move its answer.
    assert_eq!(in_a_copy(without, &["fit"]).code, 0);
}
