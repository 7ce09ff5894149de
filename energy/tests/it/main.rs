//! What holds for every model, whatever its effects.

mod allocation;
mod converter_data;
mod coverage;
mod dual;
mod exact;
mod gauges;
mod measured;
mod measured_motors;
mod rails;
mod readme;
mod recovery;
mod relaxation;
mod robot_effects;
mod robots;
mod worlds;

use std::sync::Arc;

use energy::load::Terminals as _;
use energy::real::{LANES, derivative, variable};
use energy::{Channel, Dual, Model, Run, Start, System, built_in_names, catalogue, load_model};
use proptest::prelude::*;

mod pack;
mod terminals;

fn built_in(name: &str) -> Arc<Model> {
    Arc::new(load_model(name, &|_| unreachable!("built in")).unwrap())
}

/// A battery with every effect of the catalogue, at defaults.
fn everything() -> Arc<Model> {
    everything_with("")
}

/// The same with more in its `[battery]` table: cells that differ, balancing.
fn everything_with(battery: &str) -> Arc<Model> {
    let mut text = r#"
        schema = 1
        system = "battery"
        name = "everything"
        [battery]
        series = 3
        parallel = 2
        capacity_ah = 4.0
        full_v_per_cell = 4.2
        eod_v_per_cell = 3.0
        charge_current_a = 4.0
        charge_cutoff_a = 0.2
        ocv = { soc = [0.0, 0.1, 1.0], voltage_v = [3.0, 3.5, 4.2] }
    "#
    .to_owned()
        + battery;
    for effect in catalogue().iter().filter(|effect| effect.spec().system == System::Battery) {
        text += &format!("\n[[effect]]\nid = \"{}\"\n", effect.spec().id);
    }
    Arc::new(Model::parse("everything", &text, &|_| unreachable!()).unwrap())
}

proptest! {
    /// Physics is total: any parameters in their ranges, any current, any step give numbers.
    #[test]
    fn every_step_of_every_battery_effect_is_finite(
        shares in proptest::collection::vec(0.0..1.0_f64, 32),
        currents_a in proptest::collection::vec(-50.0..50.0_f64, 1..20),
        soc in -0.2..1.2_f64,
        dt_s in 0.001..10_000.0_f64,
        cycles in 0.0..20_000.0_f64,
    ) {
        let model = everything();
        let parameters = model.parameters().iter().zip(shares.iter().cycle()).map(|(p, share)| p.min + share * (p.max - p.min)).collect();
        let mut run = Run::with_parameters(model, parameters, Start { soc, temperature_degc: 20.0, cycle_count: cycles, age_days: 400.0, history: 0.0, clock_s: 0.0 });
        for current_a in currents_a {
            run.channels[Channel::CurrentA] = current_a;
            run.step(dt_s);
            for &channel in Channel::ALL {
                prop_assert!(run.channels[channel].is_finite(), "{} = {}", channel.name(), run.channels[channel]);
            }
        }
    }

    /// A charge step never exceeds current or voltage of its charger.
    #[test]
    fn a_charger_never_exceeds_its_limits(soc in 0.0..1.0_f64, dt_s in 0.1..600.0_f64) {
        let model = built_in("explorer-3s1p-1320mah");
        let mut run = Run::new(model, Start::at_soc(soc));
        let current_a = run.step_charge(1.32, 12.6, dt_s);
        prop_assert!((-1.32..=0.0).contains(&current_a));
        prop_assert!(current_a == 0.0 || run.channels[Channel::VoltageV] <= 12.6 + 1e-6);
    }
}

/// The lab's sensitivities: exact derivatives against central differences.
#[test]
fn dual_numbers_give_the_derivatives_of_a_whole_run() {
    let model = everything();
    let values = model.values();
    let voltage = |values: Vec<f64>| {
        let mut run = Run::with_parameters(
            Arc::clone(&model),
            values,
            Start { soc: 0.8, temperature_degc: 25.0, cycle_count: 700.0, age_days: 400.0, history: 0.0, clock_s: 0.0 },
        );
        for step in 0..50 {
            run.channels[Channel::CurrentA] = if step % 10 < 5 { 3.0 } else { -1.0 };
            run.step(10.0);
        }
        run.channels[Channel::VoltageV]
    };
    for first in (0..values.len()).step_by(LANES) {
        let lanes = first..(first + LANES).min(values.len());
        let duals =
            (0..values.len()).map(|i| if lanes.contains(&i) { variable(values[i], i - first) } else { Dual::from(values[i]) }).collect();
        let start = Start { soc: Dual::from(0.8), temperature_degc: 25.0, cycle_count: 700.0, age_days: 400.0, history: 0.0, clock_s: 0.0 };
        let mut run = Run::with_parameters(Arc::clone(&model), duals, start);
        for step in 0..50 {
            run.channels[Channel::CurrentA] = Dual::from(if step % 10 < 5 { 3.0 } else { -1.0 });
            run.step(10.0);
        }
        for lane in lanes {
            let nudge = 1e-5 * values[lane].abs().max(1e-2);
            let at = |value: f64| {
                let mut nudged = values.clone();
                nudged[lane] = value;
                voltage(nudged)
            };
            let numeric = (at(values[lane] + nudge) - at(values[lane] - nudge)) / (2.0 * nudge);
            let exact = derivative(&run.channels[Channel::VoltageV], lane - first);
            let p = &model.parameters()[lane];
            assert!((exact - numeric).abs() <= 1e-5 * (1.0 + numeric.abs()), "{}.{}: {exact} and {numeric}", p.effect, p.name);
        }
    }
}

/// What goes in comes out or stays: charge drawn equals the change of state of charge.
#[test]
fn charge_is_conserved_where_nothing_leaks() {
    let model = built_in("enertech-lco-2280mah");
    let mut run = Run::new(Arc::clone(&model), Start::at_soc(0.9));
    let mut drawn_ah = 0.0;
    for step in 0..1000 {
        let current_a = f64::from(step % 7) - 2.0;
        run.channels[Channel::CurrentA] = current_a;
        run.step(3.0);
        drawn_ah += current_a * 3.0 / 3600.0;
    }
    let left = 0.9 - drawn_ah / model.battery().capacity_ah;
    assert!((run.channels[Channel::Soc] - left).abs() < 1e-12);
}

#[test]
fn a_model_without_effects_is_its_ocv() {
    let model = Arc::new(built_in("mds-3s4p-7600mah").without(|_| true));
    let mut run = Run::new(Arc::clone(&model), Start::at_soc(0.5));
    run.channels[Channel::CurrentA] = 7.6;
    run.step(36.0);
    assert!((run.channels[Channel::Soc] - 0.49).abs() < 1e-12);
    let expected_v = 3.0 * model.battery().ocv.voltage_v(0.49_f64);
    assert!((run.channels[Channel::VoltageV] - expected_v).abs() < 1e-12);
}

#[test]
fn bad_models_are_refused_with_place_and_near_match() {
    let refused = |change: (&str, &str)| {
        let text = energy::built_in("explorer-3s1p-1320mah").unwrap();
        assert!(text.contains(change.0), "{}", change.0);
        let read = |table: &str| Ok(energy::built_in(table).unwrap().to_owned());
        Model::parse("pack.toml", &text.replacen(change.0, change.1, 1), &read).unwrap_err().to_string()
    };
    assert!(refused(("capacity_ah = 1.32", "capacity_ah = -1.32")).contains("capacity_ah = -1.32: must be between"));
    assert!(refused(("capacity_ah = 1.32", "capacity_ah = nan")).contains("capacity_ah = NaN"));
    // A cell of cobalt that is empty where it is full.
    assert!(refused(("eod_v_per_cell = 3.0", "eod_v_per_cell = 4.3")).contains("battery.eod_v_per_cell = 4.3: its OCV table ends at"));
    assert!(
        refused(("capacity_relative_sigma = 0.01", "capacity_relative_sigma = 1.5")).contains("it is a share, at most 1 (5 % is 0.05)")
    );
    assert!(refused(("schema = 1", "schema = 9")).contains("this program reads schema = 1"));
    assert!(refused(("id = \"thermal\"", "id = \"thermall\"")).contains("did you mean `thermal`?"));
    assert!(refused(("heat_share", "heat_shear")).contains("did you mean `heat_share`?"));
    assert!(refused(("[sensor.voltage_v]", "[sensor.volts]")).contains("unknown channel `volts`"));
    assert!(refused(("series = 3", "serie = 3")).contains("did you mean `series`?"));
    let text = refused(("conductance_w_per_k = { value = 0.029", "conductance_w_per_k = { value = inf"));
    assert!(text.contains("must be between 0.001 and 5") && text.starts_with("pack.toml:"), "{text}");
    // What equations divide by is never nothing, whatever range a file states.
    let text = refused(("conductance_w_per_k = { value = 0.029", "conductance_w_per_k = { min = 0.0, value = 0.0"));
    assert!(text.contains("value = 0 must be between 0.00000") && text.contains("and 5"), "{text}");
    assert!(built_in_names().count() >= 5);
}
