//! Radio: what its module takes while it listens and sends.
//!
//! `P += P_listen + d (P_send + k 10^((P_dBm - 30) / 10))` in W. d: share of time that it sends
//! (channel `radio_duty`); P_dBm: radiated power, dBm (channel `radio_tx_dbm`; Kottas, Eq. 4.11);
//! k: supply power per radiated power, one over the power amplifier's efficiency; P_send: what
//! sending takes beside that, over listening. The radiated power alone says little of the supply
//! power (Kottas, section 4.4).
//!
//! Absence: the power residual goes with traffic, and with the transmit power while sending.

use crate::power::radio::watts;
use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

pub(crate) struct Radio;

static SPEC: EffectSpec = EffectSpec {
    id: "radio",
    title: "Radio: listening, sending, radiating",
    system: System::Robot,
    phase: Phase::Load,
    channel: Channel::PowerW,
    needs: &[Channel::RadioDuty, Channel::RadioTxDbm],
    equation: "P += P_listen + d (P_send + k 10^((P_dBm - 30) / 10))",
    source: "Kottas, section 4.4 and Eq. 4.11",
    validity: "one rate and channel; always on when not sending",
    signature: "missing power that goes with the share of time spent sending",
    matters: 0.02,
    confused_with: &[("idle", "switch the radio off for one log"), ("cpu", "send at a fixed clock and utilisation")],
    parameters: &[
        ParameterSpec {
            name: "listen_w",
            meaning: "supply power while it listens",
            default: 0.6,
            null: Some(0.0),
            min: 0.0,
            max: 5.0,
            source: "guess: small 802.11b/g module, 0.3-1.0 W",
        },
        ParameterSpec {
            name: "send_w",
            meaning: "supply power that sending adds, without what is radiated",
            default: 0.3,
            null: Some(0.0),
            min: 0.0,
            max: 5.0,
            source: "guess: small 802.11b/g module, 0.1-0.8 W",
        },
        ParameterSpec {
            name: "supply_per_radiated",
            meaning: "supply power per radiated power of the amplifier",
            default: 5.0,
            null: Some(0.0),
            min: 0.0,
            max: 100.0,
            source: "guess: linear amplifiers are 10-30 % efficient",
        },
    ],
    states: &[],
};

impl Physics for Radio {
    fn spec(&self) -> &'static EffectSpec {
        &SPEC
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        let [listen_w, send_w, supply_per_radiated] = [own.parameters[0], own.parameters[1], own.parameters[2]];
        let sending_w = send_w + supply_per_radiated * watts(channels[Channel::RadioTxDbm]);
        channels.add(Channel::PowerW, listen_w + channels[Channel::RadioDuty] * sending_w);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn power_w(parameters: [f64; 3], duty: f64, dbm: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        (channels[Channel::RadioDuty], channels[Channel::RadioTxDbm]) = (duty, dbm);
        step_once(&Radio, &Facts::robot(), 1.0, &parameters, &mut [], &mut channels);
        channels[Channel::PowerW]
    }

    #[test]
    fn a_radio_that_never_sends_only_listens() {
        assert_eq!(power_w([0.6, 0.3, 5.0], 0.0, 20.0), 0.6);
    }

    /// 20 dBm are 100 mW, 0 dBm 1 mW (Kottas, Eq. 4.11).
    #[test]
    fn radiated_power_counts_by_the_amplifiers_efficiency() {
        assert!((power_w([0.0, 0.0, 4.0], 0.5, 20.0) - 0.2).abs() < 1e-12);
        assert!((power_w([0.0, 0.0, 4.0], 1.0, 0.0) - 0.004).abs() < 1e-12);
        assert!((power_w([0.0, 0.2, 0.0], 0.5, 20.0) - 0.1).abs() < 1e-12);
    }
}
