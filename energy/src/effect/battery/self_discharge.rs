//! Self-discharge: charge that is lost inside the cell whether or not it is used.
//!
//! `I_leak = (loss per month / 30 d) Q exp(-E_a / R_gas (1/T - 1/T_ref))`, added to the current
//! through the cell, never to the terminals. Kottas, section 3.1: at most 3 % of capacity a month
//! (57 mAh for 1900 mAh). T in K is the temperature inside the cell, T_ref = 25 °C, E_a the
//! activation energy of the side reactions that leak, in kJ/mol. E_a is 0 where it is not stated:
//! most logs rest at one temperature and say nothing about it.
//!
//! Absence: after weeks of rest the state of charge is overestimated; with a wrong E_a, in the
//! warm and the cold with unlike signs.

use super::arrhenius;
use crate::units::{DAYS_PER_MONTH, S_PER_DAY, S_PER_H};
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct SelfDischarge;

static SPEC: EffectSpec = EffectSpec {
    id: "self_discharge",
    title: "Self-discharge",
    system: System::Battery,
    phase: Phase::Current,
    channel: Channel::LostCurrentA,
    needs: &[],
    equation: "I_leak = loss_per_month Q / 30 d exp(-Ea / R (1/T - 1/T_ref))",
    source: "Kottas, section 3.1; temperature: the law of Arrhenius, as in Kottas, Eq. C.5",
    validity: "cells of -40 to 100 degC, held constant outside; constant over SoC",
    signature: "SoC drifts down at rest over days to weeks",
    matters: 1e-4,
    confused_with: &[],
    parameters: &[
        ParameterSpec {
            name: "loss_per_month",
            meaning: "share of capacity lost in 30 days at 25 degC",
            default: 0.03,
            null: Some(0.0),
            min: 0.0,
            max: 0.3,
            source: "Kottas, section 3.1: <= 3 % a month for the LiPo cells used",
        },
        ParameterSpec {
            name: "activation_kj_per_mol",
            meaning: "activation energy of the loss; 0 is a loss that does not follow the temperature",
            default: 0.0,
            null: Some(0.0),
            min: 0.0,
            max: 100.0,
            source: "about 53 where the loss doubles with every 10 K, as a rule of thumb says (Battery University BU-802b)",
        },
    ],
    states: &[],
};

impl Physics for SelfDischarge {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let hours_per_month = DAYS_PER_MONTH * S_PER_DAY / S_PER_H;
        let cell_capacity_ah = channels[Channel::CapacityAh] / f64::from(facts.parallel());
        let at_reference_a = own.parameters[0] * cell_capacity_ah * (1.0 / hours_per_month);
        // What conducts worse in the cold by this factor leaks less by it.
        let faster = arrhenius::factor(-own.parameters[1], channels[Channel::CellDegc]);
        channels.add(Channel::LostCurrentA, at_reference_a * faster);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::{cell, step_once};
    use crate::{Channel, Start};

    /// Kottas, section 3.1: 3 % a month, "for 1900 mAh cells, this corresponds to a capacity
    /// reduction of 57 mAh".
    #[test]
    fn a_month_costs_a_1900_mah_cell_57_mah() {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::CapacityAh] = 1.9;
        step_once(&SelfDischarge, &Facts::robot(), 1.0, &[0.03, 0.0], &mut [], &mut channels);
        assert!((channels[Channel::LostCurrentA] * 30.0 * 24.0 - 0.057).abs() < 1e-12);
    }

    fn leak_a(activation_kj_per_mol: f64, cell_degc: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::CapacityAh] = 1.9;
        channels[Channel::CellDegc] = cell_degc;
        step_once(&SelfDischarge, &Facts::robot(), 1.0, &[0.03, activation_kj_per_mol], &mut [], &mut channels);
        channels[Channel::LostCurrentA]
    }

    /// By hand, at 0 °C and 45 kJ/mol: 45000 / 8.314463 x (1/273.15 - 1/298.15) = 1.66143, whose
    /// exponential is 5.26684. Without an activation energy nothing follows the temperature.
    #[test]
    fn a_cold_cell_leaks_less_and_a_cell_without_activation_energy_the_same() {
        assert!((leak_a(45.0, 25.0) / leak_a(45.0, 0.0) - 5.26684).abs() < 1e-5);
        assert_eq!(leak_a(0.0, -10.0), leak_a(0.0, 60.0));
    }

    /// Battery University BU-802b: the rate of self-discharge typically doubles with every 10 °C.
    #[test]
    fn at_53_kj_per_mol_it_doubles_with_every_ten_kelvin_as_the_rule_of_thumb_says() {
        for degc in [15.0, 25.0, 35.0] {
            let times = leak_a(53.0, degc + 10.0) / leak_a(53.0, degc);
            assert!((times - 2.0).abs() < 0.18, "{times} from {degc} degC");
        }
    }

    #[test]
    fn it_empties_the_cell_at_rest_and_never_shows_at_the_terminals() {
        let soc_after = |loss_per_month: f64| {
            let mut run = cell(1, &[("self_discharge", &[("loss_per_month", loss_per_month)])], Start::at_soc(1.0));
            (0..30).for_each(|_| run.step(86_400.0));
            assert_eq!(run.channels[Channel::TerminalCurrentA], 0.0);
            run.channels[Channel::Soc]
        };
        assert!((soc_after(0.03) - 0.97).abs() < 1e-12 && (soc_after(0.0) - 1.0).abs() < 1e-15);
    }
}
