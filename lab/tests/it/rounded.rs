//! Logs whose voltage is read in steps that its noise does not fill: what a right model leaves of them is no missing effect.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::{Discovery, Verdict};
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand::RngExt as _;
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64Mcg;

use crate::made_up;

/// How a battery management system reads: to 10 mV, with a tenth of that in noise.
const STEP_V: f64 = 0.01;
const NOISE_V: f64 = 1e-3;

fn model(floor: &str) -> Arc<Model> {
    made_up::model(&format!(
        "{floor}[uncertainty]\nocv_sigma_v = 3e-3\nsoc_initial_sigma = 0.01\n[[effect]]\nid = \"ohmic\"\nresistance_ohm = {{ value = 0.05, source = \"t\", free = true }}\n\
         [[effect]]\nid = \"rc1\"\nresistance_ohm = {{ value = 0.02, source = \"t\", free = true }}\n\
         tau_s = {{ value = 60.0, source = \"t\", free = true }}\n"
    ))
}

/// An hour and a half of a robot's work: a current that changes every few minutes, and rests.
fn logs(model: &Arc<Model>, seed: u64) -> Vec<Prepared> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let log = |random: &mut Pcg64Mcg, name: usize| {
        let mut current_a = Vec::new();
        while current_a.len() < 2700 {
            let (level_a, rows) = (random.random_range(-1.0..1.5_f64), random.random_range(20..200));
            let level_a = if level_a < -0.2 { 0.0 } else { level_a };
            current_a.extend(std::iter::repeat_n(level_a, rows));
        }
        let rows: String =
            current_a[..2700].iter().enumerate().map(|(row, current_a)| format!("{},{current_a:.4},3.7\n", 2 * row)).collect();
        let facts = LogFacts { soc_initial: Some(0.9), ..LogFacts::default() };
        let text = format!("time_s,current_a,voltage_v\n{rows}");
        let mut log = read_log(&format!("work-{name}.csv"), text.as_bytes(), facts).unwrap();
        let volts = predict(model, &prepare(model, &log).unwrap(), &model.values());
        let noise = Normal::new(0.0, NOISE_V).unwrap();
        let mut read = |volts: &f64| ((volts + noise.sample(random)) / STEP_V).round() * STEP_V;
        let volts = volts.of(Channel::VoltageV).unwrap().iter().map(&mut read).collect();
        log.channels.insert(Channel::VoltageV, volts);
        prepare(model, &log).unwrap()
    };
    (0..2).map(|name| log(&mut random, name)).collect()
}

#[test]
fn nothing_is_missing_where_readings_are_rounded() {
    // `TENDER_ROUNDED=24` for more of them.
    let seeds: u64 = std::env::var("TENDER_ROUNDED").map_or(6, |seeds| seeds.parse().unwrap());
    let mut wrong = 0;
    for (floor, stated) in [("", "not stated"), ("[sensor.voltage_v]\nsigma = 1e-3\nquantum = 0.01\n", "stated")] {
        let model = model(floor);
        let mut named = Vec::new();
        for seed in 0..seeds {
            let evidence = Evidence::new(&model, logs(&model, seed));
            let found = Discovery::of(&search(Arc::clone(&model), Arc::new(evidence), None));
            if found.verdict != Verdict::Complete {
                named.push((seed, found.verdict, found.selected.clone()));
            }
        }
        println!("floor {stated}: {} of {seeds} not complete: {named:?}", named.len());
        wrong += named.len();
    }
    assert_eq!(wrong, 0);
}
