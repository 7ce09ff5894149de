//! Satellite receiver: a constant current at 3.3 V.
//!
//! `P += I V` in W with V = 3.3 V. Kottas, section 4.4, measured 35.50 mA at 3.30 V and prints
//! 118.86 mW; the product is 117.15 mW.
//!
//! Absence: a constant power is missing whatever the robot does.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

/// A device that takes a constant current at its supply voltage, V; the current is its parameter.
pub(crate) struct ConstantCurrent(pub(crate) &'static EffectSpec, pub(crate) f64);

/// The receiver at 3.3 V (Kottas, section 4.4).
pub(crate) static RECEIVER: ConstantCurrent = ConstantCurrent(&SPEC, 3.3);

static SPEC: EffectSpec = EffectSpec {
    id: "gps",
    title: "Satellite receiver",
    system: System::Robot,
    phase: Phase::Load,
    channel: Channel::PowerW,
    needs: &[],
    equation: "P += I 3.3 V",
    source: "Kottas, section 4.4",
    validity: "after the first fix; behind a converter or on a rail",
    signature: "a constant missing power of about 0.1 W",
    matters: 0.02,
    confused_with: &[("idle", "pull the receiver's supply for one log"), ("encoders", "pull the receiver's supply for one log")],
    parameters: &[ParameterSpec {
        name: "current_a",
        meaning: "supply current",
        default: 0.0355,
        null: Some(0.0),
        min: 0.0,
        max: 0.5,
        source: "Kottas, section 4.4: 35.50 mA measured",
    }],
    states: &[],
};

impl Physics for ConstantCurrent {
    fn spec(&self) -> &'static EffectSpec {
        self.0
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PowerW, own.parameters[0] * self.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    /// Kottas, section 4.4: 35.50 mA at 3.30 V. Printed as 118.86 mW; 3.30 x 35.50 = 117.15.
    #[test]
    fn the_measured_receiver_takes_117_milliwatts() {
        let mut channels = Channels::filled(0.0_f64);
        step_once(&RECEIVER, &Facts::robot(), 1.0, &[SPEC.parameters[0].default], &mut [], &mut channels);
        assert!((channels[Channel::PowerW] - 0.117_15).abs() < 1e-12);
    }

    #[test]
    fn no_current_is_no_power() {
        let mut channels = Channels::filled(0.0_f64);
        step_once(&RECEIVER, &Facts::robot(), 1.0, &[0.0], &mut [], &mut channels);
        assert_eq!(channels[Channel::PowerW], 0.0);
    }
}
