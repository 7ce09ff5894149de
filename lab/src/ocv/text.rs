//! The model that comes of it, as the text of its file.

use std::fmt::Write as _;

use super::step::unseen_ohm;
use super::{Branch, FirstModel, Passage};

/// Current of a charge where none was stated, as a share of the capacity an hour, and at its end. Guesses: what data sheets of
/// lithium cells give for a long life.
const CHARGE_PER_HOUR: (f64, f64) = (0.5, 0.05);
/// Deviation of the state of charge in which a log begins. A guess.
const SOC_INITIAL_SIGMA: f64 = 5e-3;

/// A number with so many digits behind the point, as TOML takes it.
fn rounded(value: f64, places: usize) -> String {
    let text = format!("{value:.places$}");
    if text.contains('.') { text } else { format!("{text}.0") }
}

/// Three digits that count.
fn short(value: f64) -> String {
    let places = if value == 0.0 { 1 } else { (2.0 - value.abs().log10().floor()).clamp(1.0, 9.0) as usize };
    rounded(value, places)
}

/// The text of the model. `origin` says what made it of which logs, and when.
#[must_use]
pub fn model_text(found: &FirstModel, origin: &str) -> String {
    let sheet = &found.sheet;
    let mut text = String::new();
    let mut line = |words: String| {
        text.push_str(&words);
        text.push('\n');
    };
    line(format!("# A first model of {}, made by {origin}.", sheet.name.escape_default()));
    line("# It has the resistance alone: `lab discover` says what its logs show besides.".to_owned());
    line("schema = 1\nsystem = \"battery\"".to_owned());
    line(format!("name = {}", toml::Value::from(sheet.name.as_str())));
    line(format!("\n[battery]\nseries = {}\nparallel = {}", sheet.series, sheet.parallel));
    line(format!("# {}", capacity_source(found)));
    line(format!("capacity_ah = {}", rounded(found.capacity_ah.value, 4)));
    line(format!("full_v_per_cell = {:?}\neod_v_per_cell = {:?}", sheet.full_v_per_cell, sheet.eod_v_per_cell));
    let (current_a, guessed) = (sheet.charge_current_a, "guess, as a share of the capacity: put in what the data sheet says");
    if current_a.is_none() || sheet.charge_cutoff_a.is_none() {
        line(format!("# {}: {guessed}", if current_a.is_none() { "How it is charged" } else { "Where a charge ends" }));
    }
    let charge_a = current_a.unwrap_or(CHARGE_PER_HOUR.0 * found.capacity_ah.value);
    line(format!("charge_current_a = {}", short(charge_a)));
    let cutoff_a = sheet.charge_cutoff_a.unwrap_or((CHARGE_PER_HOUR.1 * found.capacity_ah.value).min(charge_a));
    line(format!("charge_cutoff_a = {}", short(cutoff_a)));
    let (soc, volts) = found.table.ocv.points();
    line(format!("# {}", table_source(found)));
    let list = |values: &[f64], places| values.iter().map(|&value| rounded(value, places)).collect::<Vec<_>>().join(", ");
    line(format!("ocv = {{ soc = [{}], voltage_v = [{}] }}", list(soc, 5), list(volts, 5)));
    let noise = found.voltage_noise;
    if noise.sigma_v > 0.0 || noise.quantum_v > 0.0 {
        line("\n# Noise, and the step of the digits, as the readings of the logs show them.\n[sensor.voltage_v]".to_owned());
        line(format!("sigma = {}\nquantum = {}", exponent(noise.sigma_v), exponent(noise.quantum_v)));
    }
    line("\n[uncertainty]".to_owned());
    line(format!("ocv_sigma_v = {}", exponent(found.table.rms_sigma_v)));
    line(format!("capacity_relative_sigma = {}", exponent(found.capacity_ah.sigma / found.capacity_ah.value)));
    line(format!("# A guess.\nsoc_initial_sigma = {SOC_INITIAL_SIGMA}"));
    // The effect's resistance is that of one cell: of those in parallel each has its share of the current.
    let cells = f64::from(sheet.parallel);
    let (ohm, source) = match found.step_ohm {
        Some((ohm, steps)) => (ohm, format!("middle of {steps} steps of the current, by {origin}")),
        None => (unseen_ohm(found.capacity_ah.value), "guess: no step of the current showed it".to_owned()),
    };
    let (value, sigma, source) = (exponent(cells * ohm.value), exponent(cells * ohm.sigma), toml::Value::from(source));
    line("\n[[effect]]\nid = \"ohmic\"".to_owned());
    line(format!("resistance_ohm = {{ value = {value}, sigma = {sigma}, source = {source}, free = true }}"));
    text
}

/// A number that may be small.
fn exponent(value: f64) -> String {
    if value == 0.0 { "0.0".to_owned() } else { format!("{value:.2e}") }
}

/// Where a capacity comes from, in words.
fn capacity_source(found: &FirstModel) -> String {
    if found.sheet.capacity_ah.is_some() {
        return "Capacity as it was stated.".to_owned();
    }
    let one = |passage: &Passage| {
        let what = if passage.discharge { "discharge" } else { "charge" };
        format!("{what} of {} ({:.4} Ah at {:.3} of it an hour)", passage.log, passage.charge_ah, passage.per_hour)
    };
    format!("Between full and end: {}.", found.passages.iter().map(one).collect::<Vec<_>>().join(", "))
}

/// What a table was made of, in words.
fn table_source(found: &FirstModel) -> String {
    let (rests, slow) = found.used.iter().fold((0, 0), |(rests, slow), used| (rests + used.rests, slow + used.slow));
    let mut words = format!("By least squares of {rests} rests and {slow} places with a slow current");
    let _ = match found.table.branch {
        Branch::Both => write!(words, ", charged and discharged."),
        Branch::Discharge => write!(words, ", all discharged: half of a hysteresis would be in it."),
        Branch::Unknown => write!(words, ", of which nothing says what came before: half of a hysteresis would be in it."),
        Branch::Charge => write!(words, ", all charged: half of a hysteresis would be in it."),
    };
    words
}
