//! Offset of the current sensor: it shows a constant too much.
//!
//! `I = I_shown - I_off`, in A of the pack, discharge positive: a positive offset shows a
//! discharge that is not there.
//!
//! Absence: the state of charge drifts with time in one direction, in charge, discharge and rest.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CurrentOffset;

static SPEC: EffectSpec = EffectSpec {
    id: "current_offset",
    title: "Offset of the current sensor",
    system: System::Battery,
    phase: Phase::Sensed,
    channel: Channel::TerminalCurrentA,
    needs: &[Channel::CurrentA],
    equation: "I = I_shown - I_off",
    source: "definition of an offset; gauge data sheets",
    validity: "an offset that does not move with temperature",
    signature: "SoC drifts with time whatever the current, also at rest",
    matters: 1e-4,
    confused_with: &[
        ("self_discharge", "a zeroed shunt at rest, or a second ammeter"),
        ("parasitic_load", "a zeroed shunt at rest, or a second ammeter"),
    ],
    parameters: &[ParameterSpec {
        name: "offset_a",
        meaning: "current shown when none flows",
        default: 0.0,
        null: Some(0.0),
        min: -0.5,
        max: 0.5,
        source: "sign unknown; 10 uV of amplifier offset over a 10 mOhm shunt: 1 mA",
    }],
    states: &[],
};

impl Physics for CurrentOffset {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::TerminalCurrentA, -own.parameters[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    #[test]
    fn one_step_of_a_gauges_offset_register_is_taken_off() {
        // Maxim DS2784 and MAX17047: current offsets are set in steps of 1.5625 uV over the shunt.
        let offset_a = 1.5625e-6 / 0.010;
        let mut channels = Channels::filled(0.0_f64);
        for shown_a in [0.0, 1.0, -1.0] {
            channels[Channel::TerminalCurrentA] = shown_a;
            step_once(&CurrentOffset, &Facts::robot(), 1.0, &[offset_a], &mut [], &mut channels);
            assert!((channels[Channel::TerminalCurrentA] - (shown_a - 0.156_25e-3)).abs() < 1e-15);
        }
    }
}
