//! What of an error is that of sensors and of starts, on logs of a made-up cell.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::compare::{Comparison, Verdict, calibrate};
use lab::fit::calibrated::fit_calibrated;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

const SENSORS: &str = "[uncertainty]\nsoc_initial_sigma = 0.01\nocv_sigma_v = 3e-3\n\
                       [sensor.voltage_v]\nsigma = 1e-3\noffset_sigma = 5e-3\n[sensor.current_a]\nsigma = 0.0\ngain_sigma = 0.01\n";
const KNOWN: &str = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.08, source = \"t\", free = true }\n";
const HIDDEN: &str =
    "[[effect]]\nid = \"rc1\"\nresistance_ohm = { value = 0.03, source = \"t\" }\ntau_s = { value = 60.0, source = \"t\" }\n";

fn model(effects: &str) -> Arc<Model> {
    made_up::model(&format!("{SENSORS}{KNOWN}{effects}"))
}

/// What the voltmeter adds, V, the factor of the ammeter beyond 1, and the charge at the start beyond what the log says.
type Off = [f64; 3];
/// Their deviations, as the model states them.
const STATED: Off = [5e-3, 0.01, 0.01];
/// One of them, as it may be.
const OFF: Off = [8e-3, 0.012, -0.015];
/// How they are told.
const TOLD: [&str; 3] = ["offset of the sensor of voltage_v", "gain of the sensor of current_a", "state of charge at the start"];

/// An hour and a half of pulses as such sensors show them.
fn log(truth: &Arc<Model>, of: &Model, seed: u64, [offset_v, gain, soc]: Off) -> Prepared {
    let pulse = |row: i32| [1.5, 0.3][row as usize / 24 % 2];
    let text = |gain: f64| {
        let rows: String = (0..1080).map(|row| format!("{},{},3.9\n", 5 * row, (1.0 + gain) * pulse(row))).collect();
        format!("time_s,current_a,voltage_v\n{rows}")
    };
    let read = |gain: f64, soc: f64| {
        let facts = LogFacts { soc_initial: Some(soc), ..LogFacts::default() };
        read_log(&format!("pulses-{seed}.csv"), text(gain).as_bytes(), facts).unwrap()
    };
    let shown = predict(truth, &prepare(truth, &read(0.0, 0.95 + soc)).unwrap(), &truth.values());
    let (mut random, noise) = (Pcg64::new(u128::from(seed), 0), Normal::new(0.0, 1e-3).unwrap());
    let mut log = read(gain, 0.95);
    let values = shown.of(Channel::VoltageV).unwrap().iter().map(|value| value + offset_v + noise.sample(&mut random)).collect();
    log.channels.insert(Channel::VoltageV, values);
    prepare(of, &log).unwrap()
}

fn compare(model: &Arc<Model>, logs: &[Prepared]) -> Comparison {
    lab::compare(model, &model.values(), logs)
}

#[test]
fn what_sensors_and_starts_are_off_by_is_told_and_taken_out() {
    let model = model("");
    let logs = vec![log(&model, &model, 1, OFF)];
    let alone = compare(&model, &logs).with_calibration(&model, &model.values(), &logs);
    assert_eq!(alone.verdict, Verdict::LeavesError);
    let calibration = alone.calibration.as_ref().expect("sensors are off");
    assert!(calibration.errors[0].ratio.unwrap() < 1.1, "{calibration:?}");
    assert!(alone.words.iter().any(|words| words.contains("the model explains the logs")), "{:?}", alone.words);
    assert!(TOLD.iter().all(|what| calibration.found.iter().any(|one| one.what.starts_with(what))), "{calibration:?}");
    // The calibrated logs compare as that says.
    let (corrected, found) = calibrate(&model, &model.values(), logs);
    let calibrated = compare(&model, &corrected).calibrated(found.clone());
    assert_eq!((calibrated.verdict, &found), (Verdict::WithinFloor, &calibration.found));
    assert!((calibrated.errors[0].size.rms / calibration.errors[0].rms - 1.0).abs() < 0.02, "{calibrated:?}");
}

/// Sensors and starts drawn from what is stated of them: what is told of each has the deviation that is told with it.
#[test]
fn deviations_of_what_is_calibrated_are_right() {
    let model = model("");
    let (mut squares, mut count, mut inside) = (0.0, 0.0, 0.0);
    for seed in 1..=60 {
        let mut random = Pcg64::new(1000 + u128::from(seed), 0);
        let off = STATED.map(|sigma| Normal::new(0.0, sigma).unwrap().sample(&mut random));
        let (_, found) = calibrate(&model, &model.values(), vec![log(&model, &model, seed, off)]);
        for (what, truth) in TOLD.iter().zip(off) {
            let Some(one) = found.iter().find(|one| one.what.starts_with(what)) else { continue };
            let z = (one.shift - truth) / one.sigma;
            (squares, count) = (squares + z * z, count + 1.0);
            inside += f64::from(u8::from(z.abs() < 1.645));
        }
    }
    // The three of a log err together, so that 60 logs tell a mean square to 0.3 or so.
    assert!(count > 120.0 && (0.6..1.5).contains(&(squares / count)), "{squares} of {count}");
    assert!((0.82..=0.97).contains(&(inside / count)), "{inside} of {count} in 90 %");
}

#[test]
fn a_missing_effect_is_not_explained_by_sensors() {
    let (model, truth) = (model(""), model(HIDDEN));
    let logs = vec![log(&truth, &model, 1, OFF)];
    let alone = compare(&model, &logs).with_calibration(&model, &model.values(), &logs);
    let left = &alone.calibration.as_ref().expect("sensors are off, too").errors[0];
    // 30 mohm at 1.5 and 0.3 A with 60 s: some 10 mV that no offset follows.
    assert!(left.ratio.unwrap() > 5.0 && left.rms < alone.errors[0].size.rms, "{left:?}");
    assert!(alone.words.iter().any(|words| words.contains("--calibrate shows where")), "{:?}", alone.words);
}

/// The numbers of a fit that takes stated errors as exact follow them, as surely as all else; with `--calibrate` they are as uncertain as these
/// leave them.
#[test]
fn a_calibrated_fit_is_as_certain_as_what_is_stated_of_sensors_and_starts_leaves_it() {
    let truth = model("");
    let (index, resistance_ohm) = (0, 0.08);
    assert_eq!((truth.parameters()[index].name, truth.parameters()[index].value), ("resistance_ohm", resistance_ohm));
    let worlds = 60;
    let (mut inside, mut inside_plain) = (0, 0);
    let mut random = Pcg64::new(77, 0);
    let given = Model::clone(&truth).with_values(&{
        let mut values = truth.values();
        values[index] = 0.06;
        values
    });
    for seed in 0..worlds {
        let off: Off = STATED.map(|sigma| Normal::new(0.0, sigma).unwrap().sample(&mut random));
        let given = Arc::new(given.clone());
        let logs = vec![log(&truth, &given, seed, off)];
        let calibrated = fit_calibrated(&given, &logs, &[index], &mut |_| {}).unwrap();
        let plain = lab::fit::fit(&given, &logs, &[index], &mut |_| {}).unwrap();
        let holds = |fit: &lab::fit::Fit| (fit.values[index] - resistance_ohm).abs() <= 1.645 * fit.certainty.sigma[0].unwrap();
        inside += i32::from(holds(&calibrated.fit));
        inside_plain += i32::from(holds(&plain));
    }
    // 90 % of 60 are 54; a binomial count lies within three of its deviations, 2.3 each.
    assert!((47..=60).contains(&inside), "{inside} of {worlds}");
    assert!(inside_plain < 40, "{inside_plain} of {worlds}: then there is nothing to calibrate here");
}
