//! Acceleration of the robot's own mass and of what turns with its wheels.
//!
//! `F = m_eq a`, `P = F v` in sum with the other forces, never below zero:
//! `m_eq = m + 2 (J_w + N² J_m) / r_w²` (Kottas, Eq. 5.14, with the rotors that it leaves out), kg.
//! Rotors behind a high gear may weigh as much as the robot. Braking returns nothing unless the
//! effect `regeneration` is in the model; what a payload adds is the effect `payload`.
//!
//! Absence: the power residual follows speed times acceleration.

use crate::drive::traction;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Acceleration;

static SPEC: EffectSpec = EffectSpec {
    id: "acceleration",
    title: "Acceleration",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps, Channel::AccelMps2],
    equation: "F = m_eq a, P += what F adds to max(0, v sum of all F)",
    source: "Kottas, Eqs. 5.1 and 5.14",
    validity: "no wheel slip",
    signature: "a residual in bursts, when the robot speeds up",
    matters: 0.02,
    confused_with: &[
        ("slope", "constant speed on a slope"),
        ("payload", "speeding up without payload"),
        ("motion", "slopes as well as starts: its mass has weight, what turns has none"),
    ],
    parameters: &[ParameterSpec {
        name: "mass_kg",
        meaning: "mass with what turns, without payload; beside motion only what turns",
        default: 0.9,
        null: Some(0.0),
        min: 0.0,
        max: 1000.0,
        source: "guess: palm-sized robot with small geared motors",
    }],
    states: &[],
};

impl Physics for Acceleration {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let force_n = own.parameters[0] * channels[Channel::AccelMps2];
        traction::push(channels, force_n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::explorer::WHEELS;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&Acceleration, parameters, inputs)
    }

    #[test]
    fn speeding_up_takes_the_kinetic_energy_of_wheels_and_rotors() {
        // Independent: the energy of Kottas, Eq. 5.14, against power over a ramp of one second.
        let mass_kg = WHEELS.equivalent_mass_kg(0.5);
        let steps = 1000;
        let speed_mps = |step: i32| 0.5 * (f64::from(step) + 0.5) / f64::from(steps);
        let inputs = |step| [(Channel::SpeedMps, speed_mps(step)), (Channel::AccelMps2, 0.5)];
        let energy_j: f64 = (0..steps).map(|step| power_w(&[mass_kg], &inputs(step)) / f64::from(steps)).sum();
        assert!((energy_j - WHEELS.kinetic_j(0.5, 0.0, 0.5, 0.0)).abs() < 1e-9, "{energy_j}");
    }

    #[test]
    fn braking_and_cruising_take_nothing() {
        assert_eq!(power_w(&[1.0], &[(Channel::SpeedMps, 0.5), (Channel::AccelMps2, -1.0)]), 0.0);
        assert_eq!(power_w(&[1.0], &[(Channel::SpeedMps, 0.5)]), 0.0);
    }
}
