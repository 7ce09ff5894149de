//! Payload: lifting and accelerating what the robot carries.
//!
//! `F = k m_payload (g sin(pitch) + a)`, `P = F v` in sum with the other forces, never below zero.
//! m_payload in kg from the channel `payload_kg`; k is 1 when the log states it rightly and the
//! wheels carry all of it. Its rolling resistance is in `rolling`.
//!
//! Absence: slopes and acceleration leave a residual that grows with the payload.

use crate::drive::traction;
use crate::units::GRAVITY_MPS2;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Payload;

static SPEC: EffectSpec = EffectSpec {
    id: "payload",
    title: "Payload on slopes and when accelerated",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps, Channel::PayloadKg],
    equation: "F = k m_payload (g sin(pitch) + a), P += what F adds to max(0, v sum of all F)",
    source: "Newton's second law",
    validity: "payload fixed to the robot",
    signature: "a residual on slopes and when speeding up, in proportion to the payload",
    matters: 0.02,
    confused_with: &[
        ("slope", "the same slope without payload"),
        ("acceleration", "speeding up without payload"),
        ("rolling", "a slope at constant speed, with and without payload"),
        ("motion", "leave one of them out: both hold the payload"),
    ],
    parameters: &[ParameterSpec {
        name: "share",
        meaning: "share of the payload that is lifted and accelerated",
        default: 1.0,
        null: Some(0.0),
        min: 0.0,
        max: 3.0,
        source: "one, unless the log states the payload wrongly",
    }],
    states: &[],
};

impl Physics for Payload {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let carried_kg = own.parameters[0] * channels[Channel::PayloadKg];
        let force_n = carried_kg * (channels[Channel::PitchRad].sin() * GRAVITY_MPS2 + channels[Channel::AccelMps2]);
        traction::push(channels, force_n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&Payload, parameters, inputs)
    }

    #[test]
    fn a_payload_climbs_and_speeds_up_like_mass() {
        let pitch_rad = 0.5_f64.asin();
        // 2 kg at 1 m/s up a slope of one in two: 9.80665 W (standard gravity); at 3 m/s²: 6 W.
        let inputs = [(Channel::SpeedMps, 1.0), (Channel::PayloadKg, 2.0)];
        let lifted_w = power_w(&[1.0], &[inputs[0], inputs[1], (Channel::PitchRad, pitch_rad)]);
        assert!((lifted_w - 9.806_65).abs() < 1e-12);
        assert!((power_w(&[1.0], &[inputs[0], inputs[1], (Channel::AccelMps2, 3.0)]) - 6.0).abs() < 1e-12);
    }

    #[test]
    fn no_payload_or_no_share_takes_nothing() {
        let inputs = [(Channel::SpeedMps, 1.0), (Channel::PitchRad, 0.2)];
        assert_eq!(power_w(&[1.0], &inputs), 0.0);
        assert_eq!(power_w(&[0.0], &[inputs[0], inputs[1], (Channel::PayloadKg, 2.0)]), 0.0);
    }
}
