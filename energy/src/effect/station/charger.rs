//! Efficiency of the chargers between bay and robot.
//!
//! `P_in = P_out / eta` in W. The Explorer carries a switch-mode CC-CV charger on board (Kottas,
//! section B.2.1).
//!
//! Absence: missing power in proportion to the power that robots receive.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Charger;

static SPEC: EffectSpec = EffectSpec {
    id: "charger_efficiency",
    title: "Charger efficiency",
    system: System::Station,
    phase: Phase::Charger,
    channel: Channel::PackPowerW,
    needs: &[Channel::ChargePowerW],
    equation: "P_in = P_out / eta",
    source: "definition of efficiency; Kottas, Eq. 4.1",
    validity: "eta constant over the charge",
    signature: "missing power in proportion to the charge power",
    matters: 0.1,
    confused_with: &[("converter_efficiency", "measure between converter and charger")],
    parameters: &[ParameterSpec {
        name: "efficiency",
        meaning: "power into robot and battery over power from the bay",
        default: 0.9,
        null: Some(1.0),
        min: 0.3,
        max: 1.0,
        source: "switch-mode single-cell to 3-cell chargers: 0.85-0.95",
    }],
    states: &[],
};

impl Physics for Charger {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels[Channel::PackPowerW] /= own.parameters[0];
    }
}
