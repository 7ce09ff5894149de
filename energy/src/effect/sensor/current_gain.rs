//! Gain of the current sensor: it shows a share too much.
//!
//! `I = I_shown / g`, with g as what is shown over what flows. Acts after the offset, which the
//! amplifier adds to the amplified current: shown = g I + offset.
//!
//! Absence: every discharge ends at another charge than the model's capacity, by the same share;
//! resistances look wrong by that share too.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CurrentGain;

static SPEC: EffectSpec = EffectSpec {
    id: "current_gain",
    title: "Gain of the current sensor",
    system: System::Battery,
    phase: Phase::Sensed,
    channel: Channel::TerminalCurrentA,
    needs: &[Channel::CurrentA],
    equation: "I = I_shown / g",
    source: "definition of a gain; gauge data sheets",
    validity: "a gain that does not move with temperature",
    signature: "the SoC error grows with the charge drawn and comes back with the charge put in",
    matters: 1e-3,
    confused_with: &[("capacity_fade", "a second ammeter"), ("ohmic", "a second ammeter"), ("coulombic_loss", "a discharge only")],
    parameters: &[ParameterSpec {
        name: "gain",
        meaning: "current shown over current that flows",
        default: 1.0,
        null: Some(1.0),
        min: 0.8,
        max: 1.25,
        source: "0.35 % uncalibrated at a 0.1 % shunt, 5 % with a copper track as shunt",
    }],
    states: &[],
};

impl Physics for CurrentGain {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels[Channel::TerminalCurrentA] /= own.parameters[0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;
    use crate::{Model, Run, Start};
    use std::sync::Arc;

    #[test]
    fn a_shunt_of_the_next_value_scales_every_current() {
        // E24 series: a gauge set up for 10 mOhm that sits on 11 mOhm shows 1.1 times the current.
        let mut channels = Channels::filled(0.0_f64);
        for flows_a in [0.0, 1.3, -0.7] {
            channels[Channel::TerminalCurrentA] = flows_a * 11.0 / 10.0;
            step_once(&CurrentGain, &Facts::robot(), 1.0, &[1.1], &mut [], &mut channels);
            assert!((channels[Channel::TerminalCurrentA] - flows_a).abs() < 1e-15);
        }
    }

    #[test]
    fn gain_and_offset_are_undone_in_the_order_in_which_the_amplifier_makes_them() {
        let text = r#"
            schema = 1
            system = "battery"
            name = "one cell"
            battery = { series = 1, parallel = 1, capacity_ah = 1.0, full_v_per_cell = 4.2, eod_v_per_cell = 3.0, charge_current_a = 1.0, charge_cutoff_a = 0.05, ocv = { soc = [0.0, 1.0], voltage_v = [3.0, 4.2] } }
            [[effect]]
            id = "current_gain"
            gain = { value = 1.02, source = "test" }
            [[effect]]
            id = "current_offset"
            offset_a = { value = 0.01, source = "test" }
        "#;
        let mut run = Run::new(Arc::new(Model::parse("test", text, &|_| unreachable!()).unwrap()), Start::at_soc(0.5));
        run.channels[Channel::CurrentA] = 1.02 * 0.4 + 0.01;
        run.step(1.0);
        assert!((run.channels[Channel::TerminalCurrentA] - 0.4).abs() < 1e-15);
    }
}
