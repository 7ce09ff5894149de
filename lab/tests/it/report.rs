//! The HTML report says what the comparison says.

use std::fs;

use crate::commands::lab;

const CELL: &str = "enertech-lco-2280mah";

#[test]
fn the_report_holds_the_numbers_of_the_comparison_and_loads_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("report.html");
    let logs = ["--log", "discharge-0p5c.csv", "discharge-1c.csv"];
    let compared = lab(&[&["compare", "--format", "json", "--model", CELL], &logs[..]].concat());
    let more = ["--holdout", "discharge-0p1c.csv", "--date", "2026-01-31", "-o", path.to_str().unwrap()];
    let outcome = lab(&[&["report", "--format", "json", "--model", CELL], &logs[..], &more].concat());
    assert_eq!((compared.code, outcome.code), (1, 1), "{}", outcome.stderr);
    assert_eq!(outcome.json()["comparison"], compared.json());
    let text = fs::read_to_string(&path).unwrap();
    assert!(!text.contains("http"));
    assert!(text.contains("2026-01-31") && text.contains("discharge-0p1c"));
    for error in compared.json()["errors"].as_array().unwrap() {
        let cell = |value: String| assert!(text.contains(&format!(">{value}</td>")), "{value} is not in the report");
        cell(error["rows"].to_string());
        cell(format!("{:.2}", error["ratio"].as_f64().unwrap()));
        cell(lab::report::quantity::quantity(error["rms"].as_f64().unwrap(), "V"));
    }
    let found = &outcome.json()["discovery"];
    for file in found["files"].as_array().unwrap() {
        let rms = lab::report::quantity::quantity(file["found"].as_f64().unwrap(), "V");
        assert!(text.contains(&format!(">{rms}</td>")), "{rms} of the file found is not in the report");
    }
    // The held-out discharge is worse with what was found, and where it begins has no place in the file.
    assert!(text.contains("<strong>Where the model found is worse, ") && text.contains("A model file cannot hold what follows"));
    for one in found["left_out"].as_array().unwrap() {
        let what = one["what"].as_str().unwrap();
        assert!(text.contains(&format!("<li>{what}: ")), "{what} is not in the report");
    }
    for words in compared.json()["words"].as_array().unwrap() {
        assert!(text.contains(words.as_str().unwrap()), "{words} is not in the report");
    }
}

#[test]
fn two_runs_write_the_same_report() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str| {
        let path = directory.path().join(name);
        lab(&["report", "--model", CELL, "--log", "discharge-1c.csv", "-o", path.to_str().unwrap()]);
        fs::read(path).unwrap()
    };
    assert_eq!(write("a.html"), write("b.html"));
}

/// Who opens a report tomorrow does not see what stood in the terminal today.
#[test]
fn what_was_noticed_in_the_logs_stands_in_the_report() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    // A row every 5 s, one of them twice, and half an hour that is not there.
    let times_s = (0..100).map(|row| 5 * row).chain([495]).chain((0..100).map(|row| 2295 + 5 * row));
    let rows: String = times_s.map(|time_s| format!("{time_s},1.0,3.9,25\n")).collect();
    fs::write(at("gap.csv"), format!("time_s,current_a,voltage_v,ambient_degc\n{rows}")).unwrap();
    let outcome =
        lab(&["report", "--no-discover", "--soc-initial", "0.9", "--model", CELL, "--log", &at("gap.csv"), "-o", &at("report.html")]);
    let told: Vec<&str> = outcome.stderr.lines().filter_map(|line| line.strip_prefix("lab: note: ")).collect();
    let told: Vec<&str> = told.into_iter().filter(|note| note.contains("gap.csv: ")).collect();
    assert!(told.len() >= 2, "{}", outcome.stderr);
    let text = fs::read_to_string(at("report.html")).unwrap();
    assert!(told.iter().all(|note| text.contains(&note.replace('"', "&quot;"))), "{told:#?}");
}
