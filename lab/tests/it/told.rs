//! What is told of logs that are not as they should be, and how to make them so.

use std::fs;

use crate::commands::{Outcome, lab_in};

const CELL: &str = "enertech-lco-2280mah";

/// Compares logs, given as texts by name, with the built-in cell.
fn compare(logs: &[(&str, &str)], more: &[&str]) -> Outcome {
    with(&["compare"], logs, more)
}

fn with(verb: &[&str], logs: &[(&str, &str)], more: &[&str]) -> Outcome {
    let directory = tempfile::tempdir().unwrap();
    logs.iter().for_each(|(name, text)| fs::write(directory.path().join(name), text).unwrap());
    let names: Vec<&str> = logs.iter().map(|(name, _)| *name).filter(|name| name.ends_with("csv") && !more.contains(name)).collect();
    lab_in(directory.path(), &[verb, &["--model", CELL, "--log"], &names, more].concat())
}

fn tells(outcome: &Outcome, words: &str) {
    assert!(outcome.stderr.contains(words), "`{words}` is not in: {}", outcome.stderr);
}

/// Rows of a slow discharge in steps of a minute, with more columns.
fn rows(range: std::ops::Range<u32>, more: impl Fn(u32) -> String) -> String {
    let row = |row: u32| format!("{},{},{:.3}{}\n", 10 * row, row / 6 % 3, 4.1 - 1e-3 * f64::from(row), more(row));
    range.map(row).collect()
}

#[test]
fn every_column_that_is_missing_is_told_at_once() {
    let log = "time_s,current_ma,voltage_v\n0,1,4.1\n1,1,4.1\n";
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("run.csv"), log).unwrap();
    let outcome = lab_in(directory.path(), &["compare", "--model", "enertech-lco-2280mah-full", "--soc-initial", "1", "--log", "run.csv"]);
    assert_eq!(outcome.code, 2);
    tells(&outcome, "no column `current_a`, which every battery model needs; did you mean `current_ma`?");
    tells(&outcome, " No column `ambient_degc`, which effect `thermal` needs.");
    tells(&outcome, "--column current_a=current_ma/1000");
    tells(&outcome, "`ambient_degc = NUMBER`");
    tells(&outcome, "in run.toml (or ");
    tells(&outcome, "--ambient-degc NUMBER for every log without that column");
}

#[test]
fn a_number_that_stands_for_a_column_which_a_log_has_is_told() {
    let log = format!("time_s,current_a,voltage_v,ambient_degc\n{}", rows(0..50, |_| ",20".to_owned()));
    let outcome = compare(&[("run.csv", &log)], &["--soc-initial", "1", "--column", "ambient_degc=25"]);
    tells(&outcome, "note: run.csv: `ambient_degc`: 25 stands for every row, and the column of that name is not read");
    let outcome = compare(&[("run.csv", &log)], &["--soc-initial", "1", "--column", "cycle_count=25"]);
    assert!(!outcome.stderr.contains("stands for every row"), "{}", outcome.stderr);
}

#[test]
fn a_column_of_the_charge_offers_where_a_log_begins() {
    let log = format!("time_s,current_a,voltage_v,soc\n{}", rows(0..50, |_| ",0.95".to_owned()));
    let outcome = compare(&[("run.csv", &log)], &[]);
    assert_eq!(outcome.code, 2);
    tells(&outcome, "its soc column begins at 0.95: --soc-initial 0.95");
}

#[test]
fn a_reading_that_is_none_in_one_column_is_taken_out_there_alone() {
    let log = format!("time_s,current_a,voltage_v\n{}500,2,0\n{}", rows(0..50, |_| String::new()), rows(51..90, |_| String::new()));
    let given = |more: &[&str]| compare(&[("run.csv", &log)], &[&["--soc-initial", "1", "--format", "json"], more].concat());
    let as_it_is = given(&[]);
    tells(&as_it_is, "such as 0 after 4.051; not removed, unless --missing voltage_v=0 says that this is no measurement (line 52)");
    let without = given(&["--missing", "voltage_v=0"]);
    assert_eq!(without.json()["errors"][0]["rows"].as_u64(), as_it_is.json()["errors"][0]["rows"].as_u64().map(|rows| rows - 1));
    assert!(!without.stderr.contains("`current_a`"), "{}", without.stderr);
    tells(
        &given(&["--missing", "voltage=0"]),
        "--missing voltage=NUMBER (or `missing`): the log has no column `voltage`; did you mean `voltage_v`?",
    );
    let facts = "schema = 1\nsoc_initial = 1.0\nmissing = [-9999, \"voltage_v=0\"]\n";
    let beside = compare(&[("run.csv", &log), ("run.toml", facts)], &["--format", "json"]);
    assert_eq!(beside.json()["errors"][0]["rows"], without.json()["errors"][0]["rows"], "{}", beside.stderr);
}

#[test]
fn rows_that_train_and_held_out_logs_share_are_told() {
    let head = "time_s,current_a,voltage_v\n";
    let seen = format!("{head}{}", rows(0..100, |_| String::new()));
    let held = format!("{head}{}", rows(60..200, |_| String::new()));
    let outcome = with(&["diagnose"], &[("seen.csv", &seen), ("held.csv", &held)], &["--soc-initial", "0.9", "--holdout", "held.csv"]);
    tells(&outcome, "held.csv: 40 of its 140 rows hold the times and readings of seen.csv");
}

#[test]
fn an_epoch_in_milliseconds_is_told() {
    let row = |row: u32| format!("{},0.5,{}\n", 1_764_500_000_000_u64 + 2000 * u64::from(row), 4.1 - 1e-3 * f64::from(row));
    let log = (0..50).map(row).fold("timestamp,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
    let outcome = compare(&[("run.csv", &log)], &["--soc-initial", "1"]);
    tells(&outcome, "map it: --column time_s=timestamp/1000");
    let outcome = compare(&[("run.csv", &log)], &["--soc-initial", "1", "--column", "time_s=timestamp"]);
    tells(&outcome, "are they milliseconds: --column time_s=timestamp/1000?");
}
