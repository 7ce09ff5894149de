//! A resistance over charge, learned from logs that only visit the upper half of it.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::Discovery;
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

const SENSOR: &str = "[sensor.voltage_v]\nsigma = 1e-3\n";
const KNOTS: [&str; 7] = ["000", "005", "010", "020", "040", "070", "100"];
const TRUTH_OHM: [f64; 7] = [0.12, 0.1, 0.09, 0.07, 0.05, 0.03, 0.025];

fn model(effects: &str) -> Arc<Model> {
    made_up::model(&format!("{SENSOR}{effects}"))
}

/// Pulses of 1 A from full down to 60 %, as the true cell shows them to a voltmeter of 1 mV.
fn log(of: &Model, seed: u64) -> Prepared {
    let numbers: String = KNOTS
        .iter()
        .zip(TRUTH_OHM)
        .map(|(knot, ohm)| format!("resistance_soc_{knot}_ohm = {{ value = {ohm}, source = \"t\" }}\n"))
        .collect();
    let truth = model(&format!("[[effect]]\nid = \"ohmic_soc\"\n{numbers}"));
    let facts = LogFacts { soc_initial: Some(1.0), ..LogFacts::default() };
    let rows: String = (0..2880).map(|row| format!("{},{},3.9\n", 2 * row, [1.0, 0.0][row / 60 % 2])).collect();
    let mut log = read_log(&format!("pulses-{seed}.csv"), format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), facts).unwrap();
    let mut random = Pcg64::new(u128::from(seed), 0);
    let noise = Normal::new(0.0, 1e-3).unwrap();
    let volts = predict(&truth, &prepare(&truth, &log).unwrap(), &truth.values());
    let volts = volts.of(Channel::VoltageV).unwrap().iter().map(|volts| volts + noise.sample(&mut random)).collect();
    log.channels.insert(Channel::VoltageV, volts);
    prepare(of, &log).unwrap()
}

/// Where no log was, a resistance goes on as it is at the last charge that one visited: before, it ended in 0 ohm, and whoever planned
/// with the model promised energy that the cell could not give.
#[test]
fn a_resistance_goes_on_where_no_log_was() {
    let base = model("");
    let logs = vec![log(&base, 1), log(&base, 2)];
    let found = Discovery::of(&search(Arc::clone(&base), Arc::new(Evidence::new(&base, logs)), None));
    assert_eq!(found.selected, ["ohmic_soc"], "{:?}", found.verdict);
    let of = |knot: &str| found.parameters["ohmic_soc"][format!("resistance_soc_{knot}_ohm").as_str()];
    let last_visited = of("040").value;
    assert!((last_visited / 0.05 - 1.0).abs() < 0.3, "{last_visited}");
    for knot in ["000", "005", "010", "020"] {
        let (value, sigma) = (of(knot).value, of(knot).sigma);
        assert!((value / last_visited - 1.0).abs() < 0.01 && sigma.is_none(), "{knot}: {value} +- {sigma:?}, {last_visited}");
    }
}
