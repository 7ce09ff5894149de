//! First models of batteries whose ammeter and voltmeter are no good, against a cell whose every number is known.

use std::fmt::Write as _;

use energy::Model;
use lab::measurement::{History, Log, LogFacts, read_log};
use lab::ocv::{Branch, FirstModel, OcvError, Sheet, first_model, model_text};
use lab::report::first::FirstReport;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

const CAPACITY_AH: f64 = 2.5;
const C20_A: f64 = CAPACITY_AH / 20.0;
const EOD_V: f64 = 3.1;
/// At once, and beside that in a minute, ohm.
const OHM: f64 = 0.03;
const LATE_OHM: f64 = 0.02;
const LATE_S: f64 = 60.0;

/// Voltage of a full and an emptier cell: steep at the end, and nowhere flat.
fn ocv_v(soc: f64) -> f64 {
    3.05 + 0.62 * (1.0 - (-soc / 0.035).exp()) + 0.12 * soc + 0.3 * soc * soc + 0.05 * ((soc - 0.55) / 0.12).tanh()
}

/// How the cell is read, and what it hides.
#[derive(Clone, Copy)]
struct Read {
    noise_a: f64,
    off_a: f64,
    noise_v: f64,
    step_v: f64,
    /// Half of what lies between charge and discharge.
    hysteresis_v: f64,
    /// Whether it is charged again.
    back: bool,
    every_s: f64,
    seed: u64,
}

const WELL: Read = Read { noise_a: 0.0, off_a: 0.0, noise_v: 5e-4, step_v: 1e-4, hysteresis_v: 0.0, back: true, every_s: 30.0, seed: 1 };

/// An hour of rest, C/20 to the end, an hour of rest, and the same back; and where it was empty.
fn log(read: Read) -> (Log, f64) {
    let (mut random, noise) = (Pcg64Mcg::seed_from_u64(read.seed), Normal::new(0.0, 1.0).unwrap());
    let (mut soc, mut late_v, mut branch, mut time_s) = (1.0_f64, 0.0_f64, 1.0_f64, 0.0);
    let mut text = String::from("time_s,current_a,voltage_v\n");
    let kept = (-read.every_s / LATE_S).exp();
    let mut step = |current_a: f64, until: &mut dyn FnMut(f64) -> bool| loop {
        let moved = current_a * read.every_s / 3600.0 / CAPACITY_AH;
        (soc, late_v) = (soc - moved, late_v * kept + LATE_OHM * current_a * (1.0 - kept));
        if moved != 0.0 {
            branch = -moved.signum() + (branch + moved.signum()) * (-60.0 * moved.abs()).exp();
        }
        let cell_v = ocv_v(soc) + read.hysteresis_v * branch - OHM * current_a - late_v;
        let (amps, volts) =
            (current_a + read.off_a + read.noise_a * noise.sample(&mut random), cell_v + read.noise_v * noise.sample(&mut random));
        writeln!(text, "{time_s},{amps:.4},{:.6}", (volts / read.step_v).round() * read.step_v).unwrap();
        time_s += read.every_s;
        if until(cell_v) {
            return soc;
        }
    };
    let hour = |every_s: f64| {
        let mut left_s = 3600.0;
        move |_: f64| {
            left_s -= every_s;
            left_s < 0.0
        }
    };
    step(0.0, &mut hour(read.every_s));
    let empty = step(C20_A, &mut |volts| volts <= EOD_V);
    step(0.0, &mut hour(read.every_s));
    if read.back {
        step(-C20_A, &mut |volts| volts >= full_v(read));
        step(0.0, &mut hour(read.every_s));
    }
    (read_log("slow.csv", text.as_bytes(), LogFacts::default()).unwrap(), empty)
}

fn full_v(read: Read) -> f64 {
    ocv_v(1.0) + read.hysteresis_v
}

fn sheet(read: Read) -> Sheet {
    Sheet {
        name: "cell".to_owned(),
        series: 1,
        parallel: 1,
        full_v_per_cell: full_v(read),
        eod_v_per_cell: EOD_V,
        charge_current_a: None,
        charge_cutoff_a: None,
        capacity_ah: None,
        slow_per_hour: 0.5,
    }
}

/// The model, what its table is off by between 5 and 98 % of the charge, V RMS, and what its capacity is off by, Ah.
fn found(read: Read) -> (FirstModel, f64, f64) {
    let (log, empty) = log(read);
    let found = first_model(&sheet(read), &[log]).unwrap();
    let off_v = |step: u32| {
        let soc = 0.05 + 0.93 * f64::from(step) / 200.0;
        found.table.ocv.voltage_v(soc) - ocv_v(empty + soc * (1.0 - empty))
    };
    let rms_v = ((0..=200).map(|step| off_v(step).powi(2)).sum::<f64>() / 201.0).sqrt();
    let off_ah = found.capacity_ah.value - CAPACITY_AH * (1.0 - empty);
    eprintln!(
        "{:.4} +- {:.4} Ah, off by {off_ah:.4}; table off by {:.2} mV, says {:.2}; {:?}",
        found.capacity_ah.value,
        found.capacity_ah.sigma,
        1e3 * rms_v,
        1e3 * found.table.rms_sigma_v,
        found.table.slow_ohm
    );
    (found, rms_v, off_ah)
}

/// A current whose single readings scatter by up to 2 % of the capacity an hour, where C/20 is 5 %, and a rest one below half a per cent.
#[test]
fn rests_and_slow_currents_show_through_an_ammeter_that_scatters() {
    for noise_a in [0.01, 0.02, 0.05] {
        for back in [false, true] {
            let (found, off_v, off_ah) = found(Read { noise_a, back, ..WELL });
            assert_eq!(found.used[0].rests, if back { 3 } else { 2 }, "{noise_a}: {:?}", found.used);
            assert!(found.used[0].slow > 55 && off_v < 3e-3 && off_v < 1.5 * found.table.rms_sigma_v, "{noise_a}: {off_v}");
            assert!(off_ah.abs() < 2.0 * found.capacity_ah.sigma, "{noise_a}: {:?}", found.capacity_ah);
        }
    }
}

/// 0.2 to 0.4 % of the capacity an hour, either way: 6 to 13 % of what is drawn in all.
#[test]
fn an_ammeter_that_is_off_hides_no_rest() {
    for off_a in [-0.01, -0.006, 0.006, 0.01] {
        let (found, off_v, off_ah) = found(Read { off_a, noise_a: 2e-3, ..WELL });
        assert!(found.used[0].rests == 3 && off_v < 2.5e-3 && off_v < found.table.rms_sigma_v, "{off_a}: {off_v}, {:?}", found.used);
        assert!(off_ah.abs() < 0.01 * CAPACITY_AH, "{off_a}: {off_ah}");
    }
}

#[test]
fn what_an_ammeter_hides_is_said() {
    let scatters = Read { noise_a: 0.2, ..WELL };
    let refused = first_model(&sheet(scatters), &[log(scatters).0]).unwrap_err();
    assert!(matches!(refused, OcvError::NoCapacity { .. } | OcvError::NothingSlow { .. } | OcvError::Overrun { .. }), "{refused}");
    let words = refused.to_string();
    let (_, scatter) = words.split_once("The current of slow.csv scatters by ").unwrap_or_else(|| panic!("{words}"));
    let milliamps: f64 = scatter.split_once(" mA").unwrap().0.parse().unwrap();
    assert!((milliamps / 200.0 - 1.0).abs() < 0.06, "{words}");
    // 0.6 % of the capacity an hour could as well be a load.
    let off = Read { off_a: 0.015, back: false, ..WELL };
    let words = match first_model(&sheet(off), &[log(off).0]) {
        Ok(found) => found.ammeters.concat(),
        Err(refused) => refused.to_string(),
    };
    assert!(words.contains("slow.csv has no rest, and its current is 15.0 mA where it is least"), "{words}");
}

/// A reading errs by noise and rounding, and a model states both: they add up to what the readings err by, whatever their steps.
#[test]
fn the_noise_that_is_stated_is_that_before_rounding() {
    for (noise_v, step_v) in [(1e-3, 1e-4), (1e-3, 1e-3), (1e-3, 2e-3), (1e-3, 4e-3), (5e-4, 5e-3)] {
        for noise_a in [0.0, 0.01] {
            let (found, ..) = found(Read { noise_v, step_v, noise_a, back: false, ..WELL });
            let noise = found.voltage_noise;
            let (states, errs) = (noise.sigma_v.hypot(noise.quantum_v / 12f64.sqrt()), noise_v.hypot(step_v / 12f64.sqrt()));
            eprintln!("{noise_v} {step_v} {noise_a}: {noise:?}");
            assert!((states / errs - 1.0).abs() < 0.1, "{noise_v} {step_v}: {noise:?} states {states}, errs by {errs}");
            assert!((noise.quantum_v / step_v - 1.0).abs() < 1e-3, "{noise_v} {step_v}: {noise:?}");
            assert!(step_v > 1e-3 || (noise.sigma_v / noise_v - 1.0).abs() < 0.1, "{noise_v} {step_v}: {noise:?}");
        }
    }
}

/// One branch hides half of a hysteresis, and the deviation that the model states covers that; both branches show it.
#[test]
fn half_of_a_hysteresis_is_in_the_deviation_of_one_way() {
    for hysteresis_v in [0.0, 0.01, 0.015] {
        let one_way = Read { hysteresis_v, back: false, ..WELL };
        let (found, off_v, _) = found(one_way);
        let says_v = found.table.rms_sigma_v;
        assert!(
            says_v > 0.01 && says_v < 0.012 && off_v > hysteresis_v && off_v < 1.645 * says_v,
            "{hysteresis_v}: {off_v}, says {says_v}"
        );
        // That the cell was charged before it rested, full, tells of no other place.
        let mut log = log(one_way).0;
        log.facts.history = Some(History::Charged);
        let rested = first_model(&sheet(one_way), &[log]).unwrap().table;
        assert!(rested.branch == Branch::Discharge && rested.rms_sigma_v > 0.01, "{:?} {}", rested.branch, rested.rms_sigma_v);
    }
}

/// Both ways show half of a hysteresis as what a current costs, and that is said.
#[test]
fn half_of_a_hysteresis_is_in_what_a_current_costs() {
    let (found, ..) = found(Read { hysteresis_v: 0.015, ..WELL });
    let ohm = found.table.slow_ohm.unwrap();
    // 50 mohm of the cell, and 15 mV at 125 mA.
    assert!((ohm.value - 0.17).abs() < 0.02, "{ohm:?}");
    let said = FirstReport::of(&found, None).human();
    assert!(said.contains("costs at half the charge, half of a hysteresis in it: 1"), "{said}");
}

/// C/20 steps by 3.75 mV at once, which is eight times the noise of no single reading.
#[test]
fn means_show_a_step_that_single_readings_do_not() {
    for seed in 1..4 {
        let (found, ..) = found(Read { every_s: 2.0, seed, ..WELL });
        let (ohm, steps) = found.step_ohm.unwrap();
        eprintln!("{ohm:?} of {steps}");
        assert!(steps == 2 && ohm.sigma < 0.01 && (ohm.value - OHM).abs() < 2.0 * ohm.sigma, "{ohm:?} of {steps}");
    }
}

/// Rows of half a minute show no step: the model has a resistance all the same, as roughly known as that of any cell.
#[test]
fn a_resistance_that_nothing_shows_is_a_guess() {
    let (found, ..) = found(WELL);
    assert_eq!(found.step_ohm, None);
    let model = Model::parse("first.toml", &model_text(&found, "a test"), &|_| Err("no file".to_owned())).unwrap();
    let ohm = model.parameter("ohmic", "resistance_ohm").unwrap();
    assert!((ohm.value - OHM).abs() < ohm.sigma && ohm.sigma > 0.5 * ohm.value && ohm.source.starts_with("guess"), "{ohm:?}");
}
