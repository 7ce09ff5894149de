//! Parasitic load: electronics that hang on the cells before the current sensor.
//!
//! `I_cell += I_par / p`, with I_par the constant current of the pack in A and p the number of
//! parallel strings. It flows through the cells' resistances, yet the sensor does not see it:
//! gauge, protection, balancing and indicator take their supply on the cells' side of the shunt.
//!
//! Absence: the state of charge is overestimated by an amount that grows with time, at rest and
//! under load alike.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct ParasiticLoad;

static SPEC: EffectSpec = EffectSpec {
    id: "parasitic_load",
    title: "Parasitic load before the current sensor",
    system: System::Battery,
    phase: Phase::Current,
    channel: Channel::CellCurrentA,
    needs: &[],
    equation: "I_cell += I_par / p",
    source: "Kirchhoff; Kottas, section 3.2 (the gauge's own consumption)",
    validity: "a load that does not change with voltage or time",
    signature: "SoC drifts down with time, whatever the measured current",
    matters: 1e-4,
    confused_with: &[
        ("self_discharge", "the pack's electronics taken off for a month"),
        ("current_offset", "a second ammeter, or a zeroed shunt at rest"),
    ],
    parameters: &[ParameterSpec {
        name: "load_a",
        meaning: "current of the pack that its sensor does not see",
        default: 3e-4,
        null: Some(0.0),
        min: 0.0,
        max: 1.0,
        source: "gauge and front-end chips: about 0.08 mA asleep (Kottas, section 3.2) to some 0.5 mA awake",
    }],
    states: &[],
};

impl Physics for ParasiticLoad {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::CellCurrentA, own.parameters[0] / f64::from(facts.parallel()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Model, Run, Start};
    use std::sync::Arc;

    /// The Aquapod's 1900 mAh as two parallel strings with 0.1 ohm per cell.
    fn run(load_a: f64) -> Run<f64> {
        let text = format!(
            r#"
            schema = 1
            system = "battery"
            name = "two strings"
            battery = {{ series = 1, parallel = 2, capacity_ah = 1.9, full_v_per_cell = 4.2, eod_v_per_cell = 3.0, charge_current_a = 1.0, charge_cutoff_a = 0.05, ocv = {{ soc = [0.0, 1.0], voltage_v = [4.0, 4.0] }} }}
            [[effect]]
            id = "ohmic"
            resistance_ohm = {{ value = 0.1, source = "test" }}
            [[effect]]
            id = "parasitic_load"
            load_a = {{ value = {load_a:e}, source = "test" }}
        "#
        );
        Run::new(Arc::new(Model::parse("test", &text, &|_| unreachable!()).unwrap()), Start::at_soc(1.0))
    }

    #[test]
    fn strings_share_the_load_and_it_drops_over_their_resistance_unseen() {
        let mut run = run(0.5);
        run.step(3600.0);
        assert!((run.channels[Channel::CellCurrentA] - 0.25).abs() < 1e-15);
        assert!((run.channels[Channel::VoltageV] - (4.0 - 0.025)).abs() < 1e-12);
        assert!((run.channels[Channel::Soc] - (1.0 - 0.5 / 1.9)).abs() < 1e-12);
        assert_eq!(run.channels[Channel::TerminalCurrentA], 0.0);
    }

    #[test]
    fn a_gauge_asleep_takes_as_much_as_self_discharge_does() {
        // Kottas, section 3.2: asleep, the gauge takes about as much as the cells lose by themselves; section 3.1:
        // that is 57 mAh of 1900 mAh in a month.
        let mut run = run(0.057 / (30.0 * 24.0));
        for _ in 0..30 {
            run.step(86_400.0);
        }
        assert!((1.0 - run.channels[Channel::Soc] - 0.03).abs() < 1e-12, "{}", run.channels[Channel::Soc]);
    }
}
