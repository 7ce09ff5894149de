//! Loss of the station's converters that feed the bays.
//!
//! `P_in = P_q + P_out / eta` in W. The thesis' station has two 15 V SEPIC converters with large
//! heat sinks (Kottas, section B.2.2); loss as in Eq. 4.1 put right: `P_in (1 - eta)`.
//!
//! Absence: missing power in proportion to the power of all bays, and a little always.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Converter;

static SPEC: EffectSpec = EffectSpec {
    id: "converter_efficiency",
    title: "Bay converter efficiency",
    system: System::Station,
    phase: Phase::Converter,
    channel: Channel::PackPowerW,
    needs: &[Channel::ChargePowerW],
    equation: "P_in = P_q + P_out / eta",
    source: "Kottas, Eq. 4.1 with the loss put right: P_in (1 - eta)",
    validity: "eta constant over pack voltage",
    signature: "missing power in proportion to the bays' power",
    matters: 0.1,
    confused_with: &[("charger_efficiency", "measure between converter and charger")],
    parameters: &[
        ParameterSpec {
            name: "efficiency",
            meaning: "power to the bays over power from the pack beyond the quiescent power",
            default: 0.88,
            null: Some(1.0),
            min: 0.3,
            max: 1.0,
            source: "SEPIC converters of some tens of watts: 0.80-0.92",
        },
        ParameterSpec {
            name: "quiescent_w",
            meaning: "power that the converters take at no load",
            default: 0.1,
            null: Some(0.0),
            min: 0.0,
            max: 20.0,
            source: "guess: 5 mA at 12 V for each of two",
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
        channels[Channel::PackPowerW] = channels[Channel::PackPowerW] / own.parameters[0] + own.parameters[1];
    }
}
