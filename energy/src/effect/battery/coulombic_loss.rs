//! Coulombic loss: a share of the charge that goes in does not stay.
//!
//! `I_lost = (l_0 + l_1 SoC²) |I|` in A per cell while the cell is charged (I < 0), zero
//! otherwise; l_0 and l_1 are shares. Side reactions eat the charge, and eat more as the cell
//! fills and its electrodes reach more reactive potentials; the square is a guess at that rise.
//! The coulombic efficiency at a state of charge is 1 - l_0 - l_1 SoC². The state of charge is
//! that at the start of the step.
//!
//! Absence: the state of charge is overestimated after every charge, by the same share.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct CoulombicLoss;

static SPEC: EffectSpec = EffectSpec {
    id: "coulombic_loss",
    title: "Coulombic loss on charge",
    system: System::Battery,
    phase: Phase::Current,
    channel: Channel::LostCurrentA,
    needs: &[Channel::CurrentA],
    equation: "I_lost = (l_0 + l_1 SoC^2) |I| while I < 0",
    source: "definition of coulombic efficiency; the rise with SoC is a guess at its form",
    validity: "charge below the charger's end voltage; SoC 0..1, held outside",
    signature: "the SoC error grows by a share of the charge throughput, towards overestimation",
    matters: 1e-3,
    confused_with: &[
        ("current_gain", "a discharge from full to empty without a charge before it"),
        ("self_discharge", "the same charge at two currents"),
        ("current_offset", "the same charge at two currents"),
    ],
    parameters: &[
        ParameterSpec {
            name: "loss_share",
            meaning: "share of the charge current that is lost at any SoC",
            default: 1e-3,
            null: Some(0.0),
            min: 0.0,
            max: 0.2,
            source: "coulombic efficiency of Li-ion cells above 0.99, of good ones 0.998-0.9995",
        },
        ParameterSpec {
            name: "loss_share_full",
            meaning: "share that is lost in addition when full; falls with the square of SoC",
            default: 1e-3,
            null: Some(0.0),
            min: 0.0,
            max: 0.2,
            source: "guess: of the order of the loss at any SoC",
        },
    ],
    states: &[],
};

impl Physics for CoulombicLoss {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let current_a = channels[Channel::CellCurrentA];
        if current_a.re() < 0.0 {
            let soc = channels[Channel::Soc];
            let soc = if (0.0..=1.0).contains(&soc.re()) { soc } else { S::from(soc.re().clamp(0.0, 1.0)) };
            let share = own.parameters[0] + own.parameters[1] * soc * soc;
            channels.add(Channel::LostCurrentA, -share * current_a);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;
    use crate::{Model, Run, Start};
    use std::sync::Arc;

    #[test]
    fn loses_on_charge_only_and_most_when_full() {
        let lost_a = |current_a: f64, soc: f64| {
            let mut channels = Channels::filled(0.0_f64);
            channels[Channel::CellCurrentA] = current_a;
            channels[Channel::Soc] = soc;
            step_once(&CoulombicLoss, &Facts::robot(), 1.0, &[0.01, 0.02], &mut [], &mut channels);
            channels[Channel::LostCurrentA]
        };
        assert_eq!(lost_a(2.0, 0.5), 0.0);
        assert!((lost_a(-2.0, 0.5) - 2.0 * 0.015).abs() < 1e-15);
        assert!((lost_a(-2.0, 1.2) - 2.0 * 0.03).abs() < 1e-15);
        assert!((lost_a(-2.0, -0.1) - 2.0 * 0.01).abs() < 1e-15);
    }

    #[test]
    fn a_cycle_at_defaults_has_the_efficiency_of_a_good_cell() {
        // High-precision coulometry of commercial Li-ion cells: 0.998 to 0.9995 (Smith, Burns, Dahn 2010,
        // J. Electrochem. Soc. 157, A196).
        let text = r#"
            schema = 1
            system = "battery"
            name = "one cell"
            battery = { series = 1, parallel = 1, capacity_ah = 1.0, full_v_per_cell = 4.2, eod_v_per_cell = 3.0, charge_current_a = 1.0, charge_cutoff_a = 0.05, ocv = { soc = [0.0, 1.0], voltage_v = [3.0, 4.2] } }
            [[effect]]
            id = "coulombic_loss"
        "#;
        let model = Arc::new(Model::parse("test", text, &|_| unreachable!()).unwrap());
        let mut run = Run::new(model, Start::at_soc(0.0));
        for _ in 0..3600 {
            run.channels[Channel::CurrentA] = -1.0;
            run.step(1.0);
        }
        let efficiency = run.channels[Channel::Soc];
        assert!((0.998..0.9995).contains(&efficiency), "{efficiency}");
        // By hand: 1 - l_0 - l_1 / 3.
        assert!((efficiency - (1.0 - 1e-3 - 1e-3 / 3.0)).abs() < 1e-5);
    }
}
