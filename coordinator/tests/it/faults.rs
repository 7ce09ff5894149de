//! Whatever goes wrong, the promises hold.

use coordinator::sim::{Trial, forgetful_trial, trial};

/// Seeds in the test command; `TENDER_SEEDS=FROM..TO` tries others, and prints what went wrong in one
/// that is tried alone.
const SEEDS: std::ops::Range<u64> = 0..200;

fn seeds() -> std::ops::Range<u64> {
    let Ok(text) = std::env::var("TENDER_SEEDS") else { return SEEDS };
    let (from, to) = text.split_once("..").expect("TENDER_SEEDS=FROM..TO");
    from.parse().expect("a number")..to.parse().expect("a number")
}

/// Trials are independent: as many at a time as there are cores.
fn trials(seeds: std::ops::Range<u64>) -> Vec<Trial> {
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
    let seeds = seeds();
    let (count, alone) = (seeds.end - seeds.start, seeds.end - seeds.start == 1);
    let trials = trials(seeds);
    if alone {
        println!("{}\n{}", trials[0].faults.join("\n"), trials[0].trace);
    }
    let told = |trial: &Trial| {
        let (seed, next, broken) = (trial.seed, trial.seed + 1, trial.violations.join("\n  "));
        let again = format!("TENDER_SEEDS={seed}..{next} cargo test -p coordinator --test it faults -- --nocapture");
        format!("seed {seed}:\n  {broken}\nagain, with all that happened: {again}")
    };
    let failed: Vec<String> = trials.iter().filter(|trial| !trial.violations.is_empty()).map(told).collect();
    assert!(failed.is_empty(), "{} of {count} seeds:\n{}", failed.len(), failed.join("\n"));
    let services: usize = trials.iter().map(|trial| trial.services).sum();
    let coordinators: usize = trials.iter().map(|trial| trial.coordinators).sum();
    println!("{count} trials, {services} services, {coordinators} coordinators: every promise held");
    // Trials in which nothing happens would hold any promise.
    assert!(alone || (services as u64 > count && coordinators as u64 > count), "{services} {coordinators}");
}

#[test]
fn agents_that_forget_are_found_out() {
    let found = (0..100).find_map(|seed| forgetful_trial(seed).unwrap().violations.into_iter().next());
    assert!(found.is_some(), "agents without memory break no promise: the checks see nothing");
}
