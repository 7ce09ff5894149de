//! Gauges on measured discharges, against the energy that the cell then delivered.
//!
//! Read at 75, 50 and 25 % of the delivered energy left; errors are shares of the whole. The
//! Enertech logs come with the project; other sets are tried where they are (see
//! `LOGS`) and have a built-in model.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use energy::gauge::{Kind, Sample, soc_at_rest};
use energy::{Estimate, Model, built_in, load_model};

/// Model, file beside the crate, and whether it must be there.
const LOGS: &[(&str, &str, bool)] = &[
    ("enertech-lco-2280mah", "../scenarios/measured/enertech-lco-2280mah/discharge-0p5c.csv", true),
    ("enertech-lco-2280mah", "../scenarios/measured/enertech-lco-2280mah/discharge-1c.csv", true),
    ("enertech-lco-2280mah-full", "../scenarios/measured/enertech-lco-2280mah/discharge-0p5c.csv", true),
    ("enertech-lco-2280mah-full", "../scenarios/measured/enertech-lco-2280mah/discharge-1c.csv", true),
    ("samsung-inr18650-30q-3ah", "../../shared/data/samsung_inr18650_30q_3ah/discharge_s001_1c.csv", false),
    ("samsung-inr18650-30q-3ah", "../../shared/data/samsung_inr18650_30q_3ah/discharge_s001_2c.csv", false),
];
/// Shares of the delivered energy that are left when a gauge is read.
const LEFT: [f64; 3] = [0.75, 0.5, 0.25];

/// A measured discharge: what the sensors showed, and the energy from each sample on.
struct Log {
    samples: Vec<Sample>,
    left_wh: Vec<f64>,
    rest_v: f64,
}

fn read(path: &Path, model: &Model) -> Log {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |names: &[&str]| header.iter().position(|name| names.contains(name));
    let (time, current, voltage) = (column(&["time_s"]).unwrap(), column(&["current_a"]).unwrap(), column(&["voltage_v"]).unwrap());
    let temperature = column(&["temperature_degc", "temperature_c"]);
    let rows: Vec<Vec<f64>> = lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()).collect();
    let mut samples = Vec::new();
    for pair in rows.windows(2) {
        let (before, row) = (&pair[0], &pair[1]);
        let temperature_degc = temperature.map_or(25.0, |index| row[index]);
        samples.push(Sample { dt_s: row[time] - before[time], current_a: row[current], voltage_v: row[voltage], temperature_degc });
        if row[voltage] <= model.battery().eod_v() {
            break;
        }
    }
    samples.retain(|sample| sample.dt_s > 0.0);
    let mut left_wh = vec![0.0; samples.len()];
    for index in (0..samples.len() - 1).rev() {
        let after = &samples[index + 1];
        left_wh[index] = left_wh[index + 1] + after.current_a * after.voltage_v * after.dt_s / 3600.0;
    }
    Log { samples, left_wh, rest_v: rows[0][voltage] }
}

/// Errors of the energy left at [`LEFT`], % of the whole, each with the gauge's deviation.
fn errors(kind: Kind, model: &Arc<Model>, log: &Log, soc: Estimate) -> Vec<Estimate> {
    let mut gauge = kind.open(Arc::clone(model), soc, log.samples[0].temperature_degc);
    let whole_wh = log.left_wh[0];
    let mut errors = Vec::new();
    for (sample, &left_wh) in log.samples.iter().zip(&log.left_wh) {
        gauge.update(sample);
        if errors.len() < LEFT.len() && left_wh <= LEFT[errors.len()] * whole_wh {
            let predicted_wh = gauge.reading().remaining_wh;
            errors.push(Estimate::new(100.0 * (predicted_wh.value - left_wh) / whole_wh, 100.0 * predicted_wh.sigma / whole_wh));
        }
    }
    errors
}

#[test]
fn predicted_energy_of_measured_discharges_is_what_was_then_delivered() {
    let crate_folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    println!(
        "{:16} {:26} {:24} {:10} error +- sigma of the energy left, % of the whole, at 75, 50, 25 % left",
        "gauge", "model", "log", "start"
    );
    for &(name, file, required) in LOGS {
        let path = crate_folder.join(file);
        if !required && (built_in(name).is_none() || !path.exists()) {
            println!("{name}: no such model or log here");
            continue;
        }
        let model = Arc::new(load_model(name, &|_| unreachable!("built in")).unwrap());
        let log = read(&path, &model);
        let rested = soc_at_rest(&model, log.rest_v);
        let right = Estimate::new(rested.value, rested.sigma.max(model.uncertainty.soc_initial_sigma));
        let wrong = Estimate::new(rested.value - 0.1, 0.1);
        for (start, soc) in [("at rest", right), ("10 % off", wrong)] {
            for &kind in Kind::ALL {
                let errors = errors(kind, &model, &log, soc);
                let text: Vec<String> = errors.iter().map(|error| format!("{:6.2} +- {:4.2}", error.value, error.sigma)).collect();
                let log_name = path.file_name().unwrap().to_string_lossy();
                println!("{:16} {name:26} {log_name:24} {start:10} {}", kind.name(), text.join("   "));
                assert_eq!(errors.len(), LEFT.len(), "{file}: the discharge does not end");
                // With one resistance for every state of charge, what is foreseen from a right
                // start is off by up to 4 %; the full set knows the cell better.
                assert!(start != "at rest" || errors.iter().all(|error| error.value.abs() < 5.0), "{file}: {}: {errors:?}", kind.name());
            }
        }
    }
}
