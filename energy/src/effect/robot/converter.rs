//! Converter loss between the robot's battery and its rails.
//!
//! `P_in = P_q + P_out / eta`, all in W. Kottas, Eq. 4.1, labels `V_in I_in eta` as the loss; that
//! is the output power, the loss is `P_in (1 - eta)`. The quiescent term is why efficiency falls
//! at light load (Kottas, Fig. 4.2).
//!
//! Absence: the battery gives more power than the loads account for, in proportion to it.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Converter;

static SPEC: EffectSpec = EffectSpec {
    id: "converter",
    title: "Converter loss",
    system: System::Robot,
    phase: Phase::Converter,
    channel: Channel::PowerW,
    needs: &[],
    equation: "P_in = P_q + P_out / eta",
    source: "Kottas, Eq. 4.1 with the loss put right: P_in (1 - eta)",
    validity: "eta constant over input voltage",
    signature: "missing power in proportion to the load",
    matters: 0.02,
    confused_with: &[("idle", "logs at two different loads")],
    parameters: &[
        ParameterSpec {
            name: "efficiency",
            meaning: "output power over input power beyond the quiescent power",
            default: 0.9,
            null: Some(1.0),
            min: 0.3,
            max: 1.0,
            source: "Kottas, section 4.1: up to 95 % when well designed",
        },
        ParameterSpec {
            name: "quiescent_w",
            meaning: "power that the converter takes at no load",
            default: 0.02,
            null: Some(0.0),
            min: 0.0,
            max: 10.0,
            source: "guess: a few mA at 12 V",
        },
    ],
    states: &[],
};

impl Physics for Converter {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels[Channel::PowerW] = channels[Channel::PowerW] / own.parameters[0] + own.parameters[1];
    }
}
