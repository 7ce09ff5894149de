//! Sensors: constant currents, straight on the battery or behind a 5 V regulator.
//!
//! `P += I_direct V_bat + I_regulated V_reg` in W, with V_reg = 5 V. On the battery a constant
//! current costs more the fuller the pack is; behind a switch-mode converter it is a constant
//! power (Kottas, section 4.5). Behind a *linear* regulator it stays a constant current for the
//! battery: count it as direct. V_bat is the channel `voltage_v`, or the robot's nominal voltage.
//!
//! Absence: a constant power is missing, with a part that falls with the battery's voltage.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Sensors;

/// Voltage of the regulated sensors, V (Kottas, section 4.5: logic-level supplies).
const REGULATED_V: f64 = 5.0;

static SPEC: EffectSpec = EffectSpec {
    id: "sensors",
    title: "Sensors of constant current",
    system: System::Robot,
    phase: Phase::Load,
    channel: Channel::PowerW,
    needs: &[Channel::VoltageV],
    equation: "P += I_direct V_bat + I_regulated 5 V",
    source: "Kottas, section 4.5",
    validity: "within the range of supply voltages of the sensors",
    signature: "missing power with a part in proportion to the battery voltage",
    matters: 0.02,
    confused_with: &[
        ("idle", "a log from full to empty at one operating state"),
        ("ldo", "switch off the loads of the linear regulator for one log"),
        ("encoders", "unplug the encoders for one log"),
    ],
    parameters: &[
        ParameterSpec {
            name: "direct_a",
            meaning: "current of sensors on the battery or behind a linear regulator",
            default: 0.02,
            null: Some(0.0),
            min: 0.0,
            max: 5.0,
            source: "guess: a few sensors of 1-20 mA",
        },
        ParameterSpec {
            name: "regulated_a",
            meaning: "current of sensors behind a 5 V converter",
            default: 0.03,
            null: Some(0.0),
            min: 0.0,
            max: 5.0,
            source: "guess: infrared and ultrasonic rangers of 5-40 mA",
        },
    ],
    states: &[],
};

impl Physics for Sensors {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let battery_v = facts.supply_v(channels);
        channels.add(Channel::PowerW, own.parameters[0] * battery_v + own.parameters[1] * REGULATED_V);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    use crate::RobotFacts;

    fn power_w(facts: &Facts, parameters: [f64; 2], battery_v: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::VoltageV] = battery_v;
        step_once(&Sensors, facts, 1.0, &parameters, &mut [], &mut channels);
        channels[Channel::PowerW]
    }

    #[test]
    fn direct_sensors_cost_by_voltage_and_regulated_ones_do_not() {
        // 20 mA: 0.252 W at 12.6 V, 0.18 W at 9 V; 30 mA at 5 V: 0.15 W at either.
        assert!((power_w(&Facts::robot(), [0.02, 0.0], 12.6) - 0.252).abs() < 1e-12);
        assert!((power_w(&Facts::robot(), [0.02, 0.0], 9.0) - 0.18).abs() < 1e-12);
        assert_eq!(power_w(&Facts::robot(), [0.0, 0.03], 12.6), power_w(&Facts::robot(), [0.0, 0.03], 9.0));
    }

    /// GP2Y0A21YK0F infrared ranger (Sharp datasheet): 30 mA typical, 40 mA at most, at 5 V.
    #[test]
    fn an_infrared_ranger_takes_150_milliwatts() {
        assert!((power_w(&Facts::robot(), [0.0, 0.03], 11.1) - 0.15).abs() < 1e-12);
    }

    #[test]
    fn without_a_measured_voltage_the_nominal_one_counts() {
        let facts = Facts::Robot(RobotFacts { nominal_v: 11.1, ..RobotFacts::default() });
        assert!((power_w(&facts, [0.1, 0.0], 0.0) - 1.11).abs() < 1e-12);
    }
}
