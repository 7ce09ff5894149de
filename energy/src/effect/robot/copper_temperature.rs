//! Temperature of the windings: copper resists more when it is warm.
//!
//! `P += P_copper alpha (T - 25 degC)`; P_copper is what `motor_copper` found at the reference
//! temperature, alpha 0.385 %/K of that for copper, T the ambient temperature (a winding that heats itself
//! is warmer by a constant share of its loss, which `motor_copper` takes in).
//!
//! Absence: in the heat, hard pulls take more than in the cold.

use crate::units::REFERENCE_DEGC;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CopperTemperature;

static SPEC: EffectSpec = EffectSpec {
    id: "copper_temperature",
    title: "Temperature of the windings",
    system: System::Robot,
    phase: Phase::Drive,
    channel: Channel::PowerW,
    needs: &[Channel::SpeedMps, Channel::AmbientDegc],
    equation: "P += P_copper alpha (T - 25)",
    source: "IEC 60028: annealed copper, 0.00393 per kelvin of its resistance at 20 degC: 0.00385 of that at 25 degC",
    validity: "-40 to 150 degC; weaker magnets when warm are not in it; needs motor_copper",
    signature: "a residual with the square of force times temperature",
    matters: 0.02,
    confused_with: &[("motor_copper", "two ambient temperatures at least 20 K apart")],
    parameters: &[ParameterSpec {
        name: "per_kelvin",
        meaning: "relative change of resistance per kelvin",
        default: 0.00385,
        null: Some(0.0),
        min: 0.0,
        max: 0.02,
        source: "IEC 60028; magnets add up to twice 0.2 %/K",
    }],
    states: &[],
};

impl Physics for CopperTemperature {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let warmer_k = channels[Channel::AmbientDegc] - REFERENCE_DEGC;
        channels.add(Channel::PowerW, channels[Channel::CopperW] * own.parameters[0] * warmer_k);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    fn power_w(parameters: &[f64], inputs: &[(Channel, f64)]) -> f64 {
        robot_power_w(&CopperTemperature, parameters, inputs)
    }

    #[test]
    fn a_winding_at_75_degrees_resists_a_fifth_more_than_at_25() {
        // IEC 60028: R is in proportion to 234.5 + T: (234.5 + 75) / (234.5 + 25) = 1.1927.
        let more_w = power_w(&[0.00385], &[(Channel::CopperW, 1.0), (Channel::AmbientDegc, 75.0)]);
        assert!((1.0 + more_w - 1.1927).abs() < 0.0005, "{more_w}");
    }

    #[test]
    fn nothing_changes_at_the_reference_temperature() {
        assert_eq!(power_w(&[0.00385], &[(Channel::CopperW, 1.0), (Channel::AmbientDegc, 25.0)]), 0.0);
        assert!(power_w(&[0.00385], &[(Channel::CopperW, 1.0), (Channel::AmbientDegc, 0.0)]) < 0.0);
    }
}
