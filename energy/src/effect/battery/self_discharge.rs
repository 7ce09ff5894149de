//! Self-discharge: charge that is lost inside the cell whether or not it is used.
//!
//! `I_leak = (loss per month / 30 d) Q`, added to the current through the cell, never to the
//! terminals. Kottas, section 3.1: at most 3 % of capacity a month (57 mAh for 1900 mAh).
//!
//! Absence: after weeks of rest the state of charge is overestimated.

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
    equation: "I_leak = loss_per_month Q / 30 d",
    source: "Kottas, section 3.1",
    validity: "near room temperature; constant over SoC",
    signature: "SoC drifts down at rest over days to weeks",
    matters: 1e-4,
    confused_with: &[],
    parameters: &[ParameterSpec {
        name: "loss_per_month",
        meaning: "share of capacity lost in 30 days",
        default: 0.03,
        null: Some(0.0),
        min: 0.0,
        max: 0.3,
        source: "Kottas, section 3.1: <= 3 % a month for the LiPo cells used",
    }],
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
        channels.add(Channel::LostCurrentA, own.parameters[0] * cell_capacity_ah / hours_per_month);
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
        step_once(&SelfDischarge, &Facts::robot(), 1.0, &[0.03], &mut [], &mut channels);
        assert!((channels[Channel::LostCurrentA] * 30.0 * 24.0 - 0.057).abs() < 1e-12);
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
