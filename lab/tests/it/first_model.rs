//! First models of batteries from their own logs: against truths that are known, and against tables that another program made
//! of the same measurements together with all effects.

use std::fmt::Write as _;
use std::sync::Arc;

use energy::{Channel, Model, OcvTable, Run, Start};
use lab::measurement::{Log, LogFacts, read_log};
use lab::ocv::{Beginning, Branch, FirstModel, OcvError, Sheet, first_model, model_text};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

use crate::commands::lab_in;
use crate::sets::shared;

/// The pouch cell whose every number is known here, as a pack of three.
const CELL: &str = "enertech-lco-2280mah-full";
const CAPACITY_AH: f64 = 2.3351;

fn truth() -> Arc<Model> {
    Arc::new(lab::load_model(CELL).unwrap().model.without(|_| false))
}

/// Drives the truth by a list of currents and their lengths, read every so many seconds with half a millivolt of noise; a current
/// ends early where the voltage of full or end is reached.
fn driven(name: &str, soc: f64, steps: &[(f64, f64)], every_s: f64, facts: LogFacts) -> Log {
    let model = truth();
    let mut run = Run::new(Arc::clone(&model), Start::at_soc(soc));
    let mut random = Pcg64Mcg::seed_from_u64(name.len() as u64 + 40);
    let noise = Normal::new(0.0, 5e-4).unwrap();
    let mut text = String::from("time_s,current_a,voltage_v,temperature_degc,ambient_degc\n");
    let mut time_s = 0.0;
    let mut row = |time_s: f64, run: &Run<f64>, current_a: f64| {
        let volts = run.channels[Channel::VoltageV] + noise.sample(&mut random);
        writeln!(text, "{time_s},{current_a},{volts:.5},{:.3},25", run.channels[Channel::TemperatureDegc]).unwrap();
    };
    run.channels[Channel::CurrentA] = 0.0;
    run.channels[Channel::AmbientDegc] = 25.0;
    run.step(0.0);
    row(0.0, &run, 0.0);
    for &(current_a, length_s) in steps {
        let until_s = time_s + length_s;
        while time_s < until_s - 1e-9 {
            run.channels[Channel::CurrentA] = current_a;
            run.step(every_s);
            time_s += every_s;
            row(time_s, &run, current_a);
            let volts = run.channels[Channel::VoltageV];
            if current_a > 0.0 && volts <= 3.0 || current_a < 0.0 && volts >= 4.2 {
                break;
            }
        }
    }
    read_log(&format!("{name}.csv"), text.as_bytes(), facts).unwrap()
}

fn sheet() -> Sheet {
    Sheet {
        name: "cell".to_owned(),
        series: 1,
        parallel: 1,
        full_v_per_cell: 4.2,
        eod_v_per_cell: 3.0,
        charge_current_a: None,
        charge_cutoff_a: None,
        capacity_ah: None,
        slow_per_hour: 0.5,
    }
}

fn full() -> LogFacts {
    LogFacts { soc_initial: Some(1.0), ..LogFacts::default() }
}

/// What a table is off by against the true one, V, RMS and at most, between two states of charge.
fn off(found: &OcvTable, truth: &OcvTable, from: f64, to: f64) -> (f64, f64) {
    let errors: Vec<f64> =
        (0..=200).map(|step| from + (to - from) * f64::from(step) / 200.0).map(|soc| found.voltage_v(soc) - truth.voltage_v(soc)).collect();
    let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
    (rms, errors.iter().fold(0.0, |most, error| error.abs().max(most)))
}

fn told(name: &str, found: &FirstModel, (rms_v, most_v): (f64, f64)) {
    eprintln!(
        "{name}: {:.4} +- {:.4} Ah, {} points, sigma {:.2} mV, left {:.2} mV, off by {:.2} mV, at most {:.2}; at once {:?}, slow {:?}",
        found.capacity_ah.value,
        found.capacity_ah.sigma,
        found.table.ocv.points().0.len(),
        1e3 * found.table.rms_sigma_v,
        1e3 * found.table.left_v.unwrap_or(f64::NAN),
        1e3 * rms_v,
        1e3 * most_v,
        found.step_ohm,
        found.table.slow_ohm,
    );
}

#[test]
fn slow_ways_down_and_up_give_capacity_and_table() {
    let c20 = CAPACITY_AH / 20.0;
    let down = driven("down", 1.0, &[(0.0, 600.0), (c20, 90_000.0), (0.0, 3600.0)], 30.0, full());
    let empty = 1.0 - down.channels[&Channel::CurrentA].iter().sum::<f64>() * 30.0 / 3600.0 / CAPACITY_AH;
    let up = driven("up", empty, &[(0.0, 600.0), (-c20, 90_000.0)], 30.0, LogFacts { soc_initial: Some(0.0), ..LogFacts::default() });
    let found = first_model(&sheet(), &[down, up]).unwrap();
    let table = off(&found.table.ocv, &truth().battery().ocv, 0.05, 0.99);
    told("slow", &found, table);
    assert_eq!((found.passages.len(), found.table.branch), (2, Branch::Both));
    // What a slow discharge leaves in the cell is not taken for its own.
    assert!((found.capacity_ah.value / CAPACITY_AH - 1.0).abs() < 0.01, "{:?}", found.capacity_ah);
    assert!(table.0 < 2.0 * found.table.rms_sigma_v, "{table:?}, {}", found.table.rms_sigma_v);
}

/// A discharge to the end at a tenth of the capacity an hour and a charge back to the full voltage, and how full the charge begins and ends.
fn down_and_up(stated: impl Fn(f64) -> f64) -> ([Log; 2], f64, f64) {
    let c10 = CAPACITY_AH / 10.0;
    let moved = |log: &Log| log.channels[&Channel::CurrentA].iter().sum::<f64>() * 30.0 / 3600.0 / CAPACITY_AH;
    let down = driven("down", 1.0, &[(0.0, 600.0), (c10, 45_000.0), (0.0, 1800.0)], 30.0, full());
    let empty = 1.0 - moved(&down);
    let facts = LogFacts { soc_initial: Some(stated(empty)), ..LogFacts::default() };
    let up = driven("up", empty, &[(0.0, 600.0), (-c10, 45_000.0), (0.0, 1800.0)], 30.0, facts);
    let end = empty - moved(&up);
    ([down, up], empty, end)
}

/// What a current costs ends a charge early, here by the 30 mV that the full voltage is stated lower: that it touches the full voltage says less of where it began than what is stated of that.
#[test]
fn a_stated_start_counts_beside_a_charge_that_ends_early() {
    let (logs, empty, end) = down_and_up(|empty| empty);
    let sheet = Sheet { full_v_per_cell: 4.17, ..sheet() };
    let found = first_model(&sheet, &logs).unwrap();
    let (used, table) = (&found.used[1], off(&found.table.ocv, &truth().battery().ocv, 0.05, 0.95));
    told("stated", &found, table);
    assert_eq!(used.beginning, Beginning::Stated);
    assert!((used.soc_initial - empty).abs() < 5e-3 && (used.range.1 - end).abs() < 0.01, "{used:?}, {empty} to {end}");
    assert!(table.0 < 1.5 * found.table.rms_sigma_v, "{table:?}, {}", found.table.rms_sigma_v);
    let (logs, ..) = down_and_up(|empty| empty + 0.035);
    let doubted = first_model(&self::sheet(), &logs).unwrap().doubted;
    assert!(doubted.len() == 1 && doubted[0].log == "up" && doubted[0].counted.value < 0.02, "{doubted:?}");
}

/// An ammeter that is off shows it at rest, and where what went out differs from what went in: 8 % here.
#[test]
fn an_ammeter_that_is_off_is_taken_out_of_ways_both_ways() {
    let (mut logs, ..) = down_and_up(|empty| empty);
    for log in &mut logs {
        log.channels.get_mut(&Channel::CurrentA).unwrap().iter_mut().for_each(|amps| *amps += 0.004 * CAPACITY_AH);
    }
    let found = first_model(&sheet(), &logs).unwrap();
    let table = off(&found.table.ocv, &truth().battery().ocv, 0.05, 0.95);
    told("offset", &found, table);
    let error_ah = (found.capacity_ah.value - CAPACITY_AH).abs();
    assert!(error_ah < 0.02 * CAPACITY_AH && error_ah < 1.645 * found.capacity_ah.sigma, "{:?}", found.capacity_ah);
    assert!(table.0 < 1.5 * found.table.rms_sigma_v, "{table:?}, {}", found.table.rms_sigma_v);
    // One way alone cannot tell, and says so.
    let one = first_model(&sheet(), &logs[..1]).unwrap().capacity_ah;
    assert!((one.value - CAPACITY_AH).abs() > 0.03 * CAPACITY_AH && one.sigma > 0.03 * CAPACITY_AH, "{one:?}");
}

/// Pulses of half the capacity an hour, each of a twentieth of it, with rests of an hour.
#[test]
fn pulses_with_rests_give_table_and_resistance() {
    let pulse_a = CAPACITY_AH / 2.0;
    let mut steps = vec![(0.0, 600.0)];
    for _ in 0..19 {
        steps.extend([(pulse_a, 360.0), (0.0, 3600.0)]);
    }
    let log = driven("pulses", 1.0, &steps, 5.0, full());
    assert!(matches!(first_model(&sheet(), std::slice::from_ref(&log)), Err(OcvError::NoCapacity { .. })));
    let stated = Sheet { capacity_ah: Some(CAPACITY_AH), ..sheet() };
    let found = first_model(&stated, &[log]).unwrap();
    let truth = truth();
    let rests: Vec<f64> = found.table.ocv.points().0.to_vec();
    let at_rests = rests.iter().map(|&soc| found.table.ocv.voltage_v(soc) - truth.battery().ocv.voltage_v(soc));
    let worst = at_rests.clone().zip(&found.table.sigma_v).fold(0.0_f64, |most, (error, sigma)| most.max((error / sigma).abs()));
    told("pulses", &found, off(&found.table.ocv, &truth.battery().ocv, 0.05, 0.99));
    assert!(rests.len() >= 19 && worst < 4.0, "{} points, {worst} sigma", rests.len());
    // Five seconds of polarisation are in the step too: 29 mohm at half charge beside them.
    let (ohm, steps) = found.step_ohm.unwrap();
    let mut run = Run::new(Arc::clone(&truth), Start::at_soc(0.5));
    run.channels[Channel::AmbientDegc] = 25.0;
    run.channels[Channel::CurrentA] = pulse_a;
    run.step(5.0);
    let own = (truth.battery().ocv.voltage_v(0.5) - run.channels[Channel::VoltageV]) / pulse_a;
    assert!(steps >= 34 && (ohm.value / own - 1.0).abs() < 0.15, "{ohm:?} of {steps}, {own}");
}

/// A model that comes of it reads back, and predicts the logs that it was made of to what it says.
#[test]
fn the_text_is_a_model() {
    let c10 = CAPACITY_AH / 10.0;
    let log = driven("down", 1.0, &[(0.0, 600.0), (c10, 45_000.0), (0.0, 1800.0)], 10.0, full());
    let found = first_model(&Sheet { name: "a \"cell\"\n".to_owned(), ..sheet() }, &[log]).unwrap();
    let text = model_text(&found, "a test");
    let model = Model::parse("first.toml", &text, &|_| Err("no file".to_owned())).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(model.name, "a \"cell\"\n");
    assert!((model.battery().capacity_ah - found.capacity_ah.value).abs() < 1e-4);
    assert!(model.uncertainty.ocv_sigma_v >= 2e-3 && model.uncertainty.ocv_sigma_v < 0.02, "{}", model.uncertainty.ocv_sigma_v);
    assert_eq!(found.table.branch, Branch::Discharge);
}

/// Rests at the same charges in two logs are the same points of the table, also where places meet.
#[test]
fn rests_of_two_logs_at_one_charge_are_one_point() {
    let mut steps = vec![(0.0, 600.0)];
    for _ in 0..9 {
        steps.extend([(CAPACITY_AH / 10.0, 3600.0), (0.0, 1800.0)]);
    }
    let logs = ["one", "other"].map(|name| driven(name, 1.0, &steps, 10.0, full()));
    let found = first_model(&Sheet { capacity_ah: Some(CAPACITY_AH), slow_per_hour: 0.05, ..sheet() }, &logs).unwrap();
    let (soc, _) = found.table.ocv.points();
    assert!(soc.windows(2).all(|pair| pair[1] - pair[0] > 0.05), "{soc:?}");
    assert!(found.table.rms_sigma_v < 0.03, "{}", found.table.rms_sigma_v);
}

/// Three in series and two in parallel of the same cell give its own table and resistance, and twice its capacity.
#[test]
fn a_pack_gives_what_its_cell_gives() {
    let c10 = CAPACITY_AH / 10.0;
    let log = driven("down", 1.0, &[(0.0, 600.0), (c10, 45_000.0), (0.0, 1800.0)], 1.0, full());
    let mut of_pack = log.clone();
    of_pack.channels.get_mut(&Channel::VoltageV).unwrap().iter_mut().for_each(|volts| *volts *= 3.0);
    of_pack.channels.get_mut(&Channel::CurrentA).unwrap().iter_mut().for_each(|amps| *amps *= 2.0);
    let model = |sheet: Sheet, log: Log| {
        let text = model_text(&first_model(&sheet, &[log]).unwrap(), "a test");
        Model::parse("first.toml", &text, &|_| Err("no file".to_owned())).unwrap()
    };
    let (cell, pack) = (model(sheet(), log), model(Sheet { series: 3, parallel: 2, ..sheet() }, of_pack));
    let ohm = |model: &Model| model.parameter("ohmic", "resistance_ohm").unwrap().value;
    assert!((ohm(&pack) / ohm(&cell) - 1.0).abs() < 1e-2, "{} {}", ohm(&pack), ohm(&cell));
    assert!((pack.battery().capacity_ah / cell.battery().capacity_ah - 2.0).abs() < 1e-3);
    assert!((pack.battery().ocv.voltage_v(0.5) - cell.battery().ocv.voltage_v(0.5)).abs() < 1e-4);
}

/// Measured cells: the table that least squares of all their logs and effects found stands for the truth.
#[test]
fn measured_cells_get_their_tables() {
    let Some(folder) = shared() else { return };
    let log = |path: &str, facts: LogFacts| read_log(path, &std::fs::read(folder.join(path)).unwrap(), facts).unwrap();
    let from = |soc: f64| LogFacts { soc_initial: Some(soc), ..LogFacts::default() };
    let a123 = [log("a123_lfp_26650_2p3ah_plett/ocv_p25_s1.csv", full()), log("a123_lfp_26650_2p3ah_plett/ocv_p25_s3.csv", from(0.0))];
    let cases = [
        ("a123-lfp-26650-2p3ah", Sheet { full_v_per_cell: 3.6, eod_v_per_cell: 2.0, ..sheet() }, &a123[..], 2.0617),
        (
            "samsung-inr18650-30q-3ah",
            Sheet { eod_v_per_cell: 2.5, ..sheet() },
            &[log("samsung_inr18650_30q_3ah/discharge_s001_c10.csv", full())],
            2.9696,
        ),
        (
            "nissan-leaf-33ah",
            Sheet { capacity_ah: Some(30.508), ..sheet() },
            &[log("nissan_leaf_pouch_33ah/hppc_25c.csv", from(0.01315))],
            30.508,
        ),
        (
            "melasta-lipo-3p7ah",
            Sheet { full_v_per_cell: 4.35, capacity_ah: Some(3.828), ..sheet() },
            &[log("melasta_lipo_hv_pouch_3p7ah/hppc_25c_90kpa.csv", from(0.28433))],
            3.828,
        ),
    ];
    for (name, sheet, logs, capacity_ah) in cases {
        let found = first_model(&sheet, logs).unwrap();
        let table = off(&found.table.ocv, &lab::load_model(name).unwrap().model.battery().ocv, 0.05, 0.98);
        told(name, &found, table);
        assert!((found.capacity_ah.value / capacity_ah - 1.0).abs() < 0.005, "{name}: {:?}", found.capacity_ah);
        assert!(table.0 < 2.0 * found.table.rms_sigma_v, "{name}: {table:?}, {}", found.table.rms_sigma_v);
    }
    // This record charges back to the full voltage with 13 % less than was drawn: its capacity is as uncertain as that.
    let panasonic = [log("panasonic_ncr18650pf_2p9ah/c20_discharge_charge_25c.csv", full())];
    let found = first_model(&Sheet { eod_v_per_cell: 2.5, ..sheet() }, &panasonic).unwrap();
    assert!(found.passages.len() == 2 && found.capacity_ah.sigma > 0.2, "{:?}", found.passages);
    assert!(found.table.rms_sigma_v > 0.01, "its table, too: {}", found.table.rms_sigma_v);
}

#[test]
fn what_is_missing_is_said() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("run.csv"), "time_s,current_a,voltage_v\n0,0,4.1\n10,1,4.0\n20,1,3.9\n").unwrap();
    let ocv = |more: &[&str]| {
        lab_in(folder.path(), &[&["ocv", "--log", "run.csv", "--full-v-per-cell", "4.2", "--eod-v-per-cell", "3.0"], more].concat())
    };
    for (more, words) in [
        (&[][..], "so none says what the battery holds"),
        (&["--capacity-ah", "2"], "run.csv: nothing says how full it is anywhere"),
        (&["--capacity-ah", "2", "--soc-initial", "1"], "no log shows the open-circuit voltage"),
        (&["--capacity-ah", "0"], "--capacity-ah = 0: must be between 0.001 and 100000"),
        (&["--series", "3"], "check --series"),
        (&["--capacity-ah", "2", "--soc-initial", "0"], "run.csv: it is stated to begin at 0 %, and shows 4.100 V a cell"),
        (&["--slow-c-rate", "0"], "--slow-c-rate = 0: must be above 0"),
        (&["-o", "run.csv"], "run.csv is a log that is read here"),
    ] {
        let outcome = ocv(more);
        assert_eq!(outcome.code, 2, "{more:?}: {}", outcome.stdout);
        assert!(outcome.stderr.contains(words), "`{words}` is not in: {}", outcome.stderr);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// The same log, as if its logger had been off for so long in the middle of the discharge.
fn with_pause(log: &Log, from_s: f64, pause_s: f64) -> Log {
    let mut text = String::from("time_s,current_a,voltage_v\n");
    let (current_a, voltage_v) = (&log.channels[&Channel::CurrentA], &log.channels[&Channel::VoltageV]);
    for (row, &time_s) in log.time_s.iter().enumerate() {
        let at_s = if time_s > from_s { time_s + pause_s } else { time_s };
        writeln!(text, "{at_s},{},{}", current_a[row], voltage_v[row]).unwrap();
    }
    read_log("paused.csv", text.as_bytes(), log.facts.clone()).unwrap()
}

#[test]
fn nothing_is_counted_across_a_gap_in_which_nobody_knows_what_flowed() {
    let whole = driven("slow", 1.0, &[(0.0, 3600.0), (0.1 * CAPACITY_AH, 40_000.0), (0.0, 3600.0)], 30.0, full());
    let paused = with_pause(&whole, 18_000.0, 5.0 * 3600.0);
    // Five hours at a tenth of the capacity an hour would be half of it more.
    let refused = first_model(&sheet(), std::slice::from_ref(&paused)).unwrap_err().to_string();
    assert!(refused.contains("no log runs from full to empty"), "{refused}");
    let found = first_model(&Sheet { capacity_ah: Some(CAPACITY_AH), ..sheet() }, std::slice::from_ref(&paused)).unwrap();
    assert_eq!(found.used.iter().map(|used| used.log.as_str()).collect::<Vec<_>>(), ["paused", "paused from 36030 s"]);
    // What it shows is what the whole log shows, but for what the current costs, which a log without steps does not tell.
    let of_whole = first_model(&Sheet { capacity_ah: Some(CAPACITY_AH), ..sheet() }, std::slice::from_ref(&whole)).unwrap();
    let (rms, most) = off(&found.table.ocv, &of_whole.table.ocv, 0.1, 0.95);
    assert!(rms < 2e-3 && most < 6e-3, "{rms} {most}");
    // Where the row after it tells of all of it, so it is.
    let stated = LogFacts { gap_current: Some(lab::measurement::GapCurrent::Stated), ..full() };
    let stated = with_pause(&Log { facts: stated, ..whole.clone() }, 18_000.0, 5.0 * 3600.0);
    let found = first_model(&sheet(), &[stated]).unwrap();
    assert!((found.capacity_ah.value / CAPACITY_AH - 1.5).abs() < 0.02, "{:?}", found.capacity_ah);
    // A logger that was five minutes late on the way, as loggers are, leaves a log whole.
    let late = with_pause(&driven("late", 1.0, &[(0.1 * CAPACITY_AH, 40_000.0)], 30.0, full()), 18_000.0, 0.0);
    let without: Vec<usize> = (0..late.rows()).filter(|row| !(18_000.0..18_600.0).contains(&late.time_s[*row])).collect();
    let pick = |values: &[f64]| without.iter().map(|&row| values[row]).collect::<Vec<f64>>();
    let (time_s, current_a, voltage_v) =
        (pick(&late.time_s), pick(&late.channels[&Channel::CurrentA]), pick(&late.channels[&Channel::VoltageV]));
    let mut text = String::from("time_s,current_a,voltage_v\n");
    (0..time_s.len()).for_each(|row| writeln!(text, "{},{},{}", time_s[row], current_a[row], voltage_v[row]).unwrap());
    let late = read_log("late.csv", text.as_bytes(), full()).unwrap();
    assert!(!late.unmeasured.is_empty(), "a gap there is");
    let found = first_model(&sheet(), &[late]).unwrap();
    assert!((found.capacity_ah.value / CAPACITY_AH - 1.0).abs() < 0.01, "{:?}", found.capacity_ah);
    // A part after which nothing is full or empty is left out.
    let short = with_pause(&driven("short", 1.0, &[(0.1 * CAPACITY_AH, 20_000.0)], 30.0, full()), 10_000.0, 5.0 * 3600.0);
    let found = first_model(&sheet(), &[short, whole]).unwrap();
    assert_eq!(found.unplaced, ["paused from 28020 s"]);
}

#[test]
fn a_wrong_sign_or_unit_is_named_where_nothing_says_the_capacity() {
    let whole = driven("slow", 1.0, &[(0.1 * CAPACITY_AH, 40_000.0)], 30.0, full());
    let told = |factor: f64| {
        let mut log = whole.clone();
        log.channels.get_mut(&Channel::CurrentA).unwrap().iter_mut().for_each(|current_a| *current_a *= factor);
        first_model(&sheet(), &[log]).unwrap_err().to_string()
    };
    let told = told(-1.0);
    assert!(told.contains("slow.csv goes from 4.") && told.contains("counts -2.") && told.contains("is the sign right"), "{told}");
}
