//! Slope: lifting the robot itself.
//!
//! `F = m g sin(pitch)`, `P = F v` in sum with the other forces, never below zero. m is the robot's
//! own mass in kg; what its payload adds is the effect `payload`. Uphill pitch is positive.
//!
//! Absence: the power residual follows the pitch.

use crate::drive::traction;
use crate::units::GRAVITY_MPS2;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Slope;

static SPEC: EffectSpec = EffectSpec {
    id: "slope",
    title: "Slope",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps, Channel::PitchRad],
    equation: "F = m g sin(pitch), P += what F adds to max(0, v sum of all F)",
    source: "Newton's second law",
    validity: "pitch of the ground along the path, not of the body",
    signature: "a residual with speed and pitch",
    matters: 0.02,
    confused_with: &[
        ("acceleration", "constant speed on a slope"),
        ("payload", "the same slope without payload"),
        ("floor", "one floor at two slopes"),
        ("motion", "leave one of them out: both hold the slope"),
    ],
    parameters: &[ParameterSpec {
        name: "mass_kg",
        meaning: "mass of the robot without payload",
        default: 0.5,
        null: Some(0.0),
        min: 0.0,
        max: 500.0,
        source: "a kitchen scale; guess: palm-sized robot",
    }],
    states: &[],
};

impl Physics for Slope {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let force_n = own.parameters[0] * channels[Channel::PitchRad].sin() * GRAVITY_MPS2;
        traction::push(channels, force_n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&Slope, parameters, inputs)
    }

    #[test]
    fn a_kilogram_lifted_by_a_metre_takes_its_weight() {
        // Standard gravity (3rd CGPM, 1901): 9.80665 J for 1 kg and 1 m; here in one second.
        let pitch_rad = (1.0_f64 / 4.0).asin();
        assert!((power_w(&[1.0], &[(Channel::SpeedMps, 4.0), (Channel::PitchRad, pitch_rad)]) - 9.806_65).abs() < 1e-12);
    }

    #[test]
    fn level_and_downhill_take_nothing() {
        assert_eq!(power_w(&[1.0], &[(Channel::SpeedMps, 0.5)]), 0.0);
        assert_eq!(power_w(&[1.0], &[(Channel::SpeedMps, 0.5), (Channel::PitchRad, -0.2)]), 0.0);
    }
}
