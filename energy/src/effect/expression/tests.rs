use std::sync::Arc;

use crate::real::{Dual, derivative, variable};
use crate::{Batch, Channel, DocumentError, Model, Run, Start};

const CELL: &str = "schema = 1\nsystem = \"battery\"\nname = \"cell\"\n[battery]\nseries = 2\nparallel = 1\ncapacity_ah = 2.0\nfull_v_per_cell = 4.0\neod_v_per_cell = 3.0\ncharge_current_a = 2.0\ncharge_cutoff_a = 0.1\nocv = { soc = [0.0, 1.0], voltage_v = [3.0, 4.0] }\n";

fn parse(system: &str, effects: &str) -> Result<Model, DocumentError> {
    let head = if system == "battery" { CELL.to_owned() } else { format!("schema = 1\nsystem = \"{system}\"\nname = \"t\"\n") };
    Model::parse("m.toml", &(head + effects), &|_| Err(String::new()))
}

fn run(system: &str, effects: &str) -> Run<f64> {
    Run::new(Arc::new(parse(system, effects).unwrap_or_else(|error| panic!("{error}"))), Start::at_soc(0.5))
}

const RESISTANCE: &str = "[[effect]]\nid = \"expression\"\nname = \"near_empty\"\nchannel = \"overpotential_v\"\nformula = \"k * current_a * exp(-soc / a)\"\nk = { value = 0.2, sigma = 0.1, source = \"guess\", free = true, min = 0.0, max = 2.0, null = 0.0 }\na = { value = 0.1, source = \"guess\", min = 0.01, max = 1.0 }\n";

/// 2 A for 36 s take 1 % of 2 Ah; the cell drops 0.2 x 2 x exp(-4.9) V.
#[test]
fn a_formula_adds_to_its_channel_what_it_says() {
    let mut run = run("battery", RESISTANCE);
    run.channels[Channel::CurrentA] = 2.0;
    run.step(36.0);
    let expected_v = 2.0 * (3.49 - 0.4 * (-4.9f64).exp());
    assert!((run.channels[Channel::VoltageV] - expected_v).abs() < 1e-12, "{}", run.channels[Channel::VoltageV]);
}

#[test]
fn a_formula_equals_the_effect_of_the_catalogue_that_it_spells() {
    let ohmic = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.05, source = \"t\" }\n";
    let spelt = "[[effect]]\nid = \"expression\"\nchannel = \"overpotential_v\"\nphase = \"series\"\nformula = \"r * cell_current_a\"\nr = { value = 0.05, source = \"t\" }\n";
    let rc = "[[effect]]\nid = \"rc1\"\nresistance_ohm = { value = 0.03, source = \"t\" }\ntau_s = { value = 40.0, source = \"t\" }\n";
    let slow = "[[effect]]\nid = \"expression\"\nname = \"slow\"\nchannel = \"overpotential_v\"\nformula = \"r * lagged\"\nr = { value = 0.03, source = \"t\" }\ntau_s = { value = 40.0, source = \"t\" }\n[effect.states]\nlagged = { input = \"cell_current_a\", tau = \"tau_s\" }\n";
    let (mut one, mut other) = (run("battery", &format!("{ohmic}{rc}")), run("battery", &format!("{spelt}{slow}")));
    for step in 0..200 {
        let current_a = f64::from((step / 7) % 5) - 1.5;
        for run in [&mut one, &mut other] {
            run.channels[Channel::CurrentA] = current_a;
            run.step(3.0 + f64::from(step % 3));
        }
        assert!((one.channels[Channel::VoltageV] - other.channels[Channel::VoltageV]).abs() < 1e-12);
    }
}

#[test]
fn derivatives_by_parameters_agree_with_differences() {
    let text = "[[effect]]\nid = \"expression\"\nchannel = \"overpotential_v\"\nformula = \"k * slow * exp(-soc / a)\"\nk = { value = 0.2, source = \"t\" }\na = { value = 0.3, source = \"t\" }\ntau_s = { value = 20.0, source = \"t\" }\nstates = { slow = { input = \"current_a\", tau = \"tau_s\" } }\n";
    let model = Arc::new(parse("battery", text).unwrap());
    let values = model.values();
    let at = |values: Vec<f64>| {
        let mut run = Run::with_parameters(Arc::clone(&model), values, Start::at_soc(0.5));
        run.channels[Channel::CurrentA] = 2.0;
        (0..20).for_each(|_| run.step(2.0));
        run.channels[Channel::VoltageV]
    };
    let duals: Vec<Dual> = values.iter().enumerate().map(|(lane, &value)| variable(value, lane)).collect();
    let mut run = Run::with_parameters(Arc::clone(&model), duals, Start::at_soc(0.5).lifted());
    run.channels[Channel::CurrentA] = Dual::from(2.0);
    (0..20).for_each(|_| run.step(2.0));
    for lane in 0..values.len() {
        let h = 1e-5 * values[lane];
        let moved = |by: f64| at(values.iter().enumerate().map(|(index, value)| if index == lane { value + by } else { *value }).collect());
        let difference = (moved(h) - moved(-h)) / (2.0 * h);
        assert!((derivative(&run.channels[Channel::VoltageV], lane) / difference - 1.0).abs() < 1e-6, "{lane}");
    }
}

#[test]
fn a_batch_steps_it_as_a_lone_run_does() {
    let model = Arc::new(parse("battery", RESISTANCE).unwrap());
    let mut batch = Batch::new(Arc::clone(&model), &[Start::at_soc(0.5); 3]);
    let mut run = Run::new(model, Start::at_soc(0.5));
    batch.channels.iter_mut().chain([&mut run.channels]).for_each(|channels| channels[Channel::CurrentA] = 1.5);
    batch.step(10.0);
    run.step(10.0);
    assert!(batch.channels.iter().all(|channels| channels[Channel::VoltageV] == run.channels[Channel::VoltageV]));
}

#[test]
fn time_counts_from_the_start_of_the_run() {
    let text = "[[effect]]\nid = \"expression\"\nname = \"fan\"\nchannel = \"power_w\"\nformula = \"p_w * sin(2 * pi * time_s / period_s)\"\np_w = { value = 3.0, source = \"t\", null = 0.0 }\nperiod_s = { value = 400.0, source = \"t\", min = 10.0 }\n";
    let mut run = run("robot", text);
    run.step(40.0);
    run.step(60.0);
    assert!((run.channels[Channel::PowerW] - 3.0).abs() < 1e-12);
    run.restart(Start::at_soc(0.0));
    run.step(200.0);
    assert!(run.channels[Channel::PowerW].abs() < 1e-12);
    // Or from where its clock stands then.
    run.restart(Start { clock_s: -100.0, ..Start::at_soc(0.0) });
    run.step(200.0);
    assert!((run.channels[Channel::PowerW] - 3.0).abs() < 1e-12);
}

#[test]
fn a_pole_that_a_run_meets_adds_nothing() {
    let text = "[[effect]]\nid = \"expression\"\nchannel = \"power_w\"\nformula = \"p / voltage_v\"\np = { value = 3.0, source = \"t\" }\n";
    let mut run = run("robot", text);
    run.step(1.0);
    assert_eq!(run.channels[Channel::PowerW], 0.0);
}

#[test]
fn several_expressions_are_told_apart_by_name() {
    let twice = RESISTANCE.replace("near_empty", "second");
    let model = parse("battery", &format!("{RESISTANCE}{twice}")).unwrap();
    assert_eq!(model.parameter("second", "k").unwrap().value, 0.2);
    assert!(model.parameter("near_empty", "k").unwrap().free);
    assert_eq!(model.without(|id| id == "second").parameters().len(), 2);
    let error = parse("battery", &format!("{RESISTANCE}{RESISTANCE}")).unwrap_err().to_string();
    assert!(error.contains("`near_empty` appears twice") && error.contains("name ="), "{error}");
}

#[test]
fn errors_point_into_the_formula_and_name_what_was_meant() {
    let head = CELL.matches('\n').count();
    for (from, to, line, column, words) in [
        ("exp(-soc / a)", "exp(-sok / a)", 5, 33, "unknown name `sok`; did you mean `soc`?"),
        ("exp(-soc", "exq(-soc", 5, 28, "unknown function `exq`; did you mean `exp`?"),
        ("/ a)\"", "/ a\"", 5, 31, "not closed"),
        ("overpotential_v", "overpotental_v", 4, 11, "did you mean `overpotential_v`?"),
        ("overpotential_v", "soc", 4, 11, "cannot add to soc"),
        ("overpotential_v", "cell_degc", 4, 11, "cannot add to cell_degc"),
        ("near_empty", "ohmic", 3, 8, "name of an effect of the catalogue"),
        ("exp(-soc / a)", "ln(soc / a)", 5, 11, "not finite"),
        ("exp(-soc / a)", "exp(-soc)", 7, 5, "`a` is not used"),
        ("k * current_a", "(1 + k) * current_a", 5, 11, "not 0, where k = 0"),
        ("a = { value", "a = { valeu", 7, 5, "unknown field `valeu`"),
        ("current_a * exp", "slow * exp", 5, 16, "unknown name `slow`"),
        ("a = {", "soc = {", 7, 7, "`soc` is the name of a channel"),
        ("name = \"near_empty\"", "phase = \"heat\"", 3, 9, "Allowed: series, polarisation"),
        ("name = \"near_empty\"", "phase = \"heet\"", 3, 9, "did you mean `heat`?"),
        ("name = \"near_empty\"", "states = { slow = { input = \"current\", tau = \"a\" } }", 3, 30, "did you mean `current_a`?"),
        ("name = \"near_empty\"", "states = { slow = { input = \"soc\", tau = \"tau\" } }", 3, 10, "tau = \"tau\" is no parameter"),
    ] {
        let text = RESISTANCE.replace(from, to);
        let error = parse("battery", &text).err().unwrap_or_else(|| panic!("{text}"));
        assert!(error.place == Some((head + line, column)) && error.message.contains(words), "{to}: {error}");
    }
}

#[test]
fn one_definition_is_kept_once_however_often_it_is_read() {
    let spec = || parse("battery", RESISTANCE).unwrap().effects().next().unwrap().spec();
    assert!(std::ptr::eq(spec(), spec()));
}

/// `0^n` is 0 for every n above 0: at a standstill neither the factor before it nor the exponent changes anything, whoever is free.
#[test]
fn a_standstill_has_no_slope_by_a_free_exponent() {
    let text = "[[effect]]\nid = \"expression\"\nchannel = \"power_w\"\nformula = \"k * abs(speed_mps) ^ n\"\nk = { value = 2.0, source = \"t\" }\nn = { value = 1.5, source = \"t\" }\n";
    let model = Arc::new(parse("robot", text).unwrap());
    let duals: Vec<Dual> = model.values().iter().enumerate().map(|(lane, &value)| variable(value, lane)).collect();
    let mut run = Run::with_parameters(Arc::clone(&model), duals, Start::at_soc(0.5).lifted());
    let mut power = |speed_mps: f64| {
        run.channels[Channel::SpeedMps] = Dual::from(speed_mps);
        run.step(1.0);
        run.channels[Channel::PowerW]
    };
    let (standing, driving) = (power(0.0), power(0.5));
    assert_eq!([standing.re, derivative(&standing, 0), derivative(&standing, 1)], [0.0; 3]);
    // By hand: 0.5^1.5 = 0.353553; 2 x 0.353553 x ln 0.5 = -0.490129.
    assert!((derivative(&driving, 0) - 0.353_553).abs() < 1e-6 && (derivative(&driving, 1) + 0.490_129).abs() < 1e-6, "{driving:?}");
}
