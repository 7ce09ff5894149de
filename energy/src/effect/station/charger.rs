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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn pack_w(efficiency: f64, charge_w: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::PackPowerW] = charge_w;
        step_once(&Charger, &Facts::Station, 1.0, &[efficiency], &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn a_perfect_charger_takes_what_it_gives_and_an_idle_one_nothing() {
        assert_eq!(pack_w(1.0, 14.0), 14.0);
        assert_eq!(pack_w(0.9, 0.0), 0.0);
    }

    /// A linear charger passes its input current on: from 15 V (Kottas, section B.2.2) into three
    /// cells of 3.7 V it has 11.1 / 15 = 74 %. A switch-mode charger is there to be better.
    #[test]
    fn the_default_is_better_than_a_linear_charger_would_be() {
        let linear_w = pack_w(11.1 / 15.0, 14.65);
        assert!((linear_w - 14.65 * 15.0 / 11.1).abs() < 1e-12);
        assert!(pack_w(SPEC.parameters[0].default, 14.65) < linear_w);
    }
}
