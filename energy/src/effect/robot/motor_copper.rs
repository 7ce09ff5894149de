//! Copper loss of the drive motors: the square of the force at the wheels.
//!
//! `P = R_a I²`, `I = F r_w / (n N k_tau)` for each of n motors: together `P = c F²` with
//! `c = (R_a / n) (r_w / (N k_tau))²` in W/N² (Kottas, section 4.2 and A.1). F is the sum of the forces
//! at the wheels, also at a standstill on a slope, where the motors hold.
//!
//! Absence: slopes, payload and acceleration leave a residual with the square of their force, at any
//! speed.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct MotorCopper;

static SPEC: EffectSpec = EffectSpec {
    id: "motor_copper",
    title: "Copper loss of the drive motors",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps],
    equation: "P = c F², F the sum of all forces",
    source: "Kottas, section 4.2",
    validity: "winding at the reference temperature; forces of both wheels equal (turning adds to it)",
    signature: "a residual with the square of force, independent of speed",
    matters: 0.02,
    confused_with: &[
        ("slip", "two speeds on one slope"),
        ("h_bridge", "two speeds on one slope"),
        ("dry_friction", "uphill against level at one speed"),
    ],
    parameters: &[ParameterSpec {
        name: "copper_w_per_n2",
        meaning: "loss over the square of force",
        default: 0.02,
        null: Some(0.0),
        min: 0.0,
        max: 100.0,
        source: "small coreless motors with a gear of 40: 0.005-0.1",
    }],
    states: &[],
};

impl Physics for MotorCopper {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let force_n = channels[Channel::TractionN];
        let copper_w = own.parameters[0] * force_n * force_n;
        channels.add(Channel::CopperW, copper_w);
        channels.add(Channel::PowerW, copper_w);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::explorer::MOTOR;
    use crate::drive::motor::{Gear, Gearmotor};
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&MotorCopper, parameters, inputs)
    }

    #[test]
    fn two_motors_on_a_wheel_by_the_motor_model() {
        // FAULHABER 1331 T 012 SR (13.7 ohm, 11.4 mN m/A) behind 41:1 without gear loss, 22.5 mm wheel.
        let lossless = Gearmotor { gear: Gear { efficiency: 1.0, ..MOTOR.gear }, ..MOTOR };
        let by_motor_w = 2.0 * lossless.copper_w(3.0 * 0.0225 / 2.0);
        let copper = 13.7 / 2.0 * (0.0225 / (41.0 * 11.4e-3_f64)).powi(2);
        assert!((power_w(&[copper], &[(Channel::TractionN, 3.0)]) - by_motor_w).abs() < 1e-12, "{by_motor_w}");
    }

    #[test]
    fn twice_the_force_costs_four_times_and_holding_costs_too() {
        assert!((power_w(&[0.5], &[(Channel::TractionN, 2.0)]) - 2.0).abs() < 1e-15);
        assert!((power_w(&[0.5], &[(Channel::TractionN, -4.0), (Channel::SpeedMps, 1.0)]) - 8.0).abs() < 1e-15);
        assert_eq!(power_w(&[0.5], &[(Channel::SpeedMps, 1.0)]), 0.0);
    }
}
