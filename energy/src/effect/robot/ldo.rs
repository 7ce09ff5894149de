//! Linear regulator between the battery and some loads.
//!
//! `P += I max(0, V_bat - V_out)` in W (Kottas, Eq. 4.2, ground current left out: some uA). What the loads take
//! at V_out (V) is counted by their own effects; this is what the regulator turns into heat. For
//! a regulator behind a converter use a rail instead.
//!
//! Absence: power is missing that falls with the battery's voltage, to nothing near V_out.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct LinearRegulator;

static SPEC: EffectSpec = EffectSpec {
    id: "ldo",
    title: "Linear regulator",
    system: System::Robot,
    phase: Phase::Load,
    channel: Channel::PowerW,
    needs: &[Channel::VoltageV],
    equation: "P += I max(0, V_bat - V_out)",
    source: "Kottas, Eq. 4.2",
    validity: "load current constant; ground current small beside it",
    signature: "missing power in proportion to the battery voltage above that of a rail",
    matters: 0.02,
    confused_with: &[
        ("sensors", "switch off the loads of the linear regulator for one log"),
        ("idle", "a log from full to empty at one operating state"),
        ("input_voltage_loss", "logs at two loads over the same voltages"),
    ],
    parameters: &[
        ParameterSpec {
            name: "current_a",
            meaning: "current through the regulator",
            default: 0.05,
            null: Some(0.0),
            min: 0.0,
            max: 5.0,
            source: "guess: low-noise supplies of 10-200 mA",
        },
        ParameterSpec {
            name: "output_v",
            meaning: "voltage that it regulates to",
            default: 3.3,
            null: None,
            min: 0.5,
            max: 15.0,
            source: "logic levels: 1.8, 2.5, 3.3, 5 V",
        },
    ],
    states: &[],
};

impl Physics for LinearRegulator {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let drop_v = facts.supply_v(channels) - own.parameters[1];
        if drop_v.re() > 0.0 {
            channels.add(Channel::PowerW, own.parameters[0] * drop_v);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn power_w(battery_v: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::VoltageV] = battery_v;
        step_once(&LinearRegulator, &Facts::robot(), 1.0, &[0.2, 5.0], &mut [], &mut channels);
        channels[Channel::PowerW]
    }

    #[test]
    fn nothing_is_lost_when_input_and_output_meet() {
        assert_eq!([power_w(5.0), power_w(4.0)], [0.0, 0.0]);
    }

    /// Kottas, section 4.1.1: four full cells give 16.8 V, and stepping these down to 5 V "can be
    /// very lossy": linearly, (16.8 - 5) / 16.8 = 70 % of the power.
    #[test]
    fn from_four_full_cells_to_five_volts_seventy_percent_are_lost() {
        let lost = power_w(16.8) / (0.2 * 16.8);
        assert!((lost - 0.702).abs() < 1e-3, "{lost}");
    }
}
