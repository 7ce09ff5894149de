//! Relaxation that takes longer in a cold cell, with an activation energy of its own.
//!
//! `tau(T) = tau(T_ref) exp(E_a / R_gas (1/T - 1/T_ref))`, T in K, T_ref = 25 °C, for the time
//! constants of pairs and ladders and for the diffusion time of particles, whose depth at a steady
//! current goes with it. A Warburg impedance has no time of its own and stays. How *much* relaxes
//! is `polarisation_arrhenius`: a pair whose resistance follows the temperature and whose
//! capacitance does not has the same energy in both, since `tau = R C`; of particles, this effect
//! has both in one (and `polarisation_arrhenius` beside it makes their share larger still).
//!
//! Absence: after a current step the residual of a cold cell relaxes with the other sign than
//! that of a warm one; that of pairs and ladders ends where it began.

use super::arrhenius;
use crate::real::exp;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct RelaxationArrhenius;

static SPEC: EffectSpec = EffectSpec {
    id: "relaxation_arrhenius",
    title: "Time constants over temperature",
    system: System::Battery,
    phase: Phase::Polarisation,
    channel: Channel::OverpotentialV,
    needs: &[Channel::CurrentA, Channel::TemperatureDegc],
    equation: "tau = tau(T_ref) exp(Ea / R (1/T - 1/T_ref))",
    source: "Arrhenius law on rates: charge transfer and diffusion, Waag, Kaebitz and Sauer, Applied Energy 102 (2013) 885",
    validity: "cells of -40 to 100 degC, held constant outside; one energy for all relaxations of a cell, none for a Warburg element",
    signature: "after each current step the residual rises and comes back to zero (of pairs), with opposite signs in a cold and a warm cell",
    matters: 1e-3,
    confused_with: &[("polarisation_arrhenius", "current steps at two temperatures, each held until the voltage of the pairs has settled")],
    parameters: &[ParameterSpec {
        name: "activation_kj_per_mol",
        meaning: "activation energy of the relaxations' rate",
        default: 30.0,
        null: Some(0.0),
        min: 0.0,
        max: 80.0,
        source: "20-60 kJ/mol as for polarisation; range: desolvation at graphite needs 53-59 (Abe et al., J. Electrochem. Soc. 151 (2004) A1120)",
    }],
    states: &[],
};

/// Share of the way that a relaxation leaves over a step whose exponent at the reference temperature, `-dt / tau`, is this.
#[inline(always)]
pub(crate) fn left<S: Real>(exponent: S, slowness: S) -> S {
    exp(exponent / slowness)
}

/// How many times longer relaxations take than at the reference temperature, if the temperature counts.
#[inline(always)]
pub(crate) fn slowness<S: Real>(channels: &Channels<S>) -> Option<S> {
    let logarithm = channels[Channel::LogRelaxationTime];
    (logarithm.re() != 0.0 || !logarithm.stands_still()).then(|| exp(logarithm))
}

impl Physics for RelaxationArrhenius {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels[Channel::LogRelaxationTime] = arrhenius::exponent(own.parameters[0], channels[Channel::CellDegc]);
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::cell;
    use crate::{Channel, Run, Start};

    type Effects<'a> = &'a [(&'a str, &'a [(&'a str, f64)])];

    fn under_1_a(effects: Effects<'_>, temperature_degc: f64) -> Run<f64> {
        let mut run = cell(1, effects, Start { temperature_degc, ..Start::at_soc(0.9) });
        run.channels[Channel::CurrentA] = 1.0;
        run
    }

    fn after_v(effects: Effects<'_>, temperature_degc: f64, seconds: f64) -> f64 {
        let mut run = under_1_a(effects, temperature_degc);
        run.step(seconds);
        run.channels[Channel::OverpotentialV]
    }

    /// 52.9 kJ/mol: 52900 / 8.314463 x (1/308.15 - 1/298.15) = 6362.41 x -1.088430e-4 = -0.692504, whose exponential is 0.50032.
    const HALVES_IN_10_K: f64 = 0.500_32;

    #[test]
    fn fifty_three_kilojoules_per_mole_halve_a_time_constant_in_ten_kelvin_and_leave_where_it_ends() {
        let effects: Effects<'_> =
            &[("rc1", &[("resistance_ohm", 0.02), ("tau_s", 100.0)]), ("relaxation_arrhenius", &[("activation_kj_per_mol", 52.9)])];
        let way = 1.0 - (-1f64).exp();
        assert!((after_v(effects, 25.0, 100.0) - 0.02 * way).abs() < 1e-12);
        assert!((after_v(effects, 35.0, 100.0 * HALVES_IN_10_K) - 0.02 * way).abs() < 1e-7);
        assert!((after_v(effects, 35.0, 1e5) - 0.02).abs() < 1e-12);
        assert!((after_v(effects, -10.0, 1e5) - 0.02).abs() < 1e-12);
        // A step of 1,000 time constants at 25 degC, of which nothing would be left: at -40 degC, 52900 / 8.314463 x (1/233.15 - 1/298.15)
        // = 5.94939, they are 1000 / 383.52 = 2.60743.
        assert!((after_v(effects, -40.0, 1e5) - 0.02 * (1.0 - (-2.607_43f64).exp())).abs() < 1e-6);
    }

    /// A capacitor that the temperature leaves alone takes up `I t / C` at first, whatever its resistance does: R and tau have one
    /// energy.
    #[test]
    fn with_one_energy_for_resistance_and_time_the_capacitance_is_one_too() {
        let effects: Effects<'_> = &[
            ("rc1", &[("resistance_ohm", 0.02), ("tau_s", 100.0)]),
            ("polarisation_arrhenius", &[("activation_kj_per_mol", 40.0)]),
            ("relaxation_arrhenius", &[("activation_kj_per_mol", 40.0)]),
        ];
        let capacitance_f = 100.0 / 0.02;
        for temperature_degc in [-10.0, 10.0, 25.0, 45.0] {
            let ratio = after_v(effects, temperature_degc, 0.01) / (0.01 / capacitance_f);
            assert!((ratio - 1.0).abs() < 5e-4, "{temperature_degc}: {ratio}");
        }
    }

    /// At one temperature the effect is nothing but other numbers: a ladder, and particles, of which all times are as long.
    #[test]
    fn ladders_and_particles_at_a_temperature_are_those_of_other_times_at_the_reference() {
        let warm = |id: &'static str, shape: &[(&str, f64)], time: &'static str, reference_s: f64| {
            let with = |tau_s: f64| [shape, &[(time, tau_s)]].concat();
            let (slow, fast) = (with(reference_s), with(reference_s * HALVES_IN_10_K));
            let warm: Effects<'_> = &[(id, &slow), ("relaxation_arrhenius", &[("activation_kj_per_mol", 52.9)])];
            let as_fast: Effects<'_> = &[(id, &fast)];
            let (mut warm, mut as_fast) = (under_1_a(warm, 35.0), under_1_a(as_fast, 35.0));
            for step in 0..60 {
                if step == 30 {
                    (warm.channels[Channel::CurrentA], as_fast.channels[Channel::CurrentA]) = (-0.5, -0.5);
                }
                warm.step(10.0);
                as_fast.step(10.0);
                let (ours, theirs) = (warm.channels[Channel::OverpotentialV], as_fast.channels[Channel::OverpotentialV]);
                assert!((ours - theirs).abs() < 1e-7 && theirs.abs() > 1e-5, "{id}, step {step}: {ours} {theirs}");
            }
        };
        warm("rc_ladder", &[("resistance_ohm", 0.02), ("spread", 0.3)], "tau_s", 100.0);
        warm("surface_diffusion", &[("share", 1.0)], "tau_d_s", 1000.0);
    }

    #[test]
    fn a_warburg_impedance_has_no_time_of_its_own() {
        let warburg: Effects<'_> = &[("warburg", &[("z0_ohm_per_sqrt_s", 5e-4)])];
        let both: Effects<'_> =
            &[("warburg", &[("z0_ohm_per_sqrt_s", 5e-4)]), ("relaxation_arrhenius", &[("activation_kj_per_mol", 60.0)])];
        assert_eq!(after_v(warburg, 0.0, 60.0), after_v(both, 0.0, 60.0));
    }
}
