//! Known parameters, simulated logs: a fit must give the parameters back, and its sigmas must be
//! honest.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::fit::{Fit, fit, free_parameters};
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare_to_judge};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

const TRUTH: [f64; 3] = [0.05, 0.02, 40.0];

/// A cell whose fit starts well away from the truth.
const MODEL: &str = r#"
[sensor.voltage_v]
sigma = 1e-3
[[effect]]
id = "ohmic"
resistance_ohm = { value = 0.02, source = "start", free = true }
[[effect]]
id = "rc1"
resistance_ohm = { value = 0.005, source = "start", free = true }
tau_s = { value = 150.0, source = "start", free = true }
"#;

fn model() -> Arc<Model> {
    made_up::model(MODEL)
}

/// Two logs of pulses of different length and sign, predicted with the true parameters.
fn clean(model: &Arc<Model>) -> Vec<Prepared> {
    let pulse = |seconds: usize, log: usize| match (seconds / (120 + 60 * log)) % 4 {
        0 => 2.0,
        1 => 0.0,
        2 => -1.0,
        _ => 0.5,
    };
    let mut logs = Vec::new();
    for log in 0..2 {
        let mut text = "time_s,current_a,voltage_v\n".to_owned();
        for second in (0..2400_usize).step_by(2) {
            text += &format!("{second},{},3.7\n", pulse(second, log));
        }
        let facts = LogFacts { soc_initial: Some(0.8), ..LogFacts::default() };
        let log = read_log(&format!("pulses-{log}.csv"), text.as_bytes(), facts).unwrap();
        let mut prepared = prepare_to_judge(model, &log, &[]).unwrap();
        let prediction = predict(model, &prepared, &TRUTH);
        prepared.targets[0].observed = prediction.of(Channel::VoltageV).unwrap().to_vec();
        logs.push(prepared);
    }
    logs
}

/// Fits logs with noise of 1 mV that follows itself with the given lag-1 correlation.
fn fit_noisy(model: &Arc<Model>, clean: &[Prepared], lag1: f64, seed: u64) -> Fit {
    let mut random = Pcg64::new(u128::from(seed), 0);
    let normal = Normal::new(0.0, 1e-3 * (1.0 - lag1 * lag1).sqrt()).unwrap();
    let mut logs = clean.to_vec();
    for log in &mut logs {
        let mut noise_v = Normal::new(0.0, 1e-3).unwrap().sample(&mut random);
        for voltage_v in &mut log.targets[0].observed {
            *voltage_v += noise_v;
            noise_v = lag1 * noise_v + normal.sample(&mut random);
        }
    }
    let free = free_parameters(model, &[], &[]).unwrap();
    fit(model, &logs, &free, &mut |_| {}).unwrap()
}

/// How often the true value lies within one sigma, by parameter.
fn coverage(lag1: f64) -> [f64; 3] {
    let model = model();
    let clean = clean(&model);
    let mut hits = [0; 3];
    for seed in 0..40 {
        let fit = fit_noisy(&model, &clean, lag1, seed);
        assert!(fit.solution.converged, "seed {seed}");
        for (index, hits) in hits.iter_mut().enumerate() {
            let sigma = fit.certainty.sigma[index].unwrap();
            *hits += u32::from((fit.values[index] - TRUTH[index]).abs() <= sigma);
        }
    }
    hits.map(|hits| f64::from(hits) / 40.0)
}

#[test]
fn a_fit_gives_back_what_the_logs_were_made_with() {
    let model = model();
    let fit = fit_noisy(&model, &clean(&model), 0.0, 7);
    for (index, truth) in TRUTH.iter().enumerate() {
        let sigma = fit.certainty.sigma[index].unwrap();
        assert!((fit.values[index] - truth).abs() <= 3.0 * sigma, "{}: {} +- {sigma}", truth, fit.values[index]);
        assert!(sigma < 0.05 * truth, "{truth}: sigma {sigma}");
    }
    let rms = (fit.solution.residual.norm_squared() / fit.rows as f64).sqrt();
    assert!((rms - 1.0).abs() < 0.05, "whitened RMS {rms}");
}

#[test]
fn without_noise_the_answer_is_exact() {
    let model = model();
    let clean = clean(&model);
    let fit = fit(&model, &clean, &[0, 1, 2], &mut |_| {}).unwrap();
    for (value, truth) in fit.values.iter().zip(TRUTH) {
        assert!((value / truth - 1.0).abs() < 1e-7, "{value} {truth}");
    }
}

#[test]
fn one_sigma_covers_about_two_thirds_under_white_noise() {
    let coverage = coverage(0.0);
    assert!(coverage.iter().all(|share| (0.5..=0.85).contains(share)), "{coverage:?}");
}

#[test]
fn one_sigma_is_honest_when_errors_follow_each_other() {
    // Without the correction for lag 1 the sigmas would be 3 times too small and cover a quarter.
    let coverage = coverage(0.8);
    assert!(coverage.iter().all(|share| (0.5..=0.97).contains(share)), "{coverage:?}");
}

#[test]
fn a_time_constant_without_its_resistance_is_named_as_not_determined() {
    let text = MODEL.replace(
        "resistance_ohm = { value = 0.005, source = \"start\", free = true }",
        "resistance_ohm = { value = 0.0, source = \"null\" }",
    );
    let model = made_up::model(&text);
    let logs = clean(&model);
    let free = free_parameters(&model, &[], &[]).unwrap();
    let fit = fit(&model, &logs, &free, &mut |_| {}).unwrap();
    assert_eq!(fit.certainty.silent, [false, true]);
    assert_eq!(fit.values[2], 150.0);
}
