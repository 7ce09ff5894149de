//! What is left of a pack's voltage counts by the cell.

use std::sync::Arc;

use energy::Channel;
use lab::infer::answer::{Discovery, Verdict};
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::prepare;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

/// What is said of so many cells whose voltage swings by `swing_v` beyond the model, every 50 s: no effect does that.
fn verdict(series: u32, swing_v: f64) -> Verdict {
    let rest = "[sensor.voltage_v]\nsigma = 2e-3\n[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.05, source = \"t\" }\n";
    let model = made_up::pack(series, rest);
    let rows: String = (0..1440).map(|row| format!("{},{},3.9\n", 5 * row, [1.2, 0.0, 0.4][row / 60 % 3])).collect();
    let facts = LogFacts { soc_initial: Some(0.95), ..LogFacts::default() };
    let mut log = read_log("pulses.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), facts).unwrap();
    let shown = predict(&model, &prepare(&model, &log).unwrap(), &model.values());
    let (mut random, noise) = (Pcg64::new(1, 0), Normal::new(0.0, 2e-3).unwrap());
    let swing = |row: usize| swing_v * (std::f64::consts::TAU * row as f64 / 10.0).sin();
    let values = shown.of(Channel::VoltageV).unwrap().iter().enumerate().map(|(row, volts)| volts + swing(row) + noise.sample(&mut random));
    log.channels.insert(Channel::VoltageV, values.collect());
    let logs = vec![prepare(&model, &log).unwrap()];
    Discovery::of(&search(Arc::clone(&model), Arc::new(Evidence::new(&model, logs)), None)).verdict
}

/// 1.2 mV RMS: 0.3 mV in every one of four cells, where half a millivolt is nothing that matters, and 1.2 in a single one.
#[test]
fn so_little_of_every_cell_is_no_sign_that_something_is_missing() {
    assert_eq!(verdict(4, 1.7e-3), Verdict::Complete);
    assert_eq!(verdict(1, 1.7e-3), Verdict::Unknown);
    // 0.9 mV in every cell.
    assert_eq!(verdict(4, 5e-3), Verdict::Unknown);
}
