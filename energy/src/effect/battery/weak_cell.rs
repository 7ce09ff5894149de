//! One cell of a series string that differs from the others.
//!
//! The weak cell holds `(1 - d)` of the others' charge, is at `1 + o` where they are full and has an extra
//! resistance r in ohm: `V_terminal += OCV(z_weak) - OCV(z) - r I_cell`. The same current passes
//! through all, so each step moves `z_weak` by `1 / (1 - d)` of what it moves z; the state is the
//! difference of the two, which at any charge is `o - d / (1 - d) (1 - z)`. Everything else of the weak cell is as in the others.
//!
//! It sets the least and greatest cell voltage of the string, and the mean.
//!
//! Absence: the pack's voltage falls early near empty, though the gauge says that there is charge
//! left; near full it rises early.

use crate::units::S_PER_H;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct WeakCell;

static SPEC: EffectSpec = EffectSpec {
    id: "weak_cell",
    title: "One weak cell in the string",
    system: System::Battery,
    phase: Phase::Connection,
    channel: Channel::TerminalVoltageV,
    needs: &[Channel::CurrentA],
    equation: "V += OCV(z_weak) - OCV(z) - r I, dz_weak = dz / (1 - d)",
    source: "charge balance of cells in series; Kottas, section 3.1 (cells of a pack differ most near empty)",
    validity: "one cell differs; no balancing; all strings in parallel alike",
    signature: "the residual follows SoC and is largest where the OCV curve is steep, near empty above all",
    matters: 1e-3,
    confused_with: &[
        ("ohmic_soc", "the voltage of each cell, or a rest near empty"),
        ("ohmic", "the voltage of each cell: a pack voltage alone does not tell r from R0"),
        ("capacity_fade", "the voltage of each cell"),
        ("contact_resistance", "the voltage of each cell"),
    ],
    parameters: &[
        ParameterSpec {
            name: "capacity_deficit",
            meaning: "d: share of the others' capacity that the weak cell lacks",
            default: 0.05,
            null: Some(0.0),
            min: 0.0,
            max: 0.6,
            source: "1-3 % between new cells of a batch, tens of per cent in aged packs",
        },
        ParameterSpec {
            name: "soc_offset",
            meaning: "o: SoC of the weak cell, less that of the others, where they are full",
            default: -0.02,
            null: Some(0.0),
            min: -0.3,
            max: 0.3,
            source: "some per cent in packs without balancing; range is a guess",
        },
        ParameterSpec {
            name: "extra_resistance_ohm",
            meaning: "r: what the weak cell has more than the others",
            default: 5e-3,
            null: Some(0.0),
            min: 0.0,
            max: 0.5,
            source: "guess: of the order of a cell's own resistance",
        },
    ],
    states: &["weak_soc_difference"],
};

impl Physics for WeakCell {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    fn reads_curve(&self) -> bool {
        true
    }

    fn ruled_out(&self, facts: &Facts) -> Option<&'static str> {
        matches!(facts, Facts::Battery(battery) if battery.series == 1).then_some("a single cell is no string")
    }

    fn start<S: Real>(&self, _: &Facts, parameters: &[S], states: &mut [S], channels: &Channels<S>) {
        // What the others have given since they were full, it has given with less.
        let given = -channels[Channel::Soc] + 1.0;
        states[0] = parameters[1] - parameters[0] / (-parameters[0] + 1.0) * given;
    }

    fn prepared_len(&self) -> usize {
        1
    }

    fn prepare<S: Real>(&self, facts: &Facts, dt_s: f64, parameters: &[S], prepared: &mut [S]) {
        let excess = parameters[0] / (-parameters[0] + 1.0);
        prepared[0] = excess * (dt_s / S_PER_H * f64::from(facts.parallel()));
    }

    #[inline]
    fn step<S: Real>(&self, facts: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let Facts::Battery(battery) = facts else { return };
        let current_a = channels[Channel::CellCurrentA];
        own.states[0] -= own.prepared[0] * (current_a + channels[Channel::LostCurrentA]) / channels[Channel::CapacityAh];
        let (soc, others_v) = (channels[Channel::Soc], channels[Channel::CellVoltageV]);
        let share_v = battery.cell_ocv_v(soc + own.states[0], channels) - battery.cell_ocv_v(soc, channels) - own.parameters[2] * current_a;
        let weak_v = others_v + share_v;
        let (low_v, high_v) = if share_v.re() < 0.0 { (weak_v, others_v) } else { (others_v, weak_v) };
        channels[Channel::CellMinV] = low_v;
        channels[Channel::CellMaxV] = high_v;
        channels[Channel::CellVoltageV] = others_v + share_v / f64::from(battery.series);
        channels.add(Channel::TerminalVoltageV, share_v);
    }
}

#[cfg(test)]
mod tests {
    use crate::effect::cell;
    use crate::{Channel, Run, Start};

    fn string(deficit: f64, offset: f64, extra_ohm: f64, soc: f64) -> Run<f64> {
        let effects: &[(&str, &[(&str, f64)])] =
            &[("weak_cell", &[("capacity_deficit", deficit), ("soc_offset", offset), ("extra_resistance_ohm", extra_ohm)])];
        cell(3, effects, Start::at_soc(soc))
    }

    /// By hand, cells of 2 Ah with OCV = 3 V + SoC x 1 V: half an hour at 2 A takes 0.5 from
    /// each, 0.5 / 0.8 = 0.625 from the one that holds 20 % less. From full: 3.5, 3.5, 3.375 V.
    #[test]
    fn the_cell_that_holds_less_runs_ahead_of_the_others() {
        let mut run = string(0.2, 0.0, 0.01, 1.0);
        run.channels[Channel::CurrentA] = 2.0;
        run.step(1800.0);
        assert!((run.channels[Channel::CellMaxV] - 3.5).abs() < 1e-12);
        assert!((run.channels[Channel::CellMinV] - (3.375 - 0.02)).abs() < 1e-12);
        assert!((run.channels[Channel::VoltageV] - (3.5 + 3.5 + 3.355)).abs() < 1e-12);
        assert!((3.0 * run.channels[Channel::CellVoltageV] - run.channels[Channel::VoltageV]).abs() < 1e-12);
    }

    /// By hand: in aged cells whose curve spans 0.8 V, 0.1 of charge less is 80 mV.
    #[test]
    fn a_weak_cell_ages_with_the_others() {
        let aged: &[(&str, &[(&str, f64)])] = &[
            ("electrode_balance", &[("shift_empty", 0.0), ("shift_full", -0.2)]),
            ("weak_cell", &[("capacity_deficit", 0.0), ("soc_offset", -0.1), ("extra_resistance_ohm", 0.0)]),
        ];
        let mut run = cell(3, aged, Start::at_soc(0.5));
        run.step(1.0);
        assert!((run.channels[Channel::VoltageV] - (3.0 * 3.4 - 0.08)).abs() < 1e-12);
    }

    /// An offset is seen at rest, before any current has flowed, and comes back after a cycle. By hand: at half charge a cell that holds a
    /// tenth less and is 0.1 ahead where all are full is ahead by 0.1 - 0.5 / 9.
    #[test]
    fn an_offset_shows_at_rest_and_survives_a_cycle() {
        let mut run = string(0.1, 0.1, 0.0, 0.5);
        for current_a in [0.0, 1.0, -1.0] {
            run.channels[Channel::CurrentA] = current_a;
            run.step(900.0);
        }
        assert!((run.channels[Channel::CellMaxV] - (3.6 - 0.5 / 9.0)).abs() < 1e-12);
        assert!((run.channels[Channel::CellMinV] - 3.5).abs() < 1e-12);
    }

    /// A run that begins half way is where one that began full has come to.
    #[test]
    fn it_has_run_ahead_wherever_a_run_begins() {
        let mut discharged = string(0.2, -0.03, 0.01, 1.0);
        discharged.channels[Channel::CurrentA] = 1.0;
        discharged.step(3600.0);
        let begun = string(0.2, -0.03, 0.01, discharged.channels[Channel::Soc]);
        assert!((begun.states()[1] - discharged.states()[1]).abs() < 1e-12, "{:?} {:?}", begun.states(), discharged.states());
    }

    /// Charge balance by hand: with 20 % less charge in one cell, that cell is empty when the
    /// others still hold 20 %.
    #[test]
    fn the_string_is_empty_when_its_weakest_cell_is() {
        let mut run = string(0.2, 0.0, 0.0, 1.0);
        run.channels[Channel::CurrentA] = 2.0;
        while run.channels[Channel::CellMinV] > 3.0 {
            run.step(1.0);
        }
        assert!((run.channels[Channel::Soc] - 0.2).abs() < 1e-3);
    }
}
