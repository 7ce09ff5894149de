//! What holds for every effect of a robot, whatever it models.

use std::sync::Arc;

use energy::effect::Lane;
use energy::real::{LANES, derivative, variable};
use energy::{Channel, Dual, EffectSpec, Model, Phase, Run, Start, System, catalogue};
use proptest::prelude::*;

const INPUTS: [Channel; 9] = [
    Channel::SpeedMps,
    Channel::AccelMps2,
    Channel::PitchRad,
    Channel::PayloadKg,
    Channel::YawRateRadps,
    Channel::FloorClass,
    Channel::TailAngleRad,
    Channel::AmbientDegc,
    Channel::VoltageV,
];

fn drives() -> impl Iterator<Item = &'static EffectSpec> {
    catalogue().iter().map(|effect| effect.spec()).filter(|spec| spec.system == System::Robot && spec.phase == Phase::Drive)
}

/// A robot with every effect of driving, at values that `value` chooses.
fn robot(mut value: impl FnMut(&EffectSpec, &energy::ParameterSpec) -> f64) -> Arc<Model> {
    let mut text = "schema = 1\nsystem = \"robot\"\nname = \"everything\"\n".to_owned();
    for spec in drives() {
        text += &format!("[[effect]]\nid = \"{}\"\n", spec.id);
        for p in spec.parameters {
            text += &format!("{} = {{ value = {:?}, source = \"test\" }}\n", p.name, value(spec, p));
        }
    }
    Arc::new(Model::parse("everything", &text, &|_| unreachable!()).unwrap())
}

fn power_w<S: Lane>(model: &Arc<Model>, values: Vec<S>, inputs: &[f64; 9]) -> S {
    let mut run = Run::with_parameters(Arc::clone(model), values, Start::at_soc(0.0).lifted());
    for (channel, &value) in INPUTS.iter().zip(inputs) {
        run.channels[*channel] = S::from(value);
    }
    run.step(1.0);
    run.channels[Channel::PowerW]
}

/// Driving, braking, up and down, on every floor, turning, with and without payload.
fn profile() -> Vec<[f64; 9]> {
    let wave = |i: u32, period: f64, size: f64| size * (f64::from(i) * std::f64::consts::TAU / period).sin();
    (0..60)
        .map(|i| {
            let speed_mps = if i % 10 == 0 { 0.0 } else { 0.3 + wave(i, 17.0, 0.2) };
            let payload_kg = f64::from(i / 20) * 0.4;
            let (floor, ambient) = (f64::from(i % 4), 20.0 + wave(i, 41.0, 15.0));
            [
                speed_mps,
                wave(i, 17.0, 0.5),
                wave(i, 29.0, 0.2),
                payload_kg,
                wave(i, 11.0, 2.0),
                floor,
                wave(i, 13.0, 0.5),
                ambient,
                9.0 + wave(i, 31.0, 2.0),
            ]
        })
        .collect()
}

#[test]
fn every_effect_of_driving_vanishes_at_its_null_and_matters_at_its_default() {
    let whole = robot(|_, p| p.default);
    for gone in drives() {
        let at_null = robot(|spec, p| if spec.id == gone.id { p.null.unwrap_or(p.default) } else { p.default });
        let without = Arc::new(whole.without(|id| id == gone.id));
        let mut most_w = 0.0_f64;
        for inputs in profile() {
            let [with, null, without] = [&whole, &at_null, &without].map(|model| power_w(model, model.values(), &inputs));
            assert!((null - without).abs() < 1e-12, "{} is not gone at its null: {null} {without}", gone.id);
            most_w = most_w.max((with - without).abs());
        }
        assert!(most_w > gone.matters, "{} adds {most_w} W at most", gone.id);
    }
}

#[test]
fn dual_numbers_give_the_derivatives_of_a_robot() {
    // Away from zero, where an effect without a force has no derivative to speak of.
    let model = robot(|_, p| if p.name == "step_w" { 0.1 } else { p.default });
    let values = model.values();
    for inputs in profile() {
        for first in (0..values.len()).step_by(LANES) {
            let lanes = first..(first + LANES).min(values.len());
            let dual = |i: usize| if lanes.contains(&i) { variable(values[i], i - first) } else { Dual::from(values[i]) };
            let power: Dual = power_w(&model, (0..values.len()).map(dual).collect(), &inputs);
            for lane in lanes.clone() {
                let nudge = 1e-6 * values[lane].abs().max(1e-2);
                let at = |value: f64| {
                    let mut nudged = values.clone();
                    nudged[lane] = value;
                    power_w(&model, nudged, &inputs)
                };
                let numeric = (at(values[lane] + nudge) - at(values[lane] - nudge)) / (2.0 * nudge);
                let exact = derivative(&power, lane - first);
                let p = &model.parameters()[lane];
                assert!((exact - numeric).abs() <= 1e-5 * (1.0 + numeric.abs()), "{}.{}: {exact} and {numeric}", p.effect, p.name);
            }
        }
    }
}

/// What the lab asks of an effect that a model lacks: what its first bit would change.
#[test]
fn at_its_null_an_effect_knows_what_it_would_change() {
    // `motion` lumps several of these and has no power at all at its null, where it is cut off.
    for spec in drives().filter(|spec| spec.id != "motion") {
        for wanted in spec.parameters.iter().filter(|p| p.null.is_some()) {
            let null = wanted.null.unwrap();
            let model = robot(|other, p| if other.id == spec.id && p.name == wanted.name { null } else { p.default });
            let lane = model.parameters().iter().position(|p| p.effect == spec.id && p.name == wanted.name).unwrap();
            let values = model.values();
            // Into the range, from just beside the null.
            let nudge = if null < wanted.max { 1e-6 } else { -1e-6 };
            let mut greatest = 0.0_f64;
            for inputs in profile() {
                let dual = |i: usize| if i == lane { variable(values[i], 0) } else { Dual::from(values[i]) };
                let exact = derivative(&power_w(&model, (0..values.len()).map(dual).collect(), &inputs), 0);
                let at = |steps: f64| {
                    let mut nudged = values.clone();
                    nudged[lane] = null + steps * nudge;
                    power_w(&model, nudged, &inputs)
                };
                let numeric = (at(2.0) - at(1.0)) / nudge;
                assert!((exact - numeric).abs() <= 1e-4 * (1.0 + numeric.abs()), "{}.{}: {exact} and {numeric}", spec.id, wanted.name);
                greatest = greatest.max(exact.abs());
            }
            assert!(greatest > 1e-3, "{}.{} changes nothing", spec.id, wanted.name);
        }
    }
}

/// The same where no other effect gives it a force to begin with.
#[test]
fn a_lone_force_at_its_null_knows_what_it_would_change() {
    for (id, name) in [("rolling", "rolling_coefficient"), ("dry_friction", "force_n"), ("slope", "mass_kg"), ("acceleration", "mass_kg")] {
        let text = format!(
            "schema = 1\nsystem = \"robot\"\nname = \"lone\"\n[[effect]]\nid = \"{id}\"\n{name} = {{ value = 0.0, source = \"test\" }}\n"
        );
        let model = Arc::new(Model::parse("lone", &text, &|_| unreachable!()).unwrap());
        let lane = model.parameters().iter().position(|p| p.name == name).unwrap();
        let values = model.values();
        let dual = |i: usize| if i == lane { variable(values[i], 0) } else { Dual::from(values[i]) };
        let uphill = [0.5, 0.5, 0.2, 0.0, 0.0, 0.0, 0.0, 25.0, 10.0];
        let power: Dual = power_w(&model, (0..values.len()).map(dual).collect(), &uphill);
        assert!(derivative(&power, 0) > 0.01, "{id}: {}", derivative(&power, 0));
    }
}

proptest! {
    /// Physics is total: any parameters in their ranges and any inputs give numbers.
    #[test]
    fn every_effect_of_driving_is_finite(
        shares in proptest::collection::vec(0.0..1.0_f64, 40),
        inputs in proptest::array::uniform9(-100.0..100.0_f64),
    ) {
        let model = robot(|_, p| p.default);
        let values = model.parameters().iter().zip(shares.iter().cycle()).map(|(p, share)| p.min + share * (p.max - p.min)).collect();
        let power_w: f64 = power_w(&model, values, &inputs);
        prop_assert!(power_w.is_finite(), "{power_w}");
    }
}
