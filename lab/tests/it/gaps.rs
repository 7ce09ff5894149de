//! Logs of which a part was not recorded.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::{Discovery, Verdict};
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::infer::frame::Frame;
use lab::learned::left_out;
use lab::measurement::{GapCurrent, Log, LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::prepare;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

const SENSORS: &str = "[sensor.voltage_v]\nsigma = 1e-3\n[sensor.current_a]\nsigma = 1e-3\n[uncertainty]\nsoc_initial_sigma = 5e-3\n";
const OHMIC: &str = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.05, source = \"t\", free = true }\n";
const PAIR: &str =
    "[[effect]]\nid = \"rc1\"\nresistance_ohm = { value = 0.02, source = \"t\" }\ntau_s = { value = 60.0, source = \"t\" }\n";

/// An hour of stretches of load, rest and charge, as a battery of this model shows it.
fn seen(truth: &Arc<Model>, seed: u128) -> Log {
    let (noise, mut random) = (Normal::new(0.0, 1e-3).unwrap(), Pcg64::new(seed, 0));
    let current = |row: usize| [1.5, 0.0, 0.6, -0.8, 2.0, 0.2, 1.1][(row / 90 + seed as usize) % 7];
    let rows: String = (0..3600).map(|row| format!("{row},{},3.9\n", current(row))).collect();
    let facts = LogFacts { soc_initial: Some(0.9), ..LogFacts::default() };
    let mut log = read_log("run.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), facts).unwrap();
    let volts = predict(truth, &prepare(truth, &log).unwrap(), &truth.values()).of(Channel::VoltageV).unwrap().to_vec();
    for (channel, values) in [(Channel::VoltageV, volts), (Channel::CurrentA, log.channels[&Channel::CurrentA].clone())] {
        log.channels.insert(channel, values.iter().map(|value| value + noise.sample(&mut random)).collect());
    }
    log
}

/// The log as a file would hold it without the rows, or without the currents, of a time.
fn without(log: &Log, lost_s: std::ops::Range<f64>, row_too: bool) -> Log {
    without_all(log, &[lost_s], row_too)
}

fn without_all(log: &Log, lost_s: &[std::ops::Range<f64>], row_too: bool) -> Log {
    let (current_a, voltage_v) = (&log.channels[&Channel::CurrentA], &log.channels[&Channel::VoltageV]);
    let row = |row: usize| match lost_s.iter().any(|lost_s| lost_s.contains(&log.time_s[row])) {
        true if row_too => String::new(),
        true => format!("{},,{}\n", log.time_s[row], voltage_v[row]),
        false => format!("{},{},{}\n", log.time_s[row], current_a[row], voltage_v[row]),
    };
    let rows: String = (0..log.rows()).map(row).collect();
    read_log(&log.file, format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), log.facts.clone()).unwrap()
}

fn found(base: &Arc<Model>, log: &Log) -> Discovery {
    Discovery::of(&search(Arc::clone(base), Arc::new(Evidence::new(base, vec![prepare(base, log).unwrap()])), None))
}

/// Before the current of a gap was asked for, nine of ten right models were "unknown" after five minutes of it.
#[test]
fn what_flowed_in_a_gap_is_no_missing_effect() {
    let base = made_up::model(&format!("{SENSORS}{OHMIC}"));
    let truth = made_up::model(&format!("{SENSORS}{OHMIC}{PAIR}"));
    for seed in 0..3 {
        for (lost_s, row_too) in [(1500.0..1800.0, true), (1500.0..1800.0, false), (700.0..1900.0, true)] {
            let right = found(&base, &without(&seen(&base, seed), lost_s.clone(), row_too));
            assert_eq!((right.verdict, &right.selected[..]), (Verdict::Complete, &[][..]), "{seed} {lost_s:?}");
            let lacking = found(&base, &without(&seen(&truth, seed), lost_s.clone(), row_too));
            assert_eq!((lacking.verdict, &lacking.selected[..]), (Verdict::Missing, &["rc1"][..]), "{seed} {lost_s:?}");
        }
    }
}

/// With pieces for four of them, thirteen of twenty logs with six gaps were "unknown".
#[test]
fn what_flowed_in_many_gaps_is_no_missing_effect_either() {
    let truth = made_up::model(&format!("{SENSORS}{OHMIC}{PAIR}"));
    for (seed, gaps) in [(0, 6), (1, 6), (2, 12), (3, 12)] {
        let lost_s: Vec<_> = (1..=gaps).map(|gap| f64::from(gap * 3600 / (gaps + 1))).map(|from_s| from_s..from_s + 110.0).collect();
        let log = without_all(&seen(&truth, seed), &lost_s, true);
        assert_eq!(log.unmeasured.last().map(|piece| piece.gap + 1), Some(gaps as usize));
        let right = found(&truth, &log);
        assert_eq!((right.verdict, &right.selected[..]), (Verdict::Complete, &[][..]), "{seed}: {:?}", right.residual);
    }
}

/// The charge that is told to have flowed in a gap is that which did, as surely as is said.
#[test]
fn the_charge_of_a_gap_is_told() {
    let base = made_up::model(&format!("{SENSORS}{OHMIC}"));
    let mut deviations = Vec::new();
    for seed in 0..20 {
        let whole = seen(&base, seed);
        let log = without(&whole, 1500.0..1800.0, true);
        let state = search(Arc::clone(&base), Arc::new(Evidence::new(&base, vec![prepare(&base, &log).unwrap()])), None).last;
        let after_a = log.channels[&Channel::CurrentA][1500];
        let truth_ah: f64 = whole.channels[&Channel::CurrentA][1500..1800].iter().map(|current_a| (current_a - after_a) / 3600.0).sum();
        let told = left_out(&state).into_iter().find(|one| one.what.starts_with("charge from 1499 to 1799 s of run"));
        let told = told.unwrap_or_else(|| panic!("seed {seed}: {:?}", left_out(&state)));
        assert!(told.sigma < 0.2 * told.stated_sigma, "{told:?}");
        deviations.push((told.shift - truth_ah) / told.sigma);
    }
    let rms = (deviations.iter().map(|z| z * z).sum::<f64>() / deviations.len() as f64).sqrt();
    assert!((0.5..1.5).contains(&rms), "{rms}: {deviations:.1?}");
}

/// A battery that was stored for a month and lost what it lost by itself: whoever says that it was stored learns of it, and
/// who does not is told how much charge lacks.
#[test]
fn what_a_stored_battery_lost_is_an_effect_where_it_is_said_to_have_been_stored() {
    let leak = "[[effect]]\nid = \"self_discharge\"\nloss_per_month = { value = 0.06, source = \"t\" }\n";
    let sensors = SENSORS.replace("sigma = 1e-3\n[uncertainty]", "sigma = 1e-3\noffset_sigma = 2e-5\n[uncertainty]");
    let base = made_up::model(&format!("{sensors}{OHMIC}"));
    let truth = made_up::model(&format!("{sensors}{OHMIC}{leak}"));
    let (noise, mut random) = (Normal::new(0.0, 1e-3).unwrap(), Pcg64::new(7, 0));
    let at_s = |row: usize| row as f64 + if row < 1800 { 0.0 } else { 30.0 * 86_400.0 };
    let current = |row: usize| if (1500..2100).contains(&row) { 0.0 } else { [1.5, 0.6, -0.4, 0.9][row / 150 % 4] };
    let rows: String = (0..3600).map(|row| format!("{},{},3.9\n", at_s(row), current(row))).collect();
    let facts = |gap_current| LogFacts { soc_initial: Some(0.9), gap_current, ..LogFacts::default() };
    let read = |text: &str, gap_current| read_log("run.csv", text.as_bytes(), facts(gap_current)).unwrap();
    let exact = read(&format!("time_s,current_a,voltage_v\n{rows}"), Some(GapCurrent::Stated));
    let volts = predict(&truth, &prepare(&truth, &exact).unwrap(), &truth.values()).of(Channel::VoltageV).unwrap().to_vec();
    let row = |row: usize| format!("{},{},{}\n", at_s(row), current(row), volts[row] + noise.sample(&mut random));
    let text = format!("time_s,current_a,voltage_v\n{}", (0..3600).map(row).collect::<String>());
    let stated = prepare(&base, &read(&text, Some(GapCurrent::Stated))).unwrap();
    let search_stored = search(Arc::clone(&base), Arc::new(Evidence::new(&base, vec![stated])), None);
    let leaks = search_stored.steps[0].trials.iter().find(|trial| trial.spec.id == "self_discharge").unwrap();
    // At one temperature nothing tells how the loss goes with it: no number is made up.
    let activation = leaks.state.frame.model.parameters().iter().find(|one| one.name == "activation_kj_per_mol").unwrap();
    assert!(!activation.free && activation.value == 0.0, "{activation:?}");
    let stored = Discovery::of(&search_stored);
    assert!(stored.selected.first().is_some_and(|one| stored.equivalent.contains(one)), "{stored:?}");
    assert!(stored.equivalent.contains(&"self_discharge"), "{:?}", stored.equivalent);
    let unsaid = prepare(&base, &read(&text, None)).unwrap();
    let state = search(Arc::clone(&base), Arc::new(Evidence::new(&base, vec![unsaid])), None).last;
    let told = left_out(&state).into_iter().find(|one| one.what.starts_with("charge from 1799 to 2593799 s of run"));
    let told = told.unwrap_or_else(|| panic!("{:?}", left_out(&state)));
    let lost_ah = 0.06 * 30.0 / 30.44 * base.battery().capacity_ah;
    assert!((told.shift - lost_ah).abs() < 3.0 * told.sigma && told.sigma < 0.2 * lost_ah, "{told:?} {lost_ah}");
}

/// A derivative by the current of a piece against a difference.
#[test]
fn derivatives_by_what_flowed_in_a_gap_agree_with_differences() {
    let model = made_up::model(&format!("{SENSORS}{OHMIC}{PAIR}"));
    let log = without(&seen(&model, 1), 1500.0..1800.0, true);
    let frame = Frame::new(Arc::clone(&model), Arc::new(Evidence::new(&model, vec![prepare(&model, &log).unwrap()])));
    let unknowns: Vec<usize> = (0..frame.unknowns()).collect();
    let x: Vec<f64> = frame.start().iter().map(|value| value + 1e-3).collect();
    let (_, slopes) = frame.linearise(&x, &unknowns);
    let pieces: Vec<usize> = unknowns.iter().copied().filter(|&unknown| unknown + 6 >= frame.unknowns()).collect();
    for unknown in pieces {
        let at = |shift: f64| {
            let mut x = x.clone();
            x[unknown] += shift;
            frame.predict(&x)
        };
        let (above, below) = (at(1e-4), at(-1e-4));
        let differs = (0..above.len()).map(|row| ((above[row] - below[row]) / 2e-4 - slopes[(unknown, row)]).abs()).fold(0.0, f64::max);
        assert!(differs < 1e-6 && slopes.row(unknown).amax() > 1e-6, "{unknown}: {differs}");
    }
}
