//! Logs of which it is only roughly known how warm it was around the battery.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::Discovery;
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
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

fn model() -> Arc<Model> {
    made_up::model(&format!("{SENSORS}{KNOWN}"))
}

/// An hour and a half of pulses in surroundings of 10 °C as this cell shows them, with what `facts` say of it.
fn log(truth: &Arc<Model>, seed: u64, facts: LogFacts) -> Prepared {
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
    prepare(truth, &log).unwrap()
}

/// What is missing, and what was learnt of the surroundings, K and its sigma.
fn found(facts: &LogFacts, seed: u64) -> (Vec<String>, Option<(f64, f64)>) {
    let base = model();
    let logs = vec![log(&base, seed, facts.clone())];
    let search = search(Arc::clone(&base), Arc::new(Evidence::new(&base, logs)), None);
    let around = left_out(search.last.told()).into_iter().find(|one| one.what.starts_with("temperature around"));
    (Discovery::of(&search).selected.iter().map(ToString::to_string).collect(), around.map(|one| (one.shift, one.sigma)))
}

#[test]
fn surroundings_that_are_only_roughly_known_are_learnt_and_are_no_missing_effect() {
    let roughly = LogFacts { ambient_degc: Some(12.0), ambient_sigma_k: Some(1.5), ..LogFacts::default() };
    let (mut squares, seeds) = (0.0, 1..=6);
    for seed in seeds.clone() {
        let (missing, around) = found(&roughly, seed);
        assert!(missing.is_empty(), "seed {seed}: {missing:?}");
        let (shift_k, sigma_k) = around.expect("two kelvin are worth telling");
        assert!(sigma_k < 0.1, "seed {seed}: {shift_k} +- {sigma_k}");
        squares += ((shift_k + 2.0) / sigma_k).powi(2);
    }
    // Six squares of a standard normal lie below 18.5 in 99.5 % of all cases.
    assert!(squares < 18.5, "{squares}");
    // Stated as exact, they are explained by something else.
    let exactly = LogFacts { ambient_degc: Some(12.0), ..LogFacts::default() };
    assert!(!found(&exactly, 1).0.is_empty());
}
