//! Energy of a switch-over from one pack to the next.
//!
//! `P += n_events E / dt` in W: an event of `E` joules (J) during a step of `dt` seconds. The next
//! pack refills the hold-up capacitor that carried the station through the gap, or, when the
//! selector makes before it breaks, evens out the two packs' voltages (see `selector.rs`); the
//! station's battery selector makes it an uninterruptible supply (Kottas, section B.2.2).
//!
//! Absence: a burst of missing power at each change of the active pack.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct SelectorSwitch;

static SPEC: EffectSpec = EffectSpec {
    id: "selector_switch",
    title: "Switch-over between packs",
    system: System::Station,
    phase: Phase::Overhead,
    channel: Channel::PackPowerW,
    needs: &[Channel::SelectorEvents],
    equation: "P += n_events E / dt",
    source: "energy of a capacitor; Kottas, section B.2.2 (uninterruptible supply)",
    validity: "a switch-over that is over within one step",
    signature: "a burst of missing power at each change of the active pack",
    matters: 0.1,
    confused_with: &[("lift", "switch over while the lift stands still")],
    parameters: &[ParameterSpec {
        name: "switch_j",
        meaning: "energy that one switch-over takes from the pack that takes over",
        default: 0.5,
        null: Some(0.0),
        min: 0.0,
        max: 500.0,
        source: "guess: 10 mF refilled from 9 V to 12 V is 0.3 J, and as much in the resistance that fills it",
    }],
    states: &[],
};

impl Physics for SelectorSwitch {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PackPowerW, own.parameters[0] * channels[Channel::SelectorEvents] / dt_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;
    use crate::selector;

    fn added_w(switch_j: f64, events: f64, dt_s: f64) -> f64 {
        let mut channels = Channels::filled(0.0);
        channels[Channel::SelectorEvents] = events;
        step_once(&SelectorSwitch, &Facts::Station, dt_s, &[switch_j], &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn the_energy_of_an_event_does_not_depend_on_the_step() {
        assert!((added_w(0.5, 1.0, 1.0) - 0.5).abs() < 1e-15);
        assert!((added_w(0.5, 2.0, 10.0) * 10.0 - 1.0).abs() < 1e-12);
        assert!(added_w(0.5, 0.0, 1.0).abs() < 1e-15);
    }

    /// A source of voltage V gives C V (V - V_1) to a capacitor that it fills from V_1 (physics
    /// textbook): 10 mF from 9 V to 12 V take 0.36 J, of which 0.045 J heat the wire.
    #[test]
    fn the_default_is_of_the_size_of_a_refilled_capacitor() {
        let refill_j = selector::refill_j(0.01, 9.0, 12.0);
        assert!((refill_j - 0.36).abs() < 1e-12);
        assert!((0.3..3.0).contains(&(SPEC.parameters[0].default / refill_j)));
    }
}
