//! Scenario files are whole-system tests: each says what is expected of it.

use std::num::NonZero;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use coordinator::scenario::{RunEntry, Scenario};

use super::{SMALL, read, run, scenario_folder};

fn files() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(scenario_folder()).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|ending| ending == "toml")).collect();
    files.sort();
    files
}

#[test]
fn every_scenario_holds_what_it_expects() {
    let scenarios: Vec<Scenario> = files().iter().map(|file| read(file)).collect();
    let mut runs: Vec<(&Scenario, RunEntry)> =
        scenarios.iter().flat_map(|scenario| scenario.runs().into_iter().map(move |run| (scenario, run))).collect();
    assert!(runs.len() >= 6, "scenarios are missing: {:?}", files());
    // The longest begin first, so that no thread is left with one at the end.
    let work = |scenario: &Scenario| {
        let robots: usize = scenario.robot.iter().map(|entry| entry.get_ref().len()).sum();
        *scenario.duration_s.get_ref() * robots as f64
    };
    runs.sort_by(|(a, _), (b, _)| work(b).total_cmp(&work(a)));
    let (next, failures) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let work_off = || {
        while let Some((scenario, entry)) = runs.get(next.fetch_add(1, Ordering::Relaxed)) {
            let measured = run(scenario, entry, scenario.seed, false).measured.metrics;
            let verdicts = scenario.verdicts(entry, &measured);
            let mut said: Vec<String> = verdicts
                .iter()
                .filter(|verdict| !verdict.holds())
                .map(|v| format!("{}: {}: {} is {:?}, expected {}", scenario.name, entry.name, v.metric, v.measured, v.expected))
                .collect();
            if verdicts.is_empty() {
                said.push(format!("{}: {}: expects nothing", scenario.name, entry.name));
            }
            failures.lock().unwrap().extend(said);
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, NonZero::get) {
            scope.spawn(work_off);
        }
    });
    let failures = failures.into_inner().unwrap();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_scenario_says_what_it_shows_and_fits_into_two_screens() {
    for file in files() {
        let (scenario, text) = (read(&file), std::fs::read_to_string(&file).unwrap());
        assert!(!scenario.note.is_empty(), "{}: no note", file.display());
        assert!(text.starts_with('#'), "{}: says nothing about where its numbers come from", file.display());
        assert!(text.lines().all(|line| line.chars().count() <= 160), "{}: a line is too long", file.display());
    }
}

#[test]
fn the_same_seed_gives_the_same_trace_and_another_seed_another() {
    // Ten minutes in which robots are sent in, loaded and exchanged.
    let text = std::fs::read_to_string(scenario_folder().join("hot-swap.toml")).unwrap().replace("duration_s = 9000", "duration_s = 720");
    let scenario = Scenario::parse(&scenario_folder().join("hot-swap.toml"), &text).unwrap();
    assert_eq!(*scenario.duration_s.get_ref(), 720.0);
    let plain = &scenario.runs()[0];
    let made = |seed| {
        let outcome = run(&scenario, plain, seed, false);
        (outcome.trace(), format!("{:?}", outcome.measured.metrics), proto::encode_pretty(&outcome.schedule))
    };
    let first = made(1);
    assert_eq!(first, made(1));
    assert!(first.0.lines().count() > 20 && first.0.contains("service_done"), "{}", first.0);
    let other = made(2);
    assert_ne!(first.0, other.0);
    assert_ne!(first.1, other.1);
}

#[test]
fn a_world_without_robots_runs_and_serves_nobody() {
    let text = SMALL.split("[[robot]]").next().unwrap();
    let scenario = Scenario::parse(&PathBuf::from("empty.toml"), text).unwrap();
    let measured = run(&scenario, &scenario.runs()[0], 1, true).measured.metrics;
    assert_eq!((measured["robots_served"], measured["services_promised"], measured["mission_h"]), (0.0, 0.0, 0.0));
    let nothing = Scenario::parse(&PathBuf::from("nothing.toml"), "schema = 1\nname = \"n\"\nduration_s = 3\n").unwrap();
    assert_eq!(run(&nothing, &nothing.runs()[0], 1, true).measured.metrics["pack_energy_wh"], 0.0);
}
