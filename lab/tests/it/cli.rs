//! The command line: what users get wrong, what they are told, and exit codes.

use std::fs;
use std::path::Path;

use crate::commands::{Outcome, lab, lab_in};

const CELL: &str = "enertech-lco-2280mah";

/// Compares one log, given as text, with the built-in cell.
fn compare(log: &str, more: &[&str]) -> Outcome {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("run.csv"), log).unwrap();
    let arguments = [&["compare", "--model", CELL, "--log", "run.csv", "--soc-initial", "1"], more].concat();
    lab_in(directory.path(), &arguments)
}

fn refuses(outcome: &Outcome, words: &[&str]) {
    assert_eq!(outcome.code, 2, "{}{}", outcome.stdout, outcome.stderr);
    assert_eq!(outcome.stdout, "");
    for words in words {
        assert!(outcome.stderr.contains(words), "`{words}` is not in: {}", outcome.stderr);
    }
}

#[test]
fn the_catalogue_is_printed() {
    let outcome = lab(&["effects"]);
    assert_eq!(outcome.code, 0);
    insta::assert_snapshot!(outcome.stdout);
}

#[test]
fn every_effect_has_a_card_and_a_json_entry() {
    let outcome = lab(&["effects", "--format", "json"]);
    let json = outcome.json();
    let all = json.as_array().unwrap();
    // One more: the formula of the user.
    assert_eq!(all.len(), energy::catalogue().len() + 1);
    for effect in all {
        let id = format!("{}/{}", effect["system"].as_str().unwrap(), effect["id"].as_str().unwrap());
        let card = lab(&["effects", &id]);
        assert_eq!(card.code, 0, "{}", card.stderr);
        assert!(card.stdout.contains(effect["equation"].as_str().unwrap()), "{}", card.stdout);
    }
}

#[test]
fn an_unknown_effect_is_answered_with_the_nearest() {
    refuses(&lab(&["effects", "ohmc"]), &["no effect `ohmc`; did you mean `ohmic`?"]);
    refuses(&lab(&["effects", "station/convertr"]), &["did you mean `station/converter"]);
    refuses(&lab(&["effects", "idle", "--system", "station"]), &["no effect `idle`"]);
}

#[test]
fn a_converter_is_found_in_the_system_that_is_meant() {
    let title = |arguments: &[&str]| lab(arguments).stdout.lines().next().map(str::to_owned);
    assert_eq!(title(&["effects", "robot/converter"]).as_deref(), Some("robot/converter: Converter loss"));
    let station = energy::catalogue().iter().map(|effect| effect.spec()).find(|spec| spec.title == "Bay converter efficiency").unwrap();
    let expected = format!("station/{}: {}", station.id, station.title);
    assert_eq!(title(&["effects", &format!("station/{}", station.id)]), Some(expected));
}

#[test]
fn an_unknown_model_and_an_unknown_parameter_are_answered_with_the_nearest() {
    let log = ["--log", "discharge-1c.csv"];
    refuses(&lab(&[&["compare", "--model", "enertech-lco"], &log[..]].concat()), &["did you mean `enertech-lco-2280mah`?"]);
    let outcome = lab(&[&["fit", "--model", CELL, "--free", "ohmic.resistance"], &log[..]].concat());
    refuses(&outcome, &["--free ohmic.resistance: the model has no such parameter; did you mean `ohmic.resistance_ohm`?"]);
    let outcome = lab(&[&["fit", "--model", CELL, "--fix", "ohmic"], &log[..]].concat());
    refuses(&outcome, &["--fix ohmic leaves no parameter of enertech-lco-2280mah free", "--free EFFECT.PARAMETER"]);
}

#[test]
fn a_mistake_in_a_model_is_placed() {
    let directory = tempfile::tempdir().unwrap();
    let text = energy::built_in("explorer-robot").unwrap().replace("idle_w =", "idel_w =");
    fs::write(directory.path().join("robot.toml"), text).unwrap();
    fs::write(directory.path().join("run.csv"), "time_s,power_w,speed_mps\n0,3,0\n1,3,0\n").unwrap();
    let outcome = lab_in(directory.path(), &["compare", "--model", "robot.toml", "--log", "run.csv"]);
    refuses(&outcome, &["robot.toml:14:1: effect `idle` has no parameter `idel_w`; did you mean `idle_w`?"]);
}

#[test]
fn a_missing_column_is_named_with_who_needs_it() {
    let outcome = compare("time_s,current,voltage_v\n0,1,4.1\n1,1,4.1\n", &[]);
    refuses(
        &outcome,
        &["run.csv: no column `current_a`, which every battery model needs; did you mean `current`?", "--column current_a=current."],
    );
    let outcome = compare("time_s,current_ma,voltage_mv\n0,1,4100\n1,1,4100\n", &["--column", "voltage_v=voltage_mv/1000"]);
    refuses(&outcome, &["Map with --column current_a=current_ma/1000."]);
    let outcome = compare("time_s,current_a,voltage\n0,1,4.1\n1,1,4.1\n", &[]);
    refuses(&outcome, &["nothing to compare with: a battery model predicts voltage_v; did you mean `voltage`?"]);
    let outcome = compare("time_s,current_a,voltage_v\n0,1,4.1\n1,1,\n2,1,nan\n", &[]);
    refuses(&outcome, &["nothing to compare with: no row of `voltage_v` after the first holds a number"]);
    let outcome = compare("time_s,current_a,voltage_v\n0,1,4.1\n1,,4.1\n2,1,\n", &[]);
    refuses(&outcome, &["nothing to compare with: `voltage_v` holds a number only in rows in which an input of the model does not"]);
    // Mapped, the same log is compared.
    let outcome = compare("time_s,current,mv\n0,1,4100\n1,1,4100\n", &["--column", "current_a=current", "--column", "voltage_v=mv/1000"]);
    assert_eq!(outcome.code, 1, "{}", outcome.stderr);
}

#[test]
fn targets_can_be_chosen_among_what_the_model_predicts() {
    let outcome = compare("time_s,current_a,voltage_v\n0,0,4.18\n1,0,4.18\n", &["--target", "voltage"]);
    refuses(&outcome, &["--target voltage: the model does not predict it; did you mean `voltage_v`? It predicts: voltage_v"]);
    assert_eq!(compare("time_s,current_a,voltage_v\n0,0,4.181\n1,0,4.1815\n", &["--target", "voltage_v"]).code, 0);
}

#[test]
fn what_is_wrong_in_a_log_is_placed() {
    refuses(&compare("time_s,current_a,voltage_v\n0,1,4.1\n1,x,4.1\n", &[]), &["run.csv:3: column `current_a`: `x` is not a number"]);
    refuses(
        &compare("time_s,current_a,voltage_v\n5,1,4.1\n1,1,4.1\n", &[]),
        &["run.csv:3: column `time_s`: time goes backwards: 1 s after 5 s"],
    );
    refuses(
        &compare("time_s,current_a,voltage_v\n0,,4.1\n1,NaN,4.1\n", &[]),
        &["column `current_a`, which every battery model needs, holds no number"],
    );
    refuses(&compare("time_s,current_a\n0,1\n1,1\n", &["--column", "voltage_v=u"]), &["the log has no column `u`"]);
}

#[test]
fn missing_cells_do_not_count() {
    let log = "time_s,current_a,voltage_v\n0,0,4.18\n1,0,\n2,0,NaN\n3,0,-9999\n4,0,4.18\n";
    let json = compare(log, &["--missing", "-9999", "--format", "json"]).json();
    assert_eq!(json["errors"][0]["rows"], 1);
}

#[test]
fn a_start_that_nobody_knows_is_asked_for() {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("run.csv"), "time_s,current_a,voltage_v\n0,0,3.8\n1,0,3.8\n").unwrap();
    let arguments = ["compare", "--model", CELL, "--log", "run.csv"];
    refuses(&lab_in(directory.path(), &arguments), &["--soc-initial", "--rest-voltage-v", "run.toml"]);
    fs::write(directory.path().join("run.toml"), "schema = 1\nrest_voltage_v = 3.8\n").unwrap();
    assert_eq!(lab_in(directory.path(), &arguments).code, 0);
    fs::write(directory.path().join("run.toml"), "schema = 1\nrest_volts = 3.8\n").unwrap();
    refuses(&lab_in(directory.path(), &arguments), &["run.toml:2:1:", "did you mean `rest_voltage_v`?"]);
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_the_work() {
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().to_str().unwrap();
    refuses(&lab(&["fit", "--model", CELL, "--log", "discharge-1c.csv", "-o", out]), &["it is a directory; name a file"]);
    refuses(&lab(&["predict", "--model", CELL, "--log", "discharge-1c.csv", "-o", out]), &["it is a directory; name a file"]);
    let nowhere = Path::new(out).join("no/out.csv");
    refuses(&lab(&["predict", "--model", CELL, "--log", "discharge-1c.csv", "-o", nowhere.to_str().unwrap()]), &["there is no directory"]);
}

#[test]
fn plots_are_written_as_their_ending_says_and_another_ending_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let arguments = ["compare", "--model", CELL, "--log", "discharge-1c.csv"];
    let outcome = lab(&[&arguments[..], &["--plot", &path("a.svg"), "--plot-regimes", &path("b.png")]].concat());
    assert_eq!(outcome.code, 1, "{}", outcome.stderr);
    let svg = fs::read_to_string(path("a.svg")).unwrap();
    assert!(svg.contains("measured") && svg.contains("sensor floors of 0.500 mV") && svg.len() < 200_000, "{}", svg.len());
    assert_eq!(fs::read(path("b.png")).unwrap()[1..4], *b"PNG");
    refuses(&lab(&[&arguments[..], &["--plot", &path("a.jpg")]].concat()), &["it must end in .svg or .png"]);
}

#[test]
fn a_robot_log_is_fitted_with_its_own_columns() {
    let directory = tempfile::tempdir().unwrap();
    let mut log = "t,watts,v_kmh\n".to_owned();
    for second in 0..200 {
        let driving = (second / 20) % 2;
        let speed_mps = 0.3 * f64::from(driving);
        // 4 W idle through the converter; 0.5 kg of rolling at 0.02 through 40 % from the battery.
        let drive_w = 0.5 * 9.806_65 * 0.02 * speed_mps / 0.4;
        log += &format!("{second},{},{}\n", 4.0 / 0.9 + 0.02 + drive_w, speed_mps * 3.6);
    }
    let parameter = |value: f64| format!("{{ value = {value}, source = \"test\" }}");
    let model = format!(
        "schema = 1\nsystem = \"robot\"\nname = \"robot\"\n[sensor.power_w]\nsigma = 0.02\n\
         [[effect]]\nid = \"idle\"\nidle_w = {}\n\
         [[effect]]\nid = \"motion\"\nrolling_coefficient = {}\nmass_kg = {}\ndrive_efficiency = {}\n\
         [[effect]]\nid = \"converter\"\nefficiency = {}\nquiescent_w = {}\n",
        parameter(3.75),
        parameter(0.02),
        parameter(0.5),
        parameter(0.4),
        parameter(0.9),
        parameter(0.02)
    );
    fs::write(directory.path().join("robot.toml"), model).unwrap();
    fs::write(directory.path().join("drive.csv"), log).unwrap();
    let facts = "schema = 1\n[columns]\ntime_s = \"t\"\npower_w = \"watts\"\nspeed_mps = \"v_kmh/3.6\"\n";
    fs::write(directory.path().join("drive.toml"), facts).unwrap();
    let arguments =
        ["fit", "--model", "robot.toml", "--free", "idle.idle_w", "--log", "drive.csv", "-o", "fitted.toml", "--format", "json"];
    let outcome = lab_in(directory.path(), &arguments);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    assert!((outcome.json()["parameters"][0]["value"].as_f64().unwrap() - 4.0).abs() < 1e-6);
    let outcome = lab_in(directory.path(), &["compare", "--model", "fitted.toml", "--log", "drive.csv"]);
    assert_eq!(outcome.code, 0, "{}{}", outcome.stdout, outcome.stderr);
    assert!(outcome.stdout.contains("standing still"), "{}", outcome.stdout);
}

#[test]
fn wrong_usage_exits_with_2() {
    assert_eq!(lab(&["compare"]).code, 2);
    assert_eq!(lab(&["fit", "--model", CELL, "--log", "discharge-1c.csv", "--date", "yesterday"]).code, 2);
    refuses(
        &lab(&["compare", "--model", CELL, "--log", "discharge-1c.csv", "--soc-initial", "90"]),
        &["--soc-initial = 90: must be between 0 and 1"],
    );
    refuses(&lab(&["compare", "--model", CELL, "--log", "none.csv"]), &["cannot read the log none.csv"]);
    refuses(&lab(&["compare", "--model", CELL, "--log", "LICENSE"]), &["no log format for `.`"]);
    refuses(&lab(&["compare", "--model", CELL, "--log", "discharge-1c.csv", "discharge-1c.csv"]), &["is given twice"]);
}

#[test]
fn a_model_beside_a_log_of_its_name_is_no_facts() {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("run.csv"), "time_s,power_w\n0,3\n1,3\n").unwrap();
    let model = "schema = 1\nsystem = \"robot\"\nname = \"r\"\n[[effect]]\nid = \"idle\"\n";
    fs::write(directory.path().join("run.toml"), model).unwrap();
    let outcome = lab_in(directory.path(), &["compare", "--model", "run.toml", "--log", "run.csv"]);
    refuses(&outcome, &["run.toml is a model, and would be read as the facts of the log run.csv beside it"]);
}

#[test]
fn a_table_in_per_cent_or_millivolts_is_refused_where_it_stands() {
    let directory = tempfile::tempdir().unwrap();
    fs::write(directory.path().join("run.csv"), "time_s,current_a,voltage_v\n0,1,4.1\n1,1,4.1\n").unwrap();
    for (soc, voltage_v, words) in
        [("0, 100", "3.0, 4.2", "soc runs from 0 to 100"), ("0, 1", "3000, 4200", "voltage_v runs from 3000 to 4200")]
    {
        let pack = "series = 1\nparallel = 1\ncapacity_ah = 2.0\nfull_v_per_cell = 4.2\neod_v_per_cell = 3.0\ncharge_current_a = 2.0\ncharge_cutoff_a = 0.1";
        let text = format!(
            "schema = 1\nsystem = \"battery\"\nname = \"c\"\n[battery]\n{pack}\nocv = {{ soc = [{soc}], voltage_v = [{voltage_v}] }}\n"
        );
        fs::write(directory.path().join("m.toml"), text).unwrap();
        let outcome = lab_in(directory.path(), &["compare", "--model", "m.toml", "--log", "run.csv", "--soc-initial", "1"]);
        refuses(&outcome, &["m.toml:", words]);
    }
}

/// Who knows a resistance to 0.3 ohm does not know it exactly since a log was simulated with it.
#[test]
fn a_fit_that_leaves_nothing_claims_no_more_than_the_sensor_shows_and_keeps_what_nobody_can_tell() {
    let folder = tempfile::tempdir().unwrap();
    let run = |sensor: &str| {
        let model = format!(
            "schema = 1\nsystem = \"battery\"\nname = \"t\"\n[battery]\nseries = 1\nparallel = 1\ncapacity_ah = 2.0\nfull_v_per_cell = 4.2\n\
             eod_v_per_cell = 3.0\ncharge_current_a = 1.0\ncharge_cutoff_a = 0.1\nocv = {{ soc = [0.0, 1.0], voltage_v = [3.0, 4.2] }}\n\
             {sensor}[[effect]]\nid = \"ohmic\"\nresistance_ohm = {{ value = 0.02, sigma = 0.3, source = \"t\", free = true }}\n"
        );
        let rows: String = (0..100).map(|row| format!("{row},1\n")).collect();
        fs::write(folder.path().join("m.toml"), model).unwrap();
        fs::write(folder.path().join("drive.csv"), format!("time_s,current_a\n{rows}")).unwrap();
        let told = ["--model", "m.toml", "--soc-initial", "0.9", "--log"];
        lab_in(folder.path(), &[&["predict", "-o", "told.csv"], &told[..], &["drive.csv"]].concat());
        let fitted = lab_in(folder.path(), &[&["fit", "-o", "fitted.toml"], &told[..], &["told.csv"]].concat());
        (fitted.stdout, fs::read_to_string(folder.path().join("fitted.toml")).unwrap())
    };
    let (told, text) = run("");
    assert!(text.contains("sigma = 0.3") && told.contains("how sure the numbers are cannot be told"), "{told}{text}");
    // 99 rows of 1 A that each show 1 mV: 0.1 mohm.
    let (told, text) = run("[sensor.voltage_v]\nsigma = 1e-3\n");
    assert!(text.contains("sigma = 0.0001,") && told.contains("20.00 +- 0.10 mohm"), "{told}{text}");
}
