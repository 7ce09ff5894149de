//! Hotel load: what the station itself takes, busy or not.
//!
//! `P += P_hotel` in W: computer, radios, selector and gauges (Kottas, section B.2.2).
//!
//! Absence: a constant missing power, also with every bay empty.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Hotel;

static SPEC: EffectSpec = EffectSpec {
    id: "hotel",
    title: "Hotel load of the station",
    system: System::Station,
    phase: Phase::Overhead,
    channel: Channel::PackPowerW,
    needs: &[],
    equation: "P += P_hotel",
    source: "Kottas, section B.2.2",
    validity: "one operating state of the station's computer",
    signature: "a constant missing power, also with empty bays",
    matters: 0.1,
    confused_with: &[("robot_own_load", "an hour with no robot docked")],
    parameters: &[ParameterSpec {
        name: "hotel_w",
        meaning: "power of computer, radios, selector and gauges",
        default: 3.0,
        null: Some(0.0),
        min: 0.0,
        max: 200.0,
        source: "single-board computer with Wi-Fi and Bluetooth: 2-5 W",
    }],
    states: &[],
};

impl Physics for Hotel {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PackPowerW, own.parameters[0]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn pack_w(hotel_w: f64, bays_w: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::PackPowerW] = bays_w;
        step_once(&Hotel, &Facts::Station, 1.0, &[hotel_w], &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn it_is_there_with_every_bay_empty_and_the_same_when_they_are_full() {
        assert_eq!(pack_w(3.0, 0.0), 3.0);
        assert_eq!(pack_w(3.0, 60.0), 63.0);
        assert_eq!(pack_w(0.0, 60.0), 60.0);
    }

    /// Wandboard Dual with Wi-Fi (its maker's measurement, wandboard.org): 0.23 A at 5 V idle. A
    /// station has such a computer, and gauges, selector and Bluetooth with it (Kottas, section B.2.2).
    #[test]
    fn the_default_is_more_than_an_idle_computer_alone() {
        assert!(pack_w(SPEC.parameters[0].default, 0.0) > pack_w(0.23 * 5.0, 0.0));
    }
}
