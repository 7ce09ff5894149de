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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::robot_power_w;

    #[test]
    fn it_adds_its_power_whatever_the_robot_does() {
        for speed_mps in [0.0, 0.5] {
            let inputs = [(Channel::PowerW, 1.0), (Channel::SpeedMps, speed_mps)];
            assert_eq!(robot_power_w(&Idle, &[3.0], &inputs), 4.0);
            assert_eq!(robot_power_w(&Idle, &[0.0], &inputs), 1.0);
        }
    }

    /// Wandboard Dual with Wi-Fi (its maker's measurement, wandboard.org): 0.23 A at 5 V idle, 0.32 A
    /// busy, without camera, radio traffic or sensors. The default must be above the computer
    /// alone, and of its order.
    #[test]
    fn the_default_is_more_than_a_small_computer_alone_and_not_ten_times_that() {
        let busy_w = robot_power_w(&Idle, &[0.32 * 5.0], &[]);
        assert!((busy_w..10.0 * busy_w).contains(&SPEC.parameters[0].default), "{busy_w}");
    }
}
