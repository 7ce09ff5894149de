//! Electrode balance: lost lithium shifts and shortens the open-circuit curve.
//!
//! `OCV = OCV_new(z_new)`, `z_new = z + a (1 - z) + b z`: an empty cell (z = 0) stands where the
//! new one stood at SoC a, a full one (z = 1) where it stood at SoC 1 + b. Lithium bound in the
//! anode's film slides the electrodes' curves along one another; seen from a table of the whole
//! cell, that is a shift and a stretch of its axis. What is beyond the ends of the table is its
//! end segments continued. Every effect that reads the curve at another charge than the mean one
//! (diffusion at the particles' surface, a weak cell) reads the moved curve.
//!
//! Absence: in an aged cell the residual at rest follows the slope of the OCV curve, steps and
//! plateaus included, and rests of a new cell leave none.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct ElectrodeBalance;

macro_rules! end {
    ($name:literal, $meaning:literal, $default:literal) => {
        ParameterSpec {
            name: $name,
            meaning: $meaning,
            default: $default,
            null: Some(0.0),
            min: -0.3,
            max: 0.3,
            source: "guess: some per cent of SoC at 20 % of capacity lost; range is a guess",
        }
    };
}

static SPEC: EffectSpec = EffectSpec {
    id: "electrode_balance",
    title: "Electrode balance (shifted OCV)",
    system: System::Battery,
    phase: Phase::Equilibrium,
    channel: Channel::OcvV,
    needs: &[Channel::CurrentA],
    equation: "OCV = OCV_new(z + a (1 - z) + b z)",
    source: "loss of lithium inventory as a slide of half-cell curves: Dubarry et al., J. Power Sources 219 (2012) 204; linear in SoC here",
    validity: "small shifts; a slide of one electrode changes the curve's shape in ways that a full-cell table cannot hold",
    signature: "the residual at rest follows the slope of the OCV curve",
    matters: 1e-3,
    confused_with: &[
        ("capacity_fade", "a slow discharge of the aged pack from full to empty, with rests"),
        ("hysteresis", "a long rest at one SoC reached from both sides"),
        ("current_gain", "a second ammeter beside the gauge"),
    ],
    parameters: &[
        end!("shift_empty", "a: SoC of the new curve at which the aged cell is empty", 0.02),
        end!("shift_full", "b: SoC of the new curve, less 1, at which the aged cell is full", -0.02),
    ],
    states: &[],
};

impl Physics for ElectrodeBalance {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn reads_curve(&self) -> bool {
        true
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let Facts::Battery(battery) = facts else { return };
        let soc = channels[Channel::Soc];
        (channels[Channel::OcvShiftEmpty], channels[Channel::OcvShiftFull]) = (own.parameters[0], own.parameters[1]);
        let share_v = battery.cell_ocv_v(soc, channels) - battery.ocv.voltage_v(soc);
        channels.add(Channel::OcvV, share_v);
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::cell;
    use crate::{Channel, Start};

    /// The test cell's OCV is 3 V + SoC x 1 V, so a shift of SoC shows as volts.
    fn rested_v(shift_empty: f64, shift_full: f64, soc: f64) -> f64 {
        let effects: &[(&str, &[(&str, f64)])] = &[("electrode_balance", &[("shift_empty", shift_empty), ("shift_full", shift_full)])];
        let mut run = cell(1, effects, Start::at_soc(soc));
        run.step(1.0);
        run.channels[Channel::VoltageV]
    }

    #[test]
    fn the_ends_of_the_curve_move_where_they_are_told_to() {
        assert!((rested_v(0.1, -0.05, 0.0) - 3.1).abs() < 1e-12);
        assert!((rested_v(0.1, -0.05, 1.0) - 3.95).abs() < 1e-12);
        assert!((rested_v(0.0, 0.0, 0.3) - 3.3).abs() < 1e-12);
    }

    /// Charge is conserved: a cell that lost 20 % of its capacity at its full end (b = -0.2) and
    /// counts from empty reaches any voltage after the same ampere-hours as the new one.
    #[test]
    fn a_cell_shortened_at_its_full_end_has_the_new_curve_over_ampere_hours() {
        let (new_ah, aged_ah, passed_ah) = (2.0, 1.6, 0.9);
        assert!((rested_v(0.0, -0.2, passed_ah / aged_ah) - rested_v(0.0, 0.0, passed_ah / new_ah)).abs() < 1e-12);
    }
}
