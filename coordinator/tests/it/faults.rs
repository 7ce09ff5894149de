//! Whatever goes wrong, the promises hold.

use coordinator::sim::{Trial, forgetful_trial, large_trial, trial};

/// Seeds in the test command; `TENDER_SEEDS=FROM..TO` tries others, and prints what went wrong in one
/// that is tried alone.
const SEEDS: std::ops::Range<u64> = 0..200;
/// Seeds that broke a promise once.
const ONCE_BROKEN: &[u64] = &[419, 1969, 3474, 5692, 6735, 7379, 8140];
/// The same of large fleets, `TENDER_LARGE_SEEDS`.
const LARGE_SEEDS: std::ops::Range<u64> = 0..2;

fn seeds(variable: &str, usual: std::ops::Range<u64>) -> std::ops::Range<u64> {
    let Ok(text) = std::env::var(variable) else { return usual };
    let (from, to) = text.split_once("..").expect("FROM..TO");
    from.parse().expect("a number")..to.parse().expect("a number")
}

/// Trials are independent: as many at a time as there are cores.
fn trials(seeds: std::ops::Range<u64>, trial: fn(u64) -> anyhow::Result<Trial>) -> Vec<Trial> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get) as u64;
    let part = |first: u64| seeds.clone().skip(first as usize).step_by(cores as usize).map(|seed| trial(seed).unwrap()).collect::<Vec<_>>();
    let mut all: Vec<Trial> = std::thread::scope(|scope| {
        let parts: Vec<_> = (0..cores).map(|first| scope.spawn(move || part(first))).collect();
        parts.into_iter().flat_map(|part| part.join().unwrap()).collect()
    });
    all.sort_by_key(|trial| trial.seed);
    all
}

#[test]
fn no_promise_is_broken_whatever_goes_wrong() {
    let seeds = seeds("TENDER_SEEDS", SEEDS);
    let count = seeds.end - seeds.start;
    let (services, coordinators) = all_hold(trials(seeds, trial), "TENDER_SEEDS");
    // Trials in which nothing happens would hold any promise.
    assert!(count == 1 || (services > count && coordinators > count), "{services} {coordinators}");
}

#[test]
fn what_was_broken_once_holds() {
    for &seed in ONCE_BROKEN {
        all_hold(trials(seed..seed + 1, trial), "TENDER_SEEDS");
    }
}

#[test]
fn nor_in_a_fleet_that_is_planned_for_beside_the_core() {
    let trials = trials(seeds("TENDER_LARGE_SEEDS", LARGE_SEEDS), large_trial);
    let count = trials.len() as u64;
    let (services, _) = all_hold(trials, "TENDER_LARGE_SEEDS");
    assert!(services > 5 * count, "{services}");
}

/// Fails with every promise that was broken; how many services were done, by how many coordinators.
fn all_hold(trials: Vec<Trial>, variable: &str) -> (u64, u64) {
    let count = trials.len();
    if let [alone] = &trials[..] {
        println!("{}\n{}", alone.faults.join("\n"), alone.trace);
    }
    let told = |trial: &Trial| {
        let (seed, next, broken) = (trial.seed, trial.seed + 1, trial.violations.join("\n  "));
        let again = format!("{variable}={seed}..{next} cargo test -p coordinator --test it faults -- --nocapture");
        format!("seed {seed}:\n  {broken}\nagain, with all that happened: {again}")
    };
    let failed: Vec<String> = trials.iter().filter(|trial| !trial.violations.is_empty()).map(told).collect();
    assert!(failed.is_empty(), "{} of {count} seeds:\n{}", failed.len(), failed.join("\n"));
    let services: usize = trials.iter().map(|trial| trial.services).sum();
    let coordinators: usize = trials.iter().map(|trial| trial.coordinators).sum();
    println!("{count} trials, {services} services, {coordinators} coordinators: every promise held");
    (services as u64, coordinators as u64)
}

#[test]
fn agents_that_forget_are_found_out() {
    let found = (0..100).find_map(|seed| forgetful_trial(seed).unwrap().violations.into_iter().next());
    assert!(found.is_some(), "agents without memory break no promise: the checks see nothing");
}
