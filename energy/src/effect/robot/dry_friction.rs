//! Dry friction of bearings, gears and brushes: one force at any speed and load.
//!
//! `P = F v + P_step` while driving, nothing at rest, F in sum with the other forces and F v never
//! below zero; F in N at the ground, v in m/s. The step is
//! what the motors burn, at any speed, in making the torque that overcomes the friction; leave it at
//! zero where `motor_copper` says that from the force.
//!
//! Absence: the power residual grows in proportion to speed and jumps when the robot starts.

use crate::drive::traction;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct DryFriction;

static SPEC: EffectSpec = EffectSpec {
    id: "dry_friction",
    title: "Dry friction",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps],
    equation: "F against v, P += what F adds to max(0, v sum of all F), and P_step while v != 0",
    source: "Coulomb friction; Kottas, Eq. 4.6 with its no-load current",
    validity: "speeds above creeping: no Stribeck rise near zero",
    signature: "a residual in proportion to speed, independent of load, with a step between rest and motion",
    matters: 0.02,
    confused_with: &[
        ("rolling", "the same way with and without payload"),
        ("no_load_current", "the same way on a full and on a nearly empty pack"),
        ("motor_copper", "uphill against level at one speed"),
        ("gear_loss", "a known slope as well as level ground"),
        ("h_bridge", "the step alone: a log at crawling speed with the wheels off the ground"),
        ("motion", "the same way with and without payload"),
    ],
    parameters: &[
        ParameterSpec {
            name: "force_n",
            meaning: "force at the ground that resists motion",
            default: 0.4,
            null: Some(0.0),
            min: 0.0,
            max: 500.0,
            source: "small coreless motors with gears: 0.2-1 N at the wheel",
        },
        ParameterSpec {
            name: "step_w",
            meaning: "power taken at any speed",
            default: 0.0,
            null: Some(0.0),
            min: 0.0,
            max: 100.0,
            source: "zero unless measured",
        },
    ],
    states: &[],
};

impl Physics for DryFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        traction::resist(channels, own.parameters[0]);
        if traction::drives(channels) {
            channels.add(Channel::PowerW, own.parameters[1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::explorer::{MOTOR, WHEELS};
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&DryFriction, parameters, inputs)
    }

    #[test]
    fn friction_of_two_motors_is_their_no_load_power() {
        // FAULHABER 1331 T 012 SR: 10.5 mA at 12 V and 9900 rpm without load, of which 0.144 V x
        // 10.5 mA heats the winding: 0.1245 W of friction per motor.
        let speed_mps = 9900.0 * std::f64::consts::PI / 30.0 / 41.0 * 0.0225;
        let force_n = 2.0 * MOTOR.motor.friction_nm * MOTOR.gear.ratio / WHEELS.wheel_radius_m;
        let taken_w = power_w(&[force_n, 0.0], &[(Channel::SpeedMps, speed_mps)]);
        assert!((taken_w - 2.0 * 0.1245).abs() < 0.002, "{taken_w}");
    }

    #[test]
    fn the_step_comes_with_motion_and_the_force_with_speed() {
        assert_eq!(power_w(&[2.0, 0.3], &[(Channel::SpeedMps, 0.0)]), 0.0);
        assert!((power_w(&[2.0, 0.3], &[(Channel::SpeedMps, 0.1)]) - 0.5).abs() < 1e-15);
        assert!((power_w(&[2.0, 0.3], &[(Channel::SpeedMps, -0.2)]) - 0.7).abs() < 1e-15);
    }
}
