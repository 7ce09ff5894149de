//! Numbers that logs know only together with others, or only at the end of their range.

use std::sync::Arc;

use energy::{Channel, Model};
use lab::infer::answer::{Discovery, Value, Verdict};
use lab::infer::discover::search;
use lab::infer::evidence::Evidence;
use lab::infer::other_starts::{OtherStart, other_starts};
use lab::measurement::{Log, LogFacts, read_log};
use lab::predict::predict;
use lab::prepare::prepare;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64;

use crate::made_up;

/// What the lab finds in logs of the truth, of which these channels were measured with this much noise.
fn found(base: &Arc<Model>, truth: &Arc<Model>, log: &Log, measured: &[(Channel, f64)]) -> Discovery {
    let seen = predict(truth, &prepare(truth, log).unwrap(), &truth.values());
    let noisy = |seed: u128| {
        let (mut log, mut random) = (log.clone(), Pcg64::new(seed, 0));
        for &(channel, sigma) in measured {
            let noise = Normal::new(0.0, sigma).unwrap();
            let values = seen.of(channel).unwrap().iter().map(|value| value + noise.sample(&mut random)).collect();
            log.channels.insert(channel, values);
        }
        prepare(base, &log).unwrap()
    };
    Discovery::of(&search(Arc::clone(base), Arc::new(Evidence::new(base, vec![noisy(1), noisy(2)])), None))
}

fn within(found: &Discovery, effect: &str, number: &str, truth: f64) {
    let Value { value, sigma, .. } = found.parameters[effect][number];
    let sigma = sigma.unwrap_or(0.01 * truth);
    assert!((value - truth).abs() <= 3.0 * sigma && (value / truth - 1.0).abs() < 0.1, "{effect}.{number}: {value} +- {sigma}");
}

/// Of conductance, heat capacity and the share of losses that warms the cell a thermometer knows two ratios: the share is what it usually is.
#[test]
fn a_scale_that_no_log_knows_is_the_usual_one() {
    let sensors = "[sensor.voltage_v]\nsigma = 1e-3\n[sensor.temperature_degc]\nsigma = 0.05\n";
    let ohmic = "[[effect]]\nid = \"ohmic\"\nresistance_ohm = { value = 0.05, source = \"t\", sigma = 0.005, free = true }\n";
    let base = made_up::model(&format!("{sensors}{ohmic}"));
    let truth = Arc::new(base.with("thermal").unwrap());
    let rows: String = (0..3600).map(|row| format!("{row},{},25,3.9,25\n", [1.5, 0.0, 0.5][row / 400 % 3])).collect();
    let facts = LogFacts { soc_initial: Some(0.95), ..LogFacts::default() };
    let text = format!("time_s,current_a,ambient_degc,voltage_v,temperature_degc\n{rows}");
    let log = read_log("blocks.csv", text.as_bytes(), facts).unwrap();
    let found = found(&base, &truth, &log, &[(Channel::VoltageV, 1e-3), (Channel::TemperatureDegc, 0.05)]);
    assert_eq!((found.verdict, &found.selected[..]), (Verdict::Missing, &["thermal"][..]));
    for (number, truth) in [("conductance_w_per_k", 0.05), ("heat_share", 1.0), ("heat_capacity_j_per_k", 45.0)] {
        within(&found, "thermal", number, truth);
    }
}

/// A start that is wrong by more than is stated looks like an effect of the battery: it is told that it would do as well.
#[test]
fn a_wrong_start_is_told_beside_what_stands_in_for_it() {
    let sensors = "[sensor.voltage_v]\nsigma = 1e-3\n[uncertainty]\nsoc_initial_sigma = 5e-3\n";
    let base = made_up::model(&format!("{sensors}[[effect]]\nid = \"ohmic\"\nresistance_ohm = {{ value = 0.05, source = \"t\" }}\n"));
    let rows: String = (0..3600).map(|row| format!("{row},{},3.9\n", [1.5, 0.0, 0.5][row / 400 % 3])).collect();
    let log = |soc: f64| {
        let facts = LogFacts { soc_initial: Some(soc), ..LogFacts::default() };
        read_log("blocks.csv", format!("time_s,current_a,voltage_v\n{rows}").as_bytes(), facts).unwrap()
    };
    let (noise, mut random) = (Normal::new(0.0, 1e-3).unwrap(), Pcg64::new(1, 0));
    for true_soc in [0.90, 0.52] {
        let truth = log(true_soc);
        let seen = predict(&base, &prepare(&base, &truth).unwrap(), &base.values());
        let volts: Vec<f64> = seen.of(Channel::VoltageV).unwrap().iter().map(|volts| volts + noise.sample(&mut random)).collect();
        let told = |mut log: Log| {
            log.channels.insert(Channel::VoltageV, volts.clone());
            told(&base, &log)
        };
        let [other] = &told(log(0.95))[..] else { panic!("nothing is told") };
        assert!(other.stated == 0.95 && (other.found - true_soc).abs() < 0.002, "{other:?}");
        // Where the start is right there is nothing to be told.
        assert_eq!(told(truth), []);
    }
    // A battery cannot hold more than it holds: 0.3 V too much is no charge of 120 %.
    let mut over = log(0.95);
    let seen = predict(&base, &prepare(&base, &over).unwrap(), &base.values());
    over.channels.insert(Channel::VoltageV, seen.of(Channel::VoltageV).unwrap().iter().map(|volts| volts + 0.3).collect());
    assert_eq!(told(&base, &over), []);
}

/// What is told of the starts of a log that was searched.
fn told(base: &Arc<Model>, log: &Log) -> Vec<OtherStart> {
    let logs = [prepare(base, log).unwrap()];
    let found = search(Arc::clone(base), Arc::new(Evidence::new(base, logs.to_vec())), None);
    other_starts(base, &logs, &found.last)
}

/// Surroundings that are stated without a deviation are taken at their word: that others would do as well is told.
#[test]
fn wrong_surroundings_are_told_beside_what_stands_in_for_them() {
    let sensors = "[sensor.voltage_v]\nsigma = 1e-3\n[sensor.temperature_degc]\nsigma = 0.05\n";
    let thermal = "[[effect]]\nid = \"thermal\"\nconductance_w_per_k = { value = 0.1, source = \"t\" }\nheat_capacity_j_per_k = { value = 45.0, source = \"t\" }\n";
    let base =
        made_up::model(&format!("{sensors}[[effect]]\nid = \"ohmic\"\nresistance_ohm = {{ value = 0.05, source = \"t\" }}\n{thermal}"));
    let rows: String = (0..3600).map(|row| format!("{row},{},3.9,25\n", [1.5, 0.0, 0.5][row / 400 % 3])).collect();
    let log = |ambient_degc: f64| {
        let facts = LogFacts { soc_initial: Some(0.9), ambient_degc: Some(ambient_degc), ..LogFacts::default() };
        read_log("blocks.csv", format!("time_s,current_a,voltage_v,temperature_degc\n{rows}").as_bytes(), facts).unwrap()
    };
    let seen = predict(&base, &prepare(&base, &log(28.0)).unwrap(), &base.values());
    let mut random = Pcg64::new(2, 0);
    let mut noisy = |channel: Channel, sigma: f64| -> Vec<f64> {
        let noise = Normal::new(0.0, sigma).unwrap();
        seen.of(channel).unwrap().iter().map(|value| value + noise.sample(&mut random)).collect()
    };
    let (volts, degrees) = (noisy(Channel::VoltageV, 1e-3), noisy(Channel::TemperatureDegc, 0.05));
    let measured = |ambient_degc: f64| {
        let mut said = log(ambient_degc);
        said.channels.insert(Channel::VoltageV, volts.clone());
        said.channels.insert(Channel::TemperatureDegc, degrees.clone());
        told(&base, &said)
    };
    let [other] = &measured(25.0)[..] else { panic!("nothing is told") };
    assert!(other.fact == "ambient_degc" && other.stated == 25.0 && (other.found - 28.0).abs() < 0.1, "{other:?}");
    assert_eq!(measured(28.0), []);
}

/// Of a log without load, a resistance that was measured elsewhere stays what it was: a milliampere of noise says nothing of it.
#[test]
fn what_was_stated_better_than_logs_know_it_stays() {
    let sensors = "[sensor.voltage_v]\nsigma = 1e-3\n[sensor.current_a]\nsigma = 1e-3\n";
    let model = |ohm: f64, sigma: &str| {
        made_up::model(&format!(
            "{sensors}[[effect]]\nid = \"ohmic\"\nresistance_ohm = {{ value = {ohm}, source = \"t\", {sigma}free = true }}\n"
        ))
    };
    let rows = |load_a: f64| -> String {
        let mut random = Pcg64::new(4, 0);
        let mut current_a = |row: u32| load_a * f64::from(row / 100 % 2) + Normal::new(0.0, 1e-3).unwrap().sample(&mut random);
        (0..1500).map(|row| format!("{row},{},3.9\n", current_a(row))).collect()
    };
    let log = |load_a: f64| {
        let facts = LogFacts { soc_initial: Some(0.6), ..LogFacts::default() };
        read_log("rest.csv", format!("time_s,current_a,voltage_v\n{}", rows(load_a)).as_bytes(), facts).unwrap()
    };
    let truth = model(0.05, "");
    let of = |base: &Arc<Model>, load_a: f64| {
        let found = found(base, &truth, &log(load_a), &[(Channel::VoltageV, 1e-3)]);
        assert_eq!(found.verdict, Verdict::Complete);
        found.parameters["ohmic"]["resistance_ohm"]
    };
    let kept = of(&model(0.05, "sigma = 0.005, "), 0.0);
    assert_eq!((kept.value, kept.sigma), (0.05, Some(0.005)));
    // Under load the logs know better, and what was not stated with a deviation is theirs alone.
    let better = of(&model(0.052, "sigma = 0.005, "), 1.0);
    assert!((better.value - 0.05).abs() < 3.0 * better.sigma.unwrap() && better.sigma.unwrap() < 1e-3, "{better:?}");
    assert!(of(&model(0.05, ""), 0.0).sigma.is_none_or(|sigma| sigma > 0.01));
}

const ROBOT: &str = "schema = 1\nsystem = \"robot\"\nname = \"r\"\n[robot]\nnominal_v = 11.1\n[sensor.power_w]\nsigma = 0.02\n";
const MOTION: &str = "[[effect]]\nid = \"motion\"\nrolling_coefficient = { value = 0.03, source = \"t\" }\n\
                      mass_kg = { value = 1.5, source = \"t\" }\ndrive_efficiency = { value = 0.7, source = \"t\" }\n";

fn robot(effects: &str) -> Arc<Model> {
    Arc::new(Model::parse("r.toml", &format!("{ROBOT}{effects}"), &|_| Err("no table".to_owned())).unwrap())
}

/// Twenty minutes up and down a slope, a camera on now and then.
fn drive() -> Log {
    let row = |second: u32| {
        let (phase, camera) = (second % 40, u32::from((second / 150).is_multiple_of(2)));
        let (speed, accel) = match phase {
            0..5 => (0.1 * f64::from(phase), 0.1),
            5..20 => (0.5, 0.0),
            20..25 => (0.1 * f64::from(25 - phase), -0.1),
            _ => (0.0, 0.0),
        };
        let pitch = if (second / 40).is_multiple_of(2) { 0.08 } else { -0.08 };
        format!("{second},11.1,{speed},{accel},{pitch},0,{camera},1\n")
    };
    let rows: String = (0..1200).map(row).collect();
    let text = format!("time_s,voltage_v,speed_mps,accel_mps2,pitch_rad,payload_kg,camera_on,power_w\n{rows}");
    read_log("drive.csv", text.as_bytes(), LogFacts::default()).unwrap()
}

/// What was stated with a deviation is where the fit goes back to once the effect is found without which it had walked away.
#[test]
fn numbers_that_are_known_together_keep_what_was_stated() {
    let stated = "[[effect]]\nid = \"idle\"\nidle_w = { value = 3.0, source = \"t\", sigma = 0.15, free = true }\n[[effect]]\nid = \"converter\"\n\
                  efficiency = { value = 0.9, source = \"t\", sigma = 0.045, free = true }\n\
                  quiescent_w = { value = 0.1, source = \"t\", sigma = 0.01, free = true }\n";
    let base = robot(stated);
    let camera = "[[effect]]\nid = \"camera\"\ncamera_w = { value = 10.0, source = \"t\" }\n";
    let found = found(&base, &robot(&format!("{stated}{camera}")), &drive(), &[(Channel::PowerW, 0.02)]);
    assert_eq!(found.selected, ["camera"], "{:?}", found.verdict);
    for (effect, number, truth) in [("camera", "camera_w", 10.0), ("idle", "idle_w", 3.0), ("converter", "efficiency", 0.9)] {
        within(&found, effect, number, truth);
    }
}

/// All that braking gives comes back: no more is possible, and it is enough.
#[test]
fn an_effect_as_large_as_it_can_be_is_found() {
    let idle = "[[effect]]\nid = \"idle\"\nidle_w = { value = 3.0, source = \"t\", sigma = 0.1, free = true }\n";
    let base = robot(&format!("{idle}{MOTION}"));
    let all = "[[effect]]\nid = \"regeneration\"\nshare = { value = 1.0, source = \"t\" }\n";
    let found = found(&base, &robot(&format!("{idle}{MOTION}{all}")), &drive(), &[(Channel::PowerW, 0.02)]);
    assert_eq!((found.verdict, &found.selected[..]), (Verdict::Missing, &["regeneration"][..]), "{:?}", found.ranking[0]);
    within(&found, "regeneration", "share", 1.0);
}
