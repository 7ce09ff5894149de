//! The robots' own load while they charge.
//!
//! `P += n_docked P_own`, in W at the output of the robots' chargers. In the direct-connection
//! power path the charger feeds battery and robot together, so the robot stays on and its load
//! passes through the charger (Kottas, section B.2.1).
//!
//! Absence: every docked robot takes a constant power that its battery never receives.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct RobotOwnLoad;

static SPEC: EffectSpec = EffectSpec {
    id: "robot_own_load",
    title: "Robots' own load while docked",
    system: System::Station,
    phase: Phase::Load,
    channel: Channel::PackPowerW,
    needs: &[Channel::RobotsDocked],
    equation: "P += n_docked P_own",
    source: "Kottas, section B.2.1 (direct connection)",
    validity: "direct connection; robots idle while docked",
    signature: "missing power in steps with the number of docked robots",
    matters: 0.1,
    confused_with: &[("hotel", "an hour with no robot docked"), ("charger_efficiency", "docked robots that are full")],
    parameters: &[ParameterSpec {
        name: "own_load_w",
        meaning: "power of one docked robot beside its battery",
        default: 3.0,
        null: Some(0.0),
        min: 0.0,
        max: 100.0,
        source: "a robot's idle load",
    }],
    states: &[],
};

impl Physics for RobotOwnLoad {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PackPowerW, own.parameters[0] * channels[Channel::RobotsDocked]);
    }
}
