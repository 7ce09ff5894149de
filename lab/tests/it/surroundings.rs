//! Logs of which it is only roughly known how warm it was around the battery, or how old the battery was.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::Discovery;
use lab::infer::candidate::candidates;
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::infer::frame::Frame;
use lab::learned::left_out;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

const SENSORS: &str = "[sensor.voltage_v]\nsigma = 1e-3\n[sensor.temperature_degc]\nsigma = 0.1\n";
const KNOWN: &str = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.08, source = \"t\" }\n[[effect]]\nid = \"thermal\"\n\
                     conductance_w_per_k = { value = 0.05, source = \"t\" }\nheat_capacity_j_per_k = { value = 40.0, source = \"t\" }\n\
                     heat_share = { value = 1.0, source = \"t\" }\n";

fn model(effects: &str) -> Arc<Model> {
    made_up::model(&format!("{SENSORS}{KNOWN}{effects}"))
}

/// An hour and a half of pulses in surroundings of 10 °C as this cell shows them, with what `facts` say of it.
fn log(truth: &Arc<Model>, of: &Model, seed: u64, facts: LogFacts) -> Prepared {
    let rows: String = (0..1080).map(|row| format!("{},{},3.9,10\n", 5 * row, [1.5, 0.3][row / 120 % 2])).collect();
    let text = format!("time_s,current_a,voltage_v,temperature_degc\n{rows}");
    let read =
        |facts: LogFacts| read_log(&format!("pulses-{seed}.csv"), text.as_bytes(), LogFacts { soc_initial: Some(1.0), ..facts }).unwrap();
    let known = read(LogFacts { ambient_degc: Some(10.0), ..LogFacts::default() });
    let shown = predict(truth, &prepare(truth, &known).unwrap(), &truth.values());
    let mut random = Pcg64::new(u128::from(seed), 0);
    let mut log = read(facts);
    for (channel, sigma) in [(Channel::VoltageV, 1e-3), (Channel::TemperatureDegc, 0.1)] {
        let noise = Normal::new(0.0, sigma).unwrap();
        let values = shown.of(channel).unwrap().iter().map(|value| value + noise.sample(&mut random)).collect();
        log.channels.insert(channel, values);
    }
    prepare(of, &log).unwrap()
}

/// What is missing, and what was learnt of the surroundings, K and its sigma.
fn found(truth: &str, facts: &LogFacts, seed: u64) -> (Vec<String>, Option<(f64, f64)>) {
    let (base, truth) = (model(""), model(truth));
    let logs = vec![log(&truth, &base, seed, facts.clone())];
    let search = search(Arc::clone(&base), Arc::new(Evidence::new(&base, logs)), None);
    let around = left_out(search.last.told()).into_iter().find(|one| one.what.starts_with("temperature around"));
    (Discovery::of(&search).selected.iter().map(ToString::to_string).collect(), around.map(|one| (one.shift, one.sigma)))
}

#[test]
fn surroundings_that_are_only_roughly_known_are_learnt_and_are_no_missing_effect() {
    let roughly = LogFacts { ambient_degc: Some(12.0), ambient_sigma_k: Some(1.5), ..LogFacts::default() };
    let (mut squares, seeds) = (0.0, 1..=6);
    for seed in seeds.clone() {
        let (missing, around) = found("", &roughly, seed);
        assert!(missing.is_empty(), "seed {seed}: {missing:?}");
        let (shift_k, sigma_k) = around.expect("two kelvin are worth telling");
        assert!(sigma_k < 0.1, "seed {seed}: {shift_k} +- {sigma_k}");
        squares += ((shift_k + 2.0) / sigma_k).powi(2);
    }
    // Six squares of a standard normal lie below 18.5 in 99.5 % of all cases.
    assert!(squares < 18.5, "{squares}");
    // Stated as exact, they are explained by something else.
    let exactly = LogFacts { ambient_degc: Some(12.0), ..LogFacts::default() };
    assert!(!found("", &exactly, 1).0.is_empty());
}

#[test]
fn a_worn_battery_of_which_nobody_told_the_age_is_called_worn() {
    let truth = "[[effect]]\nid = \"capacity_health\"\ncapacity_share = { value = 0.75, source = \"t\" }\n\
                 [[effect]]\nid = \"resistance_health\"\nresistance_ratio = { value = 1.4, source = \"t\" }\n";
    let facts = LogFacts { ambient_degc: Some(10.0), ..LogFacts::default() };
    for seed in 1..=3 {
        let (missing, _) = found(truth, &facts, seed);
        assert!(missing.contains(&"capacity_health".to_owned()), "seed {seed}: {missing:?}");
    }
}

/// A gauge that was set up with a worn battery counts from nothing: that says as little of the battery's cycles as nothing does.
#[test]
fn cycles_that_are_counted_from_nothing_tell_no_age() {
    let base = model("");
    let asked = |cycles: fn(f64) -> f64| {
        let facts = LogFacts { ambient_degc: Some(10.0), ..LogFacts::default() };
        let mut log = log(&base, &base, 1, facts);
        let counted = log.time_s.iter().map(|time_s| cycles(*time_s)).collect();
        log.inputs.push((Channel::CycleCount, counted));
        let frame = Frame::new(Arc::clone(&base), Arc::new(Evidence::new(&base, vec![log])));
        candidates(&frame, &frame.start()).0.iter().any(|candidate| candidate.spec.id == "capacity_health")
    };
    assert!(asked(|time_s| time_s / 7200.0), "counted since the gauge was set up");
    assert!(!asked(|time_s| 700.0 + time_s / 7200.0), "counted since the battery was new");
    assert!(!asked(|_| 0.0), "said to be new");
}
