//! No-load current: what drivers and motors take as soon as the wheels turn, whatever they pull.
//!
//! `P = I_0 V_bat` while the robot drives or turns; I_0 in A from the battery, V_bat in V. A motor's
//! own no-load current flows at the motor's voltage, not the battery's, and is `dry_friction`; this
//! is what is left at any speed: encoders' and drivers' supply, ripple, brushes.
//!
//! Absence: a constant current is missing whenever the robot moves.

use crate::drive::traction;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct NoLoadCurrent;

static SPEC: EffectSpec = EffectSpec {
    id: "no_load_current",
    title: "Current of turning motors without load",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps, Channel::VoltageV],
    equation: "P = I_0 V_bat while the wheels turn",
    source: "Kottas, section 4.2.1 (no-load current) and Eq. A.1",
    validity: "current independent of speed and load; nothing without a voltage in the log",
    signature: "a step between rest and motion, in proportion to the voltage",
    matters: 0.02,
    confused_with: &[
        ("dry_friction", "the same way on a full and on a nearly empty pack"),
        ("h_bridge", "the same way on a full and on a nearly empty pack"),
        ("scrub", "two yaw rates"),
    ],
    parameters: &[ParameterSpec {
        name: "current_a",
        meaning: "current from the battery while the wheels turn",
        default: 0.02,
        null: Some(0.0),
        min: 0.0,
        max: 10.0,
        source: "small motors: 5-50 mA each",
    }],
    states: &[],
};

impl Physics for NoLoadCurrent {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        if traction::wheels_turn(channels) {
            channels.add(Channel::PowerW, own.parameters[0] * facts.supply_v(channels));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&NoLoadCurrent, parameters, inputs)
    }

    #[test]
    fn a_vacuum_robot_that_crawls_takes_its_no_load_current() {
        // Kurt, Hacking Roomba, chapter 1: drive motors draw about 300 mA at their slowest, 10 mm/s,
        // from a pack of 14.4 V: 4.3 W.
        let taken_w = power_w(&[0.3], &[(Channel::SpeedMps, 0.01), (Channel::VoltageV, 14.4)]);
        assert!((taken_w - 4.32).abs() < 1e-12);
    }

    #[test]
    fn it_flows_while_driving_or_turning_and_not_at_rest() {
        assert_eq!(power_w(&[0.1], &[(Channel::VoltageV, 10.0)]), 0.0);
        assert_eq!(power_w(&[0.1], &[(Channel::VoltageV, 10.0), (Channel::YawRateRadps, 0.5)]), 1.0);
        assert_eq!(power_w(&[0.1], &[(Channel::VoltageV, 10.0), (Channel::SpeedMps, 0.5)]), 1.0);
    }
}
