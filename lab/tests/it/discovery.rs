//! `lab diagnose`, `discover` and `add` on the shipped Enertech discharges: a cell of which the
//! built-in model knows one resistance only.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::commands::{Outcome, lab, lab_in, measured};

const MODEL: [&str; 2] = ["--model", "enertech-lco-2280mah"];
const LOGS: [&str; 5] = ["--log", "discharge-0p5c.csv", "discharge-1c.csv", "--holdout", "discharge-0p1c.csv"];

fn run(verb: &[&str], more: &[&str]) -> Outcome {
    lab(&[verb, &MODEL, &LOGS, more].concat())
}

/// The keys of an object, and what kind of value each has; of lists the first entry.
fn shape(value: &Value) -> Value {
    match value {
        Value::Object(map) => map.iter().map(|(key, value)| (key.clone(), shape(value))).collect(),
        Value::Array(list) => Value::Array(list.first().map(shape).into_iter().collect()),
        Value::Null => Value::from("null"),
        Value::Bool(_) => Value::from("bool"),
        Value::Number(_) => Value::from("number"),
        Value::String(_) => Value::from("text"),
    }
}

fn pretty(value: &Value) -> String {
    serde_json::to_string_pretty(value).unwrap()
}

#[test]
fn the_answer_has_the_keys_that_programs_rest_on() {
    let outcome = run(&["diagnose"], &["--format", "json"]);
    assert_eq!(outcome.code, 1, "{}", outcome.stderr);
    let json = outcome.json();
    let top: Vec<&str> = json.as_object().unwrap().keys().map(String::as_str).collect();
    insta::assert_snapshot!(top.join(" "));
    insta::assert_snapshot!(pretty(&shape(&json["decision"])));
    // Which effect comes first may change with the method; what is said of each may not.
    let mut first: Vec<&str> = json["ranking"][0].as_object().unwrap().keys().map(String::as_str).collect();
    first.sort_unstable();
    insta::assert_snapshot!(first.join(" "));
    insta::assert_snapshot!(pretty(&shape(&json["ladder"][0])));
    insta::assert_snapshot!(pretty(&shape(&json["residual"])));
}

/// Without its section on the voltage's sensor.
fn cell_without_a_floor(folder: &Path) -> String {
    let text = energy::built_in("enertech-lco-2280mah").unwrap();
    let (before, after) = text.split_once("[sensor.voltage_v]").unwrap();
    let rest = after.split_once("\n[").unwrap().1;
    let path = folder.join("cell.toml");
    fs::write(&path, format!("{before}[{rest}")).unwrap();
    path.display().to_string()
}

#[test]
fn a_floor_that_no_model_states_is_told_as_noise_from_row_to_row() {
    let folder = tempfile::tempdir().unwrap();
    let model = cell_without_a_floor(folder.path());
    let report = folder.path().join("r.html").display().to_string();
    let given = |verb: &[&str]| lab(&[verb, &["--model", &model, "--log", "discharge-1c.csv"]].concat());
    let told = given(&["diagnose"]).stdout;
    assert!(told.contains("\n noise from row to row") && told.contains("since the model states no sensor floor"), "{told}");
    assert!(!told.contains("the sensor floor is"), "{told}");
    given(&["report", "-o", &report]);
    let page = fs::read_to_string(&report).unwrap();
    assert!(page.contains("noise from row to row, ") && !page.contains("sensor floor, "));
    let json = given(&["diagnose", "--format", "json"]).json();
    assert_eq!(json["ladder"][0]["floor_from_rows"], serde_json::json!(["voltage_v"]));
    assert_eq!(json["residual"]["voltage_v"]["floor_from_rows"], true);
    let stated = run(&["diagnose"], &["--format", "json"]).json();
    assert_eq!(stated["ladder"][0].get("floor_from_rows"), None);
}

/// A cell of 2 Ah, with a straight line of voltage over charge and a resistance that the logs shall tell.
const STRAIGHT: &str = r#"schema = 1
system = "battery"
name = "straight"
source = "made up"

[battery]
series = 1
parallel = 1
capacity_ah = 2.0
full_v_per_cell = 4.2
eod_v_per_cell = 3.0
charge_current_a = 2.0
charge_cutoff_a = 0.1
ocv = { soc = [0, 1], voltage_v = [3.2, 4.2] }

[sensor.voltage_v]
sigma = 0.001

[[effect]]
id = "ohmic"
resistance_ohm = { value = 0.05, sigma = 0.02, source = "guess", free = true }
"#;

/// A log of that cell in half hours of current and rest, which below this charge gives so much less.
fn straight(from_soc: f64, below_soc: f64, less_v: f64) -> String {
    let (mut soc, mut text) = (from_soc, "time_s,current_a,voltage_v\n".to_owned());
    for row in 0..360_u32 {
        let current_a = if row / 30 % 2 == 1 { 2.0 } else { 0.0 };
        soc -= current_a * 5.0 / 3600.0 / 2.0;
        // Evenly between -1.7 and 1.7 deviations, which makes one.
        let noise_v = 1e-3 * 3.46 * (f64::from(row * 7919 % 1009) / 1009.0 - 0.5);
        let missing_v = if soc < below_soc { less_v } else { 0.0 };
        text += &format!("{},{current_a},{:.5}\n", 5 * row, 3.2 + soc - 0.05 * current_a - missing_v + noise_v);
    }
    text
}

#[test]
fn held_out_logs_that_are_not_explained_are_told_beside_the_verdict() {
    let folder = tempfile::tempdir().unwrap();
    for (name, text, soc) in [("train", straight(0.9, 0.0, 0.0), 0.9), ("held", straight(0.5, 0.35, 0.02), 0.5)] {
        fs::write(folder.path().join(format!("{name}.csv")), text).unwrap();
        fs::write(folder.path().join(format!("{name}.toml")), format!("schema = 1\nsoc_initial = {soc}\n")).unwrap();
    }
    fs::write(folder.path().join("cell.toml"), STRAIGHT).unwrap();
    let logs = ["--model", "cell.toml", "--log", "train.csv", "--holdout", "held.csv"];
    let given = |verb: &[&str]| lab_in(folder.path(), &[verb, &logs].concat());
    let said = "\nHeld-out logs are not explained: ";
    for verb in ["diagnose", "discover"] {
        let told = given(&[verb]);
        assert_eq!(told.code, 0, "{}{}", told.stdout, told.stderr);
        assert!(told.stdout.contains(&format!("complete. The model explains these logs.{said}")), "{}", told.stdout);
        assert!(told.stdout.contains("of voltage_v at a sensor floor of 1.00 mV") && told.stdout.contains("SoC, in"), "{}", told.stdout);
    }
    assert!(given(&["report", "-o", "r.html"]).stdout.contains(said));
    let json = given(&["discover", "--format", "json"]).json();
    let one = &json["holdout_unexplained"][0];
    assert_eq!((json["verdict"].as_str(), one["channel"].as_str()), (Some("complete"), Some("voltage_v")));
    assert!(one["rms"].as_f64().unwrap() > 5e-3 && one["worst"]["share"].as_f64().unwrap() > 0.5, "{one}");
    // What is explained is not told.
    fs::write(folder.path().join("held.csv"), straight(0.5, 0.0, 0.0)).unwrap();
    assert!(!given(&["discover"]).stdout.contains("Held-out logs"));
    assert_eq!(given(&["discover", "--format", "json"]).json()["holdout_unexplained"], serde_json::json!([]));
}

#[test]
fn what_is_found_is_written_loads_again_and_explains_the_logs_as_well() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("found.toml");
    let out = path.to_str().unwrap();
    let outcome = run(&["discover"], &["-o", out, "--date", "2026-11-21", "--format", "json"]);
    assert!(outcome.code < 2, "{}", outcome.stderr);
    let json = outcome.json();
    assert!(!json["selected"].as_array().unwrap().is_empty(), "{json}");
    let ladder = json["ladder"].as_array().unwrap();
    let rms = |rung: &Value| rung["train_rms"]["voltage_v"].as_f64().unwrap();
    let (first, last) = (rms(&ladder[0]), rms(ladder.last().unwrap()));
    assert!(last < 0.5 * first, "{first} {last}");

    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("2026-11-21") && text.contains("free = true") && text.contains("discharge-0p5c, discharge-1c"), "{text}");
    let compared = lab(&["compare", "--model", out, "--log", "discharge-0p5c.csv", "discharge-1c.csv", "--format", "json"]);
    let errors = compared.json();
    let (squares, rows) = errors["errors"].as_array().unwrap().iter().fold((0.0, 0.0), |(squares, rows), error| {
        let (rms, count) = (error["rms"].as_f64().unwrap(), error["rows"].as_f64().unwrap());
        (squares + rms * rms * count, rows + count)
    });
    let again: f64 = f64::sqrt(squares / rows);
    // The answer says beforehand what the file alone leaves.
    assert!((again / json["file_rms"]["voltage_v"].as_f64().unwrap() - 1.0).abs() < 1e-4, "{again}");
    let file = json["files"].as_array().unwrap().iter().find(|one| one["holdout"] == false).unwrap();
    assert_eq!(file["found"], json["file_rms"]["voltage_v"], "{file}");
    // It is more than at the end of the search, since the logs' own starts stay out of the file.
    assert!(again < 0.5 * first && again > 0.99 * last, "{first}, {last} in the search, {again} by the file");
    let left_out = json["left_out"].as_array().unwrap();
    assert!(left_out.iter().all(|one| one["what"].as_str().unwrap().contains("state of charge at the start")), "{left_out:?}");

    // Every line of the given model that is not a number found is there still.
    let given = energy::built_in("enertech-lco-2280mah").unwrap();
    let gone = given.lines().filter(|line| !text.lines().any(|new| new == *line)).count();
    assert!(gone <= 5, "{gone} lines changed:\n{text}");
}

#[test]
fn with_the_starts_that_were_learned_the_written_model_leaves_what_the_search_left() {
    use std::sync::Arc;

    use lab::infer::rough::Rough;
    use lab::infer::{discover::search, evidence::Evidence};
    use lab::measurement::{LogFacts, read_log};

    let model = lab::load_model("enertech-lco-2280mah").unwrap();
    let log = |name: &str| {
        let text = fs::read(measured().join(format!("{name}.csv"))).unwrap();
        read_log(&format!("{name}.csv"), &text, LogFacts { soc_initial: Some(1.0), ..LogFacts::default() }).unwrap()
    };
    let logs = ["discharge-0p5c", "discharge-1c"].map(log);
    let ready = |model: &energy::Model| logs.iter().map(|log| lab::prepare(model, log).unwrap()).collect::<Vec<_>>();
    let found = search(Arc::clone(&model.model), Arc::new(Evidence::new(&model.model, ready(&model.model))), None).last;
    let text = lab::learned::write(&model.text, &model.model, &found, "a test", true).unwrap();
    let written = Arc::new(energy::Model::parse("written", &text, &|file| panic!("{file} is not inline")).unwrap());
    let mut logs = ready(&written);
    for (index, log) in logs.iter_mut().enumerate() {
        log.start.soc += found.frame.error(&found.x, Rough::SocInitial(index));
    }
    let alone = lab::report::discovery::rms_of(&lab::compare(&written, &written.values(), &logs));
    for (channel, rms) in found.rms() {
        let again = alone[channel.name()];
        // Not exactly: beyond its ends the written table goes on straight, with its correction, where
        // the search keeps the correction of the last knot; a table that would fall is evened out.
        assert!((again / rms - 1.0).abs() < 0.1, "{channel:?}: {again} by the file, {rms} in the search");
    }
}

#[test]
fn an_effect_by_name_is_added_and_judged() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("more.toml");
    let out = path.to_str().unwrap();
    let outcome = run(&["add", "ohmic_soc"], &["-o", out, "--format", "json"]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let json = outcome.json();
    assert_eq!((&json["accepted"], &json["effect"]), (&Value::from(true), &Value::from("ohmic_soc")));
    let fallen = |log: &Value| log["extended"].as_f64().unwrap() < 0.6 * log["refitted"].as_f64().unwrap();
    let logs = json["logs"].as_array().unwrap();
    assert!(logs.len() == 3 && logs.iter().filter(|log| log["holdout"] == false).all(fallen), "{logs:?}");
    // It adds to the model's own resistance, which no log tells from it: each of its numbers is no
    // better known than that one, of which the model says 3 mOhm.
    let numbers = json["parameters"].as_object().unwrap();
    assert!(numbers.len() == 7 && numbers.values().all(|number| number["sigma"].as_f64().unwrap() >= 0.003), "{numbers:?}");
    assert!(json["regimes"][0]["taken"].as_f64().unwrap() > 0.3, "{}", json["regimes"]);
    assert!(fs::read_to_string(&path).unwrap().contains("id = \"ohmic_soc\""));
    // The written model has it, so that it cannot be added twice.
    let twice = lab(&[&["add", "ohmic_soc", "--model", out], &LOGS[..]].concat());
    assert_eq!(twice.code, 2);
    assert!(twice.stderr.contains("has the effect `ohmic_soc` already"), "{}", twice.stderr);
}

/// A station of which nothing is free and nothing roughly known: there is no number but the effect's own.
#[test]
fn an_effect_is_added_to_a_model_that_knows_everything_else() {
    let directory = tempfile::tempdir().unwrap();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/models/mds-station-no-own-load.toml");
    let header = "time_s,pack_power_w,charge_power_w,robots_docked,robots_charging,bay_squared_current_a2,lift_active,selector_events\n";
    let line = |k: u32| format!("{},{},0,{docked},0,0,0,0\n", 5 * k, 5.7 + 4.7 * f64::from(docked(k)), docked = docked(k));
    let log = (0..400).map(line).fold(header.to_owned(), |log, line| log + &line);
    fs::write(directory.path().join("station.csv"), log).unwrap();
    let given =
        ["add", "robot_own_load", "--model", model.to_str().unwrap(), "--log", "station.csv", "-o", "more.toml", "--format", "json"];
    let outcome = lab_in(directory.path(), &given);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    let load_w = outcome.json()["parameters"]["own_load_w"]["value"].as_f64().unwrap();
    // What the station gives more reaches the robot through a converter (84 %) and a charger (88 %), by the model's file.
    assert!((load_w - 4.7 * 0.84 * 0.88).abs() < 0.01, "{load_w} W");
    assert!(fs::read_to_string(directory.path().join("more.toml")).unwrap().contains("robot_own_load"));
}

fn docked(k: u32) -> u32 {
    k / 100 % 2
}

#[test]
fn an_unknown_effect_and_one_without_its_column_are_refused() {
    let refuses = |outcome: Outcome, words: &str| {
        assert_eq!((outcome.code, outcome.stdout.as_str()), (2, ""), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(words), "`{words}` is not in: {}", outcome.stderr);
    };
    refuses(run(&["add", "ohmic_sock"], &[]), "a battery has no effect `ohmic_sock`; did you mean `ohmic_soc`?");
    refuses(run(&["add", "capacity_fade"], &[]), "needs the column cycle_count");
    refuses(run(&["discover"], &["-o", "no/such/place.toml"]), "there is no directory no/such");
}

/// What is found is written with its error on the logs that are held out: an effect whose column these lack is not looked for.
#[test]
fn what_a_held_out_log_lacks_the_column_for_is_not_tried() {
    let directory = tempfile::tempdir().unwrap();
    for name in ["discharge-0p5c", "discharge-1c", "discharge-0p1c"] {
        let text = fs::read_to_string(measured().join(format!("{name}.csv"))).unwrap();
        let is_held = name == "discharge-0p1c";
        let line = |line: &str| match line {
            _ if is_held || line.starts_with('#') => format!("{line}\n"),
            _ if line.starts_with("time_s") => format!("{line},cycle_count\n"),
            _ => format!("{line},100\n"),
        };
        fs::write(directory.path().join(format!("{name}.csv")), text.lines().map(line).collect::<String>()).unwrap();
        let facts = measured().join(format!("{name}.toml"));
        if facts.exists() {
            fs::copy(facts, directory.path().join(format!("{name}.toml"))).unwrap();
        }
    }
    let told = "needs the column cycle_count, which held-out discharge-0p1c lacks";
    let added = lab_in(directory.path(), &[&["add", "capacity_fade"], &MODEL[..], &LOGS].concat());
    assert!(added.code == 2 && added.stderr.contains(told), "{}", added.stderr);
    let looked = lab_in(directory.path(), &[&["diagnose", "--format", "json"], &MODEL[..], &LOGS].concat());
    let untested =
        looked.json()["untested"].as_array().unwrap().iter().any(|one| one["effect"] == "capacity_fade" && one["reason"] == told);
    assert!(untested, "{}", looked.stdout);
}

#[test]
fn a_log_with_fewer_rows_than_unknowns_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let log = directory.path().join("short.csv");
    fs::write(&log, "time_s,current_a,voltage_v\n0,1,4.10\n1,1,4.09\n2,1,4.08\n3,1,4.07\n").unwrap();
    let outcome = lab(&[&["discover"], &MODEL[..], &["--soc-initial", "1", "--log", log.to_str().unwrap()]].concat());
    assert_eq!((outcome.code, outcome.stdout.as_str()), (2, ""), "{}", outcome.stderr);
    // One resistance, the capacity, the charge at the start and the table's 24 knots: 22, and one beyond each end.
    assert!(outcome.stderr.contains("short: 3 rows count, and 27 numbers are free or only roughly known"), "{}", outcome.stderr);
}

#[test]
fn two_searches_say_the_same() {
    assert_eq!(run(&["diagnose"], &[]).stdout, run(&["diagnose"], &[]).stdout);
}

/// Discharges of one cell: no string, and no change of direction by which hysteresis differs from a drop that stays.
#[test]
fn what_these_logs_or_this_pack_cannot_show_is_not_tried_and_the_reason_is_told() {
    let json = run(&["diagnose"], &["--format", "json"]).json();
    let reason = |effect: &str| {
        let untested = json["untested"].as_array().unwrap();
        untested.iter().find(|one| one["effect"] == effect).unwrap_or_else(|| panic!("{effect}: {}", json["untested"]))["reason"]
            .as_str()
            .unwrap()
    };
    assert!(reason("hysteresis").contains("into the battery"), "{}", reason("hysteresis"));
    assert!(reason("weak_cell").contains("no string"), "{}", reason("weak_cell"));
}
