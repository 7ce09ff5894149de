//! Viscous friction of lubricant, bearings and eddy currents: a force that grows with speed.
//!
//! `F = b v`, `P = b v²` in sum with the other forces, never below zero, b in N s/m at the ground. For motors of damping f_m behind a gear N and a
//! wheel r_w: `b = n f_m (N / r_w)²` (Kottas, Eq. 4.6, tau_f = f_m w).
//!
//! Absence: the power residual grows with the square of the speed.

use crate::drive::traction;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct ViscousFriction;

static SPEC: EffectSpec = EffectSpec {
    id: "viscous_friction",
    title: "Viscous friction",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps],
    equation: "F = b v, P += what F adds to max(0, v sum of all F)",
    source: "Kottas, Eq. 4.6",
    validity: "laminar lubrication; air drag of small robots is far less",
    signature: "a residual with the square of speed",
    matters: 0.02,
    confused_with: &[
        ("slip", "the same speeds with and without payload"),
        ("rolling", "two speeds a factor of two apart"),
        ("dry_friction", "two speeds a factor of two apart"),
    ],
    parameters: &[ParameterSpec {
        name: "viscous_n_s_per_m",
        meaning: "force over speed",
        default: 0.1,
        null: Some(0.0),
        min: 0.0,
        max: 1000.0,
        source: "coreless motors: hardly any; iron-cored ones with grease: 0.1-10",
    }],
    states: &[],
};

impl Physics for ViscousFriction {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let force_n = own.parameters[0] * channels[Channel::SpeedMps];
        traction::push(channels, force_n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::explorer::MOTOR;
    use crate::drive::motor::{Gear, Gearmotor, Motor};
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&ViscousFriction, parameters, inputs)
    }

    #[test]
    fn power_grows_with_the_square_of_speed_in_either_direction() {
        assert!((power_w(&[2.0], &[(Channel::SpeedMps, 0.5)]) - 0.5).abs() < 1e-15);
        assert!((power_w(&[2.0], &[(Channel::SpeedMps, -1.0)]) - 2.0).abs() < 1e-15);
    }

    #[test]
    fn the_damping_of_a_datasheet_gives_the_same_through_the_motor_model() {
        // Ametek Pittman 14203, data sheet: 1.2e-5 N m s/rad; behind 20:1 on a wheel of 5 cm.
        let (damping, ratio, radius_m, speed_mps) = (1.2e-5, 20.0, 0.05, 0.8);
        let motor = Motor {
            viscous_nm_s_per_rad: damping,
            friction_nm: 0.0,
            resistance_ohm: 1e-9,
            back_emf_v_s_per_rad: 3.27e-2,
            torque_nm_per_a: 3.27e-2,
            ..MOTOR.motor
        };
        let at = Gearmotor { motor, gear: Gear { ratio, efficiency: 0.7 } }.at(0.0, speed_mps / radius_m);
        let viscous_n_s_per_m = damping * (ratio / radius_m) * (ratio / radius_m);
        assert!((power_w(&[viscous_n_s_per_m], &[(Channel::SpeedMps, speed_mps)]) / at.electrical_w - 1.0).abs() < 1e-6);
    }
}
