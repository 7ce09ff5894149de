//! Converter loss that grows with the input voltage.
//!
//! `P += g V_in^2` in W: charging and discharging the switch's capacitances at a fixed frequency
//! takes C V^2 f, at any load. g in W/V². V_in is the channel `voltage_v`, or the robot's nominal
//! voltage. It is why a converter is better at a low input voltage, most of all at light load
//! (Kottas, Fig. 4.2).
//!
//! Absence: missing power that falls as the battery empties.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct InputVoltageLoss;

static SPEC: EffectSpec = EffectSpec {
    id: "input_voltage_loss",
    title: "Converter loss with input voltage",
    system: System::Robot,
    phase: Phase::Converter,
    channel: Channel::PowerW,
    needs: &[Channel::VoltageV],
    equation: "P += g V_in^2",
    source: "switching loss C V^2 f; Kottas, Fig. 4.2",
    validity: "step-down converters at a fixed frequency",
    signature: "missing power that falls with the battery voltage, the same at any load",
    matters: 0.02,
    confused_with: &[
        ("sensors", "wider range of voltages: square against line"),
        ("ldo", "logs at two loads over the same voltages"),
        ("converter_quadratic", "a log from full to empty at one operating state"),
    ],
    parameters: &[ParameterSpec {
        name: "loss_w_per_v2",
        meaning: "g: loss per square of the input voltage",
        default: 0.001,
        null: Some(0.0),
        min: 0.0,
        max: 0.1,
        source: "Kottas, section 4.1.1: 15 % between 7 V and 12 V at small currents",
    }],
    states: &[],
};

impl Physics for InputVoltageLoss {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let input_v = facts.supply_v(channels);
        channels.add(Channel::PowerW, own.parameters[0] * input_v * input_v);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn power_w(loss_w_per_v2: f64, load_w: f64, input_v: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        (channels[Channel::PowerW], channels[Channel::VoltageV]) = (load_w, input_v);
        step_once(&InputVoltageLoss, &Facts::robot(), 1.0, &[loss_w_per_v2], &mut [], &mut channels);
        channels[Channel::PowerW]
    }

    #[test]
    fn the_loss_goes_with_the_square_of_the_voltage() {
        assert!((power_w(0.001, 0.0, 12.0) - 0.144).abs() < 1e-12);
        assert!((power_w(0.001, 2.0, 6.0) - 2.036).abs() < 1e-12);
        assert_eq!(power_w(0.0, 2.0, 12.0), 2.0);
    }

    /// Kottas, section 4.1.1: at small output currents, 7 V instead of 12 V at the input gains 15 %
    /// efficiency. The default does that for about half a watt (0.1 A at 5 V).
    #[test]
    fn the_default_gives_the_measured_gain_at_a_small_current() {
        let efficiency = |input_v| 0.5 / power_w(SPEC.parameters[0].default, 0.5, input_v);
        let gain = efficiency(7.0) - efficiency(12.0);
        assert!((gain - 0.15).abs() < 0.02, "{gain}");
    }
}
