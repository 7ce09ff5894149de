//! Converter loss as a polynomial of the load.
//!
//! `I_in = (P0 + a I + b I^2) / V_in`: the input power is a fixed need, a part in proportion to the
//! output current I (output voltage and diode drops) and a resistive part. Written with the output
//! power P (W) at a fixed output voltage, `P_in = P0 + (1 + p) P + q P^2` with p = a / V_out - 1 and
//! q = b / V_out^2 (1/W). Efficiency falls at light load (P0) and at heavy load (q), as in Kottas,
//! Fig. 4.2; the loss is `P_in (1 - eta)`, not `V_in I_in eta` as Eq. 4.1 prints.
//!
//! Absence: missing power at rest, and more than in proportion to the load.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct ConverterQuadratic;

static SPEC: EffectSpec = EffectSpec {
    id: "converter_quadratic",
    title: "Converter loss: fixed, proportional, resistive",
    system: System::Robot,
    phase: Phase::Converter,
    channel: Channel::PowerW,
    needs: &[],
    equation: "P_in = P0 + (1 + p) P + q P^2",
    source: "polynomial loss of switch-mode converters; Kottas, Eq. 4.1 with the loss put right",
    validity: "output voltage constant; one input voltage",
    signature: "missing power that bends upwards with the load",
    matters: 0.02,
    confused_with: &[("converter", "logs at three different loads"), ("idle", "logs at two different loads")],
    parameters: &[
        ParameterSpec {
            name: "fixed_w",
            meaning: "P0: power at no load",
            default: 0.05,
            null: Some(0.0),
            min: 0.0,
            max: 10.0,
            source: "guess: a few mA at 12 V",
        },
        ParameterSpec {
            name: "proportional",
            meaning: "p: loss in proportion to the output power",
            default: 0.06,
            null: Some(0.0),
            min: 0.0,
            max: 2.0,
            source: "guess: diode of 0.3 V at 5 V out",
        },
        ParameterSpec {
            name: "quadratic_per_w",
            meaning: "q: loss with the square of the output power",
            default: 0.005,
            null: Some(0.0),
            min: 0.0,
            max: 0.5,
            source: "guess: 0.1 ohm at 5 V out is 0.004 / W",
        },
    ],
    states: &[],
};

impl Physics for ConverterQuadratic {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let [fixed_w, proportional, quadratic_per_w] = [own.parameters[0], own.parameters[1], own.parameters[2]];
        let output_w = channels[Channel::PowerW];
        channels.add(Channel::PowerW, fixed_w + (proportional + quadratic_per_w * output_w) * output_w);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn input_w(parameters: [f64; 3], output_w: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::PowerW] = output_w;
        step_once(&ConverterQuadratic, &Facts::robot(), 1.0, &parameters, &mut [], &mut channels);
        channels[Channel::PowerW]
    }

    #[test]
    fn it_is_the_polynomial_of_the_output_current() {
        // 5 V out, P0 0.1 W, a 5.3 V, b 0.2 ohm: 2 A take 0.1 + 10.6 + 0.8 = 11.5 W.
        assert!((input_w([0.1, 5.3 / 5.0 - 1.0, 0.2 / 25.0], 10.0) - 11.5).abs() < 1e-12);
        assert_eq!(input_w([0.0, 0.0, 0.0], 7.0), 7.0);
        assert_eq!(input_w([0.1, 0.5, 0.5], 0.0), 0.1);
    }

    /// A measured 12 V buck-boost converter (github jorge-pais/PE_universal12Vsupply): 0.41 A in at
    /// 6.063 W out, 0.75 A at 12.128 W: 0.0561 A per W. The line through them leaves 0.07 A at no
    /// load: the fixed part that a plain efficiency lacks. The input voltage is not recorded; 18.5 V, a
    /// guess, only scales the watts.
    #[test]
    fn a_fixed_part_explains_a_measured_converter_at_light_load() {
        let (input_v, slope) = (18.5, (0.75 - 0.41) / (12.128 - 6.063));
        let fixed_w = (0.41 - slope * 6.063) * input_v;
        let parameters = [fixed_w, slope * input_v - 1.0, 0.0];
        // Measured at 0.727 W out: 0.13 A.
        assert!((input_w(parameters, 0.727) / input_v - 0.13).abs() < 0.025);
        assert!((input_w([0.0, 0.75 * input_v / 12.128 - 1.0, 0.0], 0.727) / input_v - 0.13).abs() > 0.08);
    }
}
