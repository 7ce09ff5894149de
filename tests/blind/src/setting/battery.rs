//! Packs: cells with measured OCV curves, gauges, and the logs of a careful user.

use energy::{Channel, OcvTable, Sensor, Start, System, Uncertainty, built_in};

use super::{Poor, Setting, Wish, believed};
use crate::draft::{Draft, PackFacts, Part, part};
use crate::random::Stream;
use crate::world::{Script, Stretch};

/// Measured OCV curves: table, full voltage, empty voltage.
const CELLS: &[(&str, f64, f64)] = &[
    ("enertech-lco-2280mah-ocv.csv", 4.2, 3.0),
    ("samsung-inr18650-30q-3ah-ocv.csv", 4.2, 2.5),
    ("melasta-lipo-3p7ah-ocv.csv", 4.35, 3.0),
];
/// RMS error of the lab's OCV table, V per cell, and what its model states.
pub const OCV_ERROR_V: f64 = 3e-3;
/// Deviation of the known state of charge at the start of a log.
pub const SOC_SIGMA: f64 = 0.01;
/// Length of a row, s.
const DT_S: f64 = 5.0;

/// Bases that an effect needs, or that would swallow it otherwise; the others take any of `ANY`.
const BASES: &[(&str, &[&str])] = &[
    ("ohmic", &["rc1"]),
    ("contact_resistance", &["rc1"]),
    ("rc1", &["ohmic"]),
    ("rc_ladder", &["ohmic"]),
    ("warburg", &["ohmic"]),
    ("rc2", &["ohmic", "rc1"]),
    ("polarisation_arrhenius", &["ohmic", "rc1"]),
    ("relaxation_arrhenius", &["ohmic", "rc1"]),
    ("polarisation_soc", &["ohmic", "rc1"]),
    ("polarisation_growth", &["ohmic", "rc1"]),
    ("thermal", &["ohmic"]),
    ("core_lag", &["ohmic", "thermal"]),
    ("temperature_bias", &["ohmic", "thermal"]),
];
const ANY: &[&[&str]] = &[&["ohmic"], &["ohmic", "rc1"], &["ohmic", "thermal"]];

/// Draws a pack and what is done with it.
#[must_use]
pub fn draw(seed: u64, wish: &Wish) -> Setting {
    let mut random = Stream::new(seed, "battery");
    let (table, full_v_per_cell, eod_v_per_cell) = random.pick(CELLS);
    let hides = |id: &str| wish.hidden.contains(&id);
    let series = if hides("weak_cell") { random.pick(&[3, 4]) } else { random.pick(&[1, 3, 4]) };
    let capacity_ah = random.between(1.3, 5.0);
    let ocv = curve(table);
    let pack = PackFacts { series, capacity_ah, full_v_per_cell, eod_v_per_cell, ocv };
    let sensors = sensors(&mut random, hides("self_discharge"));
    let uncertainty = Uncertainty { ocv_sigma_v: OCV_ERROR_V, soc_initial_sigma: SOC_SIGMA, ..Uncertainty::default() };
    let chosen = random.pick(ANY);
    let needed = wish.hidden.iter().find_map(|id| BASES.iter().find(|(known, _)| known == id)).map(|(_, base)| *base);
    let base = wish.base.or(needed).unwrap_or(chosen);
    let mut values = Stream::new(seed, "battery parameters");
    let parts: Vec<Part> =
        base.iter().filter(|id| !hides(id)).map(|&id| base_part(id, capacity_ah, !wish.all_known, &mut values)).collect();
    let truth = Draft { system: System::Battery, name: "base".to_owned(), pack: Some(pack), sensors: sensors.clone(), uncertainty, parts };
    let mut told = truth.clone();
    let mut beliefs = Stream::new(seed, "beliefs");
    told.parts = believed(System::Battery, &truth.parts, &mut beliefs);
    if !wish.exact_ocv {
        let pack = told.pack.as_mut().expect("a battery has a pack");
        pack.ocv = wrong(&pack.ocv, &mut Stream::new(seed, "ocv"));
    }
    let mut scripts = scripts(&mut Stream::new(seed, "scripts"), wish.poor, hides("self_discharge"));
    scripts.iter_mut().for_each(|script| script.bath = wish.poor.one_temperature);
    Setting { truth, believed: told, scripts, sensors }
}

/// A built-in table.
fn curve(name: &str) -> OcvTable {
    let text = built_in(name).unwrap_or_else(|| panic!("no table {name}"));
    let rows = text.lines().filter(|line| !line.starts_with('#') && !line.starts_with("soc"));
    let pairs = rows.map(|line| {
        let (soc, volts) = line.split_once(',').expect("two columns");
        (soc.trim().parse::<f64>().expect("a number"), volts.trim().parse::<f64>().expect("a number"))
    });
    let (soc, voltage_v) = pairs.unzip();
    OcvTable::new(soc, voltage_v).unwrap_or_else(|error| panic!("{error}"))
}

/// The table with a smooth random error of the stated RMS. Where it would let the voltage fall
/// with the charge, it stays level.
fn wrong(table: &OcvTable, random: &mut Stream) -> OcvTable {
    let (soc, voltage_v) = table.points();
    let length = random.pick(&[0.08, 0.15, 0.3]);
    let waves: Vec<[f64; 3]> = (0..40).map(|_| [random.normal() / length, random.normal(), random.normal()]).collect();
    let error = |s: f64| waves.iter().map(|[k, a, b]| a * (k * s).cos() + b * (k * s).sin()).sum::<f64>();
    let rms = ((0..=100).map(|step| error(f64::from(step) / 100.0).powi(2)).sum::<f64>() / 101.0).sqrt();
    // A finer table, since an error can bend where the curve is straight.
    let mut fine: Vec<f64> = soc.iter().copied().chain((0..=40).map(|step| f64::from(step) / 40.0)).collect();
    fine.sort_by(f64::total_cmp);
    fine.dedup_by(|b, a| *b - *a < 2e-3);
    let mut least_v = voltage_v[0] - 1.0;
    let moved = fine.iter().map(|&s| {
        least_v = least_v.max(table.voltage_v(s) + OCV_ERROR_V * error(s) / rms);
        least_v
    });
    let moved = moved.collect();
    OcvTable::new(fine, moved).unwrap_or_else(|error| panic!("{error}"))
}

/// A gauge IC as its data sheet states it. `zeroed` is one whose shunt was zeroed.
fn sensors(random: &mut Stream, zeroed: bool) -> Vec<(Channel, Sensor)> {
    let volts = Sensor {
        sigma: random.between(5e-4, 1e-3),
        quantum: 1e-3,
        dead_band: 0.0,
        lag_s: 0.0,
        lag_sigma_s: 0.0,
        offset_sigma: 3e-3,
        gain_sigma: 1e-3,
    };
    let offset_sigma = if zeroed { 2e-5 } else { 1e-3 };
    let amperes = Sensor { sigma: 1e-3, quantum: 1e-3, dead_band: 0.0, lag_s: 0.0, lag_sigma_s: 0.0, offset_sigma, gain_sigma: 3.5e-3 };
    let degrees = Sensor { sigma: 0.05, quantum: 0.1, dead_band: 0.0, lag_s: 0.0, lag_sigma_s: 0.0, offset_sigma: 1.0, gain_sigma: 0.0 };
    vec![(Channel::CurrentA, amperes), (Channel::VoltageV, volts), (Channel::TemperatureDegc, degrees)]
}

/// True numbers of a base effect.
pub fn base_part(id: &'static str, capacity_ah: f64, free: bool, random: &mut Stream) -> Part {
    let scale = 2.5 / capacity_ah;
    match id {
        "ohmic" => part(System::Battery, id, free, &[("resistance_ohm", scale * random.log_between(0.025, 0.07))]),
        "rc1" => {
            let (ohm, tau_s) = (scale * random.log_between(0.01, 0.03), random.log_between(20.0, 70.0));
            part(System::Battery, id, free, &[("resistance_ohm", ohm), ("tau_s", tau_s)])
        }
        "thermal" => {
            let (heat_j_per_k, tau_s) = (20.0 * capacity_ah, random.between(600.0, 1200.0));
            let mut thermal = part(
                System::Battery,
                id,
                free,
                &[("conductance_w_per_k", heat_j_per_k / tau_s), ("heat_share", 1.0), ("heat_capacity_j_per_k", heat_j_per_k)],
            );
            thermal.values[1].free = false;
            thermal
        }
        _ => panic!("no base has `{id}`"),
    }
}

/// Conditions of a log: ambient, cycles, days.
type Conditions = (f64, f64, f64);

/// Four logs to learn from and two to judge by.
fn scripts(random: &mut Stream, poor: Poor, shelf: bool) -> Vec<Script> {
    let (warm, cold) = (random.between(22.0, 30.0), random.between(3.0, 10.0));
    let mild = random.between(14.0, 18.0);
    // Temperature, cycles and age go their own ways.
    let mut conditions: [Conditions; 6] =
        [(warm, 10.0, 20.0), (cold, 450.0, 60.0), (warm, 900.0, 400.0), (cold, 30.0, 700.0), (mild, 600.0, 200.0), (warm, 250.0, 550.0)];
    for (index, (ambient, cycles, days)) in conditions.iter_mut().enumerate() {
        if poor.one_temperature {
            *ambient = cold;
        }
        if poor.one_age {
            (*cycles, *days) = (500.0, 400.0);
        }
        if poor.age_follows_cycles {
            (*cycles, *days) = if index % 3 == 0 { (0.0, 0.0) } else { (480.0, 365.0) };
        }
    }
    let mut logs = [pulses(random), driving(random), charging(random), low(random), driving(random), charging(random)];
    if shelf {
        logs[1].push(Stretch::Shelf { days: 25.0 });
        logs[1].extend([rest(600.0), hold(0.5, 1200.0), rest(1200.0)]);
        logs[4].push(Stretch::Shelf { days: 18.0 });
        logs[4].extend([rest(600.0), hold(0.5, 1200.0)]);
    }
    let socs = [random.between(0.9, 0.97), random.between(0.8, 0.95), random.between(0.1, 0.2), 0.5, 0.9, 0.2];
    logs.into_iter().enumerate().map(|(index, log)| script(index, conditions[index], socs[index], log)).collect()
}

fn script(index: usize, (ambient_degc, cycle_count, age_days): Conditions, soc: f64, stretches: Vec<Stretch>) -> Script {
    let holdout = index >= 4;
    let name = if holdout { format!("holdout-{}", index - 3) } else { format!("train-{}", index + 1) };
    // A nearly empty pack got there by discharge, a nearly full one by charge.
    let history = if soc > 0.6 { -1.0 } else { 1.0 };
    let start = Start { soc, temperature_degc: ambient_degc, cycle_count, age_days, history, clock_s: 0.0 };
    Script { name, holdout, start, dt_s: DT_S, bath: false, stretches, inputs: Vec::new() }
}

fn hold(rate: f64, seconds: f64) -> Stretch {
    Stretch::Hold { rate, seconds }
}

fn rest(seconds: f64) -> Stretch {
    hold(0.0, seconds)
}

/// Pulses of both signs with short rests, and one rest of over an hour.
fn pulses(random: &mut Stream) -> Vec<Stretch> {
    let mut log = vec![rest(120.0)];
    for pulse in 0..8 {
        let rate = [0.3, 1.0, 1.6, 0.6, 2.0, 0.8, 1.3, 0.5][pulse] * random.between(0.9, 1.1);
        log.extend([
            hold(rate, (0.07 / rate * 3600.0).clamp(60.0, 500.0)),
            rest(random.between(60.0, 240.0)),
            hold(-0.5, 60.0),
            rest(60.0),
        ]);
        if pulse == 3 {
            log.push(rest(3900.0));
        }
    }
    log
}

/// A robot that drives: steps of power that come and go, brakes now and then, and stands at last.
fn driving(random: &mut Stream) -> Vec<Stretch> {
    let mut log = vec![rest(60.0)];
    let (mean, mut seconds) = (random.between(0.3, 0.5), 0.0);
    while seconds < 4500.0 {
        let length = 5.0 * random.between(2.0, 18.0).round();
        let rate = if random.chance(0.12) { -0.5 * mean } else { (mean + 0.6 * random.normal()).clamp(0.05, 2.0) * 0.9 };
        log.push(hold(rate, length));
        seconds += length;
    }
    log.push(rest(3900.0));
    log
}

/// A charge to full and beyond the turn to constant voltage, a rest, a discharge.
fn charging(random: &mut Stream) -> Vec<Stretch> {
    let rate = random.between(0.5, 0.8);
    let seconds = 5.0 * (0.95 / rate * 720.0).round();
    vec![rest(120.0), Stretch::Charge { rate, seconds }, rest(1200.0), hold(1.0, 900.0), rest(300.0), hold(0.4, 600.0), rest(600.0)]
}

/// Down to nearly empty in pulses, a long rest, and up again to where it began.
fn low(random: &mut Stream) -> Vec<Stretch> {
    let mut log = vec![rest(300.0)];
    for _ in 0..5 {
        log.extend([hold(random.between(0.6, 1.4), 300.0), rest(180.0), hold(-0.3, 60.0), rest(120.0)]);
    }
    log.extend([rest(3900.0), hold(-0.4, 2400.0), rest(900.0)]);
    log
}
