//! Servo of the caster tail: power to hold its torque, by the tail's angle.
//!
//! `P = P_hold cos²(k (tail - worst))`: `I² R` of the current that holds the torque, whose shape over
//! the angle is that of the crank slider in `drive/caster.rs` (Kottas, Eqs. 5.3 to 5.10, put right
//! there). Angles in rad, positive down; worst is where the torque is greatest, 7.5 degrees in the
//! Explorer. The short form follows the whole geometry within 2.5 % of the greatest torque.
//!
//! Absence: a standing load that changes with the tail's angle.

use crate::drive::caster::relative_hold;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CasterHold;

static SPEC: EffectSpec = EffectSpec {
    id: "caster_hold",
    title: "Servo that holds the caster tail",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::TailAngleRad],
    equation: "P = P_hold cos²(k (tail - worst))",
    source: "Kottas, section 5.1.1 and Fig. 5.3",
    validity: "level ground, standing or steady speed; tail from 5 degrees up to 40 degrees down",
    signature: "a standing load that goes with the tail's angle",
    matters: 0.02,
    confused_with: &[("idle", "two angles of the tail")],
    parameters: &[
        ParameterSpec {
            name: "hold_w",
            meaning: "power at the angle of greatest torque",
            default: 0.3,
            null: Some(0.0),
            min: 0.0,
            max: 50.0,
            source: "hobby servos: 0.1-1 W at a third of their torque",
        },
        ParameterSpec {
            name: "worst_rad",
            meaning: "angle of greatest torque",
            default: 0.13,
            null: None,
            min: -0.6,
            max: 0.9,
            source: "Kottas, section 5.1.1: about 7.5 degrees",
        },
        ParameterSpec {
            name: "narrowness",
            meaning: "how fast the torque falls beside it",
            default: 1.5,
            null: None,
            min: 0.3,
            max: 5.0,
            source: "crank sliders with a tail of one to two pivot arms: 1-2",
        },
    ],
    states: &[],
};

impl Physics for CasterHold {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let relative = relative_hold(channels[Channel::TailAngleRad], own.parameters[1], own.parameters[2]);
        channels.add(Channel::PowerW, own.parameters[0] * relative * relative);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::explorer::{CASTER, SERVO};
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&CasterHold, parameters, inputs)
    }

    #[test]
    fn the_explorers_tail_by_its_whole_geometry() {
        let (worst_rad, worst_nm) = CASTER.worst(-0.15, 0.7).unwrap();
        let hold_w = SERVO.hold_w(worst_nm);
        for tail_rad in [-0.05, 0.0, 0.13, 0.4, 0.7] {
            let exact_w = SERVO.hold_w(CASTER.stance(tail_rad, 0.0).unwrap().hold_nm);
            let short_w = power_w(&[hold_w, worst_rad, 1.6], &[(Channel::TailAngleRad, tail_rad)]);
            assert!((short_w - exact_w).abs() < 0.05 * hold_w, "{tail_rad}: {short_w} {exact_w}");
        }
    }

    #[test]
    fn it_is_greatest_at_the_worst_angle_of_the_thesis_and_vanishes_across() {
        // Kottas, section 5.1.1: 7.5 degrees.
        let worst_rad = 7.5_f64.to_radians();
        let at = |degrees: f64| power_w(&[0.3, worst_rad, 1.0], &[(Channel::TailAngleRad, degrees.to_radians())]);
        assert!((at(7.5) - 0.3).abs() < 1e-12 && at(7.0) < 0.3 && at(8.0) < 0.3);
        assert!((at(67.5) - 0.075).abs() < 1e-12);
        assert_eq!(at(100.0), 0.0);
    }
}
