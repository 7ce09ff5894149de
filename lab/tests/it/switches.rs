//! Logs that give the mean of a current over each row, and the voltage at its end, of loads that switch at any time.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::{Discovery, Verdict};
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::measurement::{Log, LogFacts, leave_out_edges, read_log};
use lab::predict::predict;
use lab::prepare::prepare;
use rand::RngExt as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

const MODEL: &str = r#"
[sensor.voltage_v]
sigma = 1e-3
[sensor.current_a]
sigma = 2e-3
[[effect]]
id = "ohmic"
resistance_ohm = { value = 0.03, source = "t", free = true }
[[effect]]
id = "rc1"
resistance_ohm = { value = 0.012, source = "t", free = true }
tau_s = { value = 40.0, source = "t", free = true }
"#;

/// Parts of a row in which the cell is stepped.
const PARTS: usize = 20;

/// An hour at one row a second, in which 2 A switch on and off about every ten minutes.
fn log(truth: &Arc<Model>, seed: u128) -> Log {
    let (noise, mut random) = (Normal::new(0.0, 1.0).unwrap(), Pcg64::new(seed, 0));
    let parts = 3600 * PARTS;
    let switches: Vec<usize> = (1..6).map(|spell| spell * parts / 6 + random.random_range(0..200 * PARTS)).collect();
    let felt_a = |part: usize| if switches.partition_point(|&at| at < part) % 2 == 1 { 2.0 } else { 0.0 };
    let rows: String = (0..=parts).map(|part| format!("{},{},3.9\n", part as f64 / PARTS as f64, felt_a(part))).collect();
    let facts = LogFacts { soc_initial: Some(0.9), ..LogFacts::default() };
    let read = |rows: &str| read_log("run.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), facts.clone()).unwrap();
    let volts = predict(truth, &prepare(truth, &read(&rows)).unwrap(), &truth.values()).of(Channel::VoltageV).unwrap().to_vec();
    let row = |row: usize| {
        let mean_a = if row == 0 { 0.0 } else { ((row - 1) * PARTS + 1..=row * PARTS).map(felt_a).sum::<f64>() / PARTS as f64 };
        let [of_current, of_voltage] = [(); 2].map(|()| noise.sample(&mut random));
        format!("{row},{},{}\n", mean_a + 2e-3 * of_current, volts[row * PARTS] + 1e-3 * of_voltage)
    };
    let rows: String = (0..=3600).map(row).collect();
    read(&rows)
}

fn verdict(model: &Arc<Model>, log: &Log) -> Verdict {
    Discovery::of(&search(Arc::clone(model), Arc::new(Evidence::new(model, vec![prepare(model, log).unwrap()])), None)).verdict
}

/// With those rows eight of ten right models lack something, or nothing explains what they leave.
#[test]
fn a_switch_within_a_row_is_no_missing_effect() {
    let model = made_up::model(MODEL);
    let mut misled = 0;
    for seed in 0..10 {
        let mut log = log(&model, seed);
        misled += u32::from(verdict(&model, &log) != Verdict::Complete);
        leave_out_edges(&mut log, &model);
        assert_eq!(verdict(&model, &log), Verdict::Complete, "seed {seed}: {:?}", log.notes);
    }
    assert!(misled > 5, "{misled}");
}
