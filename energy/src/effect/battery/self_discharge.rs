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
