//! Pairs of a cell over temperature and over charge, in made-up worlds where both are known.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::Discovery;
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

const SENSOR: &str = "[sensor.voltage_v]\nsigma = 1e-3\n";
/// What is known of the cell: the pair of the reference temperature is to be fitted.
const PAIR: &str = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.05, free = true, source = \"t\" }\n[[effect]]\nid = \"rc1\"\n\
                    resistance_ohm = { value = 0.03, free = true, source = \"t\" }\ntau_s = { value = 60.0, free = true, source = \"t\" }\n";
/// Effect, parameter and its true value.
type Truth<'a> = (&'a str, &'a str, f64);

fn model(hidden: &[Truth<'_>]) -> Arc<Model> {
    let ids: std::collections::BTreeSet<&str> = hidden.iter().map(|(id, ..)| *id).collect();
    let effect = |id: &&str| {
        let own = hidden.iter().filter(|(of, ..)| of == id);
        let values: String = own.map(|(_, name, value)| format!("{name} = {{ value = {value:e}, source = \"t\" }}\n")).collect();
        format!("[[effect]]\nid = \"{id}\"\n{values}")
    };
    made_up::model(&format!("{SENSOR}{PAIR}{}", ids.iter().map(effect).collect::<String>()))
}

/// Pulses with rests from nearly full to nearly empty, in a bath.
fn log(truth: &Arc<Model>, of: &Model, seed: u64, bath_degc: f64) -> Prepared {
    let current = |row: usize| [2.2, 0.0, 1.0, 0.0, -0.4, 0.0][row / 36 % 6];
    let rows: String = (0..2880).map(|row| format!("{},{},3.9,{bath_degc}\n", 5 * row, current(row))).collect();
    let text = format!("time_s,current_a,voltage_v,temperature_degc\n{rows}");
    let facts = LogFacts { soc_initial: Some(0.97), ..LogFacts::default() };
    let mut log = read_log(&format!("bath-{bath_degc}.csv"), text.as_bytes(), facts).unwrap();
    let shown = predict(truth, &prepare(truth, &log).unwrap(), &truth.values());
    let (mut random, noise) = (Pcg64::new(u128::from(seed), bath_degc as u128), Normal::new(0.0, 1e-3).unwrap());
    let values = shown.of(Channel::VoltageV).unwrap().iter().map(|value| value + noise.sample(&mut random)).collect();
    log.channels.insert(Channel::VoltageV, values);
    prepare(of, &log).unwrap()
}

/// Every number of what is found missing, with its deviation.
fn found(hidden: &[Truth<'_>], seed: u64) -> BTreeMap<(String, String), (f64, f64)> {
    let (base, truth) = (model(&[]), model(hidden));
    let logs = [5.0, 15.0, 35.0].map(|bath_degc| log(&truth, &base, seed, bath_degc));
    let search = search(Arc::clone(&base), Arc::new(Evidence::new(&base, logs.into())), None);
    let discovery = Discovery::of(&search);
    let numbers = discovery.selected.iter().flat_map(|id| {
        let own = discovery.parameters[id].iter();
        own.map(move |(name, number)| ((id.to_string(), name.to_string()), (number.value, number.sigma.unwrap_or(f64::NAN))))
    });
    numbers.collect()
}

fn is_found(hidden: &[Truth<'_>], seed: u64) {
    let numbers = found(hidden, seed);
    let ids = |all: Vec<&str>| all.into_iter().map(ToOwned::to_owned).collect::<std::collections::BTreeSet<String>>();
    assert_eq!(
        ids(numbers.keys().map(|(id, _)| id.as_str()).collect()),
        ids(hidden.iter().map(|(id, ..)| *id).collect()),
        "seed {seed}: {numbers:?}"
    );
    for (id, name, true_value) in hidden {
        let (value, sigma) = numbers[&((*id).to_owned(), (*name).to_owned())];
        assert!((value - true_value).abs() < 4.0 * sigma, "seed {seed}: {id} {name} {value} +- {sigma}, is {true_value}");
    }
}

/// The textbook's pair: its resistance follows the temperature, its capacitance does not, so its time does as the resistance.
#[test]
fn a_pair_whose_capacitance_the_temperature_leaves_alone_has_one_energy_in_two_effects() {
    for seed in 1..=3 {
        is_found(
            &[
                ("arrhenius", "activation_kj_per_mol", 20.0),
                ("polarisation_arrhenius", "activation_kj_per_mol", 40.0),
                ("relaxation_arrhenius", "activation_kj_per_mol", 40.0),
            ],
            seed,
        );
    }
}

#[test]
fn what_relaxes_slower_in_the_cold_is_not_taken_for_what_relaxes_more() {
    for seed in 1..=3 {
        is_found(&[("relaxation_arrhenius", "activation_kj_per_mol", 30.0)], seed);
        is_found(&[("polarisation_arrhenius", "activation_kj_per_mol", 30.0)], seed);
    }
}

#[test]
fn a_pair_that_is_larger_near_empty_is_told_from_a_resistance_that_is() {
    for seed in 1..=3 {
        is_found(
            &[
                ("polarisation_soc", "share_soc_000", 4.0),
                ("polarisation_soc", "share_soc_005", 3.0),
                ("polarisation_soc", "share_soc_010", 2.0),
                ("polarisation_soc", "share_soc_020", 0.7),
                ("polarisation_soc", "share_soc_100", 0.3),
            ],
            seed,
        );
    }
}
