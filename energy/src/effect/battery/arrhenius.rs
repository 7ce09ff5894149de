//! Resistance that falls as the cell warms.
//!
//! `R(T) = R(T_ref) exp(E_a / R_gas (1/T - 1/T_ref))`, T in K, T_ref = 25 °C, E_a the activation
//! energy in J/mol (Kottas, Eq. C.5). The factor multiplies every drop that follows the current
//! at once; the slower ones have an activation energy of their own (`polarisation_arrhenius`).
//!
//! Absence: the residual under load is positive in a cold cell and negative in a warm one.

use crate::real::exp;
use crate::units::{GAS_CONSTANT_J_PER_MOL_K, J_PER_KJ, KELVIN_AT_0_DEGC, REFERENCE_DEGC};
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Arrhenius;

/// Least and greatest temperature inside the cell that the factor follows, °C.
const RANGE_DEGC: [f64; 2] = [-40.0, 100.0];

static SPEC: EffectSpec = EffectSpec {
    id: "arrhenius",
    title: "Series resistance over temperature",
    system: System::Battery,
    phase: Phase::Series,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA, Channel::TemperatureDegc],
    equation: "V = V_series exp(Ea / R (1/T - 1/T_ref))",
    source: "Kottas, Eq. C.5",
    validity: "cells of -40 to 100 degC, held constant outside; one activation energy for electrolyte and electrodes",
    signature: "the residual under load changes sign between a cold and a warm cell",
    matters: 1e-3,
    confused_with: &[
        ("ohmic", "discharges at two temperatures 10 K apart"),
        ("polarisation_arrhenius", "current steps logged faster than the polarisation, at two temperatures"),
    ],
    parameters: &[ParameterSpec {
        name: "activation_kj_per_mol",
        meaning: "activation energy of what conducts at once",
        default: 20.0,
        null: Some(0.0),
        min: 0.0,
        max: 60.0,
        source: "10-35 kJ/mol for the series resistance of measured cells",
    }],
    states: &[],
};

/// Temperature inside the cell in K, held within the range that equations of activation follow.
#[inline]
pub(crate) fn kelvin<S: Real>(cell_degc: S) -> S {
    let [low, high] = RANGE_DEGC;
    let held_degc = if (low..=high).contains(&cell_degc.re()) { cell_degc } else { S::from(cell_degc.re().clamp(low, high)) };
    held_degc + KELVIN_AT_0_DEGC
}

/// `Ea / R (1/T - 1/T_ref)` for an activation energy in kJ/mol and a temperature in °C.
#[inline]
pub(crate) fn exponent<S: Real>(activation_kj_per_mol: S, cell_degc: S) -> S {
    const REFERENCE_K: f64 = REFERENCE_DEGC + KELVIN_AT_0_DEGC;
    let kelvin = kelvin(cell_degc);
    activation_kj_per_mol * (J_PER_KJ / GAS_CONSTANT_J_PER_MOL_K / REFERENCE_K) * (-kelvin + REFERENCE_K) / kelvin
}

/// What a resistance is multiplied by at that temperature: `exp` of the [`exponent`].
#[inline]
pub(crate) fn factor<S: Real>(activation_kj_per_mol: S, cell_degc: S) -> S {
    exp(exponent(activation_kj_per_mol, cell_degc))
}

impl Physics for Arrhenius {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let factor = factor(own.parameters[0], channels[Channel::CellDegc]);
        channels[Channel::OverpotentialV] *= factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn drop_v(activation_kj_per_mol: f64, cell_degc: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::OverpotentialV] = 0.1;
        channels[Channel::CellDegc] = cell_degc;
        step_once(&Arrhenius, &Facts::robot(), 1.0, &[activation_kj_per_mol], &mut [], &mut channels);
        channels[Channel::OverpotentialV]
    }

    #[test]
    fn does_nothing_at_the_reference_temperature_or_without_activation_energy() {
        assert_eq!(drop_v(35.0, 25.0), 0.1);
        assert_eq!(drop_v(0.0, -10.0), 0.1);
    }

    /// 20000 / 8.314463 x (1/308.15 - 1/298.15) = 2405.447 x -1.088430e-4 = -0.261816, whose
    /// exponential is 0.76965: a quarter less resistance at 35 °C.
    #[test]
    fn twenty_kilojoules_per_mole_take_a_quarter_of_the_resistance_in_ten_kelvin() {
        assert!((drop_v(20.0, 35.0) / 0.1 - 0.769_65).abs() < 1e-5, "{}", drop_v(20.0, 35.0));
    }

    /// The chemists' rule of thumb: about 53 kJ/mol double a rate from 25 to 35 °C.
    #[test]
    fn fifty_three_kilojoules_per_mole_halve_the_resistance_in_ten_kelvin() {
        assert!((drop_v(52.9, 35.0) / 0.1 - 0.5).abs() < 1e-3);
    }

    #[test]
    fn outside_its_range_the_factor_stays_what_it_is_at_the_edge() {
        assert_eq!(drop_v(60.0, -300.0), drop_v(60.0, -40.0));
        assert_eq!(drop_v(60.0, 1e6), drop_v(60.0, 100.0));
    }
}
