use super::*;
use crate::measurement::{LogFacts, read_log};
use crate::prepare::prepare;

const MODEL: &str = r#"
schema = 1
system = "battery"
name = "t"
[battery]
series = 2
parallel = 1
capacity_ah = 1.0
full_v_per_cell = 4.2
eod_v_per_cell = 3.0
charge_current_a = 1.0
charge_cutoff_a = 0.1
ocv = { soc = [0.0, 0.4, 1.0], voltage_v = [3.0, 3.7, 4.1] }
[sensor.voltage_v]
sigma = 1e-3
offset_sigma = 3e-3
gain_sigma = 1e-3
lag_sigma_s = 0.5
[sensor.current_a]
sigma = 1e-3
offset_sigma = 1e-3
gain_sigma = 3e-3
[sensor.temperature_degc]
sigma = 0.1
offset_sigma = 1.0
[uncertainty]
ocv_sigma_v = 3e-3
soc_initial_sigma = 0.01
capacity_relative_sigma = 0.01
[[effect]]
id = "ohmic"
resistance_ohm = { value = 0.1, source = "t", free = true }
[[effect]]
id = "arrhenius"
activation_kj_per_mol = { value = 20.0, source = "t", free = true }
[[effect]]
id = "rc1"
resistance_ohm = { value = 0.05, source = "t", free = true }
tau_s = { value = 60.0, source = "t", free = true }
"#;

/// Two logs of pulses and rests, the second in the cold; a thermal effect in the model or not.
fn frame(thermal: bool) -> Frame {
    let more = "[[effect]]\nid = \"thermal\"\nconductance_w_per_k = { value = 0.05, source = \"t\", free = true }\n";
    let text = if thermal { format!("{MODEL}{more}") } else { MODEL.to_owned() };
    let model = Model::parse("m.toml", &text, &|_| Err(String::new())).unwrap();
    let log = |name: &str, ambient_degc: f64| {
        let mut text = "time_s,current_a,voltage_v,temperature_degc,ambient_degc\n".to_owned();
        for row in 0..120 {
            let current_a = [0.0, 1.0, -0.5, 2.0][row / 15 % 4] + 0.01 * (row % 7) as f64;
            let voltage_v = 7.6 - 0.1 * current_a - 0.002 * row as f64;
            text += &format!("{},{current_a},{voltage_v},{},{ambient_degc}\n", 5 * row, ambient_degc + 0.02 * row as f64);
        }
        let facts = LogFacts { soc_initial: Some(0.8), ..LogFacts::default() };
        prepare(&model, &read_log(name, text.as_bytes(), facts).unwrap()).unwrap()
    };
    let logs = vec![log("a.csv", 25.0), log("b.csv", 5.0)];
    let evidence = Evidence::new(&model, logs);
    Frame::new(Arc::new(model), Arc::new(evidence))
}

/// Rows over which the inputs hold are walked in one step: far fewer steps, the same means; of a clock that jitters as well.
#[test]
fn a_course_of_few_steps_shows_the_means_of_all_rows() {
    for jitter_s in [0.0, 0.05] {
        let model = Model::parse("m.toml", MODEL, &|_| Err(String::new())).unwrap();
        let mut text = "time_s,current_a,voltage_v,temperature_degc\n".to_owned();
        for row in 0..600 {
            let current_a = [0.0, 1.0, -0.5, 2.0][row / 150] + 0.001 * (row % 3) as f64;
            let time_s = 5.0 * row as f64 + jitter_s * [0.0, 1.0, -1.0, 0.5][row % 4];
            text += &format!("{time_s},{current_a},7.6,25\n");
        }
        let facts = LogFacts { soc_initial: Some(0.8), ..LogFacts::default() };
        let log = prepare(&model, &read_log("a.csv", text.as_bytes(), facts).unwrap()).unwrap();
        let frame = Frame::new(Arc::new(model.clone()), Arc::new(Evidence::new(&model, vec![log])));
        let whole = Frame::new(Arc::new(model), Arc::clone(frame.evidence.whole.as_ref().unwrap()));
        assert!(frame.evidence.courses[0].time_s.len() < 600 / 2, "{}", frame.evidence.courses[0].time_s.len());
        let (few, all) = (frame.predict(&frame.start()), whole.predict(&whole.start()));
        let segment = &frame.evidence.segments[0];
        let mut means = vec![0.0; few.len()];
        segment.block_of.iter().zip(&all).for_each(|(&block, value)| means[block] += value / segment.counts[block]);
        let worst = few.iter().zip(&means).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // A step of 2.5 C on a pack of 0.1 ohm in its RC pair, over a kink of the OCV table: a twentieth
        // of the noise of one reading, and with a clock that is off by a hundredth of a row a fifth.
        assert!(worst < if jitter_s > 0.0 { 2e-4 } else { 5e-5 }, "{jitter_s}: {worst}");
    }
}

const ROBOT: &str = r#"
schema = 1
system = "robot"
name = "r"
[sensor.power_w]
sigma = 0.02
[[effect]]
id = "idle"
idle_w = { value = 3.0, source = "t", free = true }
[[effect]]
id = "rolling"
rolling_coefficient = { value = 0.03, source = "t", free = true }
mass_kg = { value = 2.0, source = "t" }
[[effect]]
id = "slope"
mass_kg = { value = 2.0, source = "t" }
[[effect]]
id = "input_voltage_loss"
"#;

/// Spells of driving and standing, with a voltage that sags all the time and a speed that changes sign by next to nothing.
fn driven(model: &Model) -> Frame {
    let mut text = "time_s,power_w,voltage_v,speed_mps,pitch_rad\n".to_owned();
    for row in 0..900 {
        let speed_mps = [0.0, 0.2, -0.2, 1e-6, -1e-6][row / 9 % 5];
        let voltage_v = 12.4 - 1e-4 * row as f64 - 0.02 * (row / 9 % 5) as f64;
        text += &format!("{row},{},{voltage_v},{speed_mps},{}\n", 3.0 + speed_mps, [0.0, 0.1, -0.05][row / 45 % 3]);
    }
    let log = prepare(model, &read_log("a.csv", text.as_bytes(), LogFacts::default()).unwrap()).unwrap();
    Frame::new(Arc::new(model.clone()), Arc::new(Evidence::new(model, vec![log])))
}

/// A model that forgets at once shows in one step what it shows in all rows of a spell over which its inputs hold.
#[test]
fn a_spell_is_one_step_for_a_model_that_forgets_at_once() {
    let model = Model::parse("r.toml", ROBOT, &|_| Err(String::new())).unwrap();
    let frame = driven(&model);
    let whole = Frame::new(Arc::clone(&frame.model), Arc::clone(frame.evidence.whole.as_ref().unwrap()));
    assert_eq!(frame.evidence.rows(), 100, "a mean for each spell");
    assert!(frame.evidence.courses[0].time_s.len() <= 102, "{}", frame.evidence.courses[0].time_s.len());
    let (few, all) = (frame.predict(&frame.start()), whole.predict(&whole.start()));
    let segment = &frame.evidence.segments[0];
    let mut means = vec![0.0; few.len()];
    segment.block_of.iter().zip(&all).for_each(|(&block, value)| means[block] += value / segment.counts[block]);
    let worst = few.iter().zip(&means).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // A loss that goes with the voltage is straight in it, or nearly: nothing beside the 20 mW of one reading.
    assert!(worst < 1e-6, "{worst}");
}

/// A formula that remembers is walked in steps that are short beside the time since something jumped.
#[test]
fn a_model_that_remembers_has_no_spells() {
    let late = r#"
[[effect]]
id = "expression"
name = "late"
channel = "power_w"
formula = "k * held"
states = { held = { input = "speed_mps", tau = "tau_s" } }
k = { value = 0.1, source = "t", free = true }
tau_s = { value = 5.0, source = "t" }
"#;
    let model = Model::parse("r.toml", &format!("{ROBOT}{late}"), &|_| Err(String::new())).unwrap();
    let frame = driven(&model);
    assert!(frame.evidence.rows() > 200, "{}", frame.evidence.rows());
}

/// Every derivative, of parameters and of what is only roughly known, against differences.
#[test]
fn derivatives_are_those_of_the_predictions() {
    for thermal in [false, true] {
        let frame = frame(thermal);
        let mut x = frame.start();
        // Off zero, where every correction is at work.
        for (place, known) in frame.known.iter().enumerate() {
            x[frame.free.len() + place] = 0.3 * known.sigma * [1.0, -1.0, 0.5][place % 3];
        }
        let by: Vec<usize> = (0..frame.unknowns()).collect();
        let (predicted, slopes) = frame.linearise(&x, &by);
        let plain = frame.predict(&x);
        assert!(predicted.iter().zip(&plain).all(|(a, b)| (a - b).abs() < 1e-12));
        for unknown in by {
            let what = frame.what(unknown);
            let scale = if unknown < frame.free.len() { x[unknown].abs() } else { frame.known[unknown - frame.free.len()].sigma };
            let h = 1e-4 * scale;
            let beside = |side: f64| {
                let mut moved = x.clone();
                moved[unknown] += side * h;
                frame.predict(&moved)
            };
            let (above, below) = (beside(1.0), beside(-1.0));
            for row in 0..predicted.len() {
                let slope = (above[row] - below[row]) / (2.0 * h);
                let error = (slopes[(unknown, row)] - slope).abs() * scale;
                // A hundredth of a millivolt, or of a millikelvin, per deviation.
                assert!(error < 1e-5 + 0.02 * slope.abs() * scale, "{what:?} row {row}: {} against {slope}", slopes[(unknown, row)]);
            }
        }
    }
}

/// A sensor that is late shows what was true before, also several rows before.
#[test]
fn a_late_sensor_shows_an_earlier_row() {
    let frame = frame(false);
    let whole = Frame::new(Arc::clone(&frame.model), Arc::clone(frame.evidence.whole.as_ref().unwrap()));
    let late = whole.known.iter().position(|known| known.what == Rough::Lag(Channel::VoltageV)).unwrap();
    let prompt = whole.predict(&whole.start());
    let voltage = whole.evidence.segments.iter().find(|segment| segment.channel == Channel::VoltageV).unwrap();
    // Rows are 5 s apart.
    for (late_s, row_of) in [(15.0, 20 - 3), (-10.0, 20 + 2)] {
        let mut x = whole.start();
        x[whole.free.len() + late] = late_s;
        assert!((whole.predict(&x)[voltage.begin + 20] - prompt[voltage.begin + row_of]).abs() < 1e-12, "{late_s} s");
    }
}
