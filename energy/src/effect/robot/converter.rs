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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    fn input_w(efficiency: f64, quiescent_w: f64, output_w: f64) -> f64 {
        robot_power_w(&Converter, &[efficiency, quiescent_w], &[(Channel::PowerW, output_w)])
    }

    #[test]
    fn a_perfect_converter_takes_what_it_gives_and_an_idle_one_its_own_need() {
        assert_eq!(input_w(1.0, 0.0, 3.0), 3.0);
        assert_eq!(input_w(0.9, 0.02, 0.0), 0.02);
    }

    /// Kottas, section 4.1: up to 95 %. The loss is then 5 % of the input (Eq. 4.1 put right), not
    /// 95 % of it as printed. By hand: at an output of eta P_q half of the input is the quiescent need.
    #[test]
    fn the_loss_is_the_rest_of_the_input_and_light_load_halves_the_efficiency() {
        let input = input_w(0.95, 0.0, 1.9);
        assert!((input - 2.0).abs() < 1e-12 && (input - 1.9 - input * 0.05).abs() < 1e-12);
        assert!((input_w(0.95, 0.1, 0.95 * 0.1) - 2.0 * 0.1).abs() < 1e-12);
    }
}
