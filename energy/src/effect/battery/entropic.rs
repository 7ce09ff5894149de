//! Entropic coefficient: the equilibrium voltage moves with temperature, and heat comes with it.
//!
//! `U(SoC, T) = U(SoC, T_ref) + u(SoC) (T - T_ref)`, where u = dU/dT in V/K per cell is linearly
//! interpolated between five knots over SoC (states of charge 0, 0.25, 0.5, 0.75, 1), T in °C is
//! the temperature inside the cell and T_ref = 25 °C is that of the OCV table.
//!
//! Thermodynamics ties a heat to the same coefficient, `-I T u` in W per cell (T in K, I in A,
//! discharge positive): with u < 0 a discharge warms and a charge cools. The effect therefore
//! only states u on its channel; the battery's step puts it into the heat balance beside the
//! losses (Bernardi et al. 1985, doi 10.1149/1.2113792). So one coefficient makes both, and no
//! model can have the one without the other.
//!
//! Absence: at rest the residual follows the temperature, with a sign that depends on SoC only;
//! a warming cell's temperature residual changes sign between charge and discharge.

use crate::units::REFERENCE_DEGC;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Entropic;

/// Knots, evenly spaced from empty to full.
const KNOTS: usize = 5;

macro_rules! knot {
    ($name:literal, $default:literal) => {
        ParameterSpec {
            name: $name,
            meaning: "change of one cell's equilibrium voltage with temperature, at this SoC",
            default: $default,
            null: Some(0.0),
            min: -2e-3,
            max: 2e-3,
            source: "LiCoO2 minus graphite of the Enertech cell: Ai et al. 2020, doi 10.1149/2.0122001JES; range: guess",
        }
    };
}

static SPEC: EffectSpec = EffectSpec {
    id: "entropic",
    title: "Entropic coefficient dU/dT and reversible heat",
    system: System::Battery,
    phase: Phase::Equilibrium,
    channel: Channel::OcvV,
    needs: &[Channel::TemperatureDegc],
    equation: "U += u(SoC) (T - 25 degC); heat += -I T u(SoC); u linear between SoC 0, 0.25, 0.5, 0.75, 1",
    source: "Bernardi et al. 1985, doi 10.1149/1.2113792; Kottas, Eq. C.8 (entropy of the reaction)",
    validity: "SoC 0..1, held constant outside; -20..60 degC; one relaxed temperature in the cell",
    signature: "the rest voltage follows temperature; the heat of charge and discharge differs",
    matters: 1e-3,
    confused_with: &[("voltage_offset", "rests at least 10 K apart")],
    parameters: &[
        knot!("entropy_soc_000_v_per_k", -4.5e-4),
        knot!("entropy_soc_025_v_per_k", -4.2e-4),
        knot!("entropy_soc_050_v_per_k", -2.5e-4),
        knot!("entropy_soc_075_v_per_k", -1.8e-4),
        knot!("entropy_soc_100_v_per_k", -5.0e-5),
    ],
    states: &[],
};

impl Physics for Entropic {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        const LAST: f64 = (KNOTS - 1) as f64;
        let soc = channels[Channel::Soc];
        let knots: &[S; KNOTS] = own.parameters.try_into().expect("one parameter per knot");
        // A float becomes an index by saturation: below empty 0.
        let low = ((soc.re() * LAST) as usize).min(KNOTS - 2);
        let share = if (0.0..=1.0).contains(&soc.re()) { soc * LAST - low as f64 } else { S::from(if soc.re() > 1.0 { 1.0 } else { 0.0 }) };
        let entropy_v_per_k = knots[low] + (knots[low + 1] - knots[low]) * share;
        channels.add(Channel::EntropyVPerK, entropy_v_per_k);
        channels.add(Channel::OcvV, entropy_v_per_k * (channels[Channel::CellDegc] - REFERENCE_DEGC));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;
    use crate::{Model, Run, Start};
    use std::sync::Arc;

    /// Charge of a mole of electrons, C.
    const FARADAY_C_PER_MOL: f64 = 96_485.332;
    /// Entropy of the whole reaction of a LiCoO2/graphite battery that discharges from full, and
    /// the heat that goes with it at 25 degC: Huang, Yan, Jiang 2006, J. Power Sources 156, 541.
    const ENTROPY_J_PER_MOL_K: f64 = -29.78;
    const HEAT_J_PER_MOL: f64 = 8874.0;

    #[test]
    fn interpolates_between_knots_and_holds_outside() {
        let shift_v = |soc: f64, degc: f64| {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::Soc] = soc;
            channels[Channel::CellDegc] = degc;
            step_once(&Entropic, &Facts::robot(), 1.0, &[-4e-4, -2e-4, 0.0, 2e-4, 6e-4], &mut [], &mut channels);
            channels[Channel::OcvV]
        };
        assert_eq!(shift_v(0.4, 25.0), 0.0);
        assert!((shift_v(0.125, 35.0) + 3e-3).abs() < 1e-15);
        assert!((shift_v(0.875, 15.0) + 4e-3).abs() < 1e-15);
        assert!((shift_v(-0.3, 35.0) + 4e-3).abs() < 1e-15);
        assert!((shift_v(1.0, 35.0) - 6e-3).abs() < 1e-15 && (shift_v(1.3, 35.0) - 6e-3).abs() < 1e-15);
    }

    #[test]
    fn the_default_averages_to_the_entropy_measured_for_this_chemistry() {
        let knots: Vec<f64> = SPEC.parameters.iter().map(|p| p.default).collect();
        let mean = knots.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0).sum::<f64>() / (KNOTS - 1) as f64;
        let measured = ENTROPY_J_PER_MOL_K / FARADAY_C_PER_MOL;
        assert!((mean / measured - 1.0).abs() < 0.15, "{mean} and {measured} V/K");
    }

    #[test]
    fn a_discharge_gives_the_measured_reversible_heat_and_a_charge_takes_it() {
        let per_k = ENTROPY_J_PER_MOL_K / FARADAY_C_PER_MOL;
        let mut text = r#"
            schema = 1
            system = "battery"
            name = "one cell"
            battery = { series = 1, parallel = 1, capacity_ah = 2.0, full_v_per_cell = 4.2, eod_v_per_cell = 3.0, charge_current_a = 2.0, charge_cutoff_a = 0.1, ocv = { soc = [0.0, 1.0], voltage_v = [3.0, 4.2] } }
            [[effect]]
            id = "entropic"
        "#
        .to_owned();
        for p in SPEC.parameters {
            text += &format!("{} = {{ value = {per_k:e}, source = \"test\" }}\n", p.name);
        }
        let model = Arc::new(Model::parse("test", &text, &|_| unreachable!()).unwrap());
        let mut run = Run::new(model, Start::at_soc(0.6));
        for current_a in [1.0, -1.0] {
            run.channels[Channel::CurrentA] = current_a;
            run.step(1.0);
            let measured_w = current_a * HEAT_J_PER_MOL / FARADAY_C_PER_MOL;
            assert!((run.channels[Channel::HeatW] / measured_w - 1.0).abs() < 1e-3, "{}", run.channels[Channel::HeatW]);
        }
    }
}
