//! Worn batteries, of which nobody told the age, or of which the cycles are told.

use std::collections::BTreeSet;
use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::Discovery;
use lab::infer::candidate::candidates;
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::infer::frame::Frame;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

const SENSOR: &str = "[sensor.voltage_v]\nsigma = 1e-3\n";
/// A new cell as its maker measured it: nothing of it is free.
const NEW: &str = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.05, source = \"t\" }\n[[effect]]\nid = \"rc1\"\n\
                   resistance_ohm = { value = 0.03, source = \"t\" }\ntau_s = { value = 60.0, source = \"t\" }\n";
/// What wears, and how large it is.
type Wear<'a> = (&'a str, &'a str, f64);

fn model(wear: &[Wear<'_>]) -> Arc<Model> {
    let effect = |(id, name, value): &Wear<'_>| format!("[[effect]]\nid = \"{id}\"\n{name} = {{ value = {value:e}, source = \"t\" }}\n");
    made_up::model(&format!("{SENSOR}{NEW}{}", wear.iter().map(effect).collect::<String>()))
}

/// Two hours of pulses with rests, as that cell shows them after `cycles`, which are told or not.
fn log(truth: &Arc<Model>, of: &Model, seed: u64, cycles: f64, told: bool) -> Prepared {
    let current = |row: usize| [1.6, 0.0, 0.4, 0.0, -0.5][row / 30 % 5];
    let rows: String = (0..1440).map(|row| format!("{},{},3.9,25,{cycles}\n", 5 * row, current(row))).collect();
    let text = format!("time_s,current_a,voltage_v,temperature_degc,cycle_count\n{rows}");
    let facts = LogFacts { soc_initial: Some(0.95), ambient_degc: Some(25.0), ..LogFacts::default() };
    let mut log = read_log(&format!("pulses-{cycles}-{seed}.csv"), text.as_bytes(), facts).unwrap();
    let shown = predict(truth, &prepare(truth, &log).unwrap(), &truth.values());
    let (mut random, noise) = (Pcg64::new(u128::from(seed), cycles as u128), Normal::new(0.0, 1e-3).unwrap());
    let values = shown.of(Channel::VoltageV).unwrap().iter().map(|value| value + noise.sample(&mut random)).collect();
    log.channels.insert(Channel::VoltageV, values);
    log.channels.remove(&Channel::TemperatureDegc);
    if !told {
        log.channels.remove(&Channel::CycleCount);
    }
    prepare(of, &log).unwrap()
}

/// What is missing in logs of so many cycles each, with the numbers found.
fn found(wear: &[Wear<'_>], cycles: &[f64], told: bool, seed: u64) -> (BTreeSet<String>, Vec<(f64, f64)>) {
    let (base, truth) = (model(&[]), model(wear));
    let logs = cycles.iter().map(|&cycles| log(&truth, &base, seed, cycles, told)).collect();
    let search = search(Arc::clone(&base), Arc::new(Evidence::new(&base, logs)), None);
    let discovery = Discovery::of(&search);
    let number = |(effect, name, _): &Wear<'_>| {
        let of_effect = discovery.parameters.get(*effect)?;
        of_effect.get(*name).map(|number| (number.value, number.sigma.expect("known")))
    };
    (discovery.selected.iter().map(ToString::to_string).collect(), wear.iter().filter_map(number).collect())
}

fn named(wear: &[Wear<'_>]) -> BTreeSet<String> {
    wear.iter().map(|(effect, ..)| (*effect).to_owned()).collect()
}

#[test]
fn what_wore_of_a_cell_without_a_count_of_cycles_is_told_apart() {
    let cases: [&[Wear<'_>]; 3] = [
        &[("polarisation_health", "polarisation_ratio", 1.6)],
        &[("resistance_health", "resistance_ratio", 1.4)],
        &[("resistance_health", "resistance_ratio", 1.3), ("polarisation_health", "polarisation_ratio", 1.7)],
    ];
    for wear in cases {
        for seed in 1..=3 {
            let (missing, numbers) = found(wear, &[0.0], false, seed);
            assert_eq!(missing, named(wear), "seed {seed}");
            for ((value, sigma), (.., true_value)) in numbers.iter().zip(wear) {
                assert!((value - true_value).abs() < 4.0 * sigma && *sigma < 0.1, "seed {seed}: {value} +- {sigma}, is {true_value}");
            }
        }
    }
}

#[test]
fn where_cycles_are_told_the_growth_is_asked_about_and_not_its_sum() {
    let wear: &[Wear<'_>] = &[("polarisation_growth", "growth_per_cycle", 1.2e-3)];
    for seed in 1..=3 {
        let (missing, _) = found(wear, &[20.0, 500.0], true, seed);
        assert_eq!(missing, named(wear), "seed {seed}");
    }
}

#[test]
fn a_worn_battery_of_which_nobody_told_the_age_has_less_capacity() {
    let wear: &[Wear<'_>] = &[("capacity_health", "capacity_share", 0.75), ("resistance_health", "resistance_ratio", 1.4)];
    for seed in 1..=3 {
        let (missing, _) = found(wear, &[0.0], false, seed);
        assert_eq!(missing, named(wear), "seed {seed}");
    }
}

/// A gauge that was set up with a worn battery counts from nothing: that says as little of the battery's cycles as nothing does.
#[test]
fn cycles_that_are_counted_from_nothing_tell_no_age() {
    let base = model(&[]);
    let asked = |cycles: fn(f64) -> f64| {
        let mut log = log(&base, &base, 1, 0.0, false);
        let counted = log.time_s.iter().map(|time_s| cycles(*time_s)).collect();
        log.inputs.push((Channel::CycleCount, counted));
        let frame = Frame::new(Arc::clone(&base), Arc::new(Evidence::new(&base, vec![log])));
        candidates(&frame, &frame.start()).0.iter().any(|candidate| candidate.spec.id == "capacity_health")
    };
    assert!(asked(|time_s| time_s / 7200.0), "counted since the gauge was set up");
    assert!(!asked(|time_s| 700.0 + time_s / 7200.0), "counted since the battery was new");
    assert!(!asked(|_| 0.0), "said to be new");
}
