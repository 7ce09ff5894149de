//! Idle load: computing, sensing and radio of a robot that stands still.
//!
//! `P += P_idle` in W on the robot's rails. In the Explorer it dominates: the drive motors take
//! less than 5 % of the battery current (Kottas, section 5.2).
//!
//! Absence: a constant power is missing whatever the robot does.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Idle;

static SPEC: EffectSpec = EffectSpec {
    id: "idle",
    title: "Idle load (computing, sensing, radio)",
    system: System::Robot,
    phase: Phase::Load,
    channel: Channel::PowerW,
    needs: &[],
    equation: "P += P_idle",
    source: "Kottas, sections 4.3 and 5.2",
    validity: "one operating state of computer and radio",
    signature: "a constant missing power",
    matters: 0.02,
    confused_with: &[("converter", "logs at two different loads")],
    parameters: &[ParameterSpec {
        name: "idle_w",
        meaning: "power of all rails at standstill",
        default: 3.0,
        null: Some(0.0),
        min: 0.0,
        max: 100.0,
        source: "small single-board computer with Wi-Fi: 2-5 W",
    }],
    states: &[],
};

impl Physics for Idle {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PowerW, own.parameters[0]);
    }
}
