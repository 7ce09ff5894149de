//! Rolling resistance: the tyres' force, in proportion to the weight on them.
//!
//! `F = c_rr (m + m_payload) g cos(pitch)`, `P = F v` in sum with the other forces,
//! never below zero, in N and W. m is the robot's own mass in kg,
//! pitch the slope in rad, v the speed in m/s. The payload rolls with the robot; what it adds on
//! slopes and when accelerated is the effect `payload`.
//!
//! Absence: the power residual grows in proportion to speed, more with payload.

use crate::drive::traction;
use crate::units::GRAVITY_MPS2;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Rolling;

static SPEC: EffectSpec = EffectSpec {
    id: "rolling",
    title: "Rolling resistance",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps],
    equation: "F = c_rr (m + m_payload) g cos(pitch), P += what F adds to max(0, v sum of all F)",
    source: "Newton; rolling coefficient as in vehicle engineering",
    validity: "hard ground, slow speed, no slip",
    signature: "a residual in proportion to speed and to payload",
    matters: 0.02,
    confused_with: &[
        ("dry_friction", "the same way with and without payload"),
        ("gear_loss", "a known slope as well as level ground"),
        ("floor", "two floors"),
        ("motion", "leave one of them out: both hold rolling"),
    ],
    parameters: &[
        ParameterSpec {
            name: "rolling_coefficient",
            meaning: "rolling resistance over weight",
            default: 0.02,
            null: Some(0.0),
            min: 0.0,
            max: 0.5,
            source: "rubber tyres on hard floor: 0.01-0.04; car tyres on asphalt 0.013, in a field 0.1-0.35 (Bosch Automotive Handbook)",
        },
        ParameterSpec {
            name: "mass_kg",
            meaning: "mass of the robot without payload",
            default: 0.5,
            null: None,
            min: 0.01,
            max: 500.0,
            source: "a kitchen scale; guess: palm-sized robot",
        },
    ],
    states: &[],
};

impl Physics for Rolling {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let mass_kg = own.parameters[1] + channels[Channel::PayloadKg];
        let force_n = own.parameters[0] * mass_kg * channels[Channel::PitchRad].cos() * GRAVITY_MPS2;
        traction::resist(channels, force_n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&Rolling, parameters, inputs)
    }

    #[test]
    fn a_car_on_asphalt_by_the_handbook() {
        // Bosch Automotive Handbook: coefficient 0.013 on asphalt; 1000 kg at 10 m/s takes 1.275 kW.
        let taken_w = power_w(&[0.013, 800.0], &[(Channel::SpeedMps, 10.0), (Channel::PayloadKg, 200.0)]);
        assert!((taken_w - 1275.0).abs() < 1.0, "{taken_w}");
    }

    #[test]
    fn nothing_rolls_at_rest_and_a_wall_carries_no_weight() {
        assert_eq!(power_w(&[0.02, 1.0], &[]), 0.0);
        let steep = [(Channel::SpeedMps, 1.0), (Channel::PitchRad, std::f64::consts::FRAC_PI_2)];
        assert!(power_w(&[0.02, 1.0], &steep).abs() < 1e-12);
    }
}
