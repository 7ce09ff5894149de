//! A robot's rails in its model file, and what they make of its loads.

use std::sync::Arc;

use energy::power::Cause;
use energy::real::{derivative, variable};
use energy::{Channel, Dual, Model, Phase, Run, Start, System, catalogue, load_model};
use proptest::prelude::*;

/// Kottas, Fig. 4.1: a converter with a regulator behind it, and a regulator beside it.
const ROBOT: &str = r#"
schema = 1
system = "robot"
name = "two-branches"

[robot]
nominal_v = 7.4

[[rail]]
id = "5v"
from = "battery"
kind = "switching"
voltage_v = 5.0
input_min_v = 6.0
polynomial = { fixed_w = 0.1, linear_v = 5.4, resistance_ohm = 0.2 }

[[rail.load]]
name = "camera"
kind = "power"
value = 1.0
when = "camera_on"

[[rail]]
id = "3v3"
from = "5v"
kind = "linear"
voltage_v = 3.3
dropout_v = 0.3
current_max_a = 0.5

[[rail]]
id = "clean"
from = "battery"
kind = "linear"
voltage_v = 5.0
theta_ja_k_per_w = 100.0

[[rail.load]]
name = "sensors"
kind = "current"
value = 0.2

[[effect]]
id = "idle"
idle_w = { value = 0.3, source = "test" }

[[effect]]
id = "gps"
rail = "3v3"
current_a = { value = 0.0355, source = "test" }

[[effect]]
id = "encoders"
rail = "5v"
current_a = { value = 0.02, source = "test" }
"#;

fn parse(text: &str) -> Result<Model, energy::DocumentError> {
    Model::parse("robot.toml", text, &|_| unreachable!())
}

fn robot() -> Run<f64> {
    Run::new(Arc::new(parse(ROBOT).unwrap()), Start::at_soc(0.0))
}

/// By hand at 7.4 V: 3v3 takes 117.15 mW / 3.3 V = 35.5 mA; 5v gives these, the encoders' 20 mA and
/// the camera's 200 mA: 0.2555 A, for 0.1 + 5.4 x 0.2555 + 0.2 x 0.2555^2 = 1.49275605 W. clean:
/// 0.2 A x 7.4 V = 1.48 W. Straight on the battery: 0.3 W.
#[test]
fn effects_and_loads_on_rails_reach_the_battery_through_their_converters() {
    let mut run = robot();
    run.channels[Channel::CameraOn] = 1.0;
    run.step(1.0);
    assert!((run.channels[Channel::PowerW] - (1.492_756_05 + 1.48 + 0.3)).abs() < 1e-9, "{}", run.channels[Channel::PowerW]);
    // Without the camera: 0.0555 A.
    run.channels[Channel::CameraOn] = 0.0;
    run.step(1.0);
    let hand_w = 0.1 + 5.4 * 0.0555 + 0.2 * 0.0555 * 0.0555 + 1.48 + 0.3;
    assert!((run.channels[Channel::PowerW] - hand_w).abs() < 1e-9);
}

#[test]
fn the_packs_voltage_counts_and_the_nominal_one_where_it_is_not_given() {
    let mut run = robot();
    run.step(1.0);
    let nominal_w = run.channels[Channel::PowerW];
    run.channels[Channel::VoltageV] = 8.4;
    run.step(1.0);
    // The linear branch takes 0.2 A at any voltage; the polynomial takes the same power.
    assert!((run.channels[Channel::PowerW] - nominal_w - 0.2).abs() < 1e-9);
}

#[test]
fn shares_and_rails_sum_to_the_power() {
    let mut run = robot();
    run.channels[Channel::CameraOn] = 0.7;
    let shares = run.step_explained(1.0);
    assert_eq!(shares.last().unwrap().0, "rails");
    let sum: f64 = shares.iter().map(|(_, share)| share).sum();
    assert!((sum - run.channels[Channel::PowerW]).abs() < 1e-12);
    let flow = run.rails().unwrap();
    assert!((flow.load_w() + flow.loss_w() - flow.battery_w).abs() < 1e-12);
    assert!((flow.battery_w + 0.3 - run.channels[Channel::PowerW]).abs() < 1e-12);
}

#[test]
fn a_rail_that_cannot_deliver_is_named_and_the_power_stays_a_number() {
    let mut run = robot();
    run.channels[Channel::VoltageV] = 5.5;
    run.step(1.0);
    assert!(run.channels[Channel::PowerW].is_finite());
    let refused = run.model().facts.tree().unwrap().refused(&run.rails().unwrap()).unwrap();
    assert_eq!((refused.rail.as_str(), refused.cause), ("5v", Cause::DropOut { input_v: 5.5, needed_v: 6.0 }));
    run.channels[Channel::VoltageV] = 7.4;
    run.step(1.0);
    assert_eq!(run.rails().unwrap().refusal(), None);
}

#[test]
fn parameters_of_effects_on_rails_keep_exact_derivatives() {
    let model = Arc::new(parse(ROBOT).unwrap());
    let values = model.values();
    let power_w = |values: Vec<f64>| {
        let mut run = Run::with_parameters(Arc::clone(&model), values, Start::at_soc(0.0));
        run.step(1.0);
        run.channels[Channel::PowerW]
    };
    let duals = values.iter().enumerate().map(|(lane, &value)| variable(value, lane)).collect();
    let mut run = Run::<Dual>::with_parameters(Arc::clone(&model), duals, Start::at_soc(0.0).lifted());
    run.step(1.0);
    for lane in 0..values.len() {
        let at = |nudge: f64| {
            let mut nudged = values.clone();
            nudged[lane] += nudge;
            power_w(nudged)
        };
        let numeric = (at(1e-5) - at(-1e-5)) / 2e-5;
        assert!((derivative(&run.channels[Channel::PowerW], lane) - numeric).abs() < 1e-6, "{lane}");
    }
}

#[test]
fn bad_rails_are_refused_with_place_and_near_match() {
    let refused = |change: (&str, &str)| {
        assert!(ROBOT.contains(change.0), "{}", change.0);
        parse(&ROBOT.replacen(change.0, change.1, 1)).unwrap_err().to_string()
    };
    let text = refused(("rail = \"3v3\"", "rail = \"3v\""));
    assert!(text.starts_with("robot.toml:49:8:") && text.contains("did you mean `3v3`?"), "{text}");
    assert!(refused(("from = \"battery\"", "from = \"batery\"")).contains("did you mean `battery`?"));
    assert!(refused(("from = \"5v\"", "from = \"3v3\"")).contains("rail `3v3` hangs on itself"));
    assert!(refused(("id = \"clean\"", "id = \"5v\"")).contains("a second rail `5v`"));
    assert!(refused(("kind = \"switching\"", "kind = \"switchng\"")).contains("did you mean `switching`?"));
    assert!(refused(("dropout_v = 0.3", "drop_out_v = 0.3")).contains("did you mean `dropout_v`?"));
    assert!(refused(("dropout_v = 0.3", "input_min_v = 4.0")).contains("a linear rail has no `input_min_v`"));
    assert!(refused(("when = \"camera_on\"", "when = \"camera\"")).contains("did you mean `camera_on`?"));
    assert!(refused(("when = \"camera_on\"", "when = \"power_w\"")).contains("no channel that could switch it"));
    assert!(refused(("linear_v = 5.4", "linear_v = 4.9")).contains("linear_v = 4.9: must be between 5 and 50"));
    assert!(refused(("value = 0.2", "value = -0.2")).contains("load `sensors`: value (A) = -0.2"));
    assert!(refused(("current_max_a = 0.5", "current_max_a = nan")).contains("current_max_a = NaN"));
    assert!(refused(("voltage_v = 3.3", "")).contains("rail `3v3`: voltage_v is missing"));
    assert!(refused(("[robot]\nnominal_v = 7.4", "")).contains("rails need a [robot] table"));
    let text = refused(("polynomial = { fixed_w = 0.1, linear_v = 5.4, resistance_ohm = 0.2 }", ""));
    assert!(text.starts_with("robot.toml:") && text.contains("needs one of efficiency"), "{text}");
    let station = ROBOT.replace("system = \"robot\"", "system = \"station\"");
    assert!(parse(&station).unwrap_err().to_string().contains("a [robot] table in a model with system = \"station\""));
    let converter = ROBOT
        .replace("id = \"gps\"\nrail = \"3v3\"\ncurrent_a = { value = 0.0355, source = \"test\" }", "id = \"converter\"\nrail = \"3v3\"");
    assert!(parse(&converter).unwrap_err().to_string().contains("only effects of phase Load hang on a rail"));
}

/// Kottas, section 4.1.1: as the battery runs down, the switch-mode branch works better.
#[test]
fn the_aquapod_stands_on_two_branches_and_its_converter_gains_as_the_pack_empties() {
    let model = Arc::new(load_model("aquapod-robot", &|_| unreachable!("built in")).unwrap());
    let mut run = Run::new(Arc::clone(&model), Start::at_soc(0.0));
    let tree = model.facts.tree().unwrap();
    assert!(tree.rails().iter().all(|rail| rail.source.is_some()));
    let mut losses_w = Vec::new();
    // 2s: 8.4 V full, 6.0 V at the end of discharge.
    for volts in [8.4, 7.4, 6.0] {
        run.channels[Channel::VoltageV] = volts;
        run.step(1.0);
        let flow = run.rails().unwrap();
        assert_eq!(flow.refusal(), None, "{volts} V");
        losses_w.push(flow.rails()[tree.find("5v").unwrap()].loss_w);
        assert!((0.5..3.0).contains(&run.channels[Channel::PowerW]), "{}", run.channels[Channel::PowerW]);
    }
    assert!(losses_w[0] > losses_w[1] && losses_w[1] > losses_w[2], "{losses_w:?}");
}

/// The robot of above with every effect that may hang on a rail, in turn on each of them.
fn everything_on_rails() -> Arc<Model> {
    let mut text = ROBOT[..ROBOT.find("[[effect]]").unwrap()].to_owned();
    let specs = catalogue().iter().map(|effect| effect.spec()).filter(|spec| spec.system == System::Robot);
    for (index, spec) in specs.enumerate() {
        text += &format!("[[effect]]\nid = \"{}\"\n", spec.id);
        if spec.phase == Phase::Load {
            text += &format!("rail = \"{}\"\n", ["battery", "5v", "3v3", "clean"][index % 4]);
        }
    }
    Arc::new(parse(&text).unwrap())
}

proptest! {
    /// Physics is total: any parameters in their ranges and any inputs give numbers.
    #[test]
    fn every_step_of_every_robot_effect_is_finite(
        shares in proptest::collection::vec(0.0..1.0_f64, 64),
        inputs in proptest::collection::vec(-1.0..1.0_f64, Channel::COUNT),
        size in prop_oneof![Just(1.0), Just(20.0), Just(500.0)],
        dt_s in 0.001..10_000.0_f64,
    ) {
        let model = everything_on_rails();
        let parameters = model.parameters().iter().zip(shares.iter().cycle()).map(|(p, share)| p.min + share * (p.max - p.min)).collect();
        let mut run = Run::with_parameters(model, parameters, Start::at_soc(0.0));
        for _ in 0..3 {
            for (&channel, share) in Channel::ALL.iter().zip(&inputs) {
                run.channels[channel] = share * size;
            }
            run.step(dt_s);
            prop_assert!(run.channels[Channel::PowerW].is_finite(), "{}", run.channels[Channel::PowerW]);
        }
    }
}

#[test]
fn what_hangs_on_a_rail_and_is_only_roughly_known_adds_to_the_robots_sigma() {
    let text = "schema = 1\nsystem = \"robot\"\nname = \"r\"\n[robot]\nnominal_v = 10.0\n[[rail]]\nid = \"5v\"\nfrom = \"battery\"\nkind = \"linear\"\nvoltage_v = 5.0\n[[rail.load]]\nname = \"sensors\"\nkind = \"current\"\nvalue = 0.2\nsigma = 0.03\n";
    let power = |text: &str| {
        let model = Model::parse("r.toml", text, &|_| unreachable!()).map(Arc::new);
        model.map(|model| energy::forecast::power_w(&model, &[])).map_err(|error| error.to_string())
    };
    // By hand: a linear regulator passes its current on, 10 V x (0.2 +- 0.03) A.
    let known = power(text).unwrap();
    assert!((known.value - 2.0).abs() < 1e-9 && (known.sigma - 0.3).abs() < 1e-9, "{known:?}");
    let refused = power(&text.replace("sigma = 0.03", "sigma = 0.3")).unwrap_err();
    assert!(refused.contains("load `sensors`: sigma (A) = 0.3: must be between 0 and 0.2"), "{refused}");
}
