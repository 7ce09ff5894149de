//! Two effects, of which neither seems to help without the other.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::Discovery;
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::infer::look::Outcome;
use lab::measurement::{LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::{Prepared, prepare};
use rand::RngExt as _;
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

/// A station whose charger and lighting are known about, and what more its file says.
fn station(more: &str) -> Arc<Model> {
    let text = format!(
        "schema = 1\nsystem = \"station\"\nname = \"t\"\n[sensor.pack_power_w]\nsigma = 0.05\n[sensor.charge_power_w]\nsigma = 0.02\n\
         [[effect]]\nid = \"charger_efficiency\"\nefficiency = {{ value = 0.88, sigma = 0.01, free = true, source = \"t\" }}\n\
         [[effect]]\nid = \"converter_efficiency\"\nefficiency = {{ value = 0.84, source = \"t\" }}\nquiescent_w = {{ value = 0.3, source = \"t\" }}\n\
         [[effect]]\nid = \"hotel\"\nhotel_w = {{ value = 5.5, sigma = 0.2, free = true, source = \"t\" }}\n{more}"
    );
    Arc::new(Model::parse("station.toml", &text, &|_| Err("no table".to_owned())).unwrap())
}

const ROWS: usize = 14400;
/// The arm moves for so many seconds before a robot docks, and from when it leaves.
const LIFT_S: usize = 25;

/// Four hours, by the second, of three bays at which robots come and go, each lifted in and out.
fn log(truth: &Arc<Model>, of: &Model, seed: u64) -> Prepared {
    let mut random = Pcg64::seed_from_u64(seed);
    let (mut docked, mut charging, mut lifted, mut into_w) = (vec![0; ROWS], vec![0; ROWS], vec![0; ROWS], vec![0.0; ROWS]);
    for _ in 0..3 {
        let mut row = random.random_range(60..1800);
        while row + LIFT_S < ROWS {
            let (docks, charges, rests) = (row + LIFT_S, random.random_range(1500..4000), random.random_range(60..1500));
            let leaves = docks + charges + rests;
            (row..docks).chain(leaves..leaves + LIFT_S).filter(|&row| row < ROWS).for_each(|row| lifted[row] = 1);
            (docks..leaves.min(ROWS)).for_each(|row| docked[row] += 1);
            for row in docks..(docks + charges).min(ROWS) {
                charging[row] += 1;
                // Constant current, then the taper.
                let left = (docks + charges - row) as f64;
                into_w[row] += 16.0 * (left / 750.0).min(1.0);
            }
            row = leaves + random.random_range(100..2500);
        }
    }
    let line = |row: usize| format!("{},{:.3},{},{},{},12.0,20\n", row, into_w[row], docked[row], charging[row], lifted[row]);
    let rows: String = (0..ROWS).map(line).collect();
    let text = format!("time_s,charge_power_w,robots_docked,robots_charging,lift_active,pack_voltage_v,pack_power_w\n{rows}");
    let mut log = read_log("station.csv", text.as_bytes(), LogFacts::default()).unwrap();
    let shown = predict(truth, &prepare(truth, &log).unwrap(), &truth.values());
    let noise = Normal::new(0.0, 0.05).unwrap();
    let values = shown.of(Channel::PackPowerW).unwrap().iter().map(|value| value + noise.sample(&mut random)).collect();
    log.channels.insert(Channel::PackPowerW, values);
    let noise = Normal::new(0.0, 0.02).unwrap();
    let metered = into_w.iter().map(|&watts| if watts > 0.0 { watts + noise.sample(&mut random) } else { 0.0 }).collect();
    log.channels.insert(Channel::ChargePowerW, metered);
    prepare(of, &log).unwrap()
}

/// As a robot docks, the arm's power ends and the robot's own begins: beside slow noise, whose steps are taken to be of one size, what
/// the steps say of either effect contradicts it as long as the other is missing.
#[test]
fn an_arm_and_what_docked_robots_draw_are_found_together() {
    // 5.9 W behind charger and converter are the 8 W of the arm: the step from one to the other is none.
    let missing = "[[effect]]\nid = \"robot_own_load\"\nown_load_w = { value = 5.9, source = \"t\" }\n\
                   [[effect]]\nid = \"lift\"\nlift_w = { value = 8.0, source = \"t\" }\n";
    let (truth, base) = (station(missing), station(""));
    for (first, held_out) in [(1, true), (191, true), (191, false)] {
        let evidence = |seeds: [u64; 2]| Arc::new(Evidence::new(&base, seeds.map(|seed| log(&truth, &base, seed)).to_vec()));
        let found = search(Arc::clone(&base), evidence([first, first + 1]), held_out.then(|| evidence([first + 2, first + 3])).as_ref());
        let answer = Discovery::of(&found);
        let mut names = answer.selected.clone();
        names.sort_unstable();
        assert!(names == ["lift", "robot_own_load"] || names == ["lift", "path_selection"], "{first}: {names:?}");
        // The last look finds nothing more.
        assert_eq!(found.steps.last().unwrap().outcome, Outcome::Complete);
        let rms = found.last.rms()[0].1;
        // The meter's own noise, and what the noise of the charging power becomes on its way through charger and converter.
        let floor_w = 0.05_f64.hypot(0.02 / (0.88 * 0.84));
        assert!(rms < 1.05 * floor_w, "{first}: {rms} W");
        let lift = &answer.parameters["lift"]["lift_w"];
        assert!((lift.value - 8.0).abs() < 4.0 * lift.sigma.unwrap() && lift.sigma.unwrap() < 0.05, "{first}: {lift:?}");
    }
}
