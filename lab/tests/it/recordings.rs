//! MCAP recordings made by an independent library (`tests/data/battery_state_mcap.py`), and bytes
//! that are no recording at all.

use std::fs;
use std::path::{Path, PathBuf};

use energy::Channel;
use lab::measurement::{LogFacts, read_log};
use proptest::prelude::*;

use crate::commands::{Outcome, lab_in};

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data")
}

fn battery() -> Vec<u8> {
    fs::read(data().join("battery.mcap")).unwrap()
}

#[test]
fn a_recording_gives_the_numbers_that_were_put_in() {
    let log = read_log("battery.mcap", &battery(), LogFacts::default()).unwrap();
    assert_eq!(log.rows(), 121);
    for second in 0..121 {
        let time_s = second as f64;
        assert_eq!(log.time_s[second], time_s);
        // ROS counts discharge negative.
        assert_eq!(log.channels[&Channel::CurrentA][second], if second < 60 { 1.0 } else { 2.0 });
        assert!((log.channels[&Channel::VoltageV][second] - (12.0 - 0.005 * time_s)).abs() < 1e-6);
        assert!((log.channels[&Channel::Soc][second] - (0.9 - 0.001 * time_s)).abs() < 1e-6);
        let temperature_degc = log.channels[&Channel::TemperatureDegc][second];
        assert!(if second % 10 == 0 { temperature_degc == 25.0 } else { temperature_degc.is_nan() });
    }
    assert!(log.extra.contains_key("cell_3_v") && !log.extra.contains_key("charge_ah"));
    assert_eq!((log.facts.soc_initial, log.facts.soc_initial_sigma), (Some(0.9), Some(0.05)));
    assert!(log.notes.iter().any(|note| note.contains("starts at 90.0 % by the gauge in the log")), "{:?}", log.notes);
}

fn predict(log: &str, more: &[&str]) -> Outcome {
    lab_in(&data(), &[&["predict", "--model", "explorer-3s1p-1320mah", "--column", "cycle_count=0", "--log", log], more].concat())
}

#[test]
fn a_recording_that_was_split_is_read_as_one_by_its_folder() {
    let [whole, split] = ["battery.mcap", "split"].map(|log| predict(log, &["--column", "ambient_degc=25", "--format", "json"]));
    assert_eq!((whole.code, split.code), (0, 0), "{}{}", whole.stderr, split.stderr);
    let whole: serde_json::Value = serde_json::from_str(&whole.stdout).unwrap();
    let split: serde_json::Value = serde_json::from_str(&split.stdout).unwrap();
    assert_eq!(whole["columns"], split["columns"]);
    let sqlite = tempfile::tempdir().unwrap();
    fs::write(sqlite.path().join("run_0.db3"), "SQLite format 3").unwrap();
    let refused = predict(sqlite.path().to_str().unwrap(), &[]);
    assert!(refused.code == 2 && refused.stderr.contains("`ros2 bag convert` makes MCAP of it"), "{}", refused.stderr);
}

#[test]
fn one_of_several_batteries_is_chosen_by_its_topic() {
    let refused = |outcome: Outcome, words: &str| {
        assert_eq!(outcome.code, 2, "{}", outcome.stdout);
        assert!(outcome.stderr.contains(words), "{}", outcome.stderr);
    };
    let several = "several topics of type sensor_msgs/msg/BatteryState; choose one with --topic: /front/battery, /rear/battery";
    refused(predict("two-batteries.mcap", &[]), several);
    let near = "--topic /fron/battery: no such topic of type sensor_msgs/msg/BatteryState; did you mean `/front/battery`? Its topics: ";
    refused(predict("two-batteries.mcap", &["--topic", "/fron/battery"]), near);
    refused(predict("battery.mcap", &["--topic", "/rosout"]), "/rosout (std_msgs/msg/String, 5 messages)");
    let outcome = predict("two-batteries.mcap", &["--topic", "/rear/battery", "--column", "ambient_degc=25"]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
}

#[test]
fn a_recording_that_was_not_closed_is_read_as_far_as_it_goes() {
    let bytes = battery();
    let whole = read_log("a.mcap", &bytes, LogFacts::default()).unwrap();
    // What follows the last chunk is an index.
    let cut = read_log("a.mcap", &bytes[..bytes.len() - 40], LogFacts::default()).unwrap();
    assert_eq!(cut.time_s, whole.time_s);
    assert!(cut.notes.iter().any(|note| note.contains("the recording was not closed; read are the 121 messages")), "{:?}", cut.notes);
    let error = read_log("a.mcap", &bytes[..200], LogFacts::default()).unwrap_err().to_string();
    assert!(error.starts_with("a.mcap: not readable as MCAP"), "{error}");
    let error = read_log("a.mcap", b"time_s,current_a\n0,1\n1,1\n", LogFacts::default()).unwrap_err().to_string();
    assert!(error.starts_with("a.mcap: not readable as MCAP"), "{error}");
}

/// Whatever comes out keeps the contract of logs; whatever does not is named.
fn read(file: &str, bytes: &[u8]) {
    match read_log(file, bytes, LogFacts::default()) {
        Ok(log) => assert!(log.rows() >= 2 && log.channels.values().all(|values| values.len() == log.rows())),
        Err(error) => assert!(error.to_string().starts_with(file), "{error}"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(debug_assertions) { 300 } else { 5_000 }))]

    #[test]
    fn no_damage_to_a_recording_makes_the_reader_panic(hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8), cut in any::<prop::sample::Index>()) {
        let mut bytes = battery();
        for (at, byte) in &hits {
            let at = at.index(bytes.len());
            bytes[at] = *byte;
        }
        read("a.mcap", &bytes);
        bytes.truncate(cut.index(bytes.len()));
        read("a.mcap", &bytes);
    }

    #[test]
    fn no_bytes_make_a_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        read("a.csv", &bytes);
        let with_header = [b"time_s,current_a,voltage_v\n".as_slice(), &bytes].concat();
        read("a.csv", &with_header);
        let magic = [b"\x89MCAP0\r\n".as_slice(), &bytes].concat();
        read("a.mcap", &magic);
    }

    #[test]
    fn no_numbers_make_a_log_that_breaks_its_contract(rows in prop::collection::vec((0_i32..20, prop::num::f64::ANY, -5.0..5.0_f64), 0..40)) {
        let mut rows = rows;
        rows.sort_by_key(|row| row.0);
        let text: String = rows.iter().map(|(time, a, v)| format!("{time},{a},{v}\n")).collect();
        if let Ok(log) = read_log("a.csv", format!("time_s,current_a,voltage_v\n{text}").as_bytes(), LogFacts::default()) {
            prop_assert!(log.time_s.windows(2).all(|pair| pair[1] > pair[0]));
            prop_assert!(log.channels[&Channel::CurrentA].iter().all(|a| a.is_nan() || a.abs() <= 1e4));
        }
    }
}
