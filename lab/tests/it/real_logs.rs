//! `lab discover` on measured logs that are too large to ship: looked for in `shared/data` beside the
//! project, left out where they are not.

use std::path::{Path, PathBuf};

use crate::commands::lab_in;

/// The folder of one set of logs; none, with a word about it, where it is not there.
fn real(set: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(set);
    let there = folder.is_dir();
    if !there {
        eprintln!("left out: {} is not there", folder.display());
    }
    there.then_some(folder)
}

/// Four discharges of a Samsung INR18650-30Q (ARTS-Laboratory, CC BY-SA 4.0), one of them held out. The
/// model knows the cell's open-circuit voltage and one resistance; the best that another program
/// left on the discharges that it was *fitted* to, with four effects, is 7.9 mV.
#[test]
fn a_discharge_that_was_never_seen_is_predicted_better_than_others_fit_theirs() {
    let Some(logs) = real("samsung_inr18650_30q_3ah") else { return };
    let directory = tempfile::tempdir().unwrap();
    let known = energy::built_in("samsung-inr18650-30q-3ah").unwrap();
    let table = Path::new(env!("CARGO_MANIFEST_DIR")).join("../energy/params");
    let facts = known.split("[[effect]]").next().unwrap().replace("ocv_csv = \"", &format!("ocv_csv = \"{}/", table.display()));
    let base = directory.path().join("base.toml");
    std::fs::write(&base, facts + "[[effect]]\nid = \"ohmic\"\n").unwrap();
    let from = ["discover", "--model", base.to_str().unwrap(), "--target", "voltage_v", "--format", "json", "--every", "10"];
    let with = ["--soc-initial", "1", "--column", "temperature_degc=temperature_c"];
    let train = ["--log", "discharge_s001_1c.csv", "discharge_s001_2c.csv", "discharge_s001_4c.csv"];
    let outcome = lab_in(&logs, &[&from[..], &with, &train, &["--holdout", "discharge_s001_3c.csv"]].concat());
    assert!(outcome.code < 2, "{}", outcome.stderr);
    let json = outcome.json();
    let held_out = |rung: &serde_json::Value| rung["holdout_rms"]["voltage_v"].as_f64().unwrap();
    let ladder = json["ladder"].as_array().unwrap();
    let (first, last) = (held_out(&ladder[0]), held_out(ladder.last().unwrap()));
    assert!(last < 7.9e-3 && last < 0.2 * first, "{first} V, {last} V: {}", json["selected"]);
}
