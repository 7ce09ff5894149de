//! Single cells under currents that a cycler set.

use std::path::Path;

use super::rows::{Csv, Row, above_empty, battery, drawn_ah, interpolate, table, write_battery};
use super::{Set, real};
use crate::commands::measured;

/// Resistance of which nothing is known yet.
pub const FREE: &str = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.05, sigma = 0.05, source = \"guess\", free = true }\n";

/// What a built-in cell says but its effects, with one resistance.
fn base(built_in: &str, ohmic: &str) -> String {
    let known = energy::built_in(built_in).unwrap();
    let tables = Path::new(env!("CARGO_MANIFEST_DIR")).join("../energy/params");
    let facts = known.split("[[effect]]").next().unwrap();
    facts.replace("ocv_csv = \"", &format!("ocv_csv = \"{}/", tables.display())) + ohmic
}

/// Pulse tests cut where each pulse begins, after its rest: the charge there, and the rows. What comes
/// before the first pulse is left out.
fn pulses(rows: &[Row], soc_initial: f64, capacity_ah: f64, pulse_a: f64) -> Vec<(f64, Vec<Row>)> {
    let drawn = drawn_ah(rows);
    let begins = |&place: &usize| rows[place + 1].current_a > pulse_a && rows[place].current_a.abs() < 0.1;
    let places: Vec<usize> = (0..rows.len() - 1).filter(begins).collect();
    let ends = places.iter().skip(1).copied().chain([rows.len() - 1]);
    places.iter().zip(ends).map(|(&from, to)| (soc_initial - drawn[from] / capacity_ah, rows[from..=to].to_vec())).collect()
}

/// A pulse test whose every second pulse is held out, but for the last: no model is asked for what lies beyond all that it has seen.
fn every_second_pulse(set: &mut Set, pulses: &[(f64, Vec<Row>)]) {
    for (place, (soc, rows)) in pulses.iter().enumerate() {
        let log = write_battery(set.directory.path(), &format!("pulse{place:02}"), rows, *soc, "");
        if place % 2 == 0 || place + 1 == pulses.len() { set.train.push(log) } else { set.holdout.push(log) }
    }
}

/// Enertech 2.28 Ah (Rieger 2016): shipped, so always there. The table was solved together with resistances.
#[expect(clippy::unnecessary_wraps, reason = "the others may be absent")]
pub fn enertech() -> Option<Set> {
    let mut set = Set::new("enertech, 0.1C and 1C; 0.5C held out", &base("enertech-lco-2280mah-full", FREE));
    for rate in ["0p1c", "1c", "0p5c"] {
        for kind in ["csv", "toml"] {
            let file = format!("discharge-{rate}.{kind}");
            std::fs::copy(measured().join(&file), set.directory.path().join(file)).unwrap();
        }
    }
    set.train = vec!["discharge-0p1c.csv".to_owned(), "discharge-1c.csv".to_owned()];
    set.holdout = vec!["discharge-0p5c.csv".to_owned()];
    set.flags = &["--target", "voltage_v", "--every", "60"];
    Some(set)
}

#[test]
fn the_enertech_cells_resistance_goes_with_its_charge() {
    let answer = enertech().unwrap().discover();
    assert!(answer.names_any(&["ohmic_soc"]), "{}", answer.json["selected"]);
    let ((before, after), (_, held_out)) = (answer.train(), answer.held_out());
    // Another program: R0 25 mV at 1C, R over SoC 6.9, with a pair 5.2; the aim is 3 and 5 mV.
    assert!(after < 3e-3 && after < 0.5 * before && held_out < 5e-3, "{after} {held_out}");
}

/// Nissan Leaf 33 Ah: pulses of 30 A between rests of an hour.
pub fn leaf() -> Option<Set> {
    let folder = real("nissan_leaf_pouch_33ah")?;
    let mut set = Set::new("nissan leaf, every second pulse held out", &base("nissan-leaf-33ah", FREE));
    let rows = above_empty(battery(&Csv::read(&folder.join("hppc_25c.csv"))), 0.01315, 30.508);
    every_second_pulse(&mut set, &pulses(&rows, 0.01315, 30.508, 25.0));
    Some(set)
}

/// What relaxes: pairs, a ladder of them, or diffusion.
const RELAXATION: [&str; 5] = ["rc1", "rc2", "rc_ladder", "warburg", "surface_diffusion"];

#[test]
fn the_leaf_cell_relaxes() {
    let Some(set) = leaf() else { return };
    let answer = set.discover();
    assert!(answer.names_any(&RELAXATION), "{}", answer.json["selected"]);
    let ((_, after), (_, held_out)) = (answer.train(), answer.held_out());
    // Another program on pulses that it was fitted to: R0 6.2 mV, one pair 2.4, two 1.9.
    assert!(after < 2.4e-3 && held_out < 5e-3, "{after} {held_out}");
}

/// Samsung INR18650-30Q (ARTS-Laboratory, CC BY-SA 4.0) from 1C to 4C, while it warms by forty kelvin.
pub fn samsung() -> Option<Set> {
    let folder = real("samsung_inr18650_30q_3ah")?;
    let mut set = Set::new("samsung 30Q, 1C, 2C and 4C; 3C held out", &base("samsung-inr18650-30q-3ah", FREE));
    let log = |rate: &str| folder.join(format!("discharge_s001_{rate}.csv")).to_str().unwrap().to_owned();
    set.train = ["1c", "2c", "4c"].map(log).to_vec();
    set.holdout = vec![log("3c")];
    set.flags = &["--soc-initial", "1", "--column", "temperature_degc=temperature_c", "--target", "voltage_v", "--every", "10"];
    Some(set)
}

#[test]
fn the_samsung_cells_resistance_goes_with_its_temperature() {
    let Some(set) = samsung() else { return };
    let answer = set.discover();
    assert!(answer.names_any(&["arrhenius", "super_arrhenius", "polarisation_arrhenius"]), "{}", answer.json["selected"]);
    // A state that only a change of direction shows is not to be had of discharges.
    assert!(!answer.names_any(&["hysteresis"]), "{}", answer.json["selected"]);
    let ((_, after), (_, held_out)) = (answer.train(), answer.held_out());
    // Another program on the discharges that it was fitted to: R0 23 mV, with four effects 7.9.
    assert!(after < 7.9e-3 && held_out < 7.9e-3, "{after} {held_out}");
}

/// A123 26650 at C/30 down and up (G. Plett). At one rate a resistance does what hysteresis does, so the
/// resistance is that of the pulses of the dynamic log.
pub fn a123_both_ways() -> Option<Set> {
    let folder = real("a123_lfp_26650_2p3ah_plett")?;
    let known = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.0096, sigma = 0.0003, source = \"pulses of dyn_p25_s1\" }\n";
    let mut set = Set::new("a123, C/30 both ways", &base("a123-lfp-26650-2p3ah", known));
    for (log, soc, history) in [("ocv_p25_s1", 1.0, "charged"), ("ocv_p25_s3", 0.0, "discharged")] {
        let rows = above_empty(battery(&Csv::read(&folder.join(format!("{log}.csv")))), soc, 2.0617);
        set.train.push(write_battery(set.directory.path(), log, &rows, soc, &format!("history = \"{history}\"\n")));
    }
    Some(set)
}

#[test]
fn an_lfp_cell_down_and_up_shows_its_hysteresis() {
    let Some(set) = a123_both_ways() else { return };
    let answer = set.discover();
    assert_eq!(answer.names("selected").first(), Some(&"hysteresis"));
    // Another program: R0 19.8 mV, hysteresis 5.0, and 2.8 with an amplitude over SoC.
    let (before, after) = answer.train();
    assert!(after < 2.8e-3 && after < 0.3 * before, "{before} {after}");
}

/// The same cell's dynamic log, which only discharges but for moments, over the table of the discharge alone.
pub fn a123_one_way() -> Option<Set> {
    let folder = real("a123_lfp_26650_2p3ah_plett")?;
    let slow = battery(&Csv::read(&folder.join("ocv_p25_s1.csv")));
    let drawn = drawn_ah(&slow);
    let whole_ah = drawn[drawn.len() - 1];
    let loaded = |place: &usize| slow[*place].current_a > 0.05;
    let points = (0..slow.len()).filter(loaded).step_by(8);
    let points = points.map(|place| (1.0 - drawn[place] / whole_ah, slow[place].voltage_v + 0.0096 * slow[place].current_a)).collect();
    let facts = base("a123-lfp-26650-2p3ah", FREE);
    let (above, below) = facts.split_once("ocv_csv").unwrap();
    let model = format!("{above}{}{}", table(points), below.split_once('\n').unwrap().1);
    let mut set = Set::new("a123, dynamic, one way: first three hours; the next two held out", &model);
    let mut rows = battery(&Csv::read(&folder.join("dyn_p25_s1.csv")));
    // The cycler's counters have 7.8 mA more than the samples of a faster profile.
    rows.iter_mut().for_each(|row| row.current_a += 0.0078);
    let (first, second) = rows.split_at(rows.partition_point(|row| row.time_s < 18_000.0));
    let soc = 1.0 - drawn_ah(first)[first.len() - 1] / 2.0617;
    let second = &second[..second.partition_point(|row| row.time_s < 24_000.0)];
    set.train.push(write_battery(set.directory.path(), "first", first, 1.0, ""));
    set.holdout.push(write_battery(set.directory.path(), "second", second, soc, ""));
    Some(set)
}

#[test]
fn an_lfp_cell_in_one_direction_shows_relaxation_and_no_hysteresis() {
    let Some(set) = a123_one_way() else { return };
    let answer = set.discover();
    assert!(answer.names_any(&RELAXATION) && !answer.names_any(&["hysteresis"]), "{}", answer.json["selected"]);
    // Another program: R0 9.1 mV, one pair 3.9, two 2.9.
    assert!(answer.train().1 < 2.9e-3, "{:?}", answer.train());
}

/// Panasonic NCR18650PF (P. Kollmeyer): pulses of 0.5C to 6C, of which those between were not kept, so each has the charge that the
/// cycler counted; and a drive cycle on another day. The table is C/20, moved to where the cell rests before its pulses.
pub fn panasonic() -> Option<Set> {
    let folder = real("panasonic_ncr18650pf_2p9ah")?;
    let slow = Csv::read(&folder.join("c20_discharge_charge_25c.csv"));
    let points = slow.cells.iter().filter(|row| slow.number(row, "current_a") > 0.1);
    let slow: Vec<(f64, f64)> = points.map(|row| (slow.number(row, "ah"), slow.number(row, "voltage_v"))).collect();
    let (full_ah, empty_ah) = (slow[0].0, slow[slow.len() - 1].0);
    let capacity_ah = empty_ah - full_ah;
    let csv = Csv::read(&folder.join("hppc_25c.csv"));
    let (rows, ah) = (battery(&csv), csv.numbers("ah"));
    let apart = |place: &usize| *place == 0 || rows[*place].time_s - rows[*place - 1].time_s > 1500.0;
    let mut begins: Vec<usize> = (0..rows.len()).filter(|place| apart(place)).collect();
    begins.push(rows.len());
    let rests: Vec<(f64, f64)> =
        begins[..begins.len() - 1].iter().map(|&place| (ah[place], rows[place].voltage_v - interpolate(&slow, ah[place]))).collect();
    let soc = |ah: f64| ((empty_ah - ah) / capacity_ah).min(1.0);
    let ocv = (0..=60).map(|part| {
        let ah = full_ah + capacity_ah * f64::from(part) / 60.0;
        (soc(ah), interpolate(&slow, ah) + interpolate(&rests, ah))
    });
    let model = format!(
        "schema = 1\nsystem = \"battery\"\nname = \"panasonic-ncr18650pf\"\nsource = \"P. Kollmeyer, doi 10.17632/wykht8y7tg.1\"\n\
         [battery]\nseries = 1\nparallel = 1\ncapacity_ah = {capacity_ah:.4}\nfull_v_per_cell = 4.2\neod_v_per_cell = 2.5\n\
         charge_current_a = 1.45\ncharge_cutoff_a = 0.05\n{}[sensor.voltage_v]\nsigma = 5e-4\nquantum = 6e-4\n\
         [sensor.current_a]\nsigma = 2e-3\nquantum = 1e-3\n\
         [uncertainty]\nocv_sigma_v = 5e-3\nsoc_initial_sigma = 5e-3\ncapacity_relative_sigma = 0.02\n{FREE}",
        table(ocv.collect())
    );
    let mut set = Set::new("panasonic, pulses; US06 held out", &model);
    for (place, ends) in begins.windows(2).enumerate().take(12) {
        let log = &rows[ends[0]..ends[1]];
        set.train.push(write_battery(set.directory.path(), &format!("pulse{place:02}"), log, soc(ah[ends[0]]), ""));
    }
    let drive = battery(&Csv::read(&folder.join("drive_us06_25c_1s_mean.csv")));
    set.holdout.push(write_battery(set.directory.path(), "us06", &drive, 1.0, ""));
    set.flags = &["--target", "voltage_v", "--every", "1"];
    Some(set)
}

#[test]
fn pulses_tell_a_panasonic_cell_how_it_will_drive() {
    let Some(set) = panasonic() else { return };
    let answer = set.discover();
    assert!(answer.names_any(&RELAXATION), "{}", answer.json["selected"]);
    // Another program with models fitted to the pulses: R0 63 mV on US06, one pair 29, two 22.
    let (_, held_out) = answer.held_out();
    assert!(held_out < 22e-3, "{held_out}");
}

/// Melasta LiPo 3.7 Ah: pulses of 27.5 A, ten seconds each.
pub fn melasta() -> Option<Set> {
    let folder = real("melasta_lipo_hv_pouch_3p7ah")?;
    let mut set = Set::new("melasta, every second pulse held out", &base("melasta-lipo-3p7ah", FREE));
    let rows = above_empty(battery(&Csv::read(&folder.join("hppc_25c_90kpa.csv"))), 0.284_33, 3.828);
    every_second_pulse(&mut set, &pulses(&rows, 0.284_33, 3.828, 20.0));
    set.flags = &["--target", "voltage_v", "--every", "1"];
    Some(set)
}

#[test]
fn a_lipo_cell_relaxes_after_pulses_of_seven_c_and_its_resistance_goes_with_its_charge() {
    let Some(set) = melasta() else { return };
    let answer = set.discover();
    assert!(answer.names_any(&RELAXATION), "{}", answer.json["selected"]);
    // Another program: R0 19 mV, one pair 12.6, R over SoC and two pairs 6.3, all on rows that it was fitted to.
    let ((_, after), (_, held_out)) = (answer.train(), answer.held_out());
    assert!(after < 6.3e-3 && held_out < 6.3e-3, "{after} {held_out}");
}
