//! Every effect of the catalogue, whatever it is, can be found again: a log is simulated with
//! the effect in it and with the noise of the model's sensors, and a fit that starts from the
//! catalogue's defaults gives the effect's parameters back within their deviations.
//!
//! No effect is named here. A new one is picked up with its line in the catalogue; what it needs
//! to be seen must be in the inputs of [`excitation`]. What cannot hold for an effect stands in a
//! table with the reason.

mod excitation;
mod least_squares;

use std::sync::Arc;

use energy::{Channel, EffectSpec, Model, Run, System, built_in, catalogue};
use excitation::{Log, logs};
use least_squares::{Fit, fit};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// Effects that the recovery leaves out: system, id, reason.
const NOT_RECOVERED: &[(System, &str, &str)] = &[];

/// Parameters that no log of the effect alone can tell from the effect's others, and which the
/// fit therefore knows: system, id, parameter, reason.
const HELD: &[(System, &str, &str, &str)] =
    &[(System::Battery, "thermal", "heat_share", "scales with conductance and heat capacity: energy conservation says 1")];

/// Effects whose absence is not the model at their nulls: system, id, reason.
const NOT_NULL: &[(System, &str, &str)] =
    &[(System::Robot, "motion", "without a mass of its own a robot still carries its payload over slopes")];

/// How many times larger than the least that matters the simulated effect is, on its own channel.
const TIMES_MATTERS: f64 = 10.0;
/// A parameter counts as identifiable when its deviation is below this share of its size.
const IDENTIFIABLE: f64 = 0.3;
/// Deviations that an estimate may lie beside the truth. One in 16 000 estimates lies beyond.
const SIGMAS_MAX: f64 = 4.0;

/// What stands beside or instead of a built-in model's effects, so that everything that others
/// multiply is there and moves.
const BATTERY_BESIDE: &str = r#"
    effect = [{ id = "rc1", resistance_ohm = { value = 0.03, source = "guess" } }]
"#;

/// Loads on the rails that come and go, and motors with more resistance than the Explorer's.
const ROBOT_BESIDE: &str = r#"
    effect = [
        { id = "cpu" },
        { id = "radio", send_w = { value = 3.0, source = "guess" } },
        { id = "camera", camera_w = { value = 3.0, source = "guess" } },
        { id = "motor_copper", copper_w_per_n2 = { value = 0.3, source = "guess" } },
    ]
"#;

/// The model that an effect is tried in.
fn base(system: System) -> toml::Table {
    let (name, beside) = match system {
        System::Battery => ("explorer-3s1p-1320mah", BATTERY_BESIDE),
        System::Robot => ("explorer-robot", ROBOT_BESIDE),
        System::Station => ("mds-station", "effect = []"),
    };
    let parse = |text: &str| -> toml::Table { text.parse().unwrap_or_else(|error| panic!("{error}")) };
    let (mut model, beside) = (parse(built_in(name).unwrap()), parse(beside));
    let effects = model["effect"].as_array_mut().unwrap();
    for effect in beside["effect"].as_array().unwrap() {
        effects.retain(|known| known["id"] != effect["id"]);
        effects.push(effect.clone());
    }
    model
}

/// The base model without the effect, or with it at the given values.
fn model(spec: &EffectSpec, values: Option<&[f64]>) -> Arc<Model> {
    let mut table = base(spec.system);
    let effects = table["effect"].as_array_mut().unwrap();
    effects.retain(|effect| effect["id"].as_str() != Some(spec.id));
    if let Some(values) = values {
        let mut effect = toml::Table::new();
        effect.insert("id".to_owned(), spec.id.into());
        for (parameter, &value) in spec.parameters.iter().zip(values) {
            let mut entry = toml::Table::new();
            entry.insert("value".to_owned(), value.into());
            entry.insert("source".to_owned(), "test".into());
            effect.insert(parameter.name.to_owned(), entry.into());
        }
        effects.push(effect.into());
    }
    let text = toml::to_string(&table).unwrap();
    let read = |file: &str| Ok(built_in(file).unwrap().to_owned());
    Arc::new(Model::parse(spec.id, &text, &read).unwrap_or_else(|error| panic!("{error}\n{text}")))
}

/// Channels that a log may hold measurements of and the model predicts.
fn targets(model: &Model) -> Vec<Channel> {
    let known = model.system.targets().iter().copied();
    known.filter(|&channel| channel != Channel::TemperatureDegc || model.predicts_temperature()).collect()
}

/// Runs a model through every log and collects a number of each of its channels per row.
fn run(model: &Arc<Model>, logs: &[Log], channels: &[Channel]) -> Vec<f64> {
    let mut rows = Vec::new();
    for log in logs {
        let mut run = Run::new(Arc::clone(model), log.start);
        for row in &log.rows {
            row.apply(&mut run);
            rows.extend(channels.iter().map(|&channel| run.channels[channel]));
        }
    }
    rows
}

fn rms(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

/// Values at which the effect is off its nulls, shaped other than by default, and well above what
/// matters on its own channel; and how many times larger than that.
fn truth(spec: &EffectSpec, logs: &[Log]) -> (Vec<f64>, f64) {
    let without = run(&model(spec, None), logs, &[spec.channel]);
    // Unlike steps for the parameters, so that a fit cannot live by their symmetry.
    let unlike = |index: usize| [1.0, 0.8, 1.2, 0.9, 1.1][index % 5];
    let at = |size: f64| -> Vec<f64> {
        let value = |(index, p): (usize, &energy::ParameterSpec)| match p.null {
            None if p.min > 0.0 => p.default * 1.25,
            None => p.default + 0.25 * (p.default - p.min).abs().min(p.max - p.default),
            Some(null) if p.default != null => null + (p.default - null) * size * unlike(index),
            Some(null) => null + (p.max - null) * 0.01 * size * unlike(index),
        };
        let inside = |p: &energy::ParameterSpec, value: f64| {
            let margin = 0.05 * (p.max - p.min);
            if p.null == Some(p.max) || p.null == Some(p.min) || p.null.is_none() {
                value.clamp(p.min + margin.min((p.default - p.min).abs()), p.max - margin.min((p.max - p.default).abs()))
            } else {
                value.clamp(p.min + margin, p.max - margin)
            }
        };
        spec.parameters.iter().enumerate().map(|(index, p)| inside(p, value((index, p)))).collect()
    };
    let mut size = 1.4;
    loop {
        let values = at(size);
        let times = rms(&run(&model(spec, Some(&values)), logs, &[spec.channel]), &without) / spec.matters;
        if times >= TIMES_MATTERS || size > 1e4 || at(size * 1.4) == values {
            return (values, times);
        }
        size *= 1.4;
    }
}

/// A parameter's size, of which its deviation is a share.
fn size(spec: &EffectSpec, index: usize, value: f64) -> f64 {
    (value - spec.parameters[index].null.unwrap_or(0.0)).abs()
}

/// Simulates, fits, and says what is wrong, or how each parameter came out.
fn recover(spec: &EffectSpec) -> Result<String, String> {
    let logs = logs(spec.system);
    let (truth, times) = truth(spec, &logs);
    let true_model = model(spec, Some(&truth));
    let channels = targets(&true_model);
    let sigmas: Vec<f64> = channels.iter().map(|&channel| true_model.sensor(channel).floor()).collect();
    let mut random = Pcg64Mcg::seed_from_u64(spec.id.bytes().fold(7, |seed, byte| seed * 31 % 1_000_003 + u64::from(byte)));
    let mut measured = run(&true_model, &logs, &channels);
    for (index, value) in measured.iter_mut().enumerate() {
        let noise: f64 = StandardNormal.sample(&mut random);
        *value = true_model.sensor(channels[index % channels.len()]).shows(*value, noise, 0.0, 0.0);
    }
    let held =
        |index: usize| HELD.iter().any(|&(system, id, name, _)| (system, id, name) == (spec.system, spec.id, spec.parameters[index].name));
    let start: Vec<f64> = spec.parameters.iter().enumerate().map(|(index, p)| if held(index) { truth[index] } else { p.default }).collect();
    let free: Vec<&str> = spec.parameters.iter().enumerate().filter(|(index, _)| !held(*index)).map(|(_, p)| p.name).collect();
    let Fit { values, sigmas: deviations, chi2_per_row } =
        fit(&model(spec, Some(&start)), spec.id, &free, &logs, &channels, &measured, &sigmas);
    let mut lines = vec![format!("{} {}: {times:.0} times what matters, chi2 per row {chi2_per_row:.3}", spec.system.name(), spec.id)];
    let (mut identifiable, mut missed) = (0, false);
    for (index, p) in spec.parameters.iter().enumerate() {
        if held(index) {
            lines.push(format!("  {}: {:.6}, held", p.name, truth[index]));
            continue;
        }
        let sure = deviations[index] < IDENTIFIABLE * size(spec, index, truth[index]);
        let off = (values[index] - truth[index]).abs() / deviations[index];
        identifiable += usize::from(sure);
        missed |= sure && (off > SIGMAS_MAX || off.is_nan());
        let verdict = if !sure {
            "not identifiable"
        } else if off > SIGMAS_MAX {
            "MISSED"
        } else {
            "back"
        };
        lines.push(format!(
            "  {}: true {:.6}, fitted {:.6} +- {:.2e} ({off:.1} sigma), from {:.6}: {verdict}",
            p.name, truth[index], values[index], deviations[index], p.default
        ));
    }
    // Noise alone leaves 1 +- sqrt(2 / rows); readings in steps, a little less or more.
    let spread = (2.0 / measured.len() as f64).sqrt();
    if (chi2_per_row - 1.0).abs() > 6.0 * spread + 0.02 {
        missed = true;
        lines.push("  the fit does not reach the noise".to_owned());
    }
    if times < 1.0 || times.is_nan() {
        missed = true;
        lines.push("  even at its bounds it does not matter: the logs do not excite it, or `matters` is wrong".to_owned());
    }
    if identifiable == 0 {
        missed = true;
        lines.push("  no parameter is identifiable".to_owned());
    }
    if missed { Err(lines.join("\n")) } else { Ok(lines.join("\n")) }
}

/// Asserts that a table of exceptions names effects that there are.
fn assert_known(table: &[(System, &str, &str)]) {
    for (system, id, reason) in table {
        assert!(energy::find(*system, id).is_some(), "{id} is no effect of a {}", system.name());
        assert!(reason.len() > 20, "{id}: say why");
    }
}

/// Asserts that the parameters held are parameters.
fn assert_held_known() {
    for (system, id, name, reason) in HELD {
        assert_known(&[(*system, id, reason)]);
        let (_, effect) = energy::find(*system, id).unwrap();
        assert!(effect.spec().parameters.iter().any(|p| p.name == *name), "{id} has no parameter {name}");
    }
}

fn is_in(table: &[(System, &str, &str)], spec: &EffectSpec) -> bool {
    table.iter().any(|(system, id, _)| *system == spec.system && *id == spec.id)
}

#[test]
fn every_effect_is_found_again_from_a_noisy_log() {
    assert_known(NOT_RECOVERED);
    assert_held_known();
    let only = std::env::var("EFFECT").ok();
    let specs = catalogue().iter().map(|effect| effect.spec());
    let specs = specs.filter(|spec| !is_in(NOT_RECOVERED, spec) && only.as_deref().is_none_or(|only| only == spec.id));
    let (mut found, mut failures) = (Vec::new(), Vec::new());
    for spec in specs {
        match recover(spec) {
            Ok(text) => found.push(text),
            Err(text) => failures.push(text),
        }
    }
    println!("{}", found.join("\n"));
    assert!(
        failures.is_empty(),
        "{} of {} effects are not found again:\n{}",
        failures.len(),
        failures.len() + found.len(),
        failures.join("\n")
    );
}

#[test]
fn every_effect_vanishes_at_its_nulls() {
    assert_known(NOT_NULL);
    let mut failures = Vec::new();
    for spec in catalogue().iter().map(|effect| effect.spec()).filter(|spec| !is_in(NOT_NULL, spec)) {
        let logs = logs(spec.system);
        let nulls: Vec<f64> = spec.parameters.iter().map(|p| p.null.unwrap_or(p.default)).collect();
        let without = model(spec, None);
        let channels = targets(&without);
        let difference = rms(&run(&without, &logs, &channels), &run(&model(spec, Some(&nulls)), &logs, &channels));
        if difference > 1e-9 || difference.is_nan() {
            failures.push(format!("{} {}: {difference:e}", spec.system.name(), spec.id));
        }
    }
    assert!(failures.is_empty(), "still there at their nulls:\n{}", failures.join("\n"));
}

#[test]
fn every_input_that_an_effect_needs_is_exercised() {
    for spec in catalogue().iter().map(|effect| effect.spec()) {
        let logs = logs(spec.system);
        for &channel in spec.needs.iter().filter(|channel| !spec.system.computed().contains(channel)) {
            let values: Vec<f64> = run(&model(spec, None), &logs, &[channel]);
            let varies = values.iter().any(|value| (value - values[0]).abs() > 1e-12);
            assert!(varies, "{}: no log moves {}", spec.id, channel.name());
        }
    }
}
