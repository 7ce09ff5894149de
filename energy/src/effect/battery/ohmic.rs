//! Ohmic resistance: the drop that follows the current at once.
//!
//! `V_ohm = R0 I_cell`, with R0 in ohm per cell, I_cell in A per cell, V_ohm in V per cell
//! (Kottas, section C.1.1: the dominant overpotential over most of the discharge).
//!
//! Absence: the residual steps with the current and has its sign.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Ohmic;

static SPEC: EffectSpec = EffectSpec {
    id: "ohmic",
    title: "Ohmic resistance R0",
    system: System::Battery,
    phase: Phase::Series,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA],
    equation: "V = R0 I",
    source: "Kottas, section C.1.1",
    validity: "any current; R0 constant over SoC and temperature",
    signature: "the residual steps with the current, in proportion and at once",
    matters: 1e-3,
    confused_with: &[("ohmic_soc", "a discharge over the whole range of SoC")],
    parameters: &[ParameterSpec {
        name: "resistance_ohm",
        meaning: "resistance of one cell",
        default: 0.03,
        null: Some(0.0),
        min: 0.0,
        max: 1.0,
        source: "LiPo cells of 1-8 Ah: about 5-60 mOhm",
    }],
    states: &[],
};

impl Physics for Ohmic {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::OverpotentialV, own.parameters[0] * channels[Channel::CellCurrentA]);
    }
}
