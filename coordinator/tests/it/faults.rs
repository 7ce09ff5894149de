//! Whatever goes wrong, the promises hold.

use coordinator::sim::trial;

/// Seeds in the test command; `TENDER_SEEDS=FROM..TO` tries others, and prints what went wrong in one
/// that is tried alone.
const SEEDS: std::ops::Range<u64> = 0..200;

fn seeds() -> std::ops::Range<u64> {
    let Ok(text) = std::env::var("TENDER_SEEDS") else { return SEEDS };
    let (from, to) = text.split_once("..").expect("TENDER_SEEDS=FROM..TO");
    from.parse().expect("a number")..to.parse().expect("a number")
}

#[test]
fn no_promise_is_broken_whatever_goes_wrong() {
    let seeds = seeds();
    let alone = seeds.end - seeds.start == 1;
    let (mut failed, mut services, mut coordinators) = (Vec::new(), 0, 0);
    for seed in seeds.clone() {
        let trial = trial(seed).unwrap();
        services += trial.services;
        coordinators += trial.coordinators;
        if alone {
            println!("{}\n{}", trial.faults.join("\n"), trial.trace);
        }
        if !trial.violations.is_empty() {
            failed.push(format!(
                "seed {seed}:\n  {}\nagain, with all that happened: TENDER_SEEDS={seed}..{} cargo test -p coordinator --test it faults -- --nocapture",
                trial.violations.join("\n  "),
                seed + 1
            ));
        }
    }
    assert!(failed.is_empty(), "{} of {} seeds:\n{}", failed.len(), seeds.end - seeds.start, failed.join("\n"));
    // Trials in which nothing happens would hold any promise.
    assert!(
        alone || services as u64 > seeds.end - seeds.start && coordinators as u64 > seeds.end - seeds.start,
        "{services} {coordinators}"
    );
}
