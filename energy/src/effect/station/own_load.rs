//! The robots' own load while they charge.
//!
//! `P += n_docked P_own`, in W at the output of the robots' chargers. In the direct-connection
//! power path the charger feeds battery and robot together, so the robot stays on and its load
//! passes through the charger (Kottas, section B.2.1).
//!
//! Absence: every docked robot takes a constant power that its battery never receives.

use crate::{Channel, Channels, EffectSpec, Facts, Own, ParameterSpec, Phase, Real, System, effect::Physics};

/// The own load of docked robots, in the phase of its spec; `own_load_w` is its parameter.
pub(crate) struct OwnLoad(pub(crate) &'static EffectSpec);

/// Through the robots' chargers.
pub(crate) static DIRECT: OwnLoad = OwnLoad(&SPEC);

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

impl Physics for OwnLoad {
    fn spec(&self) -> &'static EffectSpec {
        self.0
    }

    #[inline]
    fn step<S: Real>(&self, _: &Facts, _dt_s: f64, own: Own<'_, S>, channels: &mut Channels<S>) {
        channels.add(Channel::PackPowerW, own.parameters[0] * channels[Channel::RobotsDocked]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn pack_w(own_load_w: f64, docked: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::RobotsDocked] = docked;
        step_once(&DIRECT, &Facts::Station, 1.0, &[own_load_w], &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn every_docked_robot_takes_it_and_an_empty_station_nothing() {
        assert_eq!([pack_w(3.0, 0.0), pack_w(3.0, 1.0), pack_w(3.0, 3.0)], [0.0, 3.0, 9.0]);
        assert_eq!(pack_w(0.0, 3.0), 0.0);
    }

    /// Kottas, chapter 6: three services from 10 % at 1C empty one pack of 7.6 Ah x 11.1 V. Into the
    /// robots go 3 x 0.9 x 1.32 Ah x 11.1 V; what they take for themselves in the 0.9 h of the
    /// constant current can be no more than the rest.
    #[test]
    fn the_default_fits_into_what_the_measured_pack_could_give() {
        let rest_wh = 7.6 * 11.1 - 3.0 * 0.9 * 1.32 * 11.1;
        let own_wh = pack_w(SPEC.parameters[0].default, 3.0) * 0.9;
        assert!(own_wh < rest_wh, "{own_wh} of {rest_wh} Wh");
    }
}
