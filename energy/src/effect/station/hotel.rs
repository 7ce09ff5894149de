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
