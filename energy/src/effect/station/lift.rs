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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::step_once;

    fn pack_w(lift_w: f64, active: f64) -> f64 {
        let mut channels = Channels::filled(0.0_f64);
        channels[Channel::LiftActive] = active;
        step_once(&Lift, &Facts::Station, 1.0, &[lift_w], &mut [], &mut channels);
        channels[Channel::PackPowerW]
    }

    #[test]
    fn a_lift_takes_its_power_while_it_moves() {
        assert_eq!([pack_w(10.0, 1.0), pack_w(10.0, 0.0), pack_w(0.0, 1.0)], [10.0, 0.0, 0.0]);
        assert_eq!(pack_w(10.0, 0.5), 5.0, "half of a step");
    }

    /// The work alone: 0.5 kg (guess, the Explorer) by 10 cm against standard gravity is 0.49 J. A
    /// lift that takes half a minute may not take less than 16 mW; all above that is its drive.
    #[test]
    fn the_default_lifts_a_robot_and_loses_nearly_all() {
        let work_j = 0.5 * 9.806_65 * 0.1;
        assert!(pack_w(SPEC.parameters[0].default, 1.0) * 30.0 > work_j);
    }
}
