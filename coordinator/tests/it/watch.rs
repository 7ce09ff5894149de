//! The coordinator's watch over its own models: silent while they are right, and soon heard when
//! they are not.
//!
//! With `TENDER_STORIES=all` the silence is listened to for twenty robot-days.

use coordinator::scenario::Scenario;
use coordinator::sim::Outcome;
use proto::{Event, EventKind};

use super::{read, run, scenario_folder};

fn doubts(outcome: &Outcome) -> Vec<&Event> {
    outcome.events.iter().filter(|event| event.kind == EventKind::ModelDoubted).collect()
}

/// Minutes after the start at which a doubt of that text was first told.
fn doubted_min(outcome: &Outcome, whose: &str) -> f64 {
    let first = doubts(outcome).into_iter().find(|event| event.text.starts_with(whose));
    let seen = || doubts(outcome).iter().map(|event| event.text.clone()).collect::<Vec<_>>();
    first.unwrap_or_else(|| panic!("{whose} was not doubted: {:?}", seen())).at.seconds_since(outcome.start) / 60.0
}

#[test]
fn right_models_are_not_doubted() {
    let whole = std::env::var("TENDER_STORIES").is_ok_and(|which| which == "all");
    let (seeds, hours) = if whole { (1..=5, 24) } else { (1..=2, 3) };
    let file = scenario_folder().join("pack-depot.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains("duration_s = 12000"));
    let text = text.replace("duration_s = 12000", &format!("duration_s = {}", hours * 3600));
    let scenario = Scenario::parse(&file, &text).unwrap();
    for seed in seeds {
        let outcome = run(&scenario, &scenario.runs()[0], seed, false);
        let told: Vec<&str> = doubts(&outcome).iter().map(|event| event.text.as_str()).collect();
        assert!(told.is_empty(), "seed {seed}: {told:?}");
    }
}

#[test]
fn a_hidden_own_load_is_doubted_within_five_minutes_of_the_first_robot_in_its_bay() {
    let scenario = read(&scenario_folder().join("hidden-own-load.toml"));
    let unknown = run(&scenario, &scenario.runs()[0], 1, false);
    let docked = unknown.events.iter().find(|event| event.text.contains("-> charging")).unwrap();
    let after_min = doubted_min(&unknown, "the load model of mds-1") - docked.at.seconds_since(unknown.start) / 60.0;
    assert!((0.0..5.0).contains(&after_min), "{after_min} min");
    let doubt = &unknown.schedule.doubts[0];
    assert!(doubt.z > 5.0 && doubt.station.is_some(), "{doubt:?}");
    assert!(doubt.command.ends_with("scenarios/models/mds-station-no-own-load.toml --log logs/mds-1.csv"), "{doubt:?}");
    // Whoever knows of it has no doubt.
    assert!(doubts(&run(&scenario, &scenario.runs()[1], 1, false)).is_empty());
}

#[test]
fn an_aged_pack_is_doubted_before_it_gives_out() {
    let scenario = read(&scenario_folder().join("aged-pack.toml"));
    let outcome = run(&scenario, &scenario.runs()[0], 1, false);
    let empty = outcome.events.iter().find(|event| event.kind == EventKind::PackDepleted).unwrap();
    let ahead_min = empty.at.seconds_since(outcome.start) / 60.0 - doubted_min(&outcome, "the model of pack-1 of mds-1");
    assert!(ahead_min > 10.0, "{ahead_min} min");
    // Robots that stay in its dark bays are no news, second after second.
    let began = outcome.events.iter().filter(|event| event.kind == EventKind::ServiceStarted).count();
    assert_eq!(began, 3, "only those that were planned");
}

#[test]
fn robots_that_stop_on_a_slope_tell_of_it() {
    let scenario = read(&scenario_folder().join("hidden-slope.toml"));
    let level = run(&scenario, &scenario.runs()[0], 1, false);
    doubted_min(&level, "the load model of carrier-1 on its ways");
    assert!(doubts(&run(&scenario, &scenario.runs()[1], 1, false)).is_empty());
}
