//! Resistance between the active pack and the station's converters.
//!
//! `P_pack = P + R I^2` with `I = P_pack / V_pack`: solved for the power out of the pack,
//! `P_pack = 2 P / (1 + sqrt(1 - 4 R P / V_pack^2))`, in W, with `R` in ohm: leads, connectors,
//! fuse and the transistors of the battery selector, two in series per pack (Kottas, Fig. B.8).
//! `V_pack` is the pack's voltage (V) at its own terminals, where its gauge sits. Beyond
//! `V^2 / (4 R)` no current delivers the power; there the effect stays at twice the power, and the
//! pack's protection has long acted. Where no voltage is known (0 V) the effect is left out.
//!
//! Absence: missing power in the square of the pack's current, whatever takes it: growing as the
//! pack's voltage sags.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct PackWiring;

static SPEC: EffectSpec = EffectSpec {
    id: "pack_wiring",
    title: "Wiring and selector switch of the active pack",
    system: System::Station,
    phase: Phase::Overhead,
    channel: Channel::PackPowerW,
    needs: &[Channel::PackVoltageV],
    equation: "P_pack = P + R (P_pack / V_pack)^2",
    source: "Joule's law; Kottas, Fig. B.8 (battery selector)",
    validity: "one resistance for every pack's path; 4 R P < V_pack^2",
    signature: "missing power in the square of the pack's current, growing as its voltage sags",
    matters: 0.1,
    confused_with: &[
        ("converter_curve", "measure the voltage at the converter's input"),
        ("charger_curve", "measure the voltage at the converter's input"),
    ],
    parameters: &[ParameterSpec {
        name: "wiring_ohm",
        meaning: "resistance from the pack's terminals to the converters' input",
        default: 0.04,
        null: Some(0.0),
        min: 0.0,
        max: 1.0,
        source: "two selector transistors of 5-15 milliohm, connector and leads: 20-80 milliohm",
    }],
    states: &[],
};

/// Least voltage that counts as known, V.
const KNOWN_V: f64 = 0.5;
/// Least of the root's argument: the slope stays finite at the power limit.
const ROOT_MIN: f64 = 1e-6;

impl Physics for PackWiring {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let (load_w, pack_v) = (channels[Channel::PackPowerW], channels[Channel::PackVoltageV]);
        if pack_v.re() <= KNOWN_V {
            return;
        }
        let under = S::from(1.0) - own.parameters[0] * load_w * 4.0 / (pack_v * pack_v);
        let under = if under.re() < ROOT_MIN { S::from(ROOT_MIN) } else { under };
        channels[Channel::PackPowerW] = load_w * 2.0 / (under.sqrt() + 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn pack_w(wiring_ohm: f64, load_w: f64, pack_v: f64) -> f64 {
        let mut channels = Channels::filled(0.0);
        channels[Channel::PackPowerW] = load_w;
        channels[Channel::PackVoltageV] = pack_v;
        step_once(&PackWiring, &Facts::Station, 1.0, &[wiring_ohm], &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn five_amperes_through_a_tenth_of_an_ohm_by_hand() {
        // 12 V x 5 A = 60 W at the pack, 2.5 W of it in 0.1 ohm: 57.5 W arrive.
        assert!((pack_w(0.1, 57.5, 12.0) - 60.0).abs() < 1e-9);
        assert!((pack_w(0.0, 57.5, 12.0) - 57.5).abs() < 1e-12);
        assert!((pack_w(0.1, 57.5, 0.0) - 57.5).abs() < 1e-12, "no voltage known");
    }

    /// Maximum power transfer (Jacobi's law): a source of 12 V behind 0.1 ohm gives at most
    /// 12^2 / 0.4 = 360 W, and then half of what leaves the pack is lost.
    #[test]
    fn at_the_most_power_half_is_lost_and_beyond_it_nothing_breaks() {
        assert!((pack_w(0.1, 360.0, 12.0) / 720.0 - 1.0).abs() < 2e-3);
        assert!(pack_w(1.0, 1e4, 1.0).is_finite());
    }
}
