//! Polarisation that falls as the cell warms, with an activation energy of its own.
//!
//! `V_pol(T) = V_pol(T_ref) exp(E_a / R_gas (1/T - 1/T_ref))`, T in K, T_ref = 25 °C (Kottas,
//! Eq. C.5, on the charge-transfer and diffusion resistances). It multiplies what the pairs and
//! ladders before it have put together; their time constants are `relaxation_arrhenius`. Hysteresis comes after it.
//!
//! Absence: what relaxes after a current step is too small in a cold cell, too large in a warm one.

use super::arrhenius;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct PolarisationArrhenius;

static SPEC: EffectSpec = EffectSpec {
    id: "polarisation_arrhenius",
    title: "Polarisation over temperature",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA, Channel::TemperatureDegc],
    equation: "V = V_polarisation exp(Ea / R (1/T - 1/T_ref))",
    source: "Kottas, Eq. C.5",
    validity: "cells of -40 to 100 degC, held constant outside; time constants do not follow the temperature without `relaxation_arrhenius`",
    signature: "the part of the residual that relaxes changes sign between a cold and a warm cell",
    matters: 1e-3,
    confused_with: &[("arrhenius", "current steps logged faster than the polarisation, at two temperatures")],
    parameters: &[ParameterSpec {
        name: "activation_kj_per_mol",
        meaning: "activation energy of polarisation",
        default: 30.0,
        null: Some(0.0),
        min: 0.0,
        max: 60.0,
        source: "charge transfer needs more than conduction: 20-60 kJ/mol in impedance spectra over temperature",
    }],
    states: &[],
};

impl Physics for PolarisationArrhenius {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let factor = arrhenius::factor(own.parameters[0], channels[Channel::CellDegc]);
        channels[Channel::OverpotentialV] *= factor;
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::cell;
    use crate::{Channel, Start};

    /// What is missing of the OCV after a long discharge at 1 A and 0 °C.
    fn drop_v(activation_kj_per_mol: f64) -> f64 {
        let effects: &[(&str, &[(&str, f64)])] = &[
            ("ohmic", &[("resistance_ohm", 0.05)]),
            ("rc1", &[("resistance_ohm", 0.02), ("tau_s", 10.0)]),
            ("hysteresis", &[("amplitude_v", 10e-3), ("rate", 1000.0)]),
            ("polarisation_arrhenius", &[("activation_kj_per_mol", activation_kj_per_mol)]),
        ];
        let mut run = cell(1, effects, Start { temperature_degc: 0.0, ..Start::at_soc(0.9) });
        run.channels[Channel::CurrentA] = 1.0;
        run.step(1000.0);
        run.channels[Channel::OcvV] - run.channels[Channel::VoltageV]
    }

    /// At 0 °C, 45 kJ/mol: 45000 / 8.314463 x (1/273.15 - 1/298.15) = 1.66143, whose exponential
    /// is 5.26684. Settled: 50 mV ohmic and 10 mV hysteresis stay, 20 mV of the pair become 105.3.
    #[test]
    fn multiplies_what_is_slow_and_neither_the_ohmic_drop_nor_hysteresis() {
        assert!((drop_v(0.0) - 0.08).abs() < 1e-6, "{}", drop_v(0.0));
        assert!((drop_v(45.0) - (0.06 + 0.02 * 5.26684)).abs() < 1e-6, "{}", drop_v(45.0));
    }

    /// Van 't Hoff's rule: a reaction is twice as fast when it is 10 K warmer, which near 25 °C is
    /// an activation energy of 52.9 kJ/mol; so its polarisation is half.
    #[test]
    fn a_reaction_that_doubles_its_rate_halves_its_polarisation() {
        let settled_v = |temperature_degc: f64| {
            let effects: &[(&str, &[(&str, f64)])] =
                &[("rc1", &[("resistance_ohm", 0.02), ("tau_s", 10.0)]), ("polarisation_arrhenius", &[("activation_kj_per_mol", 52.9)])];
            let mut run = cell(1, effects, Start { temperature_degc, ..Start::at_soc(0.9) });
            run.channels[Channel::CurrentA] = 1.0;
            run.step(1000.0);
            run.channels[Channel::OverpotentialV]
        };
        assert!((settled_v(25.0) - 0.02).abs() < 1e-9, "no change at the reference temperature");
        assert!((settled_v(35.0) - 0.01).abs() < 1e-5, "{}", settled_v(35.0));
    }
}
