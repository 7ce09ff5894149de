//! Long logs keep fewer rows, and a model says the same about those; and how a million rows fare.

use std::fmt::Write as _;
use std::sync::Arc;

use energy::{Channel, Model};
use lab::fit::fit;
use lab::load_model;
use lab::measurement::{Log, LogFacts, Thinning, read_log, thin};
use lab::predict::predict;
use lab::prepare::prepare;
use rand_distr::{Distribution as _, Normal};

use crate::commands::lab_in;

fn cell() -> Arc<Model> {
    load_model("enertech-lco-2280mah-full").unwrap().model
}

/// A duty cycle at one row a second: out, rest, in, rest. Times and currents.
fn duty(rows: usize) -> String {
    let mut text = "time_s,current_a,voltage_v,temperature_degc,phase\n".to_owned();
    let mut random = rand_pcg::Pcg32::new(7, 11);
    let mut noise = |sigma: f64| Normal::new(0.0, sigma).unwrap().sample(&mut random);
    for row in 0..rows {
        let (current_a, phase) = [(1.0, "out"), (0.0, "rest"), (-1.0, "in"), (0.0, "rest")][row / 1500 % 4];
        // As noisy as the model says that these sensors are.
        writeln!(text, "{row},{:.5},{:.5},{:.3},{phase}", current_a + noise(1e-3), 3.8 + noise(5e-4), 25.0 + noise(0.02)).unwrap();
    }
    text
}

fn facts() -> LogFacts {
    LogFacts { soc_initial: Some(0.7), ambient_degc: Some(25.0), ..LogFacts::default() }
}

fn voltage(model: &Arc<Model>, log: &Log) -> Vec<f64> {
    let prediction = predict(model, &prepare(model, log).unwrap(), &model.values());
    prediction.of(Channel::VoltageV).unwrap().to_vec()
}

#[test]
fn a_thinned_log_means_the_same_to_a_model() {
    let model = cell();
    let mut log = read_log("duty.csv", duty(40_000).as_bytes(), facts()).unwrap();
    let told: Vec<f64> = voltage(&model, &log);
    log.channels.insert(Channel::VoltageV, told);
    let whole = log.clone();
    thin(&mut log, &model, Thinning::WhereNothingChanges);
    assert!(log.rows() < 8_000, "{} rows", log.rows());
    assert!(log.notes.last().unwrap().starts_with("duty.csv: 40,000 rows kept as "), "{:?}", log.notes);
    let charge_as = |log: &Log| {
        let current_a = &log.channels[&Channel::CurrentA];
        (1..log.rows()).map(|row| current_a[row] * (log.time_s[row] - log.time_s[row - 1])).sum::<f64>()
    };
    assert!((charge_as(&whole) - charge_as(&log)).abs() < 1e-6);
    let row_of = |time_s: f64| whole.time_s.binary_search_by(|known| known.total_cmp(&time_s)).unwrap();
    let mut worst_v = 0.0_f64;
    for (row, volts) in voltage(&model, &log).iter().enumerate() {
        let same = row_of(log.time_s[row]);
        assert_eq!(log.channels[&Channel::VoltageV][row], whole.channels[&Channel::VoltageV][same]);
        worst_v = worst_v.max((volts - whole.channels[&Channel::VoltageV][same]).abs());
    }
    eprintln!("{} of 40000 rows, predictions move by at most {:.3} mV", log.rows(), 1e3 * worst_v);
    // A tenth of what the sensor of this cell resolves.
    assert!(worst_v < 2e-4, "{worst_v}");
    // The rows after each step are all there.
    for step in [1500.0, 3000.0, 4500.0] {
        assert!((1..20).all(|second| log.time_s.contains(&(step + f64::from(second)))), "after {step} s");
    }
}

#[test]
fn short_logs_and_logs_in_which_everything_moves_stay_whole() {
    let model = cell();
    let mut log = read_log("duty.csv", duty(10_000).as_bytes(), facts()).unwrap();
    thin(&mut log, &model, Thinning::WhereNothingChanges);
    assert_eq!(log.rows(), 10_000);
    let mut text = "time_s,current_a,voltage_v\n".to_owned();
    (0..25_000).for_each(|row| writeln!(text, "{row},{},3.8", 0.1 * f64::from(row % 17)).unwrap());
    let mut log = read_log("drive.csv", text.as_bytes(), facts()).unwrap();
    thin(&mut log, &model, Thinning::WhereNothingChanges);
    assert_eq!(log.rows(), 25_000);
    let note = "drive.csv: 25,000 rows kept as 25,000, since inputs change at nearly all of them; --every SECONDS thins all the same";
    assert_eq!(log.notes.last().unwrap(), note);
}

/// Not a benchmark of the machine: its limit only shows that nothing grows with the square.
#[test]
fn a_million_rows_are_read_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("long.csv"), duty(1_000_000)).unwrap();
    let compare = ["compare", "--model", "enertech-lco-2280mah-full", "--log", "long.csv", "--soc-initial", "0.7", "--ambient-degc", "25"];
    let outcome = lab_in(folder.path(), &compare);
    assert!(outcome.code < 2, "{}", outcome.stderr);
    assert!(outcome.stderr.contains("long.csv: 1,000,000 rows kept as "), "{}", outcome.stderr);
    assert!(outcome.stdout.contains("long "), "{}", outcome.stdout);
}

/// A load that steps every 130 s, of which every 20 s are one row: where a step lies within such a row, the voltage at its end answers to
/// the whole load and its mean to a part of it.
#[test]
fn steps_of_the_load_within_a_thinned_row_bend_no_resistance() {
    let text = "schema = 1\nsystem = \"battery\"\nname = \"t\"\n[battery]\nseries = 1\nparallel = 1\ncapacity_ah = 2.0\nfull_v_per_cell = 4.2\n\
                eod_v_per_cell = 3.0\ncharge_current_a = 1.0\ncharge_cutoff_a = 0.1\nocv = { soc = [0.0, 1.0], voltage_v = [3.0, 4.2] }\n\
                [sensor.voltage_v]\nsigma = 1e-3\n[sensor.current_a]\nsigma = 1e-3\n[[effect]]\nid = \"ohmic\"\n\
                resistance_ohm = { value = 0.02, source = \"start\" }\n[[effect]]\nid = \"rc1\"\n\
                resistance_ohm = { value = 0.015, source = \"t\" }\ntau_s = { value = 40.0, source = \"t\" }\n";
    let model = Arc::new(Model::parse("m.toml", text, &|_| Err(String::new())).unwrap());
    let truth_ohm = 0.04;
    let rows: String = (0..6000).map(|row| format!("{row},{},3.9\n", [1.0, 0.0, 2.0, 0.5][row / 130 % 4])).collect();
    let mut log = read_log("a.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), facts()).unwrap();
    let volts = predict(&model, &prepare(&model, &log).unwrap(), &[truth_ohm, 0.015, 40.0]).of(Channel::VoltageV).unwrap().to_vec();
    log.channels.insert(Channel::VoltageV, volts);
    thin(&mut log, &model, Thinning::Every(20.0));
    assert!(log.notes.iter().any(|note| note.contains("rows are not compared")), "{:?}", log.notes);
    let found = fit(&model, &[prepare(&model, &log).unwrap()], &[0], &mut |_| {}).unwrap();
    assert!((found.values[0] / truth_ohm - 1.0).abs() < 0.02, "{}", found.values[0]);
}
