//! Time of a fit of R0, R1 and C1 to an hour at 1 Hz.
//!
//! `cargo bench -p lab --bench fit`. What is fitted begins at half of the truth, as what a data sheet says may be.

use std::sync::Arc;

use divan::{Bencher, black_box};
use energy::{Channel, Model};
use lab::fit::fit;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

fn main() {
    divan::main();
}

const VOLTAGE_SIGMA_V: f64 = 1e-3;
/// Ohm, ohm, s.
const TRUTH: [f64; 3] = [0.04, 0.02, 40.0];

/// A cell whose current is read to this deviation, A.
fn cell(current_sigma_a: f64) -> Arc<Model> {
    let text = format!(
        r#"
schema = 1
system = "battery"
name = "cell"
[battery]
series = 1
parallel = 1
capacity_ah = 5.0
full_v_per_cell = 4.2
eod_v_per_cell = 2.8
charge_current_a = 2.0
charge_cutoff_a = 0.1
ocv = {{ soc = [0.0, 1.0], voltage_v = [3.0, 4.2] }}
[sensor.voltage_v]
sigma = {VOLTAGE_SIGMA_V}
[sensor.current_a]
sigma = {current_sigma_a}
[[effect]]
id = "ohmic"
resistance_ohm = {{ value = 0.02, source = "start", free = true }}
[[effect]]
id = "rc1"
resistance_ohm = {{ value = 0.01, source = "start", free = true }}
tau_s = {{ value = 20.0, source = "start", free = true }}
"#
    );
    Arc::new(Model::parse("cell.toml", &text, &|_| Err("no table".to_owned())).unwrap())
}

/// An hour of blocks of half a minute, as it is read.
fn hour(model: &Arc<Model>) -> Prepared {
    let mut random = Pcg64::new(1, 0);
    let mut noisy = |value: f64, sigma: f64| value + Normal::new(0.0, sigma).unwrap().sample(&mut random);
    let currents_a: Vec<f64> = (0..3600).map(|second| [1.5, 0.0, 2.6, -0.8, 0.4][second / 30 % 5]).collect();
    let log = |currents_a: &[f64], volts: &[f64]| {
        let rows: String =
            currents_a.iter().zip(volts).enumerate().map(|(second, (amps, volts))| format!("{second},{amps},{volts}\n")).collect();
        let facts = LogFacts { soc_initial: Some(0.9), ..LogFacts::default() };
        prepare(model, &read_log("hour.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), facts).unwrap()).unwrap()
    };
    let felt = log(&currents_a, &vec![3.7; currents_a.len()]);
    let volts = predict(model, &felt, &TRUTH).of(Channel::VoltageV).unwrap().to_vec();
    let volts: Vec<f64> = volts.iter().map(|volts| noisy(*volts, VOLTAGE_SIGMA_V)).collect();
    let sigma_a = model.sensor(Channel::CurrentA).sigma;
    let currents_a: Vec<f64> = currents_a.iter().map(|amps| noisy(*amps, sigma_a)).collect();
    log(&currents_a, &volts)
}

fn fits(bencher: Bencher<'_, '_>, current_sigma_a: f64) {
    let model = cell(current_sigma_a);
    let logs = [hour(&model)];
    bencher.bench_local(|| {
        let fitted = fit(&model, &logs, &[0, 1, 2], &mut |_| {}).unwrap();
        assert!((fitted.values[2] - TRUTH[2]).abs() < 1.0);
        black_box(fitted)
    });
}

/// A current that is known.
#[divan::bench]
fn an_hour(bencher: Bencher<'_, '_>) {
    fits(bencher, 1e-4);
}

/// A current whose noise draws the numbers aside.
#[divan::bench]
fn an_hour_of_noisy_current(bencher: Bencher<'_, '_>) {
    fits(bencher, 0.02);
}
