//! Loss in the gears: part of the power at the wheels, on top of it.
//!
//! `P += max(0, F v) (1 / eta_G - 1)` with F the sum of the forces at the wheels (Kottas, Eq. 4.6).
//!
//! Absence: a residual in proportion to the mechanical power, whatever it is used for.

use crate::drive::traction;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct GearLoss;

static SPEC: EffectSpec = EffectSpec {
    id: "gear_loss",
    title: "Loss in the gears",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps],
    equation: "P += max(0, F v) (1/eta - 1), F the sum of all forces",
    source: "Kottas, Eq. 4.6",
    validity: "efficiency constant over load and speed; friction at no load is dry_friction",
    signature: "a residual in proportion to all mechanical power",
    matters: 0.02,
    confused_with: &[
        ("rolling", "a known slope as well as level ground"),
        ("dry_friction", "a known slope as well as level ground"),
        ("slope", "the mass from a scale"),
        ("slip", "two slopes: slip grows with force"),
        ("motion", "leave one of them out: motion has its own efficiency"),
    ],
    parameters: &[ParameterSpec {
        name: "efficiency",
        meaning: "mechanical power at the wheel over that of the motor",
        default: 0.7,
        null: Some(1.0),
        min: 0.05,
        max: 1.0,
        source: "planetary gears of two to four stages: 0.6-0.8 (data sheets of their makers)",
    }],
    states: &[],
};

impl Physics for GearLoss {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let mechanical_w = traction::drawn_w(channels[Channel::TractionN], channels[Channel::SpeedMps]);
        channels.add(Channel::PowerW, mechanical_w * (own.parameters[0].recip() - 1.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::explorer::MOTOR;
    use crate::drive::motor::{Gear, Gearmotor};
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&GearLoss, parameters, inputs)
    }

    #[test]
    fn a_gear_of_seventy_percent_asks_for_three_sevenths_more() {
        let inputs = [(Channel::SpeedMps, 0.5), (Channel::TractionN, 2.0)];
        assert!((power_w(&[0.7], &inputs) - 3.0 / 7.0).abs() < 1e-12);
        assert_eq!(power_w(&[1.0], &inputs), 0.0);
        assert_eq!(power_w(&[0.7], &[(Channel::SpeedMps, 0.5), (Channel::TractionN, -2.0)]), 0.0);
    }

    #[test]
    fn the_motor_model_agrees() {
        // Same wheel power through gears of 0.7 and of 1: the difference of shaft powers.
        let lossless = Gearmotor { gear: Gear { efficiency: 1.0, ..MOTOR.gear }, ..MOTOR };
        let (with, without) = (MOTOR.at(0.02, 20.0), lossless.at(0.02, 20.0));
        let shaft_w = (with.motor_nm - without.motor_nm) * with.motor_radps;
        assert!((power_w(&[0.7], &[(Channel::SpeedMps, 1.0), (Channel::TractionN, with.wheel_w)]) - shaft_w).abs() < 1e-12);
    }

    /// FAULHABER, gearhead support page: a 16/7 of 43:1 has 70 %, at 71 mN m on its output. At
    /// 10 rad/s these are 0.71 W, and by energy the motor gives 0.71 W / 0.7.
    #[test]
    fn a_planetary_gear_of_43_to_1_by_its_makers_example() {
        let wheel_w = 0.071 * 10.0;
        let lost_w = power_w(&[0.7], &[(Channel::SpeedMps, 1.0), (Channel::TractionN, wheel_w)]);
        assert!((wheel_w + lost_w - 1.0143).abs() < 1e-4, "{lost_w}");
    }
}
