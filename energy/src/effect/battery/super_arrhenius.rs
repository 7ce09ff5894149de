//! Resistance that rises faster in the cold than Arrhenius' law says.
//!
//! `V = V_series exp(c / R_gas (T_ref - T) (1/T - 1/T_ref))`, T in K, T_ref = 25 °C: an activation energy of
//! `E_a + c (T_ref - T)`, of which `arrhenius` is the part at the reference temperature. Organic electrolytes
//! conduct by the law of Vogel, Fulcher and Tammann, `exp(B / (T - T_0))`, whose logarithm over 1/T bends upwards like
//! that, and so does that of two resistances in series with unlike energies; in parallel they bend it downwards (c < 0).
//!
//! Absence: beside a fitted `arrhenius` the residual under load has one sign at the coldest and warmest logs and the
//! other between them.

use super::arrhenius::kelvin;
use crate::real::exp;
use crate::units::{GAS_CONSTANT_J_PER_MOL_K, J_PER_KJ, KELVIN_AT_0_DEGC, REFERENCE_DEGC};
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct SuperArrhenius;

static SPEC: EffectSpec = EffectSpec {
    id: "super_arrhenius",
    title: "Series resistance that bends over 1/T",
    system: System::Battery,
    phase: Phase::Series,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA, Channel::TemperatureDegc],
    equation: "V = V_series exp(c / R (T_ref - T) (1/T - 1/T_ref))",
    source: "second order of the law of Vogel, Fulcher and Tammann about T_ref",
    validity: "cells of -40 to 100 degC, held constant outside; near T_ref the law itself bends otherwise",
    signature: "beside arrhenius, the residual under load has one sign at both ends of the temperatures and the other between",
    matters: 1e-3,
    confused_with: &[
        ("arrhenius", "discharges at three temperatures, 10 K apart each"),
        ("contact_resistance", "a discharge of the coldest cell with the voltage measured on both sides of the connector"),
    ],
    parameters: &[ParameterSpec {
        name: "activation_rise_kj_per_mol_k",
        meaning: "c: rise of the activation energy per kelvin of cooling",
        default: 0.1,
        null: Some(0.0),
        min: -0.5,
        max: 1.0,
        source: "theory: R B T_0 T_ref / (T_ref - T_0)^3 is 0.08 for B = 300 K and T_0 = 180 K, of the order of carbonate electrolytes",
    }],
    states: &[],
};

impl Physics for SuperArrhenius {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        const REFERENCE_K: f64 = REFERENCE_DEGC + KELVIN_AT_0_DEGC;
        let kelvin = kelvin(channels[Channel::CellDegc]);
        let below_k = -kelvin + REFERENCE_K;
        let exponent = own.parameters[0] * (J_PER_KJ / GAS_CONSTANT_J_PER_MOL_K / REFERENCE_K) * below_k * below_k / kelvin;
        channels[Channel::OverpotentialV] *= exp(exponent);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn factor(rise_kj_per_mol_k: f64, cell_degc: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        (channels[Channel::OverpotentialV], channels[Channel::CellDegc]) = (1.0, cell_degc);
        step_once(&SuperArrhenius, &Facts::robot(), 1.0, &[rise_kj_per_mol_k], &mut [], &mut channels);
        channels[Channel::OverpotentialV]
    }

    /// 100 / 8.314463 x 25^2 / (273.15 x 298.15) = 0.092302, whose exponential is 1.09670, at 0 °C.
    #[test]
    fn a_tenth_of_a_kilojoule_per_kelvin_is_a_tenth_more_at_0_degc() {
        assert!((factor(0.1, 0.0) - 1.096_70).abs() < 1e-5, "{}", factor(0.1, 0.0));
        assert_eq!(factor(0.1, 25.0), 1.0);
        assert_eq!(factor(0.0, -10.0), 1.0);
    }

    /// Vogel, Fulcher and Tammann with B = 300 K and T_0 = 180 K about 25 °C: ln of the ratio is B / (T - T_0) less
    /// that at T_ref. Arrhenius with the slope there, E_a = R B T_ref^2 / (T_ref - T_0)^2, and this effect with the bend
    /// leave a twentieth of what Arrhenius alone leaves at 10 °C.
    #[test]
    fn with_arrhenius_it_follows_vogel_fulcher_and_tammann() {
        let (b, zero_k, reference_k, kelvin) = (300.0, 180.0, 298.15, 283.15);
        let law = b / (kelvin - zero_k) - b / (reference_k - zero_k);
        let slope = b * (reference_k / (reference_k - zero_k)).powi(2);
        let line = slope * (1.0 / kelvin - 1.0 / reference_k);
        // Half the second derivative by 1/T, times (1/T - 1/T_ref)^2, as a rise per kelvin.
        let bend = b * zero_k * (reference_k / (reference_k - zero_k)).powi(3);
        let rise = bend * GAS_CONSTANT_J_PER_MOL_K / J_PER_KJ / (kelvin * reference_k);
        let left = law - line - factor(rise, kelvin - KELVIN_AT_0_DEGC).ln();
        assert!(left.abs() < 0.15 * (law - line), "{left} of {}", law - line);
    }
}
