//! Motor encoders: a constant current at 5 V.
//!
//! `P += I V` in W with V = 5 V. Magnetic encoders run from 4.5 to 13.8 V; at 5 V their output has
//! logic level (Kottas, section 4.5).
//!
//! Absence: a constant power is missing whatever the robot does.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Encoders;

/// Supply voltage, V (Kottas, section 4.5).
const SUPPLY_V: f64 = 5.0;

static SPEC: EffectSpec = EffectSpec {
    id: "encoders",
    title: "Motor encoders",
    system: System::Robot,
    phase: Phase::Load,
    channel: Channel::PowerW,
    needs: &[],
    equation: "P += I 5 V",
    source: "Kottas, section 4.5",
    validity: "any speed; behind a converter or on a rail",
    signature: "a constant missing power of some 10 mW",
    matters: 0.02,
    confused_with: &[("idle", "unplug the encoders for one log"), ("gps", "unplug the encoders for one log")],
    parameters: &[ParameterSpec {
        name: "current_a",
        meaning: "supply current of all encoders",
        default: 0.02,
        null: Some(0.0),
        min: 0.0,
        max: 0.5,
        source: "guess: two magnetic encoders of 5-15 mA",
    }],
    states: &[],
};

impl Physics for Encoders {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PowerW, own.parameters[0] * SUPPLY_V);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    /// Two of Faulhaber's IE2 magnetic encoders: 6 mA typical each at 5 V (their datasheet), 60 mW together.
    #[test]
    fn two_magnetic_encoders_take_60_milliwatts() {
        let mut channels = Channels::filled(0.0_f64);
        step_once(&Encoders, &Facts::robot(), 1.0, &[2.0 * 0.006], &mut [], &mut channels);
        assert!((channels[Channel::PowerW] - 0.06).abs() < 1e-12);
    }

    #[test]
    fn no_current_is_no_power() {
        let mut channels = Channels::filled(0.0_f64);
        step_once(&Encoders, &Facts::robot(), 1.0, &[0.0], &mut [], &mut channels);
        assert_eq!(channels[Channel::PowerW], 0.0);
    }
}
