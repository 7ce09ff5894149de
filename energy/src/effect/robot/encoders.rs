//! Motor encoders: a constant current at 5 V.
//!
//! `P += I V` in W with V = 5 V, the physics of the receiver ([`super::gps`]). Magnetic encoders run from 4.5 to 13.8 V; at 5 V their output has
//! logic level (Kottas, section 4.5).
//!
//! Absence: a constant power is missing whatever the robot does.

use super::gps::ConstantCurrent;
use crate::{Channel, EffectSpec, ParameterSpec, Phase, System};

/// All encoders at 5 V (Kottas, section 4.5).
pub(crate) static ENCODERS: ConstantCurrent = ConstantCurrent(&SPEC, 5.0);

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;
    use crate::{Channels, Facts};

    /// Two of Faulhaber's IE2 magnetic encoders: 6 mA typical each at 5 V (their datasheet), 60 mW together.
    #[test]
    fn two_magnetic_encoders_take_60_milliwatts() {
        let mut channels = Channels::filled(0.0_f64);
        step_once(&ENCODERS, &Facts::robot(), 1.0, &[2.0 * 0.006], &mut [], &mut channels);
        assert!((channels[Channel::PowerW] - 0.06).abs() < 1e-12);
    }

    #[test]
    fn no_current_is_no_power() {
        let mut channels = Channels::filled(0.0_f64);
        step_once(&ENCODERS, &Facts::robot(), 1.0, &[0.0], &mut [], &mut channels);
        assert_eq!(channels[Channel::PowerW], 0.0);
    }
}
