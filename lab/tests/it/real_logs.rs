//! `lab discover` on measured logs that are too large to ship, as a user would put them to it: looked
//! for in `shared/data` beside the project, left out with a word where they are not.
//!
//! Every set begins with what is known of the thing (an open-circuit table of its own slow data, one
//! resistance; a constant; a proportional loss) and logs to learn from; the bounds are what another
//! least-squares program left on the same records (`INDEX.md` beside the data), never our own results.
//!
//! `TENDER_FULL=1 cargo test --release -p lab --test it real_logs::table -- --nocapture` prints the
//! table of all sets that stands in `README.md`.

mod ageing;
mod cells;
mod machines;
mod rows;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::commands::lab_in;

/// The folder of one set of logs; none, with a word about it, where it is not there.
fn real(set: &str) -> Option<PathBuf> {
    let up = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let found = up.map(|folder| folder.join("shared/data").join(set)).find(|folder| folder.is_dir());
    if found.is_none() {
        eprintln!("left out: no shared/data/{set} beside the project");
    }
    found
}

/// A base model and logs, ready for `lab discover`.
struct Set {
    name: &'static str,
    directory: TempDir,
    train: Vec<String>,
    holdout: Vec<String>,
    flags: &'static [&'static str],
}

impl Set {
    /// A set of which nothing is there but its model.
    fn new(name: &'static str, model: &str) -> Set {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("base.toml"), model).unwrap();
        Set { name, directory, train: Vec::new(), holdout: Vec::new(), flags: &[] }
    }

    #[expect(clippy::disallowed_methods, reason = "the table says how long it took")]
    fn discover(&self) -> Answer {
        let mut arguments = vec!["discover", "--model", "base.toml", "--format", "json", "--log"];
        arguments.extend(self.train.iter().map(String::as_str));
        if !self.holdout.is_empty() {
            arguments.push("--holdout");
            arguments.extend(self.holdout.iter().map(String::as_str));
        }
        arguments.extend(self.flags);
        let begin = Instant::now();
        let outcome = lab_in(self.directory.path(), &arguments);
        assert!(outcome.code < 2, "{}: {}", self.name, outcome.stderr);
        let answer = Answer { name: self.name, json: outcome.json(), took: begin.elapsed() };
        eprint!("{}", answer.ladder());
        answer
    }
}

/// What `lab discover` said.
struct Answer {
    name: &'static str,
    json: Value,
    took: Duration,
}

impl Answer {
    fn names(&self, key: &str) -> Vec<&str> {
        self.json[key].as_array().unwrap().iter().filter_map(Value::as_str).collect()
    }

    /// Whether one of these effects is named, by itself or as one of those that the logs cannot tell apart.
    fn names_any(&self, effects: &[&str]) -> bool {
        let named = [self.names("selected"), self.names("equivalent")].concat();
        effects.iter().any(|effect| named.contains(effect))
    }

    /// The one channel's number of a rung of the ladder, counted from the model as given; none without held-out logs.
    fn rung(&self, key: &str, last: bool) -> Option<f64> {
        let ladder = self.json["ladder"].as_array().unwrap();
        let rung = if last { ladder.last() } else { ladder.first() }?;
        rung[key].as_object()?.values().next()?.as_f64()
    }

    fn train(&self) -> (f64, f64) {
        (self.rung("train_rms", false).unwrap(), self.rung("train_rms", true).unwrap())
    }

    fn held_out(&self) -> (f64, f64) {
        (self.rung("holdout_rms", false).unwrap(), self.rung("holdout_rms", true).unwrap())
    }

    /// A line for each rung.
    fn ladder(&self) -> String {
        let mut text = format!("{} ({:.1} s)\n", self.name, self.took.as_secs_f64());
        for rung in self.json["ladder"].as_array().unwrap() {
            writeln!(text, "  {} {} held out {}", rung["effect"], rung["train_rms"], rung["holdout_rms"]).unwrap();
        }
        text
    }

    /// A row of the table in `README.md`.
    fn row(&self) -> String {
        let milli = |key, last| self.rung(key, last).map_or_else(|| "-".to_owned(), |value: f64| format!("{:.3}", 1e3 * value));
        let arrow = |key| format!("{} -> {}", milli(key, false), milli(key, true));
        let selected = self.names("selected").join(", ");
        let seconds = self.took.as_secs_f64();
        format!(
            "| {} | {} | {} | {selected} | {} | {seconds:.1} |",
            self.name,
            arrow("train_rms"),
            arrow("holdout_rms"),
            milli("floor", true)
        )
    }
}

/// All sets, in thousandths of the channel's unit.
#[test]
fn table() {
    let full = std::env::var("TENDER_FULL").is_ok_and(|full| full != "0");
    let sets: [fn() -> Option<Set>; 12] = [
        cells::enertech,
        cells::leaf,
        cells::samsung,
        cells::a123_both_ways,
        cells::a123_one_way,
        cells::panasonic,
        cells::melasta,
        ageing::nasa,
        ageing::nasa_over_cycles,
        ageing::gopi5go,
        machines::robotino,
        machines::dcdc,
    ];
    if full {
        let rows: Vec<String> = sets.iter().filter_map(|set| Some(set()?.discover().row())).collect();
        println!("| set | training RMS | held out | effects | floor | s |\n| --- | --- | --- | --- | --- | --- |\n{}", rows.join("\n"));
    }
}
