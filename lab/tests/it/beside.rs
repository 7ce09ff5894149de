//! An efficiency that was stated, and a curve that is right: the curve is found beside what is stated.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::{Discovery, Verdict};
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

/// A station that is known but for its converters.
fn station(converter: &str) -> Arc<Model> {
    let text = format!(
        "schema = 1\nsystem = \"station\"\nname = \"t\"\n[sensor.pack_power_w]\nsigma = 0.05\n{converter}\
         [[effect]]\nid = \"hotel\"\nhotel_w = {{ value = 5.5, source = \"t\" }}\n"
    );
    Arc::new(Model::parse("station.toml", &text, &|_| Err("no table".to_owned())).unwrap())
}

/// One to three robots that charge with less and less, and none.
fn log(truth: &Arc<Model>, of: &Model) -> Prepared {
    let robots = |row: u32| [1, 3, 0, 2][row as usize / 600 % 4];
    let into_w = |row: u32| f64::from(robots(row)) * (16.0 - 0.02 * f64::from(row % 600));
    let row = |row: u32| format!("{},{:.3},{},{},12.0,20\n", row, into_w(row), robots(row), robots(row));
    let rows: String = (0..4800).map(row).collect();
    let text = format!("time_s,charge_power_w,robots_docked,robots_charging,pack_voltage_v,pack_power_w\n{rows}");
    let mut log = read_log("station.csv", text.as_bytes(), LogFacts::default()).unwrap();
    let shown = predict(truth, &prepare(truth, &log).unwrap(), &truth.values());
    let (mut random, noise) = (Pcg64::new(1, 0), Normal::new(0.0, 0.05).unwrap());
    let values = shown.of(Channel::PackPowerW).unwrap().iter().map(|value| value + noise.sample(&mut random)).collect();
    log.channels.insert(Channel::PackPowerW, values);
    prepare(of, &log).unwrap()
}

#[test]
fn a_curve_beside_an_efficiency_that_was_stated_as_the_whole_reaches_the_floor() {
    let curve = "[[effect]]\nid = \"converter_curve\"\nno_load_w = { value = 6.0, source = \"t\" }\n\
                 proportional_loss = { value = 0.1, source = \"t\" }\nseries_ohm = { value = 0.0, source = \"t\" }\n";
    let stated = "[[effect]]\nid = \"converter_efficiency\"\nefficiency = { value = 0.84, source = \"t\" }\n\
                  quiescent_w = { value = 0.2, source = \"t\" }\n";
    let (truth, base) = (station(curve), station(stated));
    let found = search(Arc::clone(&base), Arc::new(Evidence::new(&base, vec![log(&truth, &base)])), None);
    let answer = Discovery::of(&found);
    assert_eq!((answer.verdict, answer.selected.as_slice()), (Verdict::Missing, ["converter_curve"].as_slice()));
    let rms = found.last.rms()[0].1;
    assert!(rms < 1.05 * 0.05, "{rms} W");
    let number = |name: &str| {
        let one = &answer.parameters["converter_curve"][name];
        (one.value, one.sigma.unwrap())
    };
    // By hand: (1 + a) (P / 0.84 + 0.2) + P0 = 1.1 P + 6.0, so that 1 + a = 1.1 x 0.84 and P0 = 6.0 - 0.2 (1 + a).
    for (name, truth) in [("proportional_loss", -0.076), ("no_load_w", 5.8152)] {
        let (value, sigma) = number(name);
        assert!((value - truth).abs() < 4.0 * sigma && sigma < 0.05, "{name}: {value} +- {sigma}");
    }
}
