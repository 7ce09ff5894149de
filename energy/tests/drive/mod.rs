//! An hour of driving, a model to drive, and the same equations integrated by brute force.
//!
//! Shared by the speed bench and the test that speed is not bought with error.

use std::sync::Arc;

use energy::{Channel, Model, Run, Start};

/// Seconds of the drive.
pub const SECONDS: usize = 3600;
/// State of charge at its start.
pub const SOC: f64 = 0.9;

/// OCV, R(SoC), two RC pairs and a thermal mass, all at stated values; `more` adds effects.
pub fn model(more: &str) -> Arc<Model> {
    let text = format!(
        r#"
        schema = 1
        system = "battery"
        name = "drive"
        battery = {{ series = 1, parallel = 1, capacity_ah = 1.32, full_v_per_cell = 4.2, eod_v_per_cell = 3.0, charge_current_a = 1.32, charge_cutoff_a = 0.066, ocv_csv = "enertech-lco-2280mah-ocv.csv" }}
        [[effect]]
        id = "ohmic_soc"
        resistance_soc_000_ohm = {{ value = 0.08, source = "bench" }}
        resistance_soc_005_ohm = {{ value = 0.08, source = "bench" }}
        resistance_soc_010_ohm = {{ value = 0.08, source = "bench" }}
        resistance_soc_020_ohm = {{ value = 0.08, source = "bench" }}
        resistance_soc_040_ohm = {{ value = 0.06, source = "bench" }}
        resistance_soc_070_ohm = {{ value = 0.05, source = "bench" }}
        resistance_soc_100_ohm = {{ value = 0.05, source = "bench" }}
        [[effect]]
        id = "rc1"
        resistance_ohm = {{ value = {R1}, source = "bench" }}
        tau_s = {{ value = {TAU1}, source = "bench" }}
        [[effect]]
        id = "rc2"
        resistance_ohm = {{ value = {R2}, source = "bench" }}
        tau_s = {{ value = {TAU2}, source = "bench" }}
        [[effect]]
        id = "thermal"
        conductance_w_per_k = {{ value = {G}, source = "bench" }}
        heat_share = {{ value = 1.0, source = "bench" }}
        heat_capacity_j_per_k = {{ value = {C}, source = "bench" }}
        {more}"#
    );
    let read = |table: &str| energy::built_in(table).map(str::to_owned).ok_or_else(|| "not built in".to_owned());
    Arc::new(Model::parse("drive", &text, &read).unwrap())
}

/// The text of a hysteresis effect.
pub const HYSTERESIS: &str =
    "[[effect]]\nid = \"hysteresis\"\namplitude_v = { value = 0.01, source = \"bench\" }\nrate = { value = 50.0, source = \"bench\" }\n";

const R1: f64 = 0.02;
const TAU1: f64 = 30.0;
const R2: f64 = 0.03;
const TAU2: f64 = 600.0;
const G: f64 = 0.03;
const C: f64 = 26.0;

/// Current of each second, A: driving, braking and standing between -1 A and 2 A.
pub fn profile() -> Vec<f64> {
    let wave = |second: usize, period_s: f64| (std::f64::consts::TAU * second as f64 / period_s).sin();
    (0..SECONDS).map(|second| 0.5 + wave(second, 37.0) + 0.5 * wave(second, 11.0)).collect()
}

/// Voltage and temperature at the end of each second, by the model.
pub fn stepped(model: &Arc<Model>, profile: &[f64]) -> Vec<[f64; 2]> {
    let mut run = Run::new(Arc::clone(model), Start::at_soc(SOC));
    let step = |&current_a: &f64| {
        run.channels[Channel::CurrentA] = current_a;
        run.step(1.0);
        [run.channels[Channel::VoltageV], run.channels[Channel::TemperatureDegc]]
    };
    profile.iter().map(step).collect()
}

/// The same by the classic fourth-order Runge-Kutta method in steps of 10 ms, from the
/// differential equations and not from the crate's steps.
pub fn integrated(model: &Arc<Model>, profile: &[f64], amplitude_v: f64) -> Vec<[f64; 2]> {
    const DT_S: f64 = 0.01;
    const GAMMA: f64 = 50.0;
    let facts = model.battery();
    let resistance_ohm = |soc: f64| match soc {
        soc if soc <= 0.2 => 0.08,
        soc if soc <= 0.4 => 0.08 - 0.02 * (soc - 0.2) / 0.2,
        soc if soc <= 0.7 => 0.06 - 0.01 * (soc - 0.4) / 0.3,
        _ => 0.05,
    };
    let over_v = |x: &[f64; 5], i: f64| resistance_ohm(x[0]) * i + x[1] + x[2] + amplitude_v * x[3];
    // States: charge, both polarisations, hysteresis, temperature.
    let rate = |x: &[f64; 5], i: f64| {
        let q_as = facts.capacity_ah * 3600.0;
        [
            -i / q_as,
            (R1 * i - x[1]) / TAU1,
            (R2 * i - x[2]) / TAU2,
            GAMMA * i.abs() / q_as * (i.signum() - x[3]),
            (over_v(x, i) * i - G * (x[4] - 25.0)) / C,
        ]
    };
    let mut x = [SOC, 0.0, 0.0, 0.0, 25.0];
    let second = |&i: &f64| {
        for _ in 0..(1.0 / DT_S) as usize {
            let plus = |k: &[f64; 5], h: f64| std::array::from_fn(|n| x[n] + h * k[n]);
            let k1 = rate(&x, i);
            let k2 = rate(&plus(&k1, DT_S / 2.0), i);
            let k3 = rate(&plus(&k2, DT_S / 2.0), i);
            let k4 = rate(&plus(&k3, DT_S), i);
            x = std::array::from_fn(|n| x[n] + DT_S / 6.0 * (k1[n] + 2.0 * k2[n] + 2.0 * k3[n] + k4[n]));
        }
        [facts.ocv.voltage_v(x[0]) - over_v(&x, i), x[4]]
    };
    profile.iter().map(second).collect()
}

/// Greatest difference of voltage, V, and temperature, K.
pub fn greatest_difference(a: &[[f64; 2]], b: &[[f64; 2]]) -> [f64; 2] {
    let column = |n: usize| a.iter().zip(b).map(|(a, b)| (a[n] - b[n]).abs()).fold(0.0, f64::max);
    [column(0), column(1)]
}
