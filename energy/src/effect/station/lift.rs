//! The lift that loads and unloads robots.
//!
//! `P += P_lift` in W while the lift moves (Kottas, Fig. 6.4 shows it at both ends of the run).
//!
//! Absence: short bursts of missing power at each load and unload.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Lift;

static SPEC: EffectSpec = EffectSpec {
    id: "lift",
    title: "Lift power",
    system: System::Station,
    phase: Phase::Overhead,
    channel: Channel::PackPowerW,
    needs: &[Channel::LiftActive],
    equation: "P += P_lift while the lift moves",
    source: "Kottas, section B.2.2 and Fig. 6.4",
    validity: "robots of one weight",
    signature: "bursts of missing power at each load and unload",
    matters: 0.1,
    confused_with: &[],
    parameters: &[ParameterSpec {
        name: "lift_w",
        meaning: "power of the lift while it moves",
        default: 10.0,
        null: Some(0.0),
        min: 0.0,
        max: 500.0,
        source: "guess: one or two geared motors of a fork-lift for palm-sized robots",
    }],
    states: &[],
};

impl Physics for Lift {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PackPowerW, own.parameters[0] * channels[Channel::LiftActive]);
    }
}
