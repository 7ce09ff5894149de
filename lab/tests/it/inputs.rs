//! What is said about logs that are not as they should be, and which logs are kept from fits.

use std::fs;
use std::path::Path;

use lab::measurement::{LogFacts, read_log};

use crate::commands::{Outcome, lab_in};

const CELL: &str = "enertech-lco-2280mah";

fn refuses(outcome: &Outcome, words: &str) {
    assert_eq!(outcome.code, 2, "{}{}", outcome.stdout, outcome.stderr);
    assert_eq!(outcome.stdout, "");
    assert!(outcome.stderr.contains(words), "`{words}` is not in: {}", outcome.stderr);
}

/// Falls by a millivolt per second; row 20 repeats its time, 30 is a fill value, 40 cannot be, 50
/// is missing, 60 a spike, and after 70 half an hour is missing.
fn dirty() -> String {
    let mut text = "time_s,current_a,voltage_v\n".to_owned();
    for row in 0..100 {
        let time_s = if row > 70 { 1800 + row } else { row };
        let volts = |row: i32| format!("{:.3}", 4.1 - 0.001 * f64::from(row));
        let (current_a, voltage_v) = match row {
            30 => ("-3.4028235e38".to_owned(), volts(row)),
            40 => ("1".to_owned(), "-0.001".to_owned()),
            50 => ("1".to_owned(), String::new()),
            60 => ("1".to_owned(), "3.2".to_owned()),
            _ => ("1".to_owned(), volts(row)),
        };
        text += &format!("{time_s},{current_a},{voltage_v}\n");
        if row == 20 {
            text += "20,9,3.9\n";
        }
    }
    text
}

#[test]
fn everything_that_is_wrong_with_a_log_is_said() {
    let log = read_log("run.csv", dirty().as_bytes(), LogFacts::default()).unwrap();
    insta::assert_snapshot!(log.notes.join("\n"), @r#"
run.csv: 1 of 101 rows repeat the time before them (line 23); the first of each is kept, whose current held until then
run.csv: 1 gap longer than 10 usual steps of 1 s, the longest 1801 s; inputs of the row after a gap stand for all of it (before line 74)
run.csv: `current_a`: 1 value such as -3.4028235e38 is no measurement but a logger's sign for none: taken as missing (line 33)
run.csv: `voltage_v`: 1 of 101 values are missing (line 53)
run.csv: `voltage_v`: 1 value outside 0 to 2000, such as -0.001: taken as missing (line 43)
run.csv: `voltage_v`: 1 single value far from both neighbours (by more than 20 usual differences), such as 3.2 after 4.041; not removed, unless --missing voltage_v=3.2 says that this is no measurement (line 63)
run.csv: diagnose, discover and add ask the voltage after a gap of current_a what flowed in it; compare and fit go by the row after it, and ocv counts nothing across it. Where that row tells of all of a gap, as of a battery that was stored, say gap_current = "stated" beside the log, or --gap-current
"#);
}

fn write(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).unwrap();
}

const RUN: &str = "time_s,current_a,voltage_v\n0,1,4.1\n10,1,4.0\n20,1,3.99\n30,1,3.98\n";

#[test]
fn a_log_for_judging_is_compared_but_never_fitted() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "train.csv", RUN);
    write(folder.path(), "judge.csv", "time_s,current_a,voltage_v\n0,1,4.1\n10,1,4.1\n20,1,4.1\n30,1,4.1\n");
    write(folder.path(), "judge.toml", "schema = 1\nrole = \"holdout\"\n");
    let run = |verb: &str, more: &[&str]| lab_in(folder.path(), &[&[verb, "--model", CELL, "--soc-initial", "1"], more].concat());
    let compared = run("compare", &["--log", "train.csv", "judge.csv"]);
    assert!(compared.stdout.contains("train") && compared.stdout.contains("judge"), "{}", compared.stdout);
    let fitted = run("fit", &["--free", "ohmic", "--log", "train.csv", "judge.csv"]);
    let column = |name: &str| fitted.stdout.lines().position(|line| line.trim_start().starts_with(name));
    let (held, judge) = (column("held out"), column("judge"));
    assert!(
        column("train").is_some() && column("train") < held && held < judge && judge < column("parameter"),
        "{}{}",
        fitted.stdout,
        fitted.stderr
    );
    let by_flag = run("fit", &["--free", "ohmic", "--log", "train.csv", "--holdout", "judge.csv"]);
    assert_eq!(fitted.stdout, by_flag.stdout);
    assert!(fitted.stdout.contains("voltage_v in judge, held out, is predicted worse than before"), "{}", fitted.stdout);
    refuses(&run("fit", &["--free", "ohmic", "--log", "train.csv", "--holdout", "./train.csv"]), "is given twice");
    refuses(&run("fit", &["--free", "ohmic", "--log", "judge.csv"]), "no log to fit to: the facts of each say role = \"holdout\"");
    refuses(&run("compare", &["--log", "train.csv", "./train.csv"]), "the log ./train.csv is given twice");
}

#[test]
fn one_file_holds_several_logs() {
    let folder = tempfile::tempdir().unwrap();
    let cycle =
        |cycle: i32| (0..20).map(move |row| format!("{},{cycle},1,{:.3}\n", 100 * cycle + row, 4.1 - 0.001 * f64::from(row * cycle)));
    write(folder.path(), "all.csv", &(1..=3).flat_map(cycle).fold("time_s,cycle,current_a,voltage_v\n".to_owned(), |all, row| all + &row));
    for (name, more) in [("one", "rows = [\"cycle=1\"]\n"), ("two", "rows = [\"cycle=2\"]\nrole = \"holdout\"\n"), ("none", "")] {
        write(folder.path(), &format!("{name}.toml"), &format!("schema = 1\nlog = \"all.csv\"\nsoc_initial = 1.0\n{more}"));
    }
    let run = |verb: &str, more: &[&str]| lab_in(folder.path(), &[&[verb, "--model", CELL], more].concat());
    let compared = run("compare", &["--log", "one.toml", "two.toml"]);
    let rows = |name: &str| compared.stdout.lines().find(|line| line.trim_start().starts_with(name)).map(|line| line.contains("   19 "));
    assert_eq!((rows("one"), rows("two")), (Some(true), Some(true)), "{}{}", compared.stdout, compared.stderr);
    assert!(compared.stderr.contains("all.csv: 20 of 60 rows are read, those with cycle=2"), "{}", compared.stderr);
    let fitted = run("fit", &["--free", "ohmic", "--log", "one.toml", "two.toml"]);
    assert!(fitted.stdout.contains("one") && fitted.stdout.contains("held out"), "{}{}", fitted.stdout, fitted.stderr);
    write(folder.path(), "again.toml", "schema = 1\nlog = \"all.csv\"\nsoc_initial = 1.0\nrows = [\"time_s=100..115\"]\n");
    let again = run("fit", &["--free", "ohmic", "--log", "one.toml", "again.toml"]);
    assert!(
        again.stderr.contains("again.toml: 16 of its 16 rows hold the times and readings of one.toml: they count twice"),
        "{}",
        again.stderr
    );
    // A flag takes the place of what the file says of the same column, and adds to what it says of others.
    let flags = run("compare", &["--log", "one.toml", "--rows", "cycle=3", "--rows", "time_s=..309"]);
    assert!(flags.stderr.contains("10 of 60 rows are read, those with cycle=3 and time_s=..309"), "{}", flags.stderr);
    refuses(&run("fit", &["--free", "ohmic", "--log", "one.toml", "-o", "all.csv"]), "all.csv is a log that is read here");
    refuses(&run("compare", &["--log", "none.toml", "--rows", "cycle=4"]), "all.csv: cycle=4: no row is like that; `cycle` holds 1 to 3");
    write(folder.path(), "bare.toml", "schema = 1\n");
    refuses(&run("compare", &["--log", "bare.toml"]), "bare.toml does not say of which log it is: write log = \"FILE.csv\" into it");
    write(folder.path(), "all.toml", "schema = 1\nlog = \"other.csv\"\n");
    refuses(&run("compare", &["--log", "all.csv"]), "all.toml is of another log, other.csv, and stands beside all.csv");
}

#[test]
fn what_is_no_log_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("dir.csv")).unwrap();
    let run = |log: &str, more: &[&str]| lab_in(folder.path(), &[&["compare", "--model", CELL, "--log", log], more].concat());
    refuses(&run("dir.csv", &[]), "it is a directory");
    refuses(&run("none.csv", &[]), "cannot read the log none.csv");
    write(folder.path(), "run.xlsx", "PK");
    refuses(&run("run.xlsx", &[]), "no log format for `.xlsx`; known: .csv, .txt, .tsv, .mpt, .mcap");
    write(folder.path(), "run.csv", RUN);
    refuses(&run("run.csv", &["--every", "0"]), "must be a number of seconds above 0");
    refuses(&run("run.csv", &["--every", "1", "--no-decimation"]), "cannot be used with");
}

#[test]
#[cfg(target_os = "linux")]
fn an_endless_input_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink("/dev/zero", folder.path().join("endless.csv")).unwrap();
    let outcome = lab_in(folder.path(), &["compare", "--model", CELL, "--log", "endless.csv"]);
    refuses(&outcome, "the line is longer than 1048576 bytes");
    std::os::unix::fs::symlink("/dev/zero", folder.path().join("endless.mcap")).unwrap();
    let outcome = lab_in(folder.path(), &["compare", "--model", CELL, "--log", "endless.mcap"]);
    refuses(&outcome, "not readable as MCAP");
}

/// A measurement is not made twice.
#[test]
fn no_answer_is_written_over_a_log_or_its_facts() {
    let folder = tempfile::tempdir().unwrap();
    let (log, facts) = ("time_s,current_a,voltage_v\n0,1,4.1\n60,1,4.0\n", "schema = 1\nsoc_initial = 1.0\n");
    for name in ["a", "b"] {
        write(folder.path(), &format!("{name}.csv"), log);
        write(folder.path(), &format!("{name}.toml"), facts);
    }
    let model = ["--model", "enertech-lco-2280mah", "--log", "a.csv"];
    let outcome = |verb: &[&str], output: &str, words: &str| {
        refuses(&lab_in(folder.path(), &[verb, &model[..], &["-o", output]].concat()), words);
    };
    for verb in [&["fit"][..], &["predict"], &["discover"], &["add", "rc1"], &["propose"], &["report"]] {
        outcome(verb, "./a.csv", "./a.csv is a log that is read here");
        outcome(verb, "a.toml", "a.toml holds the facts of the log a.csv");
    }
    let judge = [&["discover"], &model[..], &["--holdout", "b.csv", "-o", "b.csv"]].concat();
    refuses(&lab_in(folder.path(), &judge), "b.csv is a log that is read here");
    for name in ["a", "b"] {
        assert_eq!(fs::read_to_string(folder.path().join(format!("{name}.csv"))).unwrap(), log);
        assert_eq!(fs::read_to_string(folder.path().join(format!("{name}.toml"))).unwrap(), facts);
    }
}

/// Neither is a model, nor what it is made of.
#[test]
fn no_answer_is_written_over_the_model_or_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let table = "enertech-lco-2280mah-ocv.csv";
    let model = energy::built_in(CELL).unwrap().replace(table, "ocv.csv");
    write(folder.path(), "cell.toml", &model);
    write(folder.path(), "ocv.csv", energy::built_in(table).unwrap());
    write(folder.path(), "run.csv", RUN);
    write(folder.path(), "run.db", "a store");
    let given = |verb: &[&str], output: &[&str]| {
        let logs = ["--soc-initial", "1", "--model", "cell.toml", "--log", "run.csv"];
        lab_in(folder.path(), &[verb, &logs, output].concat())
    };
    for verb in [&["predict"][..], &["report"]] {
        refuses(&given(verb, &["-o", "./cell.toml"]), "./cell.toml is the model that is read here");
    }
    for verb in [&["fit"][..], &["predict"], &["discover"], &["add", "rc1"], &["propose"], &["report"]] {
        refuses(&given(verb, &["-o", "ocv.csv"]), "ocv.csv is a table of the model");
    }
    for verb in [&["fit"][..], &["discover"], &["add", "rc1"], &["propose"], &["report"]] {
        for file in ["run.db", "run.db-wal"] {
            let store = ["--store", "run.db", "--robot", "r1", "-o", file];
            refuses(&given(verb, &store), "is the store that is read here");
        }
    }
    assert_eq!(fs::read_to_string(folder.path().join("cell.toml")).unwrap(), model);
    assert_eq!(fs::read_to_string(folder.path().join("ocv.csv")).unwrap(), energy::built_in(table).unwrap());
    assert_eq!(fs::read_to_string(folder.path().join("run.db")).unwrap(), "a store");
    // A better model may take the place of the one that it was made of.
    let fitted = given(&["fit", "--free", "ohmic"], &["-o", "cell.toml"]);
    assert_ne!(fitted.code, 2, "{}", fitted.stderr);
    assert_ne!(fs::read_to_string(folder.path().join("cell.toml")).unwrap(), model);
}

#[test]
fn one_file_for_two_plots_and_two_sources_for_one_column_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "run.csv", RUN);
    let given =
        |more: &[&str]| lab_in(folder.path(), &[&["compare", "--model", CELL, "--soc-initial", "1", "--log", "run.csv"], more].concat());
    refuses(&given(&["--plot", "q.svg", "--plot-regimes", "./q.svg"]), "--plot and --plot-regimes both name ./q.svg");
    assert!(!folder.path().join("q.svg").exists());
    let columns = ["--column", "voltage_v=voltage_v", "--column", "voltage_v=current_a"];
    refuses(&given(&columns), "--column voltage_v=voltage_v and --column voltage_v=current_a: one column has one source");
}

/// Whatever were learned from a current of the wrong sign would be that sign under another name.
#[test]
fn nothing_is_learned_from_a_current_of_the_wrong_sign() {
    let folder = tempfile::tempdir().unwrap();
    let row = |second: i32| format!("{},-2,{:.4}\n", 10 * second, 4.1 - 1e-3 * f64::from(second));
    write(folder.path(), "run.csv", &(0..500).map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row));
    let given = |verb: &[&str]| {
        let rest = ["--model", "enertech-lco-2280mah", "--soc-initial", "0.95", "--log", "run.csv"];
        lab_in(folder.path(), &[verb, &rest].concat())
    };
    for verb in [&["diagnose"][..], &["discover"], &["fit", "--free", "ohmic"], &["add", "rc1"]] {
        refuses(&given(verb), "Nothing is learned from such a log");
    }
    let shown = given(&["compare"]);
    assert_eq!(shown.code, 1, "{}", shown.stderr);
    assert!(shown.stderr.contains("positive must be discharging"), "{}", shown.stderr);
}

#[test]
fn the_log_of_another_system_is_told() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "run.csv", RUN);
    let outcome = lab_in(folder.path(), &["compare", "--model", "explorer-robot", "--log", "run.csv"]);
    refuses(&outcome, "this looks like the log of a battery, whose models predict voltage_v");
}
