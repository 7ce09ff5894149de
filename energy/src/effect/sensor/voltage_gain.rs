//! Gain of the voltage sensor.
//!
//! `V_shown = g V`, V of the pack in V.
//!
//! Absence: a residual in proportion to the voltage: larger when full than when empty.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct VoltageGain;

static SPEC: EffectSpec = EffectSpec {
    id: "voltage_gain",
    title: "Gain of the voltage sensor",
    system: System::Battery,
    phase: Phase::Shown,
    channel: Channel::VoltageV,
    needs: &[],
    equation: "V_shown = g V",
    source: "definition of a gain; gauge data sheets",
    validity: "a gain that does not move with temperature",
    signature: "a voltage residual in proportion to the voltage",
    matters: 1e-3,
    confused_with: &[("voltage_offset", "rests at high and low SoC")],
    parameters: &[ParameterSpec {
        name: "gain",
        meaning: "voltage shown over voltage at the terminals",
        default: 1.0,
        null: Some(1.0),
        min: 0.9,
        max: 1.1,
        source: "gauge chips: within 0.1 % typically, 0.7 % at most",
    }],
    states: &[],
};

impl Physics for VoltageGain {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels[Channel::VoltageV] *= own.parameters[0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn a_gauge_at_its_worst_shows_a_full_pack_88_millivolts_high() {
        // 0.7 % at most (data sheets) of 3 x 4.20 V.
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::VoltageV] = 12.6;
        step_once(&VoltageGain, &Facts::robot(), 1.0, &[1.007], &mut [], &mut channels);
        assert!((channels[Channel::VoltageV] - 12.6882).abs() < 1e-12);
    }

    #[test]
    fn at_its_null_the_sensor_shows_what_is() {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::VoltageV] = 12.6;
        step_once(&VoltageGain, &Facts::robot(), 1.0, &[1.0], &mut [], &mut channels);
        assert_eq!(channels[Channel::VoltageV], 12.6);
    }
}
