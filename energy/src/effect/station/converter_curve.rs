//! Efficiency of the station's converters against load and pack voltage.
//!
//! `P_in = P_0 + (1 + a) P_out + R (P_out / V_in)^2`, powers in W. `P_0` is the power at no load
//! (W), `a` the loss in proportion to the load (the diode's drop over the output voltage and the
//! switching; no unit), `R` the resistance that the input current meets (switch, inductors,
//! coupling capacitor; ohm) and `V_in` the pack's voltage (V). The thesis' station has two SEPIC
//! converters of 15 V with large heat sinks (section B.2.2). In a SEPIC the first inductor carries
//! the input current and the switch that and the output current, so its loss grows as the pack
//! empties. Loss is put right as `P_in - P_out` (Kottas, Eq. 4.1 calls the output power so). A
//! model has this or `converter_efficiency`. With both, the losses come on top of each other, and `a` may be negative: a stated
//! efficiency that was a guess of the whole then holds more than the part in proportion.
//!
//! Where no voltage is known (0 V) the last term is left out.
//!
//! Absence: missing power that is not in proportion to the load, and that grows for the same load
//! as the pack's voltage falls.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct ConverterCurve;

static SPEC: EffectSpec = EffectSpec {
    id: "converter_curve",
    title: "Bay converter efficiency against load and voltage",
    system: System::Station,
    phase: Phase::Converter,
    channel: Channel::PackPowerW,
    needs: &[Channel::ChargePowerW, Channel::PackVoltageV],
    equation: "P_in = P_0 + (1 + a) P_out + R (P_out / V_in)^2",
    source: "loss polynomial of switch-mode converters: Erickson and Maksimovic, Fundamentals of Power Electronics, chapter 3; Kottas, Eq. 4.1 with the loss put right and section B.2.2 (SEPIC)",
    validity: "continuous conduction: above about a tenth of the rating; the converters share the load equally",
    signature: "missing power that grows faster than the load and as the pack's voltage falls",
    matters: 0.1,
    confused_with: &[
        ("converter_efficiency", "loads from one to all bays at one pack voltage"),
        ("charger_curve", "measure between converter and charger"),
        ("pack_wiring", "measure the voltage at the converter's input"),
    ],
    parameters: &[
        ParameterSpec {
            name: "no_load_w",
            meaning: "power of the converters at no load",
            default: 0.3,
            null: Some(0.0),
            min: 0.0,
            max: 20.0,
            source: "controller and gate drive: some 10 mA at 12 V for each of two",
        },
        ParameterSpec {
            name: "proportional_loss",
            meaning: "loss in proportion to the power to the bays; beside a converter_efficiency, beyond what that says",
            default: 0.06,
            null: Some(0.0),
            min: -0.3,
            max: 1.0,
            source: "diode drop of 0.5 V at 15 V: 0.033; switching about as much",
        },
        ParameterSpec {
            name: "series_ohm",
            meaning: "resistance that the input current meets in the converters",
            default: 0.15,
            null: Some(0.0),
            min: 0.0,
            max: 3.0,
            source: "switch, two inductors and sense resistor: 0.1-0.5 ohm, two converters in parallel",
        },
    ],
    states: &[],
};

/// Least voltage that counts as known, V.
const KNOWN_V: f64 = 0.5;

impl Physics for ConverterCurve {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let (out_w, in_v) = (channels[Channel::PackPowerW], channels[Channel::PackVoltageV]);
        let current_a = if in_v.re() > KNOWN_V { out_w / in_v } else { S::from(0.0) };
        let lost_w = own.parameters[0] + own.parameters[1] * out_w + own.parameters[2] * current_a * current_a;
        channels.add(Channel::PackPowerW, lost_w);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn in_w(parameters: [f64; 3], out_w: f64, in_v: f64) -> f64 {
        let mut channels = Channels::filled(0.0);
        channels[Channel::PackPowerW] = out_w;
        channels[Channel::PackVoltageV] = in_v;
        step_once(&ConverterCurve, &Facts::Station, 1.0, &parameters, &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn sixty_watts_at_twelve_volts_by_hand_and_more_at_nine() {
        // 0.3 + 1.06 x 60 + 0.15 x 5^2 = 67.65 W; at 9 V 0.15 x 6.667^2 = 6.667 W instead of 3.75.
        assert!((in_w([0.3, 0.06, 0.15], 60.0, 12.0) - 67.65).abs() < 1e-12);
        assert!((in_w([0.3, 0.06, 0.15], 60.0, 9.0) - (0.3 + 63.6 + 0.15 * 400.0 / 9.0)).abs() < 1e-12);
        assert!((in_w([0.3, 0.06, 0.15], 60.0, 0.0) - 63.9).abs() < 1e-12, "no voltage known");
    }

    /// Textbook: the efficiency of a source with constant, proportional and square loss is best
    /// where constant and square loss are equal, and is 1 / (1 + a + 2 sqrt(P_0 R) / V) there. For
    /// the default that is 91 % at 17 W, as SEPIC converters of this size reach (Kottas, section
    /// 4.1: converters up to 95 %), and at the load of three bays it has fallen below 90 %.
    #[test]
    fn the_default_is_best_at_light_load_and_falls_below_nine_tenths_with_three_bays() {
        let efficiency = |out_w: f64| out_w / in_w([0.3, 0.06, 0.15], out_w, 12.0);
        let best_w = 12.0 * (0.3_f64 / 0.15).sqrt();
        assert!((efficiency(best_w) - 1.0 / (1.06 + 2.0 * (0.3_f64 * 0.15).sqrt() / 12.0)).abs() < 1e-12);
        assert!(efficiency(best_w) > 0.91 && efficiency(best_w) < 0.95);
        assert!(efficiency(60.0) < 0.90 && efficiency(1.0) < 0.75);
    }
}
