//! Held-out logs of which some lack a column that an effect needs.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::{Discovery, Verdict};
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::measurement::{Log, LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::prepare;
use lab::report::discovery::{Reach, headline};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::commands::lab_in;
use crate::made_up;

const SENSORS: &str = "[sensor.voltage_v]\nsigma = 1e-3\n[sensor.temperature_degc]\nsigma = 0.1\n[sensor.ambient_degc]\nsigma = 0.1\n";
const OHMIC: &str = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.08, source = \"t\", free = true }\n";
const THERMAL: &str = "[[effect]]\nid = \"thermal\"\nconductance_w_per_k = { value = 0.05, source = \"t\" }\n\
                       heat_capacity_j_per_k = { value = 40.0, source = \"t\" }\nheat_share = { value = 1.0, source = \"t\" }\n";

fn base() -> Arc<Model> {
    made_up::model(&format!("{SENSORS}{OHMIC}"))
}

/// An hour and a half of pulses of a cell that warms up; with the temperature of its surroundings, or without that column.
fn log(name: &str, seed: u64, with_surroundings: bool) -> Log {
    let truth = made_up::model(&format!("{SENSORS}{OHMIC}{THERMAL}"));
    let rows: String =
        (0..1080).map(|row| format!("{},{},3.9,10,10\n", 5 * row, [1.5, 0.3][(row + seed as usize * 17) / 120 % 2])).collect();
    let text = format!("time_s,current_a,voltage_v,temperature_degc,ambient_degc\n{rows}");
    let facts = LogFacts { soc_initial: Some(1.0), ..LogFacts::default() };
    let mut log = read_log(&format!("{name}.csv"), text.as_bytes(), facts).unwrap();
    let shown = predict(&truth, &prepare(&truth, &log).unwrap(), &truth.values());
    let mut random = Pcg64::new(u128::from(seed), 0);
    for (channel, sigma) in [(Channel::VoltageV, 1e-3), (Channel::TemperatureDegc, 0.1)] {
        let noise = Normal::new(0.0, sigma).unwrap();
        let values = shown.of(channel).unwrap().iter().map(|value| value + noise.sample(&mut random)).collect();
        log.channels.insert(channel, values);
    }
    if !with_surroundings {
        log.channels.remove(&Channel::AmbientDegc);
    }
    log
}

fn evidence(logs: &[Log]) -> Evidence {
    Evidence::new(&base(), logs.iter().map(|log| prepare(&base(), log).unwrap()).collect())
}

/// What a search finds whose last look is judged by these logs.
fn found(held: &[Log]) -> Discovery {
    let held = Arc::new(evidence(held));
    let seen = Arc::new(evidence(&[log("seen", 1, true)]).judged_by(&held));
    Discovery::of(&search(base(), seen, Some(&held)))
}

#[test]
fn an_effect_is_judged_by_the_held_out_logs_that_have_its_column() {
    let both = found(&[log("without", 2, false), log("with", 3, true)]);
    assert_eq!((both.verdict, &both.selected[..]), (Verdict::Missing, &["thermal"][..]), "{:?}", both.ranking.first());
    // As if there were no other one, from the first rung of the ladder on.
    let alone = found(&[log("with", 3, true)]);
    assert_eq!(both.selected, alone.selected);
    for (both, alone) in both.ladder.iter().zip(&alone.ladder) {
        let (both, alone) = (both.holdout_rms["temperature_degc"], alone.holdout_rms["temperature_degc"]);
        assert!((both / alone - 1.0).abs() < 0.02, "{both} and {alone}");
    }
}

#[test]
fn an_effect_whose_column_no_held_out_log_has_is_told_not_to_have_been_asked() {
    let found = found(&[log("without", 2, false)]);
    assert_eq!((found.verdict, &found.selected[..]), (Verdict::Unknown, &[][..]));
    let words = headline(&found, Reach::Whole);
    assert!(words.contains("thermal was not asked: held-out without lacks ambient_degc"), "{words}");
    assert!(!words.contains("effect of the catalogue explains it"), "{words}");
}

fn write(folder: &Path, log: &Log) {
    let channels: Vec<_> = log.channels.iter().collect();
    let mut text = channels.iter().fold("time_s".to_owned(), |text, (channel, _)| text + "," + channel.name()) + "\n";
    for (row, time_s) in log.time_s.iter().enumerate() {
        write!(text, "{time_s}").unwrap();
        channels.iter().for_each(|(_, values)| write!(text, ",{}", values[row]).unwrap());
        text.push('\n');
    }
    fs::write(folder.join(&log.file), text).unwrap();
    fs::write(folder.join(format!("{}.toml", log.name)), "schema = 1\nsoc_initial = 1.0\n").unwrap();
}

#[test]
fn what_was_found_is_written_and_the_held_out_log_that_it_cannot_predict_is_named_once() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cell.toml"), made_up::text(&format!("{SENSORS}{OHMIC}"))).unwrap();
    for log in [log("seen", 1, true), log("without", 2, false), log("with", 3, true)] {
        write(folder.path(), &log);
    }
    let verb = |verb: &[&str]| {
        let logs = ["--model", "cell.toml", "--log", "seen.csv", "--holdout", "without.csv", "with.csv"];
        lab_in(folder.path(), &[verb, &logs].concat())
    };
    let discovered = verb(&["discover", "-o", "found.toml"]);
    assert_eq!(discovered.code, 0, "{}", discovered.stderr);
    let once = "Held-out without lacks ambient_degc, which effect `thermal` needs";
    assert_eq!(discovered.stdout.matches(once).count(), 1, "{}", discovered.stdout);
    let json = verb(&["discover", "--format", "json"]).json();
    assert_eq!(json["holdout_unpredicted"][0]["log"], "without", "{json}");
    // The files are compared on the log that both predict.
    let of_held = json["files"].as_array().unwrap().iter().find(|file| file["holdout"] == true && file["channel"] == "voltage_v");
    assert!(of_held.is_some_and(|file| file["given"].as_f64() < Some(0.01)), "{json}");
    let added = verb(&["add", "thermal"]);
    assert!(added.code == 0 && added.stderr.contains(once), "{}", added.stderr);
}
