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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn pack_w(efficiency: f64, quiescent_w: f64, bays_w: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::PackPowerW] = bays_w;
        step_once(&Converter, &Facts::Station, 1.0, &[efficiency, quiescent_w], &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn a_perfect_converter_takes_what_it_gives_and_an_idle_one_its_own_need() {
        assert_eq!(pack_w(1.0, 0.0, 60.0), 60.0);
        assert_eq!(pack_w(0.88, 0.2, 0.0), 0.2);
    }

    /// Kottas, section 4.1: efficiencies of even 95 %, under the best conditions. Of 60 W into the
    /// converters 5 % are then heat (Eq. 4.1 put right); the default may not promise more than that.
    #[test]
    fn at_best_a_twentieth_of_the_input_is_lost_and_by_default_more() {
        assert!((pack_w(0.95, 0.0, 57.0) - 60.0).abs() < 1e-12);
        assert!(pack_w(SPEC.parameters[0].default, SPEC.parameters[1].default, 57.0) > 60.0);
    }
}
