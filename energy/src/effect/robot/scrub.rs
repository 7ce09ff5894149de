//! Scrub: tyres and caster grind over the floor when the robot turns.
//!
//! `P = tau |psi'|`, tau in N m about the vertical axis, psi' the yaw rate in rad/s.
//!
//! Absence: the residual grows with the yaw rate.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Scrub;

static SPEC: EffectSpec = EffectSpec {
    id: "scrub",
    title: "Scrub of turning wheels",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::YawRateRadps],
    equation: "P = tau |psi'|",
    source: "Coulomb friction of the contact patches",
    validity: "hard floor; torque independent of the radius of the turn",
    signature: "a residual with the yaw rate",
    matters: 0.02,
    confused_with: &[("no_load_current", "two yaw rates"), ("h_bridge", "two yaw rates")],
    parameters: &[ParameterSpec {
        name: "scrub_nm",
        meaning: "torque that resists turning",
        default: 0.05,
        null: Some(0.0),
        min: 0.0,
        max: 100.0,
        source: "guess: friction 0.5 at the caster of a palm-sized robot, a tenth of a metre from the axle",
    }],
    states: &[],
};

impl Physics for Scrub {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PowerW, own.parameters[0] * channels[Channel::YawRateRadps].abs());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&Scrub, parameters, inputs)
    }

    #[test]
    fn a_flat_pad_turning_under_load_by_the_textbook() {
        // Torque of a disc under uniform pressure, 2/3 mu N R (any text on clutches): 0.6, 10 N,
        // 15 mm give 0.06 N m; 0.12 W at 2 rad/s.
        let torque_nm = 2.0 / 3.0 * 0.6 * 10.0 * 0.015;
        assert!((power_w(&[torque_nm], &[(Channel::YawRateRadps, 2.0)]) - 0.12).abs() < 1e-12);
    }

    #[test]
    fn either_direction_takes_the_same_and_driving_straight_nothing() {
        assert_eq!(power_w(&[0.1], &[(Channel::YawRateRadps, -3.0)]), power_w(&[0.1], &[(Channel::YawRateRadps, 3.0)]));
        assert_eq!(power_w(&[0.1], &[(Channel::SpeedMps, 0.5)]), 0.0);
    }
}
